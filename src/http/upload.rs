//! A request's body → the meshes in it, whichever way they were sent: raw, multipart, or an archive of them.

use super::AppState;
use super::admission::{Patience, Work};
use super::archive::{self, ArchiveKind, Unpacking};
use super::arriving::Arriving;
use super::body::{body_too_large, broke_off, clean_name, media_type, most_bytes, no_room, within};
use super::config::UploadLimits;
use super::multipart::receive_multipart;
use super::problem::{Code, Problem};
use super::request_memory;
use super::uploaded::{Buffers, Part, Posture, SentBuffers, UploadedMesh};
use crate::model::text::is_hidden;
use axum::extract::Request;
use axum::http::{HeaderMap, header};
use futures_util::StreamExt;
use shapelex_core::memory::Reservation;
use shapelex_core::mesh::{Format, MeshError};
use std::sync::Arc;
use tracing::{Instrument, info_span};

/// Everything a request brought.
#[derive(Clone, Debug)]
pub struct Upload {
    /// The meshes, in the order they were sent.
    pub meshes: Vec<UploadedMesh>,
    /// Files that are no meshes and no buffers: materials, textures, notes.
    pub ignored: Vec<String>,
}

/// Receives a request's body. `name` is what the client calls a raw body.
///
/// The body counts against the memory of requests while it arrives, and so does what is unpacked of it while it comes
/// out. What a caller can know without the body, it must have checked before.
///
/// # Errors
/// `body_too_large`, `request_timeout`, `unsupported_media_type`, `empty_body`, `invalid_multipart`, `no_files`,
/// `overloaded` where memory is short, and those of [`archive::unpack_within`].
pub async fn receive(state: &AppState, request: Request, name: Option<String>) -> Result<Upload, Problem> {
    let limits = state.config.upload_limits();
    let memory = request_memory::of(&request)?;
    let most = most_bytes(
        request.headers(),
        limits.max_body_bytes,
        state.memory.body_limit(),
    )?;
    let declared = media_type(request.headers());
    let receiving = async {
        if declared.as_deref() == Some("multipart/form-data") {
            receive_multipart(request, most, limits.archive.max_members, &memory).await
        } else {
            Ok(vec![
                receive_raw(request, declared, name, most, &limits, &memory).await?,
            ])
        }
    };
    let parts = within(state.config.upload_timeout, receiving)
        .instrument(info_span!("receive"))
        .await?;
    let span = info_span!("unpack");
    state
        .unpacking
        .run(Patience::Bounded, state.config.query_timeout, move |work| {
            span.in_scope(|| sort(parts, &limits, work, &memory))
        })
        .await
}

/// The single mesh of an upload.
///
/// # Errors
/// `one_mesh_expected`.
pub fn only_mesh(upload: Upload) -> Result<UploadedMesh, Problem> {
    let found = upload.meshes.len();
    let mut meshes = upload.meshes.into_iter();
    match (meshes.next(), meshes.next()) {
        (Some(mesh), None) => Ok(mesh),
        _ => Err(Problem::new(
            Code::OneMeshExpected,
            format!("{found} meshes were sent; send one, or use POST /v1/query/batch"),
        )
        .with("found", found)),
    }
}

/// Media types of a raw body. curl stamps `application/x-www-form-urlencoded` on every `--data-binary` that names no
/// type, so it says as little as `application/octet-stream`.
fn is_readable(media_type: &str) -> bool {
    media_type.starts_with("model/")
        || Format::from_media_type(media_type).is_some()
        || declared_archive(media_type).is_some()
        || ACCEPTED.contains(&media_type)
}

const ACCEPTED: &[&str] = &[
    "application/octet-stream",
    "application/x-www-form-urlencoded",
    "application/x-tgif",
    "text/plain",
    "text/prs.wavefront-obj",
];

fn declared_archive(media_type: &str) -> Option<ArchiveKind> {
    match media_type {
        "application/zip" | "application/x-zip-compressed" => Some(ArchiveKind::Zip),
        "application/x-tar" | "application/tar" => Some(ArchiveKind::Tar),
        "application/gzip"
        | "application/x-gzip"
        | "application/x-gtar"
        | "application/x-compressed-tar"
        | "application/tar+gzip" => Some(ArchiveKind::TarGz),
        _ => None,
    }
}

