//! `shapelex import`: a file of dictionaries → the index of a data directory.

use super::dictionaries::{Exported, load};
use super::{CliError, data_dir, output};
use crate::config::DEFAULT_DATA;
use crate::model::{ClassName, Generation, GenerationClass, Origin};
use crate::store::{Store, StoreError, StoreOptions};
use serde_json::json;
use shapelex_core::baseline::BaselineIndex;
use std::path::PathBuf;

/// Arguments of `import`.
#[derive(Debug, clap::Args)]
pub struct ImportArgs {
    /// File written by `export`
    #[arg(value_name = "FILE")]
    pub file: PathBuf,
    /// Data directory, made where it does not exist; no service may run on it
    #[arg(long, env = "SHAPELEX_DATA", value_name = "DIR", default_value = DEFAULT_DATA)]
    pub data: PathBuf,
}

/// Makes the file's dictionaries the next generation of the index. It replaces the one before: classes the file does
/// not name stay in the catalogue but are not indexed. Classes are matched by name and made where they are missing.
/// Reindexes keep an imported class until it gets shapes of its own or is deleted.
///
/// # Errors
/// [`CliError::Failed`] where the file or the data directory cannot be used.
pub fn run(args: &ImportArgs, as_json: bool) -> Result<(), CliError> {
    let exported = load(&args.file)?;
    let names = exported
        .classes
        .iter()
        .map(|class| ClassName::new(&class.name))
        .collect::<Result<Vec<_>, _>>()
        .map_err(|error| CliError::at(&args.file, error))?;
    data_dir::require_place(&args.data)?;
    let is_new = !data_dir::exists(&args.data);
    let number = into_store(args, &exported, names).map_err(|error| data_dir::open_error(&error))?;
    if is_new {
        data_dir::say_made(&args.data);
    }
    if as_json {
        output::json(&json!({
            "generation": number,
            "classes": exported.classes,
            "absent": exported.absent(),
        }))
    } else {
        output::line(&format!(
            "{} classes are index generation {number} of {}; not in the file: {}",
            exported.classes.len(),
            args.data.display(),
            exported.absent().join("; ")
        ))
    }
}

fn into_store(args: &ImportArgs, exported: &Exported, names: Vec<ClassName>) -> Result<u64, StoreError> {
    let store = Store::open(&args.data, &StoreOptions::default())?;
    data_dir::say_repaired(&store);
    let number = store.next_generation_number()?;
    let mut classes = Vec::new();
    for ((indexed, entry), name) in exported.index.classes.iter().zip(&exported.classes).zip(names) {
        let class = match store.class_by_name(&name)? {
            Some(class) => class,
            None => store.create_class(name)?,
        };
        let key = format!("{}-imported-{number}", class.id);
        let bytes = store.put_dictionaries(&key, &indexed.dictionaries)?;
        classes.push(GenerationClass {
            class: class.id,
            name: class.name,
            origin: Origin::Imported,
            // Counts as learnt from what the class has now, so that a reindex of stale classes keeps it.
            revision: class.revision,
            shapes: entry.shapes,
            dictionary: key,
            bytes,
            atoms: indexed.dictionaries.values().map(|d| d.len()).sum(),
            report: exported.reports.get(&entry.name).cloned().unwrap_or_default(),
            shape_dictionaries: Vec::new(),
        });
    }
    let baselines = exported
        .baselines
        .as_ref()
        .map(|baselines| put_baselines(&store, &classes, baselines))
        .transpose()?;
    classes.sort_by_key(|class| class.class);
    store.put_generation_and_switch(&Generation {
        baselines,
        number,
        parameters: exported.index.parameters.clone(),
        created_at: jiff::Timestamp::now(),
        classes,
    })?;
    store.flush()?;
    Ok(number)
}

/// Keeps what the baselines need of the classes, none of a class the file has nothing of; returns the key of what they
/// share.
fn put_baselines(
    store: &Store,
    classes: &[GenerationClass],
    baselines: &BaselineIndex,
) -> Result<String, StoreError> {
    let model = store.put_baseline_model(&baselines.model)?;
    for class in classes {
        let name = class.name.as_str();
        let described = baselines.classes.iter().find(|c| c.label == name);
        let shapes = described.map_or_else(Vec::new, |c| c.shapes.clone());
        store.put_baseline_shapes(class, &model, shapes)?;
    }
    Ok(model)
}
