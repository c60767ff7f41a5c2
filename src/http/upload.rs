//! A request's body → the meshes in it, whichever way they were sent: raw, multipart, or an archive of them.

use super::archive::{self, ArchiveKind, ArchiveLimits};
use super::problem::{Code, Problem};
use super::uploaded::{Part, UploadedMesh};
use crate::mesh::{Format, MeshError};
use crate::model::text::is_hidden;
use axum::extract::{FromRequest, Multipart, Request};
use axum::http::{HeaderMap, header};
use bytes::BytesMut;
use futures_util::StreamExt;
use std::sync::Arc;
use std::time::Duration;
use tracing::{Instrument, info_span};

/// What an upload may hold at most.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UploadLimits {
    /// Bytes of the whole body.
    pub max_body_bytes: usize,
    /// Members of an archive and their bytes; a multipart body has no more parts than that either.
    pub archive: ArchiveLimits,
}

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
/// # Errors
/// `body_too_large`, `request_timeout`, `unsupported_media_type`, `empty_body`, `invalid_multipart`, `no_files`, and those of
/// [`archive::unpack`].
pub async fn receive(
    request: Request,
    name: Option<String>,
    limits: UploadLimits,
    time_limit: Duration,
) -> Result<Upload, Problem> {
    check_length(request.headers(), limits.max_body_bytes)?;
    let declared = media_type(request.headers());
    let receiving = async {
        if declared.as_deref() == Some("multipart/form-data") {
            receive_multipart(request, &limits).await
        } else {
            Ok(vec![receive_raw(request, declared, name, &limits).await?])
        }
    };
    let received = tokio::time::timeout(time_limit, receiving).instrument(info_span!("receive"));
    let parts = received.await.map_err(|_| {
        let seconds = time_limit.as_secs_f64();
        Problem::new(
            Code::RequestTimeout,
            format!("the body did not arrive within {seconds:.1} s"),
        )
        .with("limit_seconds", seconds)
    })??;
    // Unpacking is neither quick nor numeric: off tokio's threads, but not in a query's way either.
    let span = info_span!("unpack");
    tokio::task::spawn_blocking(move || span.in_scope(|| sort(parts, &limits)))
        .await
        .map_err(Problem::internal)?
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

/// The problem of a body longer than the limit.
pub fn body_too_large(limit: usize) -> Problem {
    Problem::new(
        Code::BodyTooLarge,
        format!("the body is longer than {limit} bytes"),
    )
    .with("limit_bytes", limit)
}

fn check_length(headers: &HeaderMap, limit: usize) -> Result<(), Problem> {
    match content_length(headers) {
        Some(length) if length > limit as u64 => Err(body_too_large(limit).with("body_bytes", length)),
        _ => Ok(()),
    }
}

fn content_length(headers: &HeaderMap) -> Option<u64> {
    headers.get(header::CONTENT_LENGTH)?.to_str().ok()?.parse().ok()
}

fn media_type(headers: &HeaderMap) -> Option<String> {
    let value = headers.get(header::CONTENT_TYPE)?.to_str().ok()?;
    Some(
        value
            .split(';')
            .next()
            .unwrap_or_default()
            .trim()
            .to_ascii_lowercase(),
    )
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
    limits: &UploadLimits,
) -> Result<Part, Problem> {
    if let Some(declared) = &declared
        && !is_readable(declared)
    {
        return Err(Problem::new(
            Code::UnsupportedMediaType,
            format!(
                "'{declared}' is not read here; send model/obj, model/gltf+json, model/gltf-binary, model/stl, \
                 application/octet-stream, an archive (application/zip, application/x-tar, application/gzip) or \
                 multipart/form-data"
            ),
        ));
    }
    let name = name.or_else(|| disposition_name(request.headers()));
    // The declared length was checked against the limit; pages nobody writes to cost nothing.
    let expected = content_length(request.headers()).unwrap_or(0);
    let mut body = BytesMut::with_capacity(usize::try_from(expected).unwrap_or(0));
    let mut stream = request.into_body().into_data_stream();
    while let Some(chunk) = stream.next().await {
        let chunk = chunk.map_err(|e| {
            Problem::new(Code::InvalidRequest, "the body broke off while it arrived").logged(e)
        })?;
        if body.len() + chunk.len() > limits.max_body_bytes {
            return Err(body_too_large(limits.max_body_bytes));
        }
        body.extend_from_slice(&chunk);
    }
    if body.is_empty() {
        return Err(MeshError::Empty.into());
    }
    Ok(Part {
        name: clean_name(name.as_deref()),
        media_type: declared,
        bytes: body.freeze(),
        packed: false,
    })
}

async fn receive_multipart(request: Request, limits: &UploadLimits) -> Result<Vec<Part>, Problem> {
    let broken = |error: axum::extract::multipart::MultipartError| {
        if error.status() == axum::http::StatusCode::PAYLOAD_TOO_LARGE {
            body_too_large(limits.max_body_bytes)
        } else {
            Problem::new(Code::InvalidMultipart, error.body_text())
        }
    };
    let mut multipart = Multipart::from_request(request, &())
        .await
        .map_err(|e| Problem::new(Code::InvalidMultipart, e.body_text()))?;
    let mut parts = Vec::new();
    while let Some(field) = multipart.next_field().await.map_err(broken)? {
        if parts.len() >= limits.archive.max_members {
            return Err(Problem::new(
                Code::TooManyFiles,
                format!("more than {} files were sent", limits.archive.max_members),
            )
            .with("limit_files", limits.archive.max_members));
        }
        let name = clean_name(field.file_name().or(field.name()));
        let media_type = field.content_type().map(|t| {
            t.split(';')
                .next()
                .unwrap_or_default()
                .trim()
                .to_ascii_lowercase()
        });
        let bytes = field.bytes().await.map_err(broken)?;
        parts.push(Part {
            name,
            media_type,
            bytes,
            packed: false,
        });
    }
    Ok(parts)
}

/// Unpacks archives and tells meshes, buffers and the rest apart.
fn sort(parts: Vec<Part>, limits: &UploadLimits) -> Result<Upload, Problem> {
    let mut files = Vec::new();
    let mut archive_limits = limits.archive;
    for part in parts {
        let declared = part.media_type.as_deref().and_then(declared_archive);
        let Some(kind) = archive::detect(&part.bytes).or(declared) else {
            files.push(part);
            continue;
        };
        for member in archive::unpack(kind, &part.bytes, &archive_limits)? {
            archive_limits.max_members = archive_limits.max_members.saturating_sub(1);
            archive_limits.max_bytes = archive_limits.max_bytes.saturating_sub(member.bytes.len());
            files.push(Part {
                name: member.path,
                media_type: None,
                bytes: member.bytes.into(),
                packed: true,
            });
        }
    }
    let (mut meshes, mut buffers, mut ignored) = (Vec::new(), Vec::new(), Vec::new());
    for file in files {
        match role(&file) {
            Role::Mesh => meshes.push(file),
            Role::Buffer => buffers.push(file),
            Role::Other => ignored.push(file.name),
        }
    }
    if meshes.is_empty() {
        return Err(Problem::new(
            Code::NoFiles,
            "no mesh file was sent; shapelex reads OBJ, glTF, GLB, PLY, STL and OFF",
        )
        .with("ignored", ignored));
    }
    let buffers = Arc::new(buffers);
    let meshes = meshes
        .into_iter()
        .map(|file| UploadedMesh {
            name: file.name.replace(is_hidden, ""),
            media_type: file.media_type.filter(|t| Format::from_media_type(t).is_some()),
            bytes: file.bytes,
            buffers: buffers.clone(),
        })
        .collect();
    Ok(Upload { meshes, ignored })
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

/// A name as it is kept: no folders from outside, no hidden characters, at most 200 characters.
fn clean_name(name: Option<&str>) -> String {
    let name: String = name
        .unwrap_or_default()
        .rsplit(['/', '\\'])
        .next()
        .unwrap_or_default()
        .chars()
        .filter(|&c| !is_hidden(c))
        .take(200)
        .collect();
    let name = name.trim();
    if name.is_empty() {
        "mesh".to_owned()
    } else {
        name.to_owned()
    }
}
