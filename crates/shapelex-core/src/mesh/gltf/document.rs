//! The JSON document: its lists, and the elements that are asked for.

use super::buffers::Buffers;
use super::container::Container;
use super::list::{List, reason, shortened};
use super::schema::{Asset, Index, OnlyUri, Top, text};
use super::work::Work;
use crate::memory::Held;
use crate::mesh::{Format, Limits, MeshError, ReadContext, Source};
use serde::Deserialize;
use serde_json::value::RawValue;
use std::cell::Cell;

/// Extensions that are read where they are required.
const READ: [&str; 6] = [
    "KHR_mesh_quantization",
    "KHR_draco_mesh_compression",
    "EXT_meshopt_compression",
    "KHR_meshopt_compression",
    "EXT_mesh_gpu_instancing",
    "KHR_node_visibility",
];

/// What required extensions are about that leave the surface as it is, whatever vendor they are from: how it looks,
/// sounds and behaves, what it is called and what it collides with. An extension that is about none of these may say
/// where the surface is (as `EXT_mesh_primitive_restart` and `KHR_accessor_float64` do), so it is refused by name.
const HARMLESS_SUBJECTS: [&str; 22] = [
    "materials_",
    "texture_",
    "image_",
    "lights_",
    "xmp",
    "audio",
    "techniques_webgl",
    "animation_pointer",
    "blend",
    "environment_map",
    "mesh_features",
    "instance_features",
    "structural_metadata",
    "feature_metadata",
    "mesh_manifold",
    "primitive_outline",
    "mesh_primitive_edge_visibility",
    "physics_",
    "implicit_shapes",
    "collision",
    "interactivity",
    "node_",
];

/// Whole extensions that leave the surface as it is: a shift of the whole scene, encodings that degrade to plain
/// triangles, alternatives beside the scene, descriptions of what may move.
const HARMLESS: [&str; 9] = [
    "CESIUM_RTC",
    "FB_ngon_encoding",
    "MSFT_lod",
    "AGI_articulations",
    "AGI_stk_metadata",
    "GODOT_single_root",
    "KHR_binary_glTF",
    "VRM",
    "KHR_xmp_json_ld",
];

/// Whether a required extension can be read, or passed over.
fn accepted(extension: &str) -> bool {
    let subject = extension.split_once('_').map_or("", |(_, subject)| subject);
    READ.contains(&extension)
        || HARMLESS.contains(&extension)
        || extension.starts_with("VRMC_")
        || HARMLESS_SUBJECTS.iter().any(|s| subject.starts_with(s))
}

/// A document, with access to its buffers.
pub(super) struct Document<'d> {
    pub format: Format,
    pub limits: &'d Limits,
    pub context: &'d ReadContext,
    pub work: Work<'d>,
    pub scene: Option<usize>,
    pub scenes: List<'d>,
    pub nodes: List<'d>,
    pub meshes: List<'d>,
    pub accessors: List<'d>,
    pub views: List<'d>,
    pub skins: List<'d>,
    animations: Option<&'d RawValue>,
    pub buffers: Buffers<'d>,
    /// Joints with a weight that were read so far, of all vertices.
    pub influences: Cell<usize>,
    /// Bytes of accessors that are unpacked at the moment.
    pub unpacked: Cell<usize>,
    _memory: Held<'d>,
}

impl<'d> Document<'d> {
    /// Reads the document's lists and refuses required extensions that are not read.
    pub fn open(
        container: &'d Container<'d>,
        source: &Source<'d>,
        context: &'d ReadContext,
    ) -> Result<Self, MeshError> {
        let format = container.format;
        let bytes = container.check_counts()?;
        let memory = context.memory.hold(bytes)?;
        let top = top(format, &container.json)?;
        let malformed = |detail: String| MeshError::malformed(format, detail);
        let list = |name, raw: Option<&'d RawValue>| List::parse(name, raw).map_err(malformed);
        let required: Vec<&RawValue> = list("required extension", top.extensions_required)?.into_elements();
        if let Some(extension) = required.into_iter().filter_map(text).find(|e| !accepted(e)) {
            return Err(MeshError::Unsupported {
                format,
                feature: shortened(&extension),
            });
        }
        let scene = match top.scene {
            Some(raw) => {
                let _message = message(raw, context)?;
                let index = serde_json::from_str::<Index>(raw.get());
                Some(index.map_err(|e| malformed(format!("scene: {}", reason(&e))))?)
            }
            None => None,
        };
        let buffers = list("buffer", top.buffers)?;
        let views = list("buffer view", top.buffer_views)?;
        Ok(Self {
            format,
            limits: &context.limits,
            context,
            work: Work::new(&context.cancel),
            scene: scene.map(Index::value),
            scenes: list("scene", top.scenes)?,
            nodes: list("node", top.nodes)?,
            meshes: list("mesh", top.meshes)?,
            accessors: list("accessor", top.accessors)?,
            skins: list("skin", top.skins)?,
            animations: top.animations,
            buffers: Buffers::new(views.len(), buffers, container.binary, source, context),
            views,
            influences: Cell::new(0),
            unpacked: Cell::new(0),
            _memory: memory,
        })
    }

