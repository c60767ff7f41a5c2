//! The mesh formats, their names and media types.

use serde::{Deserialize, Serialize};

/// A mesh format shapelex reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Format {
    /// Wavefront OBJ.
    Obj,
    /// glTF 2.0, JSON.
    Gltf,
    /// glTF 2.0, binary container.
    Glb,
    /// Stanford PLY, ascii or binary.
    Ply,
    /// Stereolithography STL, ascii or binary.
    Stl,
    /// Object File Format.
    Off,
}

impl std::fmt::Display for Format {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Obj => "OBJ",
            Self::Gltf => "glTF",
            Self::Glb => "GLB",
            Self::Ply => "PLY",
            Self::Stl => "STL",
            Self::Off => "OFF",
        })
    }
}

impl Format {
    /// All formats, in the order messages name them.
    pub const ALL: [Self; 6] = [Self::Obj, Self::Gltf, Self::Glb, Self::Ply, Self::Stl, Self::Off];

    /// The file name extension, lower case, without the dot.
    pub fn extension(self) -> &'static str {
        match self {
            Self::Obj => "obj",
            Self::Gltf => "gltf",
            Self::Glb => "glb",
            Self::Ply => "ply",
            Self::Stl => "stl",
            Self::Off => "off",
        }
    }

    /// The media type files of this format are served as. IANA registers those of OBJ, glTF, GLB and STL; PLY and OFF
    /// have none and get the obvious one.
    pub fn media_type(self) -> &'static str {
        match self {
            Self::Obj => "model/obj",
            Self::Gltf => "model/gltf+json",
            Self::Glb => "model/gltf-binary",
            Self::Ply => "model/ply",
            Self::Stl => "model/stl",
            Self::Off => "model/off",
        }
    }

    /// The format a file name's extension tells, in any case: `Cat.OBJ` is OBJ. `None` for every other name.
    pub fn from_name(name: &str) -> Option<Self> {
        let (stem, extension) = name.rsplit_once('.')?;
        let file_name = stem.rsplit(['/', '\\']).next()?;
        // `.obj` and `dir/.obj` are hidden files without an extension.
        if file_name.is_empty() {
            return None;
        }
        Self::ALL
            .into_iter()
            .find(|f| f.extension().eq_ignore_ascii_case(extension))
    }

    /// The format a media type tells, parameters such as `; charset=utf-8` aside. `None` for types that tell nothing,
    /// such as `text/plain` and `application/octet-stream`.
    pub fn from_media_type(media_type: &str) -> Option<Self> {
        let essence = media_type.split(';').next()?.trim().to_ascii_lowercase();
        Some(match essence.as_str() {
            "model/obj" | "application/x-obj" | "text/obj" => Self::Obj,
            "model/gltf+json" => Self::Gltf,
            "model/gltf-binary" => Self::Glb,
            "model/ply" | "application/ply" | "application/x-ply" | "text/ply" => Self::Ply,
            "model/stl"
            | "model/x.stl-ascii"
            | "model/x.stl-binary"
            | "application/sla"
            | "application/vnd.ms-pki.stl" => Self::Stl,
            "model/off" | "application/off" => Self::Off,
            _ => return None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_types_round_trip() {
        for format in Format::ALL {
            assert_eq!(Format::from_media_type(format.media_type()), Some(format));
            assert_eq!(
                Format::from_name(&format!("dir.x/cat.{}", format.extension())),
                Some(format)
            );
        }
        for name in [
            ".obj",
            "dir/.obj",
            "obj",
            "cat.obj.zip",
            "",
            "cat.",
            "dir.obj/cat",
        ] {
            assert_eq!(Format::from_name(name), None, "{name}");
        }
    }
}
