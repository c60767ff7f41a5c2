//! The store and the job queue: durability, recovery, faults at every write, and the indexing worker.

mod catalogue;
mod datasets;
mod faults;
mod formats;
mod imports;
mod jobs;
mod power_cut;
mod quotas;
mod recovery;
mod snapshots;
mod traps;

use bytes::Bytes;
use shapelex::model::{ClassName, NewShape, ShapePose};
use shapelex_core::mesh::{Format, PrepareReport};

/// A shape with contents of the test's choice; the store never looks into them.
pub fn shape(contents: &str, pose: Option<usize>) -> NewShape {
    NewShape {
        name: Some(format!("{contents}.obj")),
        bytes: Bytes::copy_from_slice(contents.as_bytes()),
        companions: Vec::new(),
        format: Format::Obj,
        pose: pose.map(|index| ShapePose {
            label: format!("Walk@{index}"),
            index,
            of: 8,
        }),
        report: PrepareReport::default(),
    }
}

pub fn name(text: &str) -> ClassName {
    ClassName::new(text).unwrap()
}