    /// The animations; only poses need them.
    pub fn animations(&self) -> Result<List<'d>, MeshError> {
        List::parse("animation", self.animations).map_err(|detail| self.malformed(detail))
    }

    /// A [`MeshError::Malformed`] of this document.
    pub fn malformed(&self, detail: impl Into<String>) -> MeshError {
        MeshError::malformed(self.format, detail)
    }

    /// A [`MeshError::Truncated`] of this document.
    pub fn truncated(&self, detail: impl Into<String>) -> MeshError {
        MeshError::truncated(self.format, detail)
    }

    /// Parses element `index` of a list.
    pub fn get<T: Deserialize<'d>>(&self, list: &List<'d>, index: usize) -> Result<T, MeshError> {
        let raw = self.element(list, index)?;
        // An element that is referred to very often is parsed as often.
        self.work.spend(raw.get().len(), 2, "steps of reading its JSON")?;
        let _message = message(raw, self.context)?;
        serde_json::from_str(raw.get())
            .map_err(|error| self.malformed(format!("{} {index}: {}", list.name(), reason(&error))))
    }

    /// The text of element `index` of a list.
    pub fn element(&self, list: &List<'d>, index: usize) -> Result<&'d RawValue, MeshError> {
        list.elements().get(index).copied().ok_or_else(|| {
            self.malformed(format!(
                "it refers to {} {index}, but has {} of them",
                list.name(),
                list.len()
            ))
        })
    }
}

/// Elements up to this many bytes are read without a reservation for the message of an error.
const SHORT_ELEMENT: usize = 64 << 10;
/// Bytes of such a message per byte of the element: it repeats a string that stands in the wrong place, a control
/// character takes six bytes there, and there are two copies for a moment.
const MESSAGE_BYTES: usize = 12;

/// Memory for the message of an error in an element. A buffer's `uri` is a long string by right, and never in a message.
fn message<'c>(raw: &RawValue, context: &'c ReadContext) -> Result<Option<Held<'c>>, MeshError> {
    if raw.get().len() <= SHORT_ELEMENT {
        return Ok(None);
    }
    // Only an object has one, and reading anything else as an object would make such a message.
    let object = Some(raw.get()).filter(|text| text.starts_with('{'));
    let only = object.and_then(|text| serde_json::from_str::<OnlyUri<'_>>(text).ok());
    let uri = only.and_then(|only| only.uri).map_or(0, |uri| uri.get().len());
    let length = raw.get().len() - uri;
    Ok(Some(context.memory.hold((length * MESSAGE_BYTES) as u64)?))
}

/// The top level of a document of glTF 2.
fn top(format: Format, json: &str) -> Result<Top<'_>, MeshError> {
    let top: Top<'_> = serde_json::from_str(json).map_err(|error| {
        if error.is_eof() {
            MeshError::truncated(format, format!("its JSON ends too early: {error}"))
        } else {
            MeshError::malformed(format, format!("its JSON: {error}"))
        }
    })?;
    let asset: Asset<'_> = top
        .asset
        .and_then(|raw| serde_json::from_str(raw.get()).ok())
        .unwrap_or_default();
    let version = asset.version.map(|raw| raw.get().trim_matches('"'));
    // In glTF 1.0 the lists are objects by name; its early files claim no version.
    let named = top.meshes.is_some_and(|raw| raw.get().starts_with('{'));
    if named || version.is_some_and(|v| v == "1" || v.starts_with("1.") || v.starts_with("0.")) {
        return Err(MeshError::Unsupported {
            format,
            feature: "glTF 1.0".to_owned(),
        });
    }
    Ok(top)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn required_extensions_are_accepted_by_what_they_are_about() {
        for name in [
            "KHR_materials_unlit",
            "ADOBE_materials_thin_transparency",
            "EXT_texture_webp",
            "EXT_mesh_features",
            "KHR_techniques_webgl",
            "EXT_structural_metadata",
            "CESIUM_primitive_outline",
            "VRMC_springBone",
            "KHR_meshopt_compression",
            "KHR_physics_rigid_bodies",
        ] {
            assert!(accepted(name), "{name}");
        }
        for name in [
            "VENDOR_new",
            "EXT_mesh_primitive_restart",
            "KHR_accessor_float64",
            "MPEG_accessor_timed",
            "EXT_implicit_cylinder_region",
            "materials_",
        ] {
            assert!(!accepted(name), "{name}");
        }
    }
}
