//! The payloads of the catalogue's families, version 1, kept apart from the model so that either can change alone.
//!
//! What grows often and describes itself (parameters and reports) is kept as JSON text inside the payload.

use super::record::{Family, Record};
use crate::model::{Class, ClassId, ClassName, CompanionFile, ContentHash, JobId, Shape, ShapeId, ShapePose};
use jiff::Timestamp;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use shapelex_core::mesh::Format;
use shapelex_core::parameters::Parameters;

pub(super) fn pack<T: Serialize>(value: &T) -> Result<Vec<u8>, String> {
    postcard::to_stdvec(value).map_err(|e| e.to_string())
}

pub(super) fn unpack<T: DeserializeOwned>(payload: &[u8]) -> Result<T, String> {
    match postcard::take_from_bytes(payload) {
        Ok((value, [])) => Ok(value),
        Ok((_, rest)) => Err(format!("{} bytes too many", rest.len())),
        Err(error) => Err(error.to_string()),
    }
}

/// JSON text that is known to read back: a number that is not finite becomes `null`, and a record that cannot be read
/// must never be written.
pub(super) fn to_json<T: Serialize + DeserializeOwned>(value: &T) -> Result<String, String> {
    let text = serde_json::to_string(value).map_err(|e| e.to_string())?;
    from_json::<T>(&text).map_err(|e| format!("it would not read back: {e}"))?;
    Ok(text)
}

pub(super) fn from_json<T: DeserializeOwned>(text: &str) -> Result<T, String> {
    serde_json::from_str(text).map_err(|e| e.to_string())
}

pub(super) fn instant(nanoseconds: i128) -> Result<Timestamp, String> {
    Timestamp::from_nanosecond(nanoseconds).map_err(|e| e.to_string())
}

/// Refuses a version this build does not know.
pub(super) fn only(version: u16, known: u16) -> Result<(), String> {
    if version == known {
        Ok(())
    } else {
        Err(format!("version {version}; this build reads version {known}"))
    }
}

/// A number of the store itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Number(pub u64);

impl Record for Number {
    const FAMILY: Family = Family::Meta;
    const VERSION: u16 = 1;

    fn encode(&self) -> Result<Vec<u8>, String> {
        Ok(self.0.to_le_bytes().to_vec())
    }

    fn decode(version: u16, payload: &[u8]) -> Result<Self, String> {
        only(version, 1)?;
        let bytes = payload
            .try_into()
            .map_err(|_| "a number has 8 bytes".to_owned())?;
        Ok(Self(u64::from_le_bytes(bytes)))
    }
}

impl Record for Parameters {
    const FAMILY: Family = Family::Meta;
    const VERSION: u16 = 1;

    fn encode(&self) -> Result<Vec<u8>, String> {
        to_json(self).map(String::into_bytes)
    }

    fn decode(version: u16, payload: &[u8]) -> Result<Self, String> {
        only(version, 1)?;
        from_json(std::str::from_utf8(payload).map_err(|e| e.to_string())?)
    }
}

/// An entry of an index: sixteen bytes of an identifier.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Link<const FAMILY: u8>(pub [u8; 16]);

/// Class name → class.
pub(super) type NameLink = Link<{ Family::Name as u8 }>;
/// Shape → class.
pub(super) type OwnerLink = Link<{ Family::Owner as u8 }>;
/// Contents and pose within a class → shape.
pub(super) type IdentityLink = Link<{ Family::Identity as u8 }>;
/// A stored file is used by a shape.
pub(super) type ReferenceLink = Link<{ Family::Reference as u8 }>;
/// A job is not finished.
pub(super) type QueueLink = Link<{ Family::Queue as u8 }>;

impl<const FAMILY: u8> Record for Link<FAMILY> {
    const FAMILY: Family = match FAMILY {
        3 => Family::Name,
        5 => Family::Owner,
        6 => Family::Identity,
        7 => Family::Reference,
        _ => Family::Queue,
    };
    const VERSION: u16 = 1;

    fn encode(&self) -> Result<Vec<u8>, String> {
        Ok(self.0.to_vec())
    }

    fn decode(version: u16, payload: &[u8]) -> Result<Self, String> {
        only(version, 1)?;
        payload
            .try_into()
            .map(Self)
            .map_err(|_| "an identifier has 16 bytes".to_owned())
    }
}

impl<const FAMILY: u8> Link<FAMILY> {
    pub(super) fn to_class(id: ClassId) -> Self {
        Self(id.to_bytes())
    }

