//! Learning the index: describe the shapes, learn the classes, switch.

use super::baselines::learn_baselines;
use super::context::{Reindex, stop_if_cancelled};
use super::describe::{Described, Describer, Failure};
use super::failure::{MEMORY_EXCEEDED, ReindexError, code, no_memory};
use super::live::{Publisher, of_generation};
use super::plan::{Plan, ToLearn, plan, shape_key, skipped};
use super::share::index_bytes;
use super::trim;
use crate::model::{
    FailedShape, Generation, GenerationClass, GenerationShape, Origin, ReindexReport, RelearnedClass, Shape,
    SkippedClass,
};
use crate::store::StoreError;
use jiff::Timestamp;
use shapelex_core::memory::MemoryError;
use shapelex_core::parameters::Parameters;
use shapelex_core::pipeline::estimate;
use shapelex_core::pipeline::{Description, PipelineError, held_out_scores, learn_model};

/// What came of it.
pub(super) struct Outcome {
    /// The generation that is current now; `None` where there is nothing to index and never was.
    pub(super) generation: Option<u64>,
    pub(super) report: ReindexReport,
}

enum Learnt {
    Class(Box<GenerationClass>, Vec<FailedShape>),
    Skipped(SkippedClass, Vec<FailedShape>),
}

/// Runs a reindex on the current rayon pool and swaps the live index at its end. Cancelled at any point before the
/// switch, it leaves the index as it was; descriptions made so far stay cached.
pub(super) fn reindex(request: &Reindex<'_>, live: &Publisher) -> Result<Outcome, ReindexError> {
    let store = request.store;
    let parameters = match request.parameters {
        Some(parameters) => parameters.clone(),
        None => store.parameters()?,
    };
    parameters
        .validate()
        .map_err(|e| ReindexError::failed("invalid_parameters", e.to_string()))?;
    let current = match store.generation() {
        // A generation that cannot be read is learnt anew.
        Err(StoreError::Damaged { .. }) => None,
        other => other?,
    };
    let Plan { learn, keep, skip } = plan(store, current.as_ref(), request.scope, &parameters)?;
    let mut report = ReindexReport {
        reused: keep.iter().map(|class| class.class).collect(),
        skipped: skip,
        ..ReindexReport::default()
    };
    let mut classes = keep;
    let kept = classes.len();
    let served = live.current().generation.as_ref().map_or(0, index_bytes);
    let describer = Describer {
        share: request.share.beside(served),
        store,
        limits: request.limits,
        parameters: &parameters,
        fingerprint: parameters.description_fingerprint(),
        cancel: request.cancel,
    };
    learn_classes(request, &describer, &learn, &mut classes, &mut report)?;
    let baselines = learn_baselines(request, &describer, current.as_ref(), &classes, kept)?;
    stop_if_cancelled(request)?;
    request.progress.begin("switch", 1);
    let generation = switch(request, current, parameters, classes, baselines, live)?;
    request.progress.advance();
    Ok(Outcome { generation, report })
}

/// Describes and learns what the plan asks for; adds to the classes of the generation and to the report.
fn learn_classes(
    request: &Reindex<'_>,
    describer: &Describer<'_>,
    learn: &[ToLearn],
    classes: &mut Vec<GenerationClass>,
    report: &mut ReindexReport,
) -> Result<(), ReindexError> {
    let shapes: Vec<&Shape> = learn.iter().flat_map(|class| &class.shapes).collect();
    request.progress.begin("describe shapes", shapes.len());
    let described = describer.describe_all(&shapes, request.progress)?;
    report.described = described.computed;
    report.described_before = described.cached;
    check_any_described(&shapes, &described)?;

    request.progress.begin("learn classes", learn.len());
    let learnt = learn_each(request, describer, learn, &described)?;
    let tried = learnt.len();
    for learnt in learnt {
        let failed = match learnt {
            Learnt::Class(class, failed) => {
                report.relearned.push(RelearnedClass {
                    class: class.class,
                    name: class.name.as_str().to_owned(),
                    shapes: class.shapes,
                });
                classes.push(*class);
                failed
            }
            Learnt::Skipped(class, failed) => {
                report.skipped.push(class);
                failed
            }
        };
        report.failed_shapes.extend(failed);
    }
    if tried > 0 && report.relearned.is_empty() {
        let reason = report.skipped.last().map_or("", |class| &class.reason);
        return Err(ReindexError::failed(
            "no_class_learnt",
            format!("none of {tried} classes could be learnt; the last: {reason}"),
        ));
    }
    classes.sort_by_key(|class| class.class);
    Ok(())
}

