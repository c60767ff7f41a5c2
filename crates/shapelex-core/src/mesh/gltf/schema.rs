//! The parts of a glTF document that a mesh needs.
//!
//! Lists of the document are kept as text, element by element, and an element is parsed when something refers to it.
//! So a slip in a part that has no shape (a material, a camera, `extras`, a name) never makes a file unreadable, and
//! the memory of a parsed document does not depend on what it lists. The vocabulary is the gltf crate's.

use gltf::json::accessor::{GenericComponentType, IndexComponentType, Type};
use gltf::json::animation::{Interpolation, Property};
use gltf::json::mesh::Mode;
use gltf::json::validation::Checked;
use serde::de::{Error, IgnoredAny, MapAccess, Visitor};
use serde::{Deserialize, Deserializer};
use serde_json::value::RawValue;
use std::borrow::Cow;
use std::fmt;

/// The document's top level; every part still is text.
#[derive(Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct Top<'t> {
    #[serde(borrow)]
    pub asset: Option<&'t RawValue>,
    #[serde(borrow)]
    pub scene: Option<&'t RawValue>,
    #[serde(borrow)]
    pub scenes: Option<&'t RawValue>,
    #[serde(borrow)]
    pub nodes: Option<&'t RawValue>,
    #[serde(borrow)]
    pub meshes: Option<&'t RawValue>,
    #[serde(borrow)]
    pub accessors: Option<&'t RawValue>,
    #[serde(borrow)]
    pub buffer_views: Option<&'t RawValue>,
    #[serde(borrow)]
    pub buffers: Option<&'t RawValue>,
    #[serde(borrow)]
    pub skins: Option<&'t RawValue>,
    #[serde(borrow)]
    pub animations: Option<&'t RawValue>,
    #[serde(borrow)]
    pub extensions_required: Option<&'t RawValue>,
}

/// The version a document claims; the rest of `asset` has no shape.
#[derive(Default, Deserialize)]
pub(super) struct Asset<'t> {
    #[serde(borrow)]
    pub version: Option<&'t RawValue>,
}

/// A number that counts or points: a whole one, which some exporters write as `3.0`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Whole(pub u64);

/// A whole number that points to an element of a list.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) struct Index(u32);

impl Index {
    pub fn value(self) -> usize {
        self.0 as usize
    }
}

struct WholeVisitor;

impl Visitor<'_> for WholeVisitor {
    type Value = u64;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a whole number of at least 0")
    }

    fn visit_u64<E: Error>(self, value: u64) -> Result<u64, E> {
        Ok(value)
    }

    fn visit_f64<E: Error>(self, value: f64) -> Result<u64, E> {
        if value >= 0.0 && value.fract() == 0.0 && value < 9.0e15 {
            Ok(value as u64)
        } else {
            Err(E::invalid_value(serde::de::Unexpected::Float(value), &self))
        }
    }
}

impl<'de> Deserialize<'de> for Whole {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_u64(WholeVisitor).map(Self)
    }
}

impl<'de> Deserialize<'de> for Index {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let value = deserializer.deserialize_u64(WholeVisitor)?;
        u32::try_from(value)
            .map(Self)
            .map_err(|_| D::Error::custom(format!("no list has an element {value}")))
    }
}

#[derive(Default, Deserialize)]
#[serde(default)]
pub(super) struct SceneNodes {
    pub nodes: Option<Vec<Index>>,
}

#[derive(Default, Deserialize)]
#[serde(default)]
pub(super) struct Node<'t> {
    pub mesh: Option<Index>,
    pub skin: Option<Index>,
    pub children: Option<Vec<Index>>,
    pub translation: Option<[f64; 3]>,
    pub rotation: Option<[f64; 4]>,
    pub scale: Option<[f64; 3]>,
    pub matrix: Option<[f64; 16]>,
    pub weights: Option<Vec<f64>>,
    #[serde(borrow)]
    pub extensions: Option<NodeExtensions<'t>>,
}

#[derive(Default, Deserialize)]
#[serde(default)]
pub(super) struct NodeExtensions<'t> {
    #[serde(rename = "EXT_mesh_gpu_instancing", borrow)]
    pub gpu_instancing: Option<&'t RawValue>,
    #[serde(rename = "KHR_node_visibility")]
    pub visibility: Option<Visibility>,
}

#[derive(Deserialize)]
pub(super) struct Visibility {
    #[serde(default = "visible")]
    pub visible: bool,
}

fn visible() -> bool {
    true
}

#[derive(Deserialize)]
pub(super) struct Mesh {
    pub primitives: Vec<Primitive>,
    #[serde(default)]
    pub weights: Option<Vec<f64>>,
}

#[derive(Deserialize)]
pub(super) struct Primitive {
    #[serde(default)]
    pub attributes: Attributes,
    #[serde(default)]
    pub indices: Option<Index>,
    #[serde(default)]
    pub mode: Option<Checked<Mode>>,
    #[serde(default)]
    pub targets: Option<Vec<Attributes>>,
    #[serde(default)]
    pub extensions: Option<PrimitiveExtensions>,
}

#[derive(Default, Deserialize)]
#[serde(default)]
pub(super) struct PrimitiveExtensions {
    #[serde(rename = "KHR_draco_mesh_compression")]
    pub draco: Option<Draco>,
}

/// A Draco stream in place of a primitive's indices and attributes.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Draco {
    pub buffer_view: Index,
    /// The stream's own numbers of its attributes.
    pub attributes: Attributes,
}

