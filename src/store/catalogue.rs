//! Classes and their shapes.

use super::entry::get;
use super::event::{Event, files_of, shapes_of};
use super::payload::{IdentityLink, NameLink, OwnerLink};
use super::{Batch, Maker, Statistics, Store, StoreError, Writer, keys, record};
use crate::model::{Class, ClassId, ClassName, CompanionFile, ContentHash, NewShape, Shape, ShapeId};
use jiff::Timestamp;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::PoisonError;

/// What adding a shape led to.
#[derive(Clone, Debug, PartialEq)]
pub struct AddedShape {
    /// The shape.
    pub shape: Shape,
    /// Whether it is new; `false` where the class had the same file and pose already.
    pub created: bool,
}

impl Store {
    /// How much there is.
    ///
    /// # Errors
    /// [`StoreError::Damaged`] where a record cannot be read.
    pub fn statistics(&self) -> Result<Statistics, StoreError> {
        let mut statistics = Statistics::default();
        for class in self.list_classes(None, usize::MAX)? {
            statistics.classes += 1;
            statistics.shapes += class.shapes;
            statistics.bytes += class.bytes;
        }
        Ok(statistics)
    }

    /// Makes a class without shapes.
    ///
    /// # Errors
    /// [`StoreError::NameTaken`]; [`StoreError::ReadOnly`]; the write's failure.
    pub fn create_class(&self, name: ClassName) -> Result<Class, StoreError> {
        self.create_class_by(None, name)
    }

    /// Makes a class without shapes, on account of an API key.
    ///
    /// # Errors
    /// As [`Store::create_class`]; [`StoreError::QuotaExceeded`].
    pub fn create_class_by(&self, maker: Option<&Maker>, name: ClassName) -> Result<Class, StoreError> {
        let mut writer = self.inner.writer();
        self.require_free(&name)?;
        self.require_quota(&writer, maker, 1, &[])?;
        let id = ClassId::new();
        self.happen(
            &mut writer,
            &Event::ClassCreated {
                id,
                name,
                at: Timestamp::now(),
                made_by: maker.map(|maker| maker.key),
            },
        )?;
        self.class(id)
    }

    /// A class.
    ///
    /// # Errors
    /// [`StoreError::NoClass`]; [`StoreError::Damaged`].
    pub fn class(&self, id: ClassId) -> Result<Class, StoreError> {
        get(&*self.inner.backend, &keys::class(id))?.ok_or(StoreError::NoClass { id })
    }

    /// The class of a name.
    ///
    /// # Errors
    /// [`StoreError::Damaged`].
    pub fn class_by_name(&self, name: &ClassName) -> Result<Option<Class>, StoreError> {
        let link: Option<NameLink> = get(&*self.inner.backend, &keys::name(name))?;
        match link {
            None => Ok(None),
            // Deleted between the two reads.
            Some(link) => match self.class(link.class()) {
                Err(StoreError::NoClass { .. }) => Ok(None),
                other => other.map(Some),
            },
        }
    }

    /// Up to `limit` classes in the order of their creation, those after `after` only.
    ///
    /// # Errors
    /// [`StoreError::Damaged`].
    pub fn list_classes(&self, after: Option<ClassId>, limit: usize) -> Result<Vec<Class>, StoreError> {
        let after = after.map(keys::class);
        self.inner
            .backend
            .scan(keys::CLASS, after.as_deref(), limit)?
            .iter()
            .map(|(key, value)| record::unseal(key, value))
            .collect()
    }

    /// Gives a class another name. Its own name is no error and changes nothing.
    ///
    /// # Errors
    /// [`StoreError::NoClass`]; [`StoreError::NameTaken`]; [`StoreError::ReadOnly`]; the write's failure.
    pub fn rename_class(&self, id: ClassId, name: ClassName) -> Result<Class, StoreError> {
        let mut writer = self.inner.writer();
        let class = self.class(id)?;
        if class.name == name {
            return Ok(class);
        }
        self.require_free(&name)?;
        self.happen(
            &mut writer,
            &Event::ClassRenamed {
                id,
                name,
                at: Timestamp::now(),
            },
        )?;
        self.class(id)
    }

    /// Removes a class with its shapes, and the stored files nobody else refers to. The index keeps the class until
    /// the next reindex. Returns the class as it was.
    ///
    /// # Errors
    /// [`StoreError::NoClass`]; [`StoreError::ReadOnly`]; the write's failure.
    pub fn delete_class(&self, id: ClassId) -> Result<Class, StoreError> {
        let mut writer = self.inner.writer();
        let class = self.class(id)?;
        let shapes = shapes_of(&*self.inner.backend, id)?;
        self.happen(&mut writer, &Event::ClassDeleted { id })?;
        drop(writer);
        self.remove_unreferenced(shapes.iter().flat_map(files_of));
        Ok(class)
    }

