//! Which classes a reindex learns, keeps or leaves out.

use super::failure::ReindexError;
use crate::model::{Class, ClassId, Generation, GenerationClass, Origin, ReindexScope, Shape, SkippedClass};
use crate::store::{Store, StoreError};
use shapelex_core::parameters::Parameters;
use std::collections::BTreeMap;

/// A class to learn.
pub(super) struct ToLearn {
    pub(super) class: Class,
    /// Sorted by identity: the key of the dictionary says nothing of the order of uploads, so neither must learning.
    pub(super) shapes: Vec<Shape>,
    /// The key its dictionaries are kept under.
    pub(super) key: String,
}

/// What is to be done.
#[derive(Default)]
pub(super) struct Plan {
    pub(super) learn: Vec<ToLearn>,
    pub(super) keep: Vec<GenerationClass>,
    pub(super) skip: Vec<SkippedClass>,
}

/// Compares the catalogue with the current generation.
///
/// # Errors
/// `imported_classes_incompatible` and `scope_too_narrow` where classes that the index has would be lost: see
/// [`refuse_losses`].
pub(super) fn plan(
    store: &Store,
    current: Option<&Generation>,
    scope: &ReindexScope,
    parameters: &Parameters,
) -> Result<Plan, ReindexError> {
    let fingerprint = parameters.learning_fingerprint();
    let mut plan = Plan::default();
    let classes = store.list_classes(None, usize::MAX)?;
    if let ReindexScope::Classes(named) = scope {
        for id in named.iter().filter(|id| classes.iter().all(|c| c.id != **id)) {
            plan.skip
                .push(skipped(*id, "", "there is no such class any more"));
        }
    }
    // Other parameters make every dictionary stale.
    let comparable = current.is_none_or(|g| g.parameters.learning_fingerprint() == fingerprint);
    let known: BTreeMap<ClassId, &GenerationClass> = current
        .iter()
        .flat_map(|g| g.classes.iter().map(|class| (class.class, class)))
        .collect();
    let mut lost = Losses::default();
    for class in classes {
        let mut shapes = match store.list_shapes(class.id, None, usize::MAX) {
            Err(StoreError::NoClass { .. }) => continue,
            other => other?,
        };
        let before = known.get(&class.id).copied();
        if shapes.is_empty() {
            match before.filter(|before| before.origin == Origin::Imported) {
                Some(_) if !comparable => lost.imported.push(class.name.to_string()),
                Some(before) => plan.keep_imported(store, &class, before),
                None => plan
                    .skip
                    .push(skipped(class.id, class.name.as_str(), "it has no shapes")),
            }
            continue;
        }
        shapes.sort_by_cached_key(Shape::identity);
        let key = class_key(&class, &shapes, &fingerprint);
        match choose(&class, before.filter(|_| comparable), scope, &key) {
            Choice::Keep(before) if readable(store, before) => plan.keep.push(kept(&class, before, &key)),
            Choice::Learn | Choice::Keep(_) => plan.learn.push(ToLearn { class, shapes, key }),
            Choice::Leave if before.is_some() => lost.unnamed.push(class.name.to_string()),
            Choice::Leave => {
                let reason = "it was never learnt, and this reindex did not name it";
                plan.skip.push(skipped(class.id, class.name.as_str(), reason));
            }
        }
    }
    refuse_losses(&lost)?;
    Ok(plan)
}

/// What to do with a class that has shapes.
enum Choice<'a> {
    Learn,
    Keep(&'a GenerationClass),
    /// It has nothing to keep, and is not to be learnt.
    Leave,
}

/// `before` is how the class stands in an index of the same parameters.
fn choose<'a>(
    class: &Class,
    before: Option<&'a GenerationClass>,
    scope: &ReindexScope,
    key: &str,
) -> Choice<'a> {
    match (scope, before) {
        (ReindexScope::All, _) | (ReindexScope::Stale, None) => Choice::Learn,
        (ReindexScope::Stale, Some(before)) if is_current(class, before, key) => Choice::Keep(before),
        (ReindexScope::Stale, Some(_)) => Choice::Learn,
        (ReindexScope::Classes(named), _) if named.contains(&class.id) => Choice::Learn,
        (ReindexScope::Classes(_), Some(before)) => Choice::Keep(before),
        (ReindexScope::Classes(_), None) => Choice::Leave,
    }
}