async fn receive_raw(
    request: Request,
    declared: Option<String>,
    name: Option<String>,
    most: usize,
    limits: &UploadLimits,
    memory: &Reservation,
) -> Result<Part, Problem> {
    if let Some(declared) = &declared
        && !is_readable(declared)
    {
        return Err(Problem::new(
            Code::UnsupportedMediaType,
            format!(
                "'{declared}' is not read here; send model/obj, model/gltf+json, model/gltf-binary, model/stl, model/ply, \
                 model/off, application/octet-stream, an archive (application/zip, application/x-tar, application/gzip) or \
                 multipart/form-data"
            ),
        ));
    }
    let name = name.or_else(|| disposition_name(request.headers()));
    let mut body = Arriving::new(most, memory);
    let mut stream = request.into_body().into_data_stream();
    while let Some(piece) = stream.next().await {
        let piece = piece.map_err(broke_off)?;
        if body.len() + piece.len() > limits.max_body_bytes {
            return Err(body_too_large(limits.max_body_bytes));
        }
        body.push(&piece).map_err(no_room)?;
    }
    if body.is_empty() {
        return Err(MeshError::Empty.into());
    }
    Ok(Part {
        name: clean_name(name.as_deref()),
        path: None,
        media_type: declared,
        bytes: body.into_bytes(),
        packed: false,
    })
}

/// Unpacks archives and tells meshes, buffers and the rest apart.
fn sort(
    parts: Vec<Part>,
    limits: &UploadLimits,
    work: &Work,
    memory: &Arc<Reservation>,
) -> Result<Upload, Problem> {
    let unpacking = Unpacking {
        cancel: &work.cancel,
        memory,
    };
    let mut files = Vec::new();
    let mut archive_limits = limits.archive;
    for part in parts {
        let declared = part.media_type.as_deref().and_then(declared_archive);
        let Some(kind) = archive::detect(&part.bytes).or(declared) else {
            files.push(part);
            continue;
        };
        for member in archive::unpack_within(kind, &part.bytes, &mut archive_limits, &unpacking)? {
            files.push(Part {
                name: member.path,
                path: None,
                media_type: None,
                bytes: member.bytes.into(),
                packed: true,
            });
        }
        forget(part, memory);
    }
    let (mut meshes, mut buffers, mut ignored) = (Vec::new(), Vec::new(), Vec::new());
    for file in files {
        match role(&file) {
            Role::Mesh => meshes.push(file),
            Role::Buffer => buffers.push(file),
            Role::Other => {
                ignored.push(file.name.clone());
                forget(file, memory);
            }
        }
    }
    if meshes.is_empty() {
        return Err(Problem::new(
            Code::NoFiles,
            "no mesh file was sent; shapelex reads OBJ, glTF, GLB, PLY, STL and OFF",
        )
        .with("ignored", ignored));
    }
    let buffers = Arc::new(SentBuffers::new(buffers));
    let meshes = meshes
        .into_iter()
        .map(|file| UploadedMesh {
            name: file.name.replace(is_hidden, ""),
            folder: file.folder().to_owned(),
            media_type: file.media_type.filter(|t| Format::from_media_type(t).is_some()),
            bytes: file.bytes,
            member: file.packed.then_some(file.name),
            buffers: Buffers::Sent(buffers.clone()),
            posture: Posture::Resting,
            memory: memory.clone(),
        })
        .collect();
    Ok(Upload { meshes, ignored })
}

/// Frees a file that is not needed any more, and what is reserved for it.
fn forget(file: Part, memory: &Reservation) {
    let bytes = file.bytes.len() as u64;
    drop(file);
    memory.shrink_body(bytes);
}

enum Role {
    Mesh,
    Buffer,
    Other,
}

fn role(file: &Part) -> Role {
    if Format::from_name(&file.name).is_some() {
        return Role::Mesh;
    }
    let extension = file.name.rsplit_once('.').map(|(_, e)| e.to_ascii_lowercase());
    match extension.as_deref().unwrap_or_default() {
        "bin" => Role::Buffer,
        "mtl" | "png" | "jpg" | "jpeg" | "webp" | "ktx" | "ktx2" | "tga" | "bmp" | "dds" => Role::Other,
        _ if file.media_type.as_deref() == Some("application/gltf-buffer") => Role::Buffer,
        _ if file.packed => Role::Other,
        // A single file without a telling name may still be told by its bytes.
        _ => Role::Mesh,
    }
}

fn disposition_name(headers: &HeaderMap) -> Option<String> {
    let value = headers.get(header::CONTENT_DISPOSITION)?.to_str().ok()?;
    value.split(';').find_map(|part| {
        let (key, value) = part.trim().split_once('=')?;
        (key.trim().eq_ignore_ascii_case("filename")).then(|| value.trim().trim_matches('"').to_owned())
    })
}