    pub(super) fn to_shape(id: ShapeId) -> Self {
        Self(id.to_bytes())
    }

    pub(super) fn to_job(id: JobId) -> Self {
        Self(id.to_bytes())
    }

    pub(super) fn class(self) -> ClassId {
        ClassId::from_bytes(self.0)
    }

    pub(super) fn shape(self) -> ShapeId {
        ShapeId::from_bytes(self.0)
    }

    pub(super) fn job(self) -> JobId {
        JobId::from_bytes(self.0)
    }
}

#[derive(Serialize, Deserialize)]
struct ClassV1 {
    id: [u8; 16],
    name: String,
    revision: u64,
    shapes: u64,
    bytes: u64,
    created_at: i128,
    updated_at: i128,
}

impl Record for Class {
    const FAMILY: Family = Family::Class;
    const VERSION: u16 = 1;

    fn encode(&self) -> Result<Vec<u8>, String> {
        pack(&ClassV1 {
            id: self.id.to_bytes(),
            name: self.name.as_str().to_owned(),
            revision: self.revision,
            shapes: self.shapes,
            bytes: self.bytes,
            created_at: self.created_at.as_nanosecond(),
            updated_at: self.updated_at.as_nanosecond(),
        })
    }

    fn decode(version: u16, payload: &[u8]) -> Result<Self, String> {
        only(version, 1)?;
        let v: ClassV1 = unpack(payload)?;
        Ok(Self {
            id: ClassId::from_bytes(v.id),
            name: ClassName::stored(&v.name).map_err(|e| e.to_string())?,
            revision: v.revision,
            shapes: v.shapes,
            bytes: v.bytes,
            created_at: instant(v.created_at)?,
            updated_at: instant(v.updated_at)?,
        })
    }
}

#[derive(Serialize, Deserialize)]
struct ShapeV1 {
    id: [u8; 16],
    class: [u8; 16],
    name: Option<String>,
    content: [u8; 32],
    companions: Vec<(String, [u8; 32])>,
    format: u8,
    bytes: u64,
    pose: Option<(String, u64, u64)>,
    report: String,
    created_at: i128,
}

/// The number of a format in records. Numbers are never given twice.
const FORMATS: [(u8, Format); 6] = [
    (1, Format::Obj),
    (2, Format::Gltf),
    (3, Format::Glb),
    (4, Format::Ply),
    (5, Format::Stl),
    (6, Format::Off),
];

impl Record for Shape {
    const FAMILY: Family = Family::Shape;
    const VERSION: u16 = 1;

    fn encode(&self) -> Result<Vec<u8>, String> {
        let format = FORMATS
            .iter()
            .find(|(_, f)| *f == self.format)
            .ok_or_else(|| format!("format {} has no number", self.format))?;
        pack(&ShapeV1 {
            id: self.id.to_bytes(),
            class: self.class.to_bytes(),
            name: self.name.clone(),
            content: self.content.to_bytes(),
            companions: self
                .companions
                .iter()
                .map(|c| (c.name.clone(), c.content.to_bytes()))
                .collect(),
            format: format.0,
            bytes: self.bytes,
            pose: self
                .pose
                .as_ref()
                .map(|p| (p.label.clone(), p.index as u64, p.of as u64)),
            report: to_json(&self.report)?,
            created_at: self.created_at.as_nanosecond(),
        })
    }

    fn decode(version: u16, payload: &[u8]) -> Result<Self, String> {
        only(version, 1)?;
        let v: ShapeV1 = unpack(payload)?;
        let format = FORMATS
            .iter()
            .find(|(number, _)| *number == v.format)
            .ok_or_else(|| format!("unknown mesh format {}", v.format))?;
        Ok(Self {
            id: ShapeId::from_bytes(v.id),
            class: ClassId::from_bytes(v.class),
            name: v.name,
            content: ContentHash::from_bytes(v.content),
            companions: v
                .companions
                .into_iter()
                .map(|(name, content)| CompanionFile {
                    name,
                    content: ContentHash::from_bytes(content),
                })
                .collect(),
            format: format.1,
            bytes: v.bytes,
            pose: v.pose.map(|(label, index, of)| ShapePose {
                label,
                index: index as usize,
                of: of as usize,
            }),
            report: from_json(&v.report)?,
            created_at: instant(v.created_at)?,
        })
    }
}
