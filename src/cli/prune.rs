//! What is in the index but no longer in the folder it was made of.

use super::client::{Client, Payload};
use super::confirm::ConfirmArgs;
use super::encode::encode;
use super::files::MeshFile;
use super::folders::LabelledFile;
use super::output::note_line;
use super::{CliError, listing};
use serde::Serialize;
use serde_json::Value;
use shapelex_core::mesh::Limits;
use std::collections::{BTreeMap, BTreeSet};

/// What was deleted.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Pruned {
    /// Shapes whose file is gone from a class that stays.
    pub shapes: Vec<PrunedShape>,
    /// Names of classes whose folder is gone.
    pub classes: Vec<String>,
}

/// A shape that was deleted.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct PrunedShape {
    /// Its class's name.
    pub class: String,
    /// The name it was uploaded under.
    pub name: String,
    /// Its id.
    pub id: String,
}

/// The bytes of a shape: its file's hash, and those of the buffers that belong to it.
type Content = (String, BTreeSet<String>);

/// Deletes what the folder does not hold any more: classes without a file, and shapes whose bytes no file of their
/// class has, whatever the files are called now. Lists them on stderr first.
///
/// # Errors
/// [`CliError::Failed`] where a file cannot be read, so that it is not known what is there, or the answer is not yes.
pub fn prune(client: &Client, files: &[LabelledFile], confirm: ConfirmArgs) -> Result<Pruned, CliError> {
    let mut there: BTreeMap<&str, BTreeSet<Content>> = BTreeMap::new();
    for file in files {
        there.entry(&file.class).or_default().insert(content(file)?);
    }
    let mut pruned = Pruned::default();
    let mut paths = Vec::new();
    for class in listing::all(client, "/v1/classes")? {
        let (name, id) = (listing::cell(&class, "name"), listing::cell(&class, "id"));
        let path = format!("/v1/classes/{}", encode(&id));
        let Some(contents) = there.get(name.as_str()) else {
            note_line!("no longer there: class {name} with {} shapes", class["shapes"]);
            paths.push(path);
            pruned.classes.push(name);
            continue;
        };
        for shape in listing::all(client, &format!("{path}/shapes"))? {
            if contents.contains(&content_of(&shape)) {
                continue;
            }
            let (label, id) = (listing::cell(&shape, "name"), listing::cell(&shape, "id"));
            note_line!("no longer there: shape {label} of class {name}");
            paths.push(format!("{path}/shapes/{}", encode(&id)));
            pruned.shapes.push(PrunedShape {
                class: name.clone(),
                name: label,
                id,
            });
        }
    }
    if paths.is_empty() {
        return Ok(pruned);
    }
    let (shapes, classes) = (pruned.shapes.len(), pruned.classes.len());
    confirm.ask(&format!("Delete these {shapes} shapes and {classes} classes"))?;
    for path in paths {
        client.call("DELETE", &path, Payload::Empty)?;
    }
    Ok(pruned)
}

fn content(file: &LabelledFile) -> Result<Content, CliError> {
    let mesh = MeshFile::load(&file.path, Limits::default().max_bytes)?;
    let hash = |bytes: &[u8]| blake3::hash(bytes).to_hex().to_string();
    let companions = mesh.companions.iter().map(|c| hash(c.bytes())).collect();
    Ok((hash(&mesh.bytes), companions))
}

fn content_of(shape: &Value) -> Content {
    let companions = shape["companions"].as_array().into_iter().flatten();
    (
        listing::cell(shape, "hash"),
        companions.map(|c| listing::cell(c, "hash")).collect(),
    )
}
