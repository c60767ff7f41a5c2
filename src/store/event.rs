//! What can happen to the catalogue, and what each event means for the records. Every change of classes and shapes is
//! an event first: it is appended to the catalogue log and then applied to the records, so that replaying the log
//! gives the records back.

use super::backend::{Backend, Batch};
use super::entry::{get, put};
use super::payload::{IdentityLink, NameLink, Number, OwnerLink, ReferenceLink};
use super::record::unseal;
use super::usage::{note_class, note_shape};
use super::{StoreError, keys};
use crate::model::{ApiKey, Class, ClassId, ClassName, ContentHash, KeyId, Shape, ShapeId};
use jiff::Timestamp;
use serde::{Deserialize, Serialize};
use shapelex_core::parameters::Parameters;

/// A change of the catalogue.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Event {
    /// A class was made.
    ClassCreated {
        id: ClassId,
        name: ClassName,
        at: Timestamp,
        /// The API key it was made with, for quotas.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        made_by: Option<KeyId>,
    },
    /// A class was made together with its first shapes, so that a crash leaves no empty class behind.
    ClassFilled {
        id: ClassId,
        name: ClassName,
        shapes: Vec<Shape>,
        at: Timestamp,
        /// The API key it was made with, for quotas.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        made_by: Option<KeyId>,
    },
    /// A class got another name.
    ClassRenamed {
        id: ClassId,
        name: ClassName,
        at: Timestamp,
    },
    /// A class went, with its shapes.
    ClassDeleted { id: ClassId },
    /// Shapes came to a class.
    ShapesAdded {
        class: ClassId,
        shapes: Vec<Shape>,
        at: Timestamp,
        /// The API key they were made with, for quotas.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        made_by: Option<KeyId>,
    },
    /// Shapes of a class went.
    ShapesDeleted {
        class: ClassId,
        shapes: Vec<ShapeId>,
        at: Timestamp,
    },
    /// A generation took over. Its dictionaries are not in the log: they can be learnt again.
    Indexed {
        generation: u64,
        parameters: Box<Parameters>,
    },
    /// A class as it stood when the log was written anew.
    ClassRestored { class: Class },
    /// Shapes as they stood when the log was written anew; their class counts them already.
    ShapesRestored { shapes: Vec<Shape> },
    /// An API key was made, or stood when the log was written anew.
    KeyCreated { key: ApiKey },
    /// An API key stopped working.
    KeyRevoked { id: KeyId },
    /// Several changes at once, each of another class: all of them happened.
    Several { events: Vec<Event> },
}

/// All shapes of a class, by identifier.
pub(super) fn shapes_of(backend: &dyn Backend, class: ClassId) -> Result<Vec<Shape>, StoreError> {
    backend
        .scan(&keys::shapes_of(class), None, usize::MAX)?
        .iter()
        .map(|(key, value)| unseal(key, value))
        .collect()
}

/// The files a shape came from.
pub(super) fn files_of(shape: &Shape) -> impl Iterator<Item = ContentHash> + '_ {
    std::iter::once(shape.content).chain(shape.companions.iter().map(|c| c.content))
}

fn put_shape(batch: &mut Batch, shape: &Shape) -> Result<(), StoreError> {
    put(batch, keys::shape(shape.class, shape.id), shape)?;
    put(batch, keys::owner(shape.id), &OwnerLink::to_class(shape.class))?;
    let identity = keys::identity(shape.class, shape.identity());
    put(batch, identity, &IdentityLink::to_shape(shape.id))?;
    for content in files_of(shape) {
        let reference = keys::reference(content, shape.id);
        put(batch, reference, &ReferenceLink::to_shape(shape.id))?;
    }
    Ok(())
}

fn delete_shape(batch: &mut Batch, shape: &Shape) {
    batch.delete(keys::shape(shape.class, shape.id));
    batch.delete(keys::owner(shape.id));
    batch.delete(keys::identity(shape.class, shape.identity()));
    for content in files_of(shape) {
        batch.delete(keys::reference(content, shape.id));
    }
}

