//! The index and the parameters.

use crate::http::AppState;
use crate::http::dto::class::IndexState;
use crate::http::dto::index::{IndexAnswer, IndexClass};
use crate::http::dto::parameters::{ParametersAnswer, PresetDto};
use crate::http::problem::Problem;
use crate::model::Class;
use crate::parameters::{Parameters, Preset};
use crate::store::Store;
use axum::Json;
use axum::extract::State;

/// Show the index
///
/// The generation queries are answered from, and how every class stands to it.
#[utoipa::path(
    get, path = "/v1/index", tag = "index",
    responses((status = 200, description = "The index", body = IndexAnswer))
)]
pub async fn get_index(State(state): State<AppState>) -> Result<Json<IndexAnswer>, Problem> {
    let live = state.jobs.live_index();
    let classes = state.blocking(|s| all_classes(&s.store)).await?;
    let generation = live.generation.as_ref();
    let classes: Vec<IndexClass> = classes
        .into_iter()
        .map(|class| {
            let learnt = generation.and_then(|g| g.class(class.id));
            IndexClass {
                index_state: IndexState::of(&class, generation),
                id: class.id.to_string(),
                name: class.name.to_string(),
                shapes: class.shapes,
                shapes_learnt: learnt.map_or(0, |c| c.shapes),
                atoms: learnt.map_or(0, |c| c.atoms),
                bytes: learnt.map_or(0, |c| c.bytes),
                shape_dictionaries: learnt.map_or(0, |c| c.shape_dictionaries.len()),
            }
        })
        .collect();
    let names = |state| {
        classes
            .iter()
            .filter(|c| c.index_state == state)
            .map(|c| c.name.clone())
            .collect()
    };
    Ok(Json(IndexAnswer {
        generation: generation.map(|g| g.number),
        created_at: generation.map(|g| g.created_at.to_string()),
        parameters: generation.map(|g| g.parameters.clone().into()),
        stale: names(IndexState::Stale),
        not_indexed: names(IndexState::NotIndexed),
        bytes: classes.iter().map(|c| c.bytes).sum(),
        classes,
    }))
}

fn all_classes(store: &Store) -> Result<Vec<Class>, Problem> {
    let mut all: Vec<Class> = Vec::new();
    loop {
        let page = store.list_classes(all.last().map(|c| c.id), 1000)?;
        let last = page.len() < 1000;
        all.extend(page);
        if last {
            return Ok(all);
        }
    }
}

/// Show the parameters
///
/// Every preset with its values, and the values a reindex starts from where it names no preset.
#[utoipa::path(
    get, path = "/v1/parameters", tag = "index",
    responses((status = 200, description = "The parameters", body = ParametersAnswer))
)]
pub async fn get_parameters(State(state): State<AppState>) -> Result<Json<ParametersAnswer>, Problem> {
    let current = match &state.jobs.live_index().generation {
        Some(generation) => generation.parameters.clone(),
        None => Parameters::preset(state.config.preset),
    };
    let presets = Preset::ALL
        .into_iter()
        .map(|preset| PresetDto {
            name: preset.into(),
            parameters: Parameters::preset(preset).into(),
        })
        .collect();
    Ok(Json(ParametersAnswer {
        current: current.into(),
        presets,
    }))
}
