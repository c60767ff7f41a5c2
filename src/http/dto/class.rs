//! Classes on the wire.

use super::time;
use crate::model::{Class, Generation, GenerationClass};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// A class to be made.
#[derive(Clone, Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(example = json!({"name": "dog"}))]
pub struct CreateClass {
    /// 1 to 100 characters, unique. White space around it is dropped and Unicode normalisation form C is made of it.
    /// Control, format and other invisible characters, slashes, `.`, `..` and UUIDs are refused.
    #[schema(min_length = 1, max_length = 100)]
    pub name: String,
}

/// A class's new name.
#[derive(Clone, Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(example = json!({"name": "wolf"}))]
pub struct RenameClass {
    /// 1 to 100 characters, unique. White space around it is dropped and Unicode normalisation form C is made of it.
    /// Control, format and other invisible characters, slashes, `.`, `..` and UUIDs are refused.
    #[schema(min_length = 1, max_length = 100)]
    pub name: String,
}

/// How a class stands to the index.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum IndexState {
    /// It has no dictionary; queries do not find it.
    NotIndexed,
    /// Its shapes changed since its dictionary was learnt.
    Stale,
    /// Its dictionary is learnt from the shapes it has.
    Current,
}

impl IndexState {
    /// How a class stands to a generation.
    pub fn of(class: &Class, generation: Option<&Generation>) -> Self {
        Self::of_learnt(class, generation.and_then(|g| g.class(class.id)))
    }

    /// How a class stands to what was learnt of it.
    pub fn of_learnt(class: &Class, learnt: Option<&GenerationClass>) -> Self {
        match learnt {
            None => Self::NotIndexed,
            Some(learnt) if learnt.revision == class.revision => Self::Current,
            Some(_) => Self::Stale,
        }
    }
}

/// A class of shapes: what a query is recognised as.
#[derive(Clone, Debug, Serialize, ToSchema)]
#[schema(example = json!({
    "id": "01980c63-5f0e-7d52-a3f5-8b7f5d6f9a10",
    "name": "dog",
    "shapes": 12,
    "bytes": 1204551,
    "revision": 3,
    "index_state": "current",
    "created_at": "2026-01-05T09:12:44.123456Z",
    "updated_at": "2026-01-05T09:13:02.654321Z"
}))]
pub struct ClassDto {
    /// Never changes.
    pub id: String,
    /// Unique.
    pub name: String,
    /// Training shapes in it.
    pub shapes: u64,
    /// Bytes of the files they came from.
    pub bytes: u64,
    /// Grows whenever shapes are added or deleted.
    pub revision: u64,
    /// How it stands to the index.
    pub index_state: IndexState,
    /// RFC 3339, UTC.
    #[schema(format = DateTime)]
    pub created_at: String,
    /// When its name or shapes last changed; RFC 3339, UTC.
    #[schema(format = DateTime)]
    pub updated_at: String,
}

impl ClassDto {
    /// A class, seen from a generation of the index.
    pub fn new(class: Class, generation: Option<&Generation>) -> Self {
        Self {
            index_state: IndexState::of(&class, generation),
            id: class.id.to_string(),
            name: class.name.to_string(),
            shapes: class.shapes,
            bytes: class.bytes,
            revision: class.revision,
            created_at: time(class.created_at),
            updated_at: time(class.updated_at),
        }
    }
}

/// A class by its two names.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, ToSchema)]
pub struct ClassRef {
    /// Never changes.
    pub id: String,
    /// As it is called now.
    pub name: String,
}
