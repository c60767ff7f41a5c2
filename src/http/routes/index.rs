//! The index and the parameters.

use crate::http::AppState;
use crate::http::access::Access;
use crate::http::dto::class::IndexState;
use crate::http::dto::index::{IndexAnswer, IndexClass, IndexQuery, IndexTotals};
use crate::http::dto::parameters::{ParametersAnswer, PresetDto};
use crate::http::dto::{Page, PageQuery};
use crate::http::extract::ApiQuery;
use crate::http::problem::Problem;
use crate::http::problem_sets::PAGE;
use crate::http::route::Route;
use crate::model::Scope;
use crate::model::{Class, ClassId, GenerationClass};
use crate::store::Store;
use axum::Json;
use axum::extract::State;
use shapelex_core::parameters::{Parameters, Preset};
use std::collections::BTreeMap;
use utoipa_axum::routes;

/// The routes of this file: handler, what it demands, the problems of its own.
pub(super) fn routes() -> Vec<Route> {
    vec![
        Route::new(routes!(get_index), Access::Needs(Scope::Read), &[PAGE]),
        Route::new(routes!(get_parameters), Access::Needs(Scope::Read), &[]),
    ]
}

/// The list its cursors belong to.
const CURSOR: &str = "index";

/// Show the index
///
/// The generation queries are answered from, and how the classes stand to it, a page of up to 1000 at a time.
#[utoipa::path(
    get, path = "/v1/index", tag = "index", params(IndexQuery),
    responses((status = 200, description = "The index", body = IndexAnswer))
)]
pub async fn get_index(
    State(state): State<AppState>,
    ApiQuery(query): ApiQuery<IndexQuery>,
) -> Result<Json<IndexAnswer>, Problem> {
    let page = PageQuery::from(query);
    let (limit, after) = (page.limit()?, page.after::<ClassId>(CURSOR)?);
    let live = state.jobs.live_index();
    let classes = state.blocking(|s| all_classes(&s.store)).await?;
    let generation = live.generation.as_ref();
    let resident = live.resident_bytes_by_class();
    let learnt: BTreeMap<ClassId, (&GenerationClass, usize)> = generation
        .into_iter()
        .flat_map(|g| &g.classes)
        .filter_map(|class| Some((class.class, (class, *resident.get(&class.class)?))))
        .collect();
    let state_of = |class: &Class| IndexState::of_learnt(class, learnt.get(&class.id).map(|(c, _)| *c));
    let mut totals = IndexTotals {
        classes: classes.len(),
        ..IndexTotals::default()
    };
    for class in &classes {
        match state_of(class) {
            IndexState::Current => totals.current += 1,
            IndexState::Stale => totals.stale += 1,
            IndexState::NotIndexed => totals.not_indexed += 1,
        }
    }
    let present = classes.iter().filter_map(|class| learnt.get(&class.id));
    let bytes = present.map(|(class, _)| class.bytes).sum();
    let found = classes
        .into_iter()
        .filter(|class| after.is_none_or(|after| class.id > after));
    let page = Page::cut(
        CURSOR,
        found.take(limit + 1).collect(),
        limit,
        |class| class.id.to_string(),
        |class| {
            let state = state_of(&class);
            index_class(&class, state, learnt.get(&class.id).copied())
        },
    );
    let names = |state| {
        page.items
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
        totals,
        bytes,
        resident_bytes: live.search.resident_bytes() as u64,
        next_cursor: page.next_cursor,
        classes: page.items,
    }))
}

fn index_class(class: &Class, state: IndexState, learnt: Option<(&GenerationClass, usize)>) -> IndexClass {
    let resident_bytes = learnt.map_or(0, |(_, bytes)| bytes as u64);
    let learnt = learnt.map(|(class, _)| class);
    IndexClass {
        index_state: state,
        id: class.id.to_string(),
        name: class.name.to_string(),
        shapes: class.shapes,
        shapes_learnt: learnt.map_or(0, |c| c.shapes),
        atoms: learnt.map_or(0, |c| c.atoms),
        bytes: learnt.map_or(0, |c| c.bytes),
        resident_bytes,
        origin: learnt.map(|c| c.origin.into()),
        shape_dictionaries: learnt.map_or(0, |c| c.shape_dictionaries.len()),
    }
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