/// The writes that make the records what they are after the event. An event that has happened already, or whose class
/// or shape is gone, writes nothing: replaying twice is replaying once.
///
/// # Errors
/// Whatever keeps the records from being read.
pub(super) fn stage(backend: &dyn Backend, event: &Event) -> Result<Batch, StoreError> {
    let mut batch = Batch::default();
    let read_class = |id: ClassId| get::<Class>(backend, &keys::class(id));
    match event {
        Event::ClassCreated {
            id,
            name,
            at,
            made_by,
        } => {
            if read_class(*id)?.is_none() {
                put(&mut batch, keys::class(*id), &new_class(*id, name, *at))?;
                put(&mut batch, keys::name(name), &NameLink::to_class(*id))?;
                note_class(&mut batch, *made_by, *id)?;
            }
        }
        Event::ClassFilled {
            id,
            name,
            shapes,
            at,
            made_by,
        } => {
            if read_class(*id)?.is_none() {
                let mut class = new_class(*id, name, *at);
                for shape in shapes {
                    put_shape(&mut batch, shape)?;
                    note_shape(&mut batch, *made_by, shape)?;
                    class.shapes += 1;
                    class.bytes += shape.bytes;
                }
                put(&mut batch, keys::name(name), &NameLink::to_class(*id))?;
                note_class(&mut batch, *made_by, *id)?;
                touch(&mut batch, class, 0, *at)?;
            }
        }
        Event::ClassRenamed { id, name, at } => {
            if let Some(mut class) = read_class(*id)? {
                batch.delete(keys::name(&class.name));
                class.name = name.clone();
                class.updated_at = *at;
                put(&mut batch, keys::class(*id), &class)?;
                put(&mut batch, keys::name(name), &NameLink::to_class(*id))?;
            }
        }
        Event::ClassDeleted { id } => {
            if let Some(class) = read_class(*id)? {
                batch.delete(keys::class(*id));
                batch.delete(keys::name(&class.name));
                for shape in shapes_of(backend, *id)? {
                    delete_shape(&mut batch, &shape);
                }
            }
        }
        Event::ShapesAdded {
            class,
            shapes,
            at,
            made_by,
        } => {
            if let Some(mut class) = read_class(*class)? {
                let before = class.shapes;
                for shape in shapes {
                    if backend.get(&keys::owner(shape.id))?.is_none() {
                        put_shape(&mut batch, shape)?;
                        note_shape(&mut batch, *made_by, shape)?;
                        class.shapes += 1;
                        class.bytes += shape.bytes;
                    }
                }
                touch(&mut batch, class, before, *at)?;
            }
        }
        Event::ShapesDeleted { class, shapes, at } => {
            if let Some(mut class) = read_class(*class)? {
                let before = class.shapes;
                for id in shapes {
                    if let Some(shape) = get::<Shape>(backend, &keys::shape(class.id, *id))? {
                        delete_shape(&mut batch, &shape);
                        class.shapes = class.shapes.saturating_sub(1);
                        class.bytes = class.bytes.saturating_sub(shape.bytes);
                    }
                }
                touch(&mut batch, class, before, *at)?;
            }
        }
        Event::Indexed {
            generation,
            parameters,
        } => {
            put(
                &mut batch,
                keys::META_LAST_GENERATION.to_vec(),
                &Number(*generation),
            )?;
            put(&mut batch, keys::META_PARAMETERS.to_vec(), &**parameters)?;
        }
        Event::ClassRestored { class } => {
            put(&mut batch, keys::class(class.id), class)?;
            put(&mut batch, keys::name(&class.name), &NameLink::to_class(class.id))?;
        }
        Event::ShapesRestored { shapes } => {
            for shape in shapes {
                put_shape(&mut batch, shape)?;
            }
        }
        Event::KeyCreated { key } => put(&mut batch, keys::api_key(key.id), key)?,
        Event::KeyRevoked { id } => batch.delete(keys::api_key(*id)),
        Event::Several { events } => {
            for event in events {
                batch.writes.extend(stage(backend, event)?.writes);
            }
        }
    }
    Ok(batch)
}

fn new_class(id: ClassId, name: &ClassName, at: Timestamp) -> Class {
    Class {
        id,
        name: name.clone(),
        revision: 0,
        shapes: 0,
        bytes: 0,
        created_at: at,
        updated_at: at,
    }
}

/// Writes a class whose shapes changed, with the next revision.
fn touch(batch: &mut Batch, mut class: Class, shapes_before: u64, at: Timestamp) -> Result<(), StoreError> {
    if class.shapes != shapes_before {
        class.revision += 1;
        class.updated_at = at;
        put(batch, keys::class(class.id), &class)?;
    }
    Ok(())
}
