//! The Wave Kernel Signature of a mesh: `cargo run --release --package shapelex-core --example wks -- mesh.obj`.
//!
//! Prints one line per sampled vertex: its number in the prepared mesh, then the values of its signal.

use shapelex_core::cancel::Cancel;
use shapelex_core::mesh::{Limits, Source, read};
use shapelex_core::parameters::{Parameters, Preset};
use shapelex_core::pipeline::describe_shape;
use std::error::Error;

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1).ok_or("usage: wks MESH")?;
    let bytes = std::fs::read(&path)?;
    let source = Source {
        bytes: &bytes,
        name: Some(&path),
        media_type: None,
        companions: &[],
    };
    let (format, soup) = read(&source, &Limits::default())?;
    let parameters = Parameters::preset(Preset::Default);
    let description = describe_shape(soup, &parameters, &Cancel::new(), &|_| ())?;
    for warning in &description.report.warnings {
        eprintln!("{path}: {warning}");
    }
    let signatures = &description.views[0].signatures;
    eprintln!(
        "{path}: {format}, {} vertices, {} signals of {} values",
        description.report.vertices,
        signatures.len(),
        signatures.dimension()
    );
    for (i, vertex) in signatures.vertices.iter().enumerate() {
        let values: Vec<String> = signatures
            .matrix
            .col(i)
            .iter()
            .map(|v| format!("{v:.6}"))
            .collect();
        println!("{vertex}\t{}", values.join("\t"));
    }
    Ok(())
}
