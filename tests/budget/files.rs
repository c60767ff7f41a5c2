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

/// A zip of these files.
pub fn zip<'f>(files: impl Iterator<Item = (&'f str, &'f [u8])>) -> Vec<u8> {
    let mut writer = zip::ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in files {
        writer
            .start_file(name, zip::write::SimpleFileOptions::default())
            .unwrap();
        writer.write_all(bytes).unwrap();
    }
    writer.finish().unwrap().into_inner()
}

/// A glTF with a string of so many bytes where a number belongs.
pub fn gltf_of_wrong_types(bytes: usize) -> Vec<u8> {
    let text = "\u{7f}".repeat(bytes);
    format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}}}}]}}],"accessors":[{{"count":"{text}"}}]}}"#
    )
    .into_bytes()
}

/// The same in the place of the scene.
pub fn gltf_of_a_wrong_scene(bytes: usize) -> Vec<u8> {
    let text = "\u{7f}".repeat(bytes);
    format!(r#"{{"asset":{{"version":"2.0"}},"scene":"{text}"}}"#).into_bytes()
}

/// A glTF that requires an extension with a name of so many bytes.
pub fn gltf_of_an_extension(bytes: usize) -> Vec<u8> {
    let text = "x".repeat(bytes);
    format!(r#"{{"asset":{{"version":"2.0"}},"extensionsRequired":["{text}"]}}"#).into_bytes()
}

/// A moving tetrahedron whose clip has a name of so many bytes, and which names so many buffers by long paths.
pub fn gltf_of_poses(name: usize, buffers: usize) -> Vec<u8> {
    const DATA: &str = "AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAAAAAAAAAAAAAAAIA/AAABAAIAAAACAAMAAAADAAEAAQADAAIAAAAAAAAAgD8AAAAAAAAAAAAAAAAAAIA/AACAPwAAgD8=";
    let path = "folder/".repeat(500);
    let more: String = (0..buffers)
        .map(|i| format!(r#",{{"byteLength":1,"uri":"{path}{i}/x.bin"}}"#))
        .collect();
    let name = "n".repeat(name);
    format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"indices":1}}]}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3"}},
          {{"bufferView":1,"componentType":5123,"count":12,"type":"SCALAR"}},
          {{"bufferView":2,"componentType":5126,"count":2,"type":"SCALAR"}},
          {{"bufferView":3,"componentType":5126,"count":2,"type":"VEC3"}}],
        "bufferViews":[{{"buffer":0,"byteOffset":0,"byteLength":48}},{{"buffer":0,"byteOffset":48,"byteLength":24}},
          {{"buffer":0,"byteOffset":72,"byteLength":8}},{{"buffer":0,"byteOffset":80,"byteLength":24}}],
        "buffers":[{{"byteLength":104,"uri":"data:application/octet-stream;base64,{DATA}"}}{more}],
        "animations":[{{"name":"{name}","channels":[{{"sampler":0,"target":{{"node":0,"path":"translation"}}}}],
          "samplers":[{{"input":2,"output":3}}]}}]}}"#
    )
    .into_bytes()
}

/// A form of one file.
pub fn form(name: &str, bytes: &[u8]) -> Vec<u8> {
    form_of(&[(name, bytes)])
}

/// A form of these files.
pub fn form_of(files: &[(&str, &[u8])]) -> Vec<u8> {
    let mut body = Vec::new();
    for (name, bytes) in files {
        let head =
            format!("--xyz\r\ncontent-disposition: form-data; name=\"file\"; filename=\"{name}\"\r\n\r\n");
        body.extend_from_slice(head.as_bytes());
        body.extend_from_slice(bytes);
        body.extend_from_slice(b"\r\n");
    }
    body.extend_from_slice(b"--xyz--\r\n");
    body
}
