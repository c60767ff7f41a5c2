//! `shapelex export`: the index's dictionaries as a safetensors file.

use super::dictionaries::{Exported, ExportedClass, to_bytes};
use super::{CliError, data_dir, output};
use crate::config::DEFAULT_DATA;
use crate::store::{Store, StoreOptions};
use serde_json::json;
use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Arguments of `export`.
#[derive(Debug, clap::Args)]
pub struct ExportArgs {
    /// File to write, such as dictionaries.safetensors
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// Data directory; no service may run on it
    #[arg(long, env = "SHAPELEX_DATA", value_name = "DIR", default_value = DEFAULT_DATA)]
    pub data: PathBuf,
}

/// Writes the current generation.
///
/// # Errors
/// [`CliError::Usage`] where there is no data directory; [`CliError::Failed`] where there is no index, or the file
/// cannot be written.
pub fn run(args: &ExportArgs, as_json: bool) -> Result<(), CliError> {
    let exported = from_store(&args.data)?;
    let bytes = to_bytes(&exported)?;
    write(&args.out, &bytes)?;
    if as_json {
        output::json(&json!({
            "file": args.out.display().to_string(),
            "classes": exported.classes,
            "absent": exported.absent(),
            "bytes": bytes.len(),
        }))
    } else {
        output::line(&format!(
            "{} classes, {} bytes in {}; not in the file: {}",
            exported.classes.len(),
            bytes.len(),
            args.out.display(),
            exported.absent().join("; ")
        ))
    }
}

fn from_store(data: &Path) -> Result<Exported, CliError> {
    let failed = |error: crate::store::StoreError| data_dir::open_error(&error);
    data_dir::require(data)?;
    let store = Store::open(data, &StoreOptions::default()).map_err(failed)?;
    data_dir::say_repaired(&store);
    let generation = store
        .generation()
        .map_err(failed)?
        .ok_or_else(|| CliError::at(data, "nothing is indexed yet; run `shapelex index DIR` first"))?;
    let mut index = store.load_index(&generation).map_err(failed)?;
    let mut baselines = store.load_baselines(&generation).map_err(failed)?;
    let names: BTreeMap<String, String> = generation
        .classes
        .iter()
        .map(|class| (class.class.to_string(), class.name.to_string()))
        .collect();
    for class in baselines.iter_mut().flat_map(|b| &mut b.classes) {
        if let Some(name) = names.get(&class.label) {
            class.label.clone_from(name);
        }
    }
    let mut classes = Vec::new();
    let mut reports = BTreeMap::new();
    for (indexed, learnt) in index.classes.iter_mut().zip(&generation.classes) {
        // The index is labelled by identifiers, which mean nothing outside this data directory.
        indexed.label = learnt.name.to_string();
        classes.push(ExportedClass {
            name: learnt.name.to_string(),
            shapes: learnt.shapes,
        });
        reports.insert(learnt.name.to_string(), learnt.report.clone());
    }
    Ok(Exported {
        index,
        classes,
        reports,
        baselines,
    })
}

/// All of the file or nothing: written beside it, then renamed.
fn write(path: &Path, bytes: &[u8]) -> Result<(), CliError> {
    let folder = match path.parent() {
        Some(parent) if parent != Path::new("") => parent,
        _ => Path::new("."),
    };
    let at = |error: std::io::Error| CliError::at(path, error);
    let mut file = tempfile::NamedTempFile::new_in(folder).map_err(at)?;
    file.write_all(bytes).map_err(at)?;
    file.as_file().sync_all().map_err(at)?;
    file.persist(path).map_err(|error| at(error.error))?;
    Ok(())
}