/// What a primitive says about its vertices, as far as it places them.
#[derive(Clone, Debug, Default)]
pub(super) struct Attributes {
    pub position: Option<Index>,
    /// `JOINTS_n` by n.
    pub joints: Vec<(u32, Index)>,
    /// `WEIGHTS_n` by n.
    pub weights: Vec<(u32, Index)>,
}

impl<'de> Deserialize<'de> for Attributes {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Named;
        impl<'de> Visitor<'de> for Named {
            type Value = Attributes;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("attributes by name")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Attributes, A::Error> {
                let mut found = Attributes::default();
                while let Some(name) = map.next_key::<Cow<'de, str>>()? {
                    let set = |prefix| name.strip_prefix(prefix).and_then(|n| n.parse::<u32>().ok());
                    if name == "POSITION" {
                        found.position = Some(map.next_value()?);
                    } else if let Some(n) = set("JOINTS_") {
                        found.joints.push((n, map.next_value()?));
                    } else if let Some(n) = set("WEIGHTS_") {
                        found.weights.push((n, map.next_value()?));
                    } else {
                        map.next_value::<IgnoredAny>()?;
                    }
                }
                Ok(found)
            }
        }
        deserializer.deserialize_map(Named)
    }
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Accessor {
    #[serde(default)]
    pub buffer_view: Option<Index>,
    #[serde(default)]
    pub byte_offset: Option<Whole>,
    pub component_type: Checked<GenericComponentType>,
    pub count: Whole,
    #[serde(rename = "type")]
    pub kind: Checked<Type>,
    #[serde(default)]
    pub normalized: Option<bool>,
    #[serde(default)]
    pub sparse: Option<Sparse>,
}

#[derive(Deserialize)]
pub(super) struct Sparse {
    pub count: Whole,
    pub indices: SparseIndices,
    pub values: SparseValues,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct SparseIndices {
    pub buffer_view: Index,
    #[serde(default)]
    pub byte_offset: Option<Whole>,
    pub component_type: Checked<IndexComponentType>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct SparseValues {
    pub buffer_view: Index,
    #[serde(default)]
    pub byte_offset: Option<Whole>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct BufferView<'t> {
    pub buffer: Index,
    #[serde(default)]
    pub byte_offset: Option<Whole>,
    pub byte_length: Whole,
    #[serde(default)]
    pub byte_stride: Option<Whole>,
    #[serde(default, borrow)]
    pub extensions: Option<ViewExtensions<'t>>,
}

#[derive(Default, Deserialize)]
#[serde(default)]
pub(super) struct ViewExtensions<'t> {
    #[serde(rename = "EXT_meshopt_compression", borrow)]
    pub ext_meshopt: Option<Meshopt<'t>>,
    #[serde(rename = "KHR_meshopt_compression", borrow)]
    pub khr_meshopt: Option<Meshopt<'t>>,
}

/// A stream of meshoptimizer's codecs in place of a view's bytes.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Meshopt<'t> {
    pub buffer: Index,
    #[serde(default)]
    pub byte_offset: Option<Whole>,
    pub byte_length: Whole,
    pub byte_stride: Whole,
    pub count: Whole,
    #[serde(borrow)]
    pub mode: Cow<'t, str>,
    #[serde(default)]
    pub filter: Option<Cow<'t, str>>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Buffer<'t> {
    #[serde(default, borrow)]
    pub uri: Option<&'t RawValue>,
    #[serde(default)]
    pub byte_length: Option<Whole>,
}

/// The one text of an element that may be long.
#[derive(Deserialize)]
pub(super) struct OnlyUri<'t> {
    #[serde(default, borrow)]
    pub uri: Option<&'t RawValue>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Skin {
    pub joints: Vec<Index>,
    #[serde(default)]
    pub inverse_bind_matrices: Option<Index>,
}

#[derive(Default, Deserialize)]
#[serde(default)]
pub(super) struct Animation<'t> {
    #[serde(borrow)]
    pub name: Option<&'t RawValue>,
    #[serde(borrow)]
    pub samplers: Option<Vec<&'t RawValue>>,
    #[serde(borrow)]
    pub channels: Option<Vec<&'t RawValue>>,
}

#[derive(Deserialize)]
pub(super) struct Sampler {
    pub input: Index,
    pub output: Index,
    #[serde(default)]
    pub interpolation: Option<Checked<Interpolation>>,
}

#[derive(Deserialize)]
pub(super) struct Channel {
    pub sampler: Index,
    pub target: Target,
}

#[derive(Deserialize)]
pub(super) struct Target {
    #[serde(default)]
    pub node: Option<Index>,
    pub path: Checked<Property>,
}

/// The text of a JSON string; escapes that stand for no character become U+FFFD.
pub(super) fn text(raw: &RawValue) -> Option<Cow<'_, str>> {
    let inside = raw.get().strip_prefix('"')?.strip_suffix('"')?;
    if !inside.contains('\\') {
        return Some(Cow::Borrowed(inside));
    }
    // As bytes, serde_json takes halves of surrogate pairs.
    let bytes: Bytes = serde_json::from_str(raw.get()).ok()?;
    Some(Cow::Owned(match String::from_utf8(bytes.0) {
        Ok(text) => text,
        Err(error) => String::from_utf8_lossy(error.as_bytes()).into_owned(),
    }))
}

struct Bytes(Vec<u8>);

impl<'de> Deserialize<'de> for Bytes {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Copied;
        impl Visitor<'_> for Copied {
            type Value = Bytes;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a string")
            }

            fn visit_bytes<E: Error>(self, bytes: &[u8]) -> Result<Bytes, E> {
                Ok(Bytes(bytes.to_vec()))
            }
        }
        deserializer.deserialize_bytes(Copied)
    }
}