    /// Adds shapes to a class, all or none, with one answer per shape in their order. A shape the class has already
    /// (same file, same pose) is answered as it is.
    ///
    /// # Errors
    /// [`StoreError::NoClass`]; [`StoreError::Full`]; [`StoreError::ReadOnly`]; the write's failure.
    pub fn add_shapes(&self, class: ClassId, shapes: Vec<NewShape>) -> Result<Vec<AddedShape>, StoreError> {
        self.add_shapes_by(None, class, shapes)
    }

    /// Adds shapes to a class, on account of an API key. Shapes the class has already count nothing.
    ///
    /// # Errors
    /// As [`Store::add_shapes`]; [`StoreError::QuotaExceeded`].
    pub fn add_shapes_by(
        &self,
        maker: Option<&Maker>,
        class: ClassId,
        shapes: Vec<NewShape>,
    ) -> Result<Vec<AddedShape>, StoreError> {
        self.inner.writable()?;
        self.class(class)?;
        let gate = self.inner.files.read().unwrap_or_else(PoisonError::into_inner);
        let at = Timestamp::now();
        let mut written = BTreeMap::new();
        let added = self
            .write_files(class, &shapes, at, &mut written)
            .and_then(|candidates| {
                let mut writer = self.inner.writer();
                self.class(class)?;
                let added = self.told_apart(class, candidates)?;
                let shapes = fresh(&added);
                self.require_quota(&writer, maker, 0, &shapes)?;
                if !shapes.is_empty() {
                    let made_by = maker.map(|maker| maker.key);
                    let event = Event::ShapesAdded {
                        class,
                        shapes,
                        at,
                        made_by,
                    };
                    self.happen(&mut writer, &event)?;
                }
                Ok(added)
            });
        drop(gate);
        if added.is_err() {
            self.remove_unreferenced(written.into_values());
        }
        added
    }

    /// Makes a class with its first shapes: both or, where it fails or the process dies, neither.
    ///
    /// # Errors
    /// [`StoreError::NameTaken`]; [`StoreError::Full`]; [`StoreError::ReadOnly`]; the write's failure.
    pub fn create_filled_class(
        &self,
        name: ClassName,
        shapes: Vec<NewShape>,
    ) -> Result<Vec<AddedShape>, StoreError> {
        self.create_filled_class_by(None, name, shapes)
    }

    /// Makes a class with its first shapes, on account of an API key.
    ///
    /// # Errors
    /// As [`Store::create_filled_class`]; [`StoreError::QuotaExceeded`].
    pub fn create_filled_class_by(
        &self,
        maker: Option<&Maker>,
        name: ClassName,
        shapes: Vec<NewShape>,
    ) -> Result<Vec<AddedShape>, StoreError> {
        self.inner.writable()?;
        self.require_free(&name)?;
        let gate = self.inner.files.read().unwrap_or_else(PoisonError::into_inner);
        let (id, at) = (ClassId::new(), Timestamp::now());
        let mut written = BTreeMap::new();
        let added = self
            .write_files(id, &shapes, at, &mut written)
            .and_then(|candidates| {
                let mut writer = self.inner.writer();
                self.require_free(&name)?;
                let added = self.told_apart(id, candidates)?;
                let shapes = fresh(&added);
                self.require_quota(&writer, maker, 1, &shapes)?;
                let made_by = maker.map(|maker| maker.key);
                let event = Event::ClassFilled {
                    id,
                    name,
                    shapes,
                    at,
                    made_by,
                };
                self.happen(&mut writer, &event)?;
                Ok(added)
            });
        drop(gate);
        if added.is_err() {
            self.remove_unreferenced(written.into_values());
        }
        added
    }

    /// Stores the files of the shapes and makes their records. Files of equal address in memory are hashed once.
    pub(super) fn write_files(
        &self,
        class: ClassId,
        shapes: &[NewShape],
        at: Timestamp,
        written: &mut BTreeMap<(usize, usize), ContentHash>,
    ) -> Result<Vec<Shape>, StoreError> {
        let mut keep = |bytes: &[u8]| {
            let address = (bytes.as_ptr().addr(), bytes.len());
            if let Some(hash) = written.get(&address) {
                return Ok(*hash);
            }
            let hash = ContentHash::of(bytes);
            written.insert(address, hash);
            self.write_original(hash, bytes).map(|()| hash)
        };
        shapes
            .iter()
            .map(|new| {
                let companions = new
                    .companions
                    .iter()
                    .map(|companion| {
                        Ok(CompanionFile {
                            name: companion.name.clone(),
                            content: keep(companion.bytes())?,
                        })
                    })
                    .collect::<Result<_, StoreError>>()?;
                let length = new.bytes.len() + new.companions.iter().map(|c| c.bytes().len()).sum::<usize>();
                Ok(Shape {
                    id: ShapeId::new(),
                    class,
                    name: new.name.clone(),
                    content: keep(&new.bytes)?,
                    companions,
                    format: new.format,
                    bytes: length as u64,
                    pose: new.pose.clone(),
                    report: new.report.clone(),
                    created_at: at,
                })
            })
            .collect()
    }

