//! What the baselines need of an index: learnt with it, kept with its generation.

use super::context::{Reindex, stop_if_cancelled};
use super::describe::Describer;
use super::failure::{MEMORY_EXCEEDED, ReindexError, no_memory};
use crate::model::{Generation, GenerationClass, Origin, Shape};
use crate::store::{Store, StoreError};
use shapelex_core::baseline::{BaselineModel, thinned};
use shapelex_core::memory::MemoryError;

/// Shapes at most that take part in finding what all share, evenly spread over the classes.
const LEARNT_FROM: usize = 128;

/// Describes the shapes of all classes for the baselines, where that is not kept already; returns the key of the model
/// they share, `None` where no shape can be described.
///
/// The model of the generation before is kept while at least half of the classes are, so that a reindex of one class
/// touches one class, and while an imported class is described by it, as that cannot be described anew. Otherwise it is
/// learnt anew, and all classes are described by it. An imported class that is not described has no shapes then.
pub(super) fn learn_baselines(
    request: &Reindex<'_>,
    describer: &Describer<'_>,
    current: Option<&Generation>,
    classes: &[GenerationClass],
    kept: usize,
) -> Result<Option<String>, ReindexError> {
    let store = request.store;
    let shapes_of = |class: &GenerationClass| -> Result<Vec<Shape>, ReindexError> {
        let mut shapes = match store.list_shapes(class.class, None, usize::MAX) {
            // Deleted while it was learnt.
            Err(StoreError::NoClass { .. }) => Vec::new(),
            other => other?,
        };
        shapes.sort_by_cached_key(Shape::identity);
        Ok(shapes)
    };
    request.progress.begin("learn baselines", classes.len());
    let before = current
        .and_then(|g| g.baselines.as_ref())
        .filter(|key| 2 * kept >= classes.len() || has_imported(store, classes, key));
    let known = match before {
        // One that cannot be read is learnt anew.
        Some(key) => store
            .baseline_model(key)
            .unwrap_or_default()
            .map(|m| (key.clone(), m)),
        None => None,
    };
    let (key, model) = match known {
        Some(known) => known,
        None => {
            let mut all = Vec::new();
            for class in classes {
                all.extend(shapes_of(class)?);
            }
            let Some(model) = learn_model(request, describer, &all)? else {
                return Ok(None);
            };
            (store.put_baseline_model(&model)?, model)
        }
    };
    let mut shapes = Vec::new();
    for class in classes {
        shapes.push(shapes_of(class)?);
    }
    let estimates: Vec<u64> = shapes.iter().map(|shapes| one_of(describer, shapes)).collect();
    let described = describer.share.run(&estimates, |i, _| {
        let class = &classes[i];
        stop_if_cancelled(request)?;
        let there = matches!(store.baseline_shapes(class, &key), Ok(Some(_)));
        if !there {
            let described = shapes[i]
                .iter()
                .filter_map(|shape| {
                    let description = describer.description(shape).ok()?;
                    model.describe(shape.id.to_string(), &description)
                })
                .collect();
            stop_if_cancelled(request)?;
            store.put_baseline_shapes(class, &key, described)?;
        }
        request.progress.advance();
        Ok::<(), ReindexError>(())
    });
    for class in described {
        class.map_err(|error| too_large(&error))??;
    }
    Ok(Some(key))
}

/// Whether an imported class is described by the model of this key.
fn has_imported(store: &Store, classes: &[GenerationClass], key: &str) -> bool {
    classes
        .iter()
        .filter(|class| class.origin == Origin::Imported)
        .any(|class| matches!(store.baseline_shapes(class, key), Ok(Some(shapes)) if !shapes.is_empty()))
}

/// Memory that a description of any of these shapes takes, made again where it is not kept any more.
fn one_of<'a>(describer: &Describer<'_>, shapes: impl IntoIterator<Item = &'a Shape>) -> u64 {
    let shapes = shapes.into_iter();
    let each = shapes.map(|shape| {
        describer
            .shape_bytes(shape)
            .max(2 * describer.description_bytes(shape))
    });
    each.max().unwrap_or(0)
}

fn too_large(error: &MemoryError) -> ReindexError {
    ReindexError::failed(
        MEMORY_EXCEEDED,
        no_memory("describing shapes for the baselines", error),
    )
}

/// Range and words of shapes evenly spread over the given ones.
fn learn_model(
    request: &Reindex<'_>,
    describer: &Describer<'_>,
    shapes: &[Shape],
) -> Result<Option<BaselineModel>, ReindexError> {
    let taken = shapes.len().min(LEARNT_FROM);
    let taken: Vec<&Shape> = (0..taken).map(|i| &shapes[i * shapes.len() / taken]).collect();
    let estimates: Vec<u64> = taken.iter().map(|&shape| one_of(describer, [shape])).collect();
    let training: Vec<_> = describer
        .share
        .run(&estimates, |i, _| thinned(&describer.description(taken[i]).ok()?))
        .into_iter()
        .filter_map(|thinned| thinned.ok().flatten())
        .collect();
    stop_if_cancelled(request)?;
    if training.is_empty() {
        return Ok(None);
    }
    Ok(Some(BaselineModel::learn(&training, describer.parameters.seed)))
}