/// Fails where shapes were to be described and none could be.
fn check_any_described(shapes: &[&Shape], described: &Described) -> Result<(), ReindexError> {
    if !shapes.is_empty()
        && shapes
            .iter()
            .all(|shape| described.failures.contains_key(&shape.identity()))
    {
        let first = described.failures.values().next();
        let memory = |failure: &Failure| failure.code == MEMORY_EXCEEDED;
        let code = match described.failures.values().all(memory) {
            true => MEMORY_EXCEEDED,
            false => "all_shapes_failed",
        };
        return Err(ReindexError::failed(
            code,
            format!(
                "none of {} shapes could be described; the first: {}",
                shapes.len(),
                first.map_or("", |failure| &failure.detail)
            ),
        ));
    }
    Ok(())
}

/// Learns classes from what was described of them, as many side by side as fit the memory.
fn learn_each(
    request: &Reindex<'_>,
    describer: &Describer<'_>,
    learn: &[ToLearn],
    described: &Described,
) -> Result<Vec<Learnt>, ReindexError> {
    let estimates: Vec<u64> = learn.iter().map(|class| class_bytes(describer, class)).collect();
    describer
        .share
        .run(&estimates, |i, _| {
            let class = &learn[i];
            let mut failed = Vec::new();
            let mut good = Vec::new();
            for shape in &class.shapes {
                match described.failures.get(&shape.identity()) {
                    Some(failure) => failed.push(failure.of(shape)),
                    None => good.push(shape),
                }
            }
            let learnt = learn_class(request, describer, class, &good, failed);
            request.progress.advance();
            learnt
        })
        .into_iter()
        .enumerate()
        .map(|(i, learnt)| learnt.map_err(|error| too_large(&learn[i], &error))?)
        .collect::<Result<_, ReindexError>>()
}

/// Memory that learning a class takes at most, in bytes.
fn class_bytes(describer: &Describer<'_>, class: &ToLearn) -> u64 {
    let parameters = describer.parameters;
    let of = |shape: &Shape| {
        let vertices = estimate::prepared_vertices(shape.report.input_vertices, parameters);
        estimate::training_signatures(vertices, parameters)
    };
    let signatures = class.shapes.iter().map(of).sum();
    let each = class.shapes.iter().map(|s| describer.description_bytes(s));
    let (descriptions, largest) = each.fold((0, 0), |(sum, largest): (u64, u64), bytes| {
        (sum + bytes, largest.max(bytes))
    });
    // One that is not kept any more is made again.
    let again = class.shapes.iter().map(|s| describer.shape_bytes(s)).max();
    estimate::learning_bytes(descriptions, largest, signatures, parameters)
        .max(descriptions + again.unwrap_or(0))
}

fn too_large(class: &ToLearn, error: &MemoryError) -> ReindexError {
    let what = format!("learning class '{}'", class.class.name.as_str());
    ReindexError::failed(MEMORY_EXCEEDED, no_memory(&what, error))
}

