//! Which classes a reindex learns, keeps or leaves out.

use crate::model::{Class, ClassId, Generation, GenerationClass, ReindexScope, Shape, SkippedClass};
use crate::parameters::Parameters;
use crate::store::{Store, StoreError};

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
pub(super) fn plan(
    store: &Store,
    current: Option<&Generation>,
    scope: &ReindexScope,
    parameters: &Parameters,
) -> Result<Plan, StoreError> {
    let fingerprint = parameters.learning_fingerprint();
    // Other parameters make every dictionary stale.
    let comparable = current.filter(|g| g.parameters.learning_fingerprint() == fingerprint);
    let mut plan = Plan::default();
    let classes = store.list_classes(None, usize::MAX)?;
    if let ReindexScope::Classes(named) = scope {
        for id in named.iter().filter(|id| classes.iter().all(|c| c.id != **id)) {
            plan.skip
                .push(skipped(*id, "", "there is no such class any more"));
        }
    }
    for class in classes {
        let mut shapes = match store.list_shapes(class.id, None, usize::MAX) {
            Err(StoreError::NoClass { .. }) => continue,
            other => other?,
        };
        if shapes.is_empty() {
            plan.skip
                .push(skipped(class.id, class.name.as_str(), "it has no shapes"));
            continue;
        }
        shapes.sort_by_cached_key(Shape::identity);
        let key = class_key(&class, &shapes, &fingerprint);
        let before = comparable.and_then(|g| g.class(class.id));
        let (forced, content_with_stale) = match scope {
            ReindexScope::Stale => (false, false),
            ReindexScope::All => (true, true),
            ReindexScope::Classes(named) => (named.contains(&class.id), true),
        };
        match before {
            Some(before)
                if !forced && (before.dictionary == key || content_with_stale) && readable(store, before) =>
            {
                let current = before.dictionary == key;
                plan.keep.push(GenerationClass {
                    name: class.name.clone(),
                    revision: if current { class.revision } else { before.revision },
                    ..before.clone()
                });
            }
            None if !forced && content_with_stale && comparable.is_some() => {
                let reason = "it was never learnt, and this reindex did not name it";
                plan.skip.push(skipped(class.id, class.name.as_str(), reason));
            }
            _ => plan.learn.push(ToLearn { class, shapes, key }),
        }
    }
    Ok(plan)
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
