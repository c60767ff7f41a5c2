//! Many classes and their shapes, added at once.

use super::catalogue::fresh;
use super::event::Event;
use super::{AddedShape, Maker, Store, StoreError};
use crate::model::{Class, ClassId, ClassName, NewShape, Shape};
use jiff::Timestamp;
use std::collections::BTreeMap;
use std::sync::PoisonError;

/// A class and the shapes it gets.
#[derive(Clone, Debug)]
pub struct ClassShapes {
    /// The class's name. Where no class has it, one is made.
    pub name: ClassName,
    /// What is added to it.
    pub shapes: Vec<NewShape>,
}

/// A class that got shapes.
#[derive(Clone, Debug, PartialEq)]
pub struct FilledClass {
    /// The class afterwards.
    pub class: Class,
    /// Whether it was made.
    pub created: bool,
    /// One entry per shape, in their order.
    pub shapes: Vec<AddedShape>,
}

impl Store {
    /// Adds shapes to classes, and makes those that do not exist: all of it or, where it fails or the process dies,
    /// nothing. No two entries may have the same name; the later one of two is refused.
    ///
    /// # Errors
    /// [`StoreError::NameTaken`]; [`StoreError::QuotaExceeded`] for all classes and bytes together;
    /// [`StoreError::Full`]; [`StoreError::ReadOnly`]; the write's failure.
    pub fn fill_classes_by(
        &self,
        maker: Option<&Maker>,
        dataset: Vec<ClassShapes>,
    ) -> Result<Vec<FilledClass>, StoreError> {
        self.inner.writable()?;
        let gate = self.inner.files.read().unwrap_or_else(PoisonError::into_inner);
        let at = Timestamp::now();
        let mut written = BTreeMap::new();
        let filled = dataset
            .into_iter()
            .map(|entry| {
                // Which class it is is decided under the writer's lock.
                let shapes = self.write_files(ClassId::new(), &entry.shapes, at, &mut written)?;
                Ok((entry.name, shapes))
            })
            .collect::<Result<Vec<_>, StoreError>>()
            .and_then(|candidates| self.fill_at_once(maker, candidates, at));
        drop(gate);
        if filled.is_err() {
            self.remove_unreferenced(written.into_values());
        }
        filled
    }

    fn fill_at_once(
        &self,
        maker: Option<&Maker>,
        candidates: Vec<(ClassName, Vec<Shape>)>,
        at: Timestamp,
    ) -> Result<Vec<FilledClass>, StoreError> {
        let mut writer = self.inner.writer();
        let made_by = maker.map(|maker| maker.key);
        let mut seen: BTreeMap<ClassName, ClassId> = BTreeMap::new();
        let (mut filled, mut events, mut all) = (Vec::new(), Vec::new(), Vec::new());
        for (name, mut shapes) in candidates {
            let known = self.class_by_name(&name)?.map(|class| class.id);
            let id = known.unwrap_or_else(ClassId::new);
            if let Some(&id) = seen.get(&name) {
                return Err(StoreError::NameTaken { name, id });
            }
            seen.insert(name.clone(), id);
            shapes.iter_mut().for_each(|shape| shape.class = id);
            let added = self.told_apart(id, shapes)?;
            let shapes = fresh(&added);
            all.extend(shapes.iter().cloned());
            match known {
                Some(_) if shapes.is_empty() => {}
                Some(class) => events.push(Event::ShapesAdded {
                    class,
                    shapes,
                    at,
                    made_by,
                }),
                None => events.push(Event::ClassFilled {
                    id,
                    name,
                    shapes,
                    at,
                    made_by,
                }),
            }
            filled.push((id, known.is_none(), added));
        }
        let made = filled.iter().filter(|(_, created, _)| *created).count();
        self.require_quota(&writer, maker, made as u64, &all)?;
        if !events.is_empty() {
            self.happen(&mut writer, &Event::Several { events })?;
        }
        filled
            .into_iter()
            .map(|(id, created, shapes)| {
                Ok(FilledClass {
                    class: self.class(id)?,
                    created,
                    shapes,
                })
            })
            .collect()
    }
}