    /// Which of the candidates are new and which the class has already; equal candidates are one shape.
    pub(super) fn told_apart(
        &self,
        class: ClassId,
        candidates: Vec<Shape>,
    ) -> Result<Vec<AddedShape>, StoreError> {
        let mut fresh: BTreeMap<ContentHash, Shape> = BTreeMap::new();
        let mut added = Vec::with_capacity(candidates.len());
        for shape in candidates {
            let identity = shape.identity();
            let link: Option<IdentityLink> = get(&*self.inner.backend, &keys::identity(class, identity))?;
            let known = match link {
                Some(link) => get(&*self.inner.backend, &keys::shape(class, link.shape()))?,
                None => fresh.get(&identity).cloned(),
            };
            added.push(match known {
                Some(shape) => AddedShape {
                    shape,
                    created: false,
                },
                None => {
                    fresh.insert(identity, shape.clone());
                    AddedShape { shape, created: true }
                }
            });
        }
        Ok(added)
    }

    /// A shape.
    ///
    /// # Errors
    /// [`StoreError::NoShape`]; [`StoreError::Damaged`].
    pub fn shape(&self, id: ShapeId) -> Result<Shape, StoreError> {
        let missing = StoreError::NoShape { id };
        let owner: Option<OwnerLink> = get(&*self.inner.backend, &keys::owner(id))?;
        let Some(owner) = owner else { return Err(missing) };
        get(&*self.inner.backend, &keys::shape(owner.class(), id))?.ok_or(missing)
    }

    /// Up to `limit` shapes of a class in the order of their creation, those after `after` only.
    ///
    /// # Errors
    /// [`StoreError::NoClass`]; [`StoreError::Damaged`].
    pub fn list_shapes(
        &self,
        class: ClassId,
        after: Option<ShapeId>,
        limit: usize,
    ) -> Result<Vec<Shape>, StoreError> {
        self.class(class)?;
        let after = after.map(|id| keys::shape(class, id));
        self.inner
            .backend
            .scan(&keys::shapes_of(class), after.as_deref(), limit)?
            .iter()
            .map(|(key, value)| record::unseal(key, value))
            .collect()
    }

    /// Removes a shape, and its stored files where nobody else refers to them. The index keeps what it learnt from it
    /// until the next reindex. Returns the shape as it was.
    ///
    /// # Errors
    /// [`StoreError::NoShape`]; [`StoreError::ReadOnly`]; the write's failure.
    pub fn delete_shape(&self, id: ShapeId) -> Result<Shape, StoreError> {
        let mut writer = self.inner.writer();
        let shape = self.shape(id)?;
        self.happen(
            &mut writer,
            &Event::ShapesDeleted {
                class: shape.class,
                shapes: vec![id],
                at: Timestamp::now(),
            },
        )?;
        drop(writer);
        self.remove_unreferenced(files_of(&shape));
        Ok(shape)
    }

    fn require_free(&self, name: &ClassName) -> Result<(), StoreError> {
        match self.class_by_name(name)? {
            None => Ok(()),
            Some(other) => Err(StoreError::NameTaken {
                name: name.clone(),
                id: other.id,
            }),
        }
    }

    pub(super) fn happen(&self, writer: &mut Writer, event: &Event) -> Result<(), StoreError> {
        self.inner.record(writer, event, Batch::default())
    }

    /// Removes stored files no shape refers to. A file that cannot be removed now is left for the next collection.
    pub(super) fn remove_unreferenced(&self, contents: impl Iterator<Item = ContentHash>) {
        let contents: BTreeSet<ContentHash> = contents.collect();
        let _gate = self.inner.files.write().unwrap_or_else(PoisonError::into_inner);
        // After a failed write the log may hold a change the records do not show yet, and that change needs its files.
        if self.inner.writable().is_err() || self.is_pinned(&contents) {
            return;
        }
        for content in contents {
            let removed = self.is_referenced(content).and_then(|referenced| {
                if referenced {
                    Ok(())
                } else {
                    self.remove_original(content)
                }
            });
            if let Err(error) = removed {
                tracing::warn!(%content, %error, "an unreferenced file was not removed");
            }
        }
    }
}

/// The shapes that are new.
pub(super) fn fresh(added: &[AddedShape]) -> Vec<Shape> {
    added
        .iter()
        .filter(|a| a.created)
        .map(|a| a.shape.clone())
        .collect()
}
