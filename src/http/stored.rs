//! A stored shape as the mesh of a query.

use super::body::{broke_off, within};
use super::problem::{Code, Problem};
use super::request_memory;
use super::routes::shapes::find_shape;
use super::state::{AppState, Parts};
use super::uploaded::{Buffers, Posture, UploadedMesh};
use crate::model::{ContentHash, Shape, ShapeId};
use crate::store::StoreError;
use axum::extract::Request;
use bytes::Bytes;
use futures_util::StreamExt;
use shapelex_core::memory::Reservation;
use shapelex_core::mesh::Companion;
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::sync::Arc;

/// The shape that `named` says, an id or `CLASS/ID`, with its files. They count against the memory of the request as a
/// body would. `name` is what it is called instead of its own name.
///
/// # Errors
/// `one_mesh_expected` where the request has a body too; `class_not_found`, `shape_not_found`; `original_missing`,
/// `original_damaged` and `storage_denied` where a file cannot be used; those of memory.
pub(super) async fn receive(
    state: &AppState,
    request: Request,
    named: String,
    name: Option<String>,
) -> Result<UploadedMesh, Problem> {
    let memory = request_memory::of(&request)?;
    within(state.config.upload_timeout, require_no_body(request)).await?;
    state.blocking(move |s| load(s, &named, name, memory)).await
}

async fn require_no_body(request: Request) -> Result<(), Problem> {
    let mut pieces = request.into_body().into_data_stream();
    while let Some(piece) = pieces.next().await {
        if !piece.map_err(broke_off)?.is_empty() {
            return Err(Problem::new(
                Code::OneMeshExpected,
                "the parameter shape names a stored mesh and the request has a body as well; send one of them",
            ));
        }
    }
    Ok(())
}

fn load(
    parts: &Parts,
    named: &str,
    name: Option<String>,
    memory: Arc<Reservation>,
) -> Result<UploadedMesh, Problem> {
    let shape = find(parts, named)?;
    memory.grow(shape.bytes)?;
    let bytes = Bytes::from(parts.store.original(shape.content)?);
    // A file under several names is loaded once.
    let mut loaded: BTreeMap<ContentHash, Bytes> = BTreeMap::new();
    let mut companions = Vec::with_capacity(shape.companions.len());
    for file in &shape.companions {
        let bytes = match loaded.entry(file.content) {
            Entry::Occupied(known) => known.get().clone(),
            Entry::Vacant(slot) => slot
                .insert(Bytes::from(parts.store.original(file.content)?))
                .clone(),
        };
        companions.push(Companion::new(file.name.clone(), bytes));
    }
    let own_name = || format!("{}.{}", shape.id, shape.format.extension());
    Ok(UploadedMesh {
        name: name.or_else(|| shape.name.clone()).unwrap_or_else(own_name),
        // What the file was found to be when it was uploaded.
        media_type: Some(shape.format.media_type().to_owned()),
        bytes,
        member: None,
        folder: String::new(),
        buffers: Buffers::Stored(companions),
        posture: match &shape.pose {
            Some(pose) => Posture::Sampled {
                index: pose.index,
                of: pose.of,
            },
            None => Posture::Resting,
        },
        memory,
    })
}

fn find(parts: &Parts, named: &str) -> Result<Shape, Problem> {
    // Ids have no slash; the name of an old class may.
    if let Some((class, shape)) = named.rsplit_once('/') {
        return find_shape(parts, class, shape);
    }
    let missing = || {
        let shown: String = named.chars().take(100).collect();
        Problem::new(
            Code::ShapeNotFound,
            format!("there is no shape '{shown}'; name a shape by its id, or as CLASS/ID"),
        )
        .with("shape", shown)
    };
    let id: ShapeId = named.parse().map_err(|_| missing())?;
    match parts.store.shape(id) {
        Err(StoreError::NoShape { .. }) => Err(missing()),
        found => Ok(found?),
    }
}
