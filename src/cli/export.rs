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
    // As queries see it: without classes that were deleted since, and under the names of today.
    let names: BTreeMap<String, String> = store
        .list_classes(None, usize::MAX)
        .map_err(failed)?
        .into_iter()
        .map(|class| (class.id.to_string(), class.name.to_string()))
        .collect();
    if let Some(baselines) = &mut baselines {
        baselines
            .classes
            .retain_mut(|class| match names.get(&class.label) {
                Some(name) => {
                    class.label.clone_from(name);
                    true
                }
                None => false,
            });
    }
    let mut classes = Vec::new();
    let mut reports = BTreeMap::new();
    let mut dictionaries = Vec::new();
    for (mut indexed, learnt) in index.classes.drain(..).zip(&generation.classes) {
        let Some(name) = names.get(&indexed.label) else {
            continue;
        };
        // The index is labelled by identifiers, which mean nothing outside this data directory.
        indexed.label.clone_from(name);
        dictionaries.push(indexed);
        classes.push(ExportedClass {
            name: name.clone(),
            shapes: learnt.shapes,
        });
        reports.insert(name.clone(), learnt.report.clone());
    }
    index.classes = dictionaries;
    if classes.is_empty() {
        let detail = "every class of the index was deleted; run `shapelex index DIR` first";
        return Err(CliError::at(data, detail));
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
