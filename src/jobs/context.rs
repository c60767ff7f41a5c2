//! What a reindex works with.

use super::failure::ReindexError;
use super::progress::Progress;
use super::share::Share;
use crate::model::ReindexScope;
use crate::store::Store;
use shapelex_core::cancel::Cancel;
use shapelex_core::mesh::Limits;
use shapelex_core::parameters::Parameters;

/// What is asked, and with what.
pub(super) struct Reindex<'a> {
    pub(super) store: &'a Store,
    pub(super) limits: &'a Limits,
    /// The memory for reindexing, the index that is served included.
    pub(super) share: Share,
    pub(super) cancel: &'a Cancel,
    pub(super) progress: &'a Progress,
    pub(super) scope: &'a ReindexScope,
    pub(super) parameters: Option<&'a Parameters>,
}

pub(super) fn stop_if_cancelled(request: &Reindex<'_>) -> Result<(), ReindexError> {
    request.cancel.check().map_err(|_| ReindexError::Cancelled)
}
