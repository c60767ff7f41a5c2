//! Files that ask for much memory, all within the limits.

use flate2::Compression;
use flate2::write::GzEncoder;
use std::io::{Cursor, Read, Write};

/// A zip of one file that unpacks to so many bytes of blanks.
pub fn zip_bomb(bytes: usize) -> Vec<u8> {
    let mut writer = zip::ZipWriter::new(Cursor::new(Vec::new()));
    writer
        .start_file("bomb.obj", zip::write::SimpleFileOptions::default())
        .unwrap();
    writer.write_all(&vec![b' '; bytes]).unwrap();
    writer.finish().unwrap().into_inner()
}

/// The same as tar.gz.
pub fn gzip_bomb(bytes: usize) -> Vec<u8> {
    let mut builder = tar::Builder::new(GzEncoder::new(Vec::new(), Compression::best()));
    let mut header = tar::Header::new_ustar();
    header.set_size(bytes as u64);
    header.set_mode(0o644);
    let blanks = std::io::repeat(b' ').take(bytes as u64);
    builder.append_data(&mut header, "bomb.obj", blanks).unwrap();
    builder.into_inner().unwrap().finish().unwrap()
}

/// A few corners, and faces of one line without an end.
pub fn long_line(bytes: usize) -> Vec<u8> {
    let mut text = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf".to_vec();
    while text.len() < bytes {
        text.extend_from_slice(b" 1 2 3 4");
    }
    text.push(b'\n');
    text
}

/// As many corners and faces as fit, in the shortest lines there are.
pub fn short_lines(bytes: usize) -> Vec<u8> {
    let mut text = Vec::with_capacity(bytes + 16);
    while text.len() < bytes / 2 {
        text.extend_from_slice(b"v 0 1 2\nv 1 2 0\nv 2 0 1\n");
    }
    while text.len() < bytes {
        text.extend_from_slice(b"f 1 2 3\n");
    }
    text
}

/// Numbers of one digit, as many as fit, as an OFF.
pub fn off_of_digits(bytes: usize) -> Vec<u8> {
    let vertices = bytes / 12;
    let faces = bytes / 16;
    let mut text = format!("OFF\n{vertices} {faces} 0\n").into_bytes();
    for i in 0..vertices {
        text.extend_from_slice(format!("{} {} {}\n", i % 7, i % 5, i % 3).as_bytes());
    }
    for _ in 0..faces {
        text.extend_from_slice(b"3 0 1 2\n");
    }
    text
}

/// A glTF whose buffer is a `data:` URI of so many bytes, read by an accessor of bytes as often as there are primitives.
pub fn gltf_of_base64(bytes: usize, primitives: usize) -> Vec<u8> {
    let buffer = bytes / 4 * 3;
    let count = buffer / 12;
    let data = "AAAA".repeat(bytes / 4);
    let primitive = r#"{"attributes":{"POSITION":0}}"#;
    let all = vec![primitive; primitives].join(",");
    format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0}}],
        "meshes":[{{"primitives":[{all}]}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":{count},"type":"VEC3"}}],
        "bufferViews":[{{"buffer":0,"byteLength":{buffer}}}],
        "buffers":[{{"byteLength":{buffer},"uri":"data:application/octet-stream;base64,{data}"}}]}}"#
    )
    .into_bytes()
}

/// A glTF of accessors without a buffer, which are zeros by definition: a few bytes that stand for many.
pub fn gltf_of_zeros(count: usize, morph_targets: usize) -> Vec<u8> {
    let targets = vec![r#"{"POSITION":0}"#; morph_targets].join(",");
    format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"targets":[{targets}]}}]}}],
        "accessors":[{{"componentType":5126,"count":{count},"type":"VEC3"}}]}}"#
    )
    .into_bytes()
}

/// A glTF document of many small objects.
pub fn gltf_of_objects(bytes: usize) -> Vec<u8> {
    let mut text = String::from(r#"{"asset":{"version":"2.0"},"nodes":[{}"#);
    while text.len() < bytes {
        text += ",{}";
    }
    text += "]}";
    text.into_bytes()
}

/// A form of one file.
pub fn form(name: &str, bytes: &[u8]) -> Vec<u8> {
    let mut body =
        format!("--xyz\r\ncontent-disposition: form-data; name=\"file\"; filename=\"{name}\"\r\n\r\n")
            .into_bytes();
    body.extend_from_slice(bytes);
    body.extend_from_slice(b"\r\n--xyz--\r\n");
    body
}