fn learn_class(
    request: &Reindex<'_>,
    describer: &Describer<'_>,
    class: &ToLearn,
    shapes: &[&Shape],
    mut failed: Vec<FailedShape>,
) -> Result<Learnt, ReindexError> {
    stop_if_cancelled(request)?;
    let _span =
        tracing::info_span!(parent: request.progress.step(), "learn", class = %class.class.id).entered();
    let parameters = describer.parameters;
    let (id, name) = (class.class.id, class.class.name.as_str());
    let mut descriptions: Vec<(&Shape, Description)> = Vec::new();
    for shape in shapes {
        match describer.description(shape) {
            Ok(description) => descriptions.push((shape, description)),
            Err(_) if request.cancel.is_cancelled() => return Err(ReindexError::Cancelled),
            Err(failure) if failure.is_passing() => return Err(ReindexError::Later(failure.detail)),
            Err(failure) => failed.push(failure.of(shape)),
        }
    }
    if descriptions.is_empty() {
        let class = skipped(id, name, "none of its shapes could be described");
        return Ok(Learnt::Skipped(class, failed));
    }
    let all: Vec<&Description> = descriptions.iter().map(|(_, description)| description).collect();
    let learnt = learn_model(&all, parameters, request.cancel, &|_, _| {}).and_then(|mut model| {
        let held_out = held_out_scores(&all, parameters, request.cancel)?;
        (model.report.held_out, model.report.copies) = (held_out.distinct, held_out.copies);
        Ok(model)
    });
    let model = match learnt {
        Ok(model) => model,
        Err(PipelineError::Cancelled(_)) => return Err(ReindexError::Cancelled),
        Err(error) => {
            let class = skipped(id, name, &format!("{}: {error}", code(&error)));
            return Ok(Learnt::Skipped(class, failed));
        }
    };
    let mut bytes = request.store.put_dictionaries(&class.key, &model.dictionaries)?;
    let mut shape_dictionaries = Vec::new();
    if parameters.per_shape {
        for (shape, description) in &descriptions {
            match learn_shape(request, parameters, shape, description)? {
                Ok((entry, size)) => {
                    shape_dictionaries.push(entry);
                    bytes += size;
                }
                Err(error) => failed.push(FailedShape {
                    class: id,
                    shape: shape.id,
                    code: code(&error).to_owned(),
                    detail: error.to_string(),
                }),
            }
        }
    }
    Ok(Learnt::Class(
        Box::new(GenerationClass {
            class: id,
            name: class.class.name.clone(),
            origin: Origin::Learnt,
            revision: class.class.revision,
            shapes: descriptions.len(),
            dictionary: class.key.clone(),
            bytes,
            atoms: model.dictionaries.values().map(|d| d.len()).sum(),
            report: model.report,
            shape_dictionaries,
        }),
        failed,
    ))
}

/// A shape's own dictionaries, those of an earlier generation where they are still there.
fn learn_shape(
    request: &Reindex<'_>,
    parameters: &Parameters,
    shape: &Shape,
    description: &Description,
) -> Result<Result<(GenerationShape, u64), PipelineError>, ReindexError> {
    let key = shape_key(shape, &parameters.learning_fingerprint());
    let size = match request.store.dictionaries(&key) {
        Ok(Some((_, size))) => size,
        _ => match learn_model(&[description], parameters, request.cancel, &|_, _| {}) {
            Ok(model) => request.store.put_dictionaries(&key, &model.dictionaries)?,
            Err(PipelineError::Cancelled(_)) => return Err(ReindexError::Cancelled),
            Err(error) => return Ok(Err(error)),
        },
    };
    let entry = GenerationShape {
        shape: shape.id,
        dictionary: key,
    };
    Ok(Ok((entry, size)))
}

/// Makes the new generation current, in the store and in memory. Where it would be the current one over again, that
/// one stays.
fn switch(
    request: &Reindex<'_>,
    current: Option<Generation>,
    parameters: Parameters,
    mut classes: Vec<GenerationClass>,
    baselines: Option<String>,
    live: &Publisher,
) -> Result<Option<u64>, ReindexError> {
    let store = request.store;
    // Classes that were deleted while they were learnt.
    let existing = store.list_classes(None, usize::MAX)?;
    classes.retain(|class| existing.iter().any(|e| e.id == class.class));
    let served = live.current().generation.as_ref().map(|g| g.number);
    let same = match &current {
        Some(current) => {
            served == Some(current.number)
                && current.parameters == parameters
                && current.classes == classes
                && current.baselines == baselines
        }
        None => classes.is_empty() && store.parameters()? == parameters,
    };
    if same {
        return Ok(served);
    }
    let generation = Generation {
        number: store.next_generation_number()?,
        parameters,
        created_at: Timestamp::now(),
        classes,
        baselines,
    };
    // Both are in memory while queries change over.
    let before = live.current().generation.as_ref().map_or(0, index_bytes);
    let needed = before + index_bytes(&generation);
    let limit = request.share.bytes;
    if needed > limit {
        let error = MemoryError::NeverFits { needed, limit };
        let detail = no_memory("the new index beside the one that is served", &error);
        return Err(ReindexError::failed(MEMORY_EXCEEDED, detail));
    }
    // Loaded before the switch, so that nothing can fail after it.
    let number = generation.number;
    let index = of_generation(store, generation.clone())?;
    live.publish(store, &index, || store.put_generation_and_switch(&generation))?;
    if let Err(error) = trim::after_loading(store, &generation) {
        // The store has closed and not opened again: the next request tells.
        tracing::error!(%error, "the store's cache could not be dropped");
    }
    Ok(Some(number))
}
