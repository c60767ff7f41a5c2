//! Which format the bytes are in: first by the bytes, then by the declared type, then by the name.

use super::scan::Scanner;
use super::{Format, MeshError};

/// Tells the format of a file: from its bytes if they are unmistakable, else from its declared media type, else from
/// its name.
///
/// Errors: [`MeshError::Empty`] for no bytes, [`MeshError::UnknownFormat`] if nothing tells.
pub fn detect(bytes: &[u8], media_type: Option<&str>, name: Option<&str>) -> Result<Format, MeshError> {
    if bytes.is_empty() {
        return Err(MeshError::Empty);
    }
    from_bytes(bytes)
        .or_else(|| media_type.and_then(Format::from_media_type))
        .or_else(|| name.and_then(Format::from_name))
        .ok_or(MeshError::UnknownFormat)
}

/// Bytes of a text that are looked at: nothing stops the look, so it must be short.
const START: usize = 4 << 20;

/// The format the bytes alone tell, or `None`. A start that is unmistakable counts even if the rest is broken; a
/// truncated binary STL and an OBJ without vertices are not recognised.
pub fn from_bytes(bytes: &[u8]) -> Option<Format> {
    if bytes.starts_with(b"glTF") {
        return Some(Format::Glb);
    }
    if super::ply::has_magic(bytes) {
        return Some(Format::Ply);
    }
    // Before any text: the header of a binary STL is free and often begins with `solid`.
    if super::stl::is_binary(bytes) {
        return Some(Format::Stl);
    }
    let start = &bytes[..bytes.len().min(START)];
    let mut text = Scanner::new(start);
    if text.skip_whitespace() && text.peek() == Some(b'{') {
        let asset = memchr::memmem::find(bytes, b"\"asset\"");
        return asset.map(|_| Format::Gltf);
    }
    if super::stl::is_text(start) {
        return Some(Format::Stl);
    }
    if super::off::has_keyword(start) {
        return Some(Format::Off);
    }
    is_obj(start).then_some(Format::Obj)
}

/// Statements an OBJ file may hold before its first vertex, or instead of one in a broken file.
const OBJ_STATEMENTS: [&[u8]; 13] = [
    b"v", b"vn", b"vt", b"vp", b"f", b"l", b"p", b"o", b"g", b"s", b"mtllib", b"usemtl", b"mg",
];

/// Whether the first lines are all OBJ statements, with a vertex of three numbers among them.
fn is_obj(bytes: &[u8]) -> bool {
    let mut text = Scanner::new(bytes);
    for _ in 0..1000 {
        if !text.next_content() {
            return false;
        }
        let word = text.word();
        if !OBJ_STATEMENTS.contains(&word) {
            return false;
        }
        if word == b"v" {
            return (0..3).all(|_| text.number().is_some());
        }
        text.next_line();
    }
    false
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_come_first() {
        let cases: [(&[u8], Format); 14] = [
            (b"glTF\x02\0\0\0", Format::Glb),
            (b"ply\nformat ascii 1.0\n", Format::Ply),
            (b"ply\r\nformat ascii 1.0\r\n", Format::Ply),
            (b" \n{\"asset\": {\"version\": \"2.0\"}}", Format::Gltf),
            (b"solid cube\n  facet normal 0 0 1\n", Format::Stl),
            (b"SOLID\nendsolid", Format::Stl),
            (b"OFF\n8 6 12\n", Format::Off),
            (b"# made by hand\nCOFF\n8 6 12\n", Format::Off),
            (b"OFF8 6 12\n", Format::Off),
            (b"STCNOFF\n", Format::Off),
            (b"# cat\nmtllib cat.mtl\no cat\nv 0 0 1\n", Format::Obj),
            (b"v 0.5 -1e3 2 1 0 0\n", Format::Obj),
            (b"\xef\xbb\xbfv 0 0 1\n", Format::Obj),
            (b"g default\r\nv 0 0 1\r\n", Format::Obj),
        ];
        for (bytes, format) in cases {
            let found = detect(bytes, Some("image/png"), Some("x.jpg"));
            assert_eq!(found, Ok(format), "{}", String::from_utf8_lossy(bytes));
        }
    }

    #[test]
    fn then_the_declared_type_then_the_name() {
        let text = b"hello, world";
        assert_eq!(detect(text, None, None), Err(MeshError::UnknownFormat));
        assert_eq!(
            detect(text, Some("text/plain"), None),
            Err(MeshError::UnknownFormat)
        );
        assert_eq!(
            detect(text, Some("Model/GLTF-Binary; x=1"), Some("a.obj")),
            Ok(Format::Glb)
        );
        assert_eq!(
            detect(text, Some("application/octet-stream"), Some("a.STL")),
            Ok(Format::Stl)
        );
        assert_eq!(detect(b"", Some("model/obj"), None), Err(MeshError::Empty));
        // JSON that is not glTF and a file of prose are not recognised.
        assert_eq!(detect(b"{\"a\": 1}", None, None), Err(MeshError::UnknownFormat));
        assert_eq!(
            detect(b"v is a letter", None, None),
            Err(MeshError::UnknownFormat)
        );
        assert_eq!(detect(b"OFFICE", None, None), Err(MeshError::UnknownFormat));
    }
}
