//! Every key of the store. The first part names the record family; identifiers follow as their raw bytes, so that the
//! order of keys is the order of creation. `docs/storage.md` lists them with their values.

use crate::model::{ClassId, ClassName, ContentHash, JobId, KeyId, ShapeId};

pub(super) const CLASS: &[u8] = b"class/";
pub(super) const NAME: &[u8] = b"name/";
pub(super) const SHAPE: &[u8] = b"shape/";
pub(super) const OWNER: &[u8] = b"owner/";
pub(super) const IDENTITY: &[u8] = b"identity/";
pub(super) const REFERENCE: &[u8] = b"reference/";
pub(super) const DICTIONARY: &[u8] = b"dictionary/";
pub(super) const BASELINE: &[u8] = b"baseline/";
pub(super) const GENERATION: &[u8] = b"generation/";
pub(super) const JOB: &[u8] = b"job/";
pub(super) const QUEUE: &[u8] = b"queue/";
pub(super) const API_KEY: &[u8] = b"api-key/";

/// `meta/sequence`: the number of the last catalogue event applied.
pub(super) const META_SEQUENCE: &[u8] = b"meta/sequence";
/// `meta/migration`: the number of the last migration applied.
pub(super) const META_MIGRATION: &[u8] = b"meta/migration";
/// `meta/generation`: the number of the current generation.
pub(super) const META_GENERATION: &[u8] = b"meta/generation";
/// `meta/last-generation`: the greatest number a generation ever had.
pub(super) const META_LAST_GENERATION: &[u8] = b"meta/last-generation";
/// `meta/parameters`: the parameters of the last reindex.
pub(super) const META_PARAMETERS: &[u8] = b"meta/parameters";

fn join(parts: &[&[u8]]) -> Vec<u8> {
    parts.concat()
}

pub(super) fn class(id: ClassId) -> Vec<u8> {
    join(&[CLASS, &id.to_bytes()])
}

pub(super) fn name(name: &ClassName) -> Vec<u8> {
    join(&[NAME, name.as_str().as_bytes()])
}

pub(super) fn shapes_of(class: ClassId) -> Vec<u8> {
    join(&[SHAPE, &class.to_bytes()])
}

pub(super) fn shape(class: ClassId, id: ShapeId) -> Vec<u8> {
    join(&[SHAPE, &class.to_bytes(), &id.to_bytes()])
}

pub(super) fn owner(id: ShapeId) -> Vec<u8> {
    join(&[OWNER, &id.to_bytes()])
}

pub(super) fn identity(class: ClassId, identity: ContentHash) -> Vec<u8> {
    join(&[IDENTITY, &class.to_bytes(), &identity.to_bytes()])
}

pub(super) fn references_of(content: ContentHash) -> Vec<u8> {
    join(&[REFERENCE, &content.to_bytes()])
}

pub(super) fn reference(content: ContentHash, id: ShapeId) -> Vec<u8> {
    join(&[REFERENCE, &content.to_bytes(), &id.to_bytes()])
}

pub(super) fn dictionary(key: &str) -> Vec<u8> {
    join(&[DICTIONARY, key.as_bytes()])
}

pub(super) fn baseline(key: &str) -> Vec<u8> {
    join(&[BASELINE, key.as_bytes()])
}

pub(super) fn generation(number: u64) -> Vec<u8> {
    join(&[GENERATION, &number.to_be_bytes()])
}

pub(super) fn job(id: JobId) -> Vec<u8> {
    join(&[JOB, &id.to_bytes()])
}

pub(super) fn queue(id: JobId) -> Vec<u8> {
    join(&[QUEUE, &id.to_bytes()])
}

pub(super) fn api_key(id: KeyId) -> Vec<u8> {
    join(&[API_KEY, &id.to_bytes()])
}
