//! What travels over the wire. Domain types are never serialised to a client: they change with the method, these
//! change with the API's version. Types that come in refuse fields they do not know.

pub mod answer;
pub mod class;
pub mod dataset;
pub mod index;
pub mod job;
pub mod key;
pub mod parameters;
pub mod problem;
pub mod query;
pub mod shape;
pub mod snapshot;

use crate::http::problem::{Code, Problem};
use crate::store;
use base64::Engine;
use base64::engine::general_purpose::URL_SAFE_NO_PAD;
use serde::{Deserialize, Serialize};
use std::str::FromStr;
use utoipa::{IntoParams, ToSchema};

/// Where a list begins and how long it is.
#[derive(Clone, Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct PageQuery {
    /// How many items at most, 1 to 1000; 100 where it is left out. A page of long items has fewer.
    #[param(minimum = 1, maximum = 1000, default = 100)]
    pub limit: Option<usize>,
    /// `next_cursor` of the page before; the first page where it is left out.
    #[param(min_length = 1, pattern = "^[A-Za-z0-9_-]+$")]
    pub cursor: Option<String>,
}

impl PageQuery {
    /// The page's length.
    ///
    /// # Errors
    /// `invalid_query` outside 1 to 1000.
    pub fn limit(&self) -> Result<usize, Problem> {
        match self.limit.unwrap_or(100) {
            limit @ 1..=1000 => Ok(limit),
            other => Err(Problem::new(
                Code::InvalidQuery,
                format!("limit must be between 1 and 1000, got {other}"),
            )
            .with("name", "limit")),
        }
    }

    /// The last item of the page before, in the list of this name.
    ///
    /// # Errors
    /// `invalid_cursor` where this list did not make it.
    pub fn after<Id: FromStr>(&self, list: &str) -> Result<Option<Id>, Problem> {
        let Some(cursor) = &self.cursor else {
            return Ok(None);
        };
        let decoded = URL_SAFE_NO_PAD.decode(cursor).ok();
        decoded
            .and_then(|bytes| {
                let text = String::from_utf8(bytes).ok()?;
                let (made_by, id) = text.rsplit_once(CURSOR_SEPARATOR)?;
                (made_by == list).then(|| id.parse().ok())?
            })
            .map(Some)
            .ok_or_else(|| {
                Problem::new(
                    Code::InvalidCursor,
                    "the cursor was not issued by this list; start again without it",
                )
            })
    }
}

/// Between the list's name and the item's id in a cursor.
const CURSOR_SEPARATOR: char = ' ';

/// Part of a list.
#[derive(Clone, Debug, Serialize, ToSchema)]
pub struct Page<T> {
    /// The items.
    pub items: Vec<T>,
    /// Pass it as `cursor` to get the next page; `null` at the end.
    pub next_cursor: Option<String>,
}

impl<T> Page<T> {
    /// Makes a page of up to `limit` items of a list out of up to `limit + 1`: the one too many tells that there are
    /// more. Its cursor is good for the list of this name only.
    pub fn cut<S>(
        list: &str,
        mut found: Vec<S>,
        limit: usize,
        id: impl Fn(&S) -> String,
        to: impl Fn(S) -> T,
    ) -> Self {
        let more = found.len() > limit;
        found.truncate(limit);
        Self::of(list, store::page::Page { items: found, more }, id, to)
    }

    /// Makes a page of one of the store's.
    pub fn of<S>(
        list: &str,
        page: store::page::Page<S>,
        id: impl Fn(&S) -> String,
        to: impl Fn(S) -> T,
    ) -> Self {
        let next_cursor = page
            .items
            .last()
            .filter(|_| page.more)
            .map(|last| URL_SAFE_NO_PAD.encode(format!("{list}{CURSOR_SEPARATOR}{}", id(last))));
        Self {
            items: page.items.into_iter().map(to).collect(),
            next_cursor,
        }
    }
}

/// A file's bytes.
#[derive(ToSchema)]
#[schema(value_type = String, format = Binary)]
pub struct Binary(#[allow(dead_code, reason = "only its schema is used")] Vec<u8>);

/// A multipart form: every part is a file, whatever its name.
#[derive(ToSchema)]
#[allow(dead_code, reason = "only its schema is used")]
pub struct FilesForm {
    /// The files: meshes, buffers of glTF files, archives.
    #[schema(value_type = Vec<String>, format = Binary)]
    pub file: Vec<Vec<u8>>,
}

/// A timestamp as the wire has it: RFC 3339, UTC.
pub(crate) fn time(timestamp: jiff::Timestamp) -> String {
    timestamp.to_string()
}