/// Whether a class is as its dictionary has it. An imported one is, for as long as its shapes are those it had at the
/// import.
fn is_current(class: &Class, before: &GenerationClass, key: &str) -> bool {
    match before.origin {
        Origin::Learnt => before.dictionary == key,
        Origin::Imported => before.revision == class.revision,
    }
}

fn kept(class: &Class, before: &GenerationClass, key: &str) -> GenerationClass {
    let current = is_current(class, before, key);
    GenerationClass {
        name: class.name.clone(),
        revision: if current { class.revision } else { before.revision },
        ..before.clone()
    }
}

impl Plan {
    /// An imported class without shapes of its own, which nothing but its dictionaries tells about.
    fn keep_imported(&mut self, store: &Store, class: &Class, before: &GenerationClass) {
        if readable(store, before) {
            self.keep.push(GenerationClass {
                name: class.name.clone(),
                // It may have had shapes that were deleted since.
                revision: class.revision,
                ..before.clone()
            });
        } else {
            let reason = "its imported dictionary cannot be read any more; import the file again";
            self.skip.push(skipped(class.id, class.name.as_str(), reason));
        }
    }
}

/// Names of classes that the index has and that a reindex could neither keep nor learn.
#[derive(Default)]
struct Losses {
    /// Imported ones without shapes.
    imported: Vec<String>,
    /// Those that the scope does not name, while the parameters change.
    unnamed: Vec<String>,
}

/// A reindex never takes a class out of the index that it could not learn again.
fn refuse_losses(lost: &Losses) -> Result<(), ReindexError> {
    if !lost.imported.is_empty() {
        return Err(ReindexError::failed(
            "imported_classes_incompatible",
            format!(
                "the parameters differ from those of the imported dictionaries, and {} to be learnt from; add shapes to \
                 them, delete the classes, or reindex without other parameters",
                listed(&lost.imported, "has no shapes", "have no shapes")
            ),
        ));
    }
    if !lost.unnamed.is_empty() {
        return Err(ReindexError::failed(
            "scope_too_narrow",
            format!(
                "the parameters differ from those the index was learnt with, so what it has of classes that the scope \
                 does not name cannot be kept: {} in the index; reindex with the scope \"stale\", or without other \
                 parameters",
                listed(&lost.unnamed, "is", "are")
            ),
        ));
    }
    Ok(())
}

/// Up to five names, the number of the others, and the verb that goes with them.
fn listed(names: &[String], one: &str, many: &str) -> String {
    const SHOWN: usize = 5;
    let mut text = names[..names.len().min(SHOWN)].join(", ");
    if names.len() > SHOWN {
        text += &format!(" and {} more", names.len() - SHOWN);
    }
    format!("{text} {}", if names.len() == 1 { one } else { many })
}

pub(super) fn skipped(class: ClassId, name: &str, reason: &str) -> SkippedClass {
    SkippedClass {
        class,
        name: name.to_owned(),
        reason: reason.to_owned(),
    }
}

/// Whether all dictionaries of a class can still be read.
fn readable(store: &Store, class: &GenerationClass) -> bool {
    std::iter::once(&class.dictionary)
        .chain(class.shape_dictionaries.iter().map(|s| &s.dictionary))
        .all(|key| matches!(store.dictionaries(key), Ok(Some(_))))
}

/// The key of a class's dictionaries: equal for equal shapes and equal parameters.
fn class_key(class: &Class, shapes: &[Shape], fingerprint: &str) -> String {
    let mut hasher = blake3::Hasher::new();
    for shape in shapes {
        hasher.update(&shape.identity().to_bytes());
    }
    let shapes = &hasher.finalize().to_hex()[..32];
    format!("class-{}-{fingerprint}-{shapes}", class.id)
}

/// The key of a shape's own dictionaries.
pub(super) fn shape_key(shape: &Shape, fingerprint: &str) -> String {
    format!("shape-{}-{fingerprint}", shape.identity())
}
