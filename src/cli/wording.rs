//! What a service says, in the words of the command line.
//!
//! The details of problems are written for those who send requests. On the command line the next step is a command, and
//! without a service there is no request. This is the one place that translates, by the problem's code.

use crate::config::DEFAULT_DATA;
use shapelex_core::mesh::MeshError;
use std::path::{Path, PathBuf};

/// Where a command works.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Place {
    /// In a data directory.
    Data(PathBuf),
    /// With a running service.
    Server(String),
}

impl Place {
    /// The flag that names it, with a space before it; nothing for the data directory that is the default.
    fn flag(&self) -> String {
        match self {
            Self::Data(data) if data == Path::new(DEFAULT_DATA) => String::new(),
            Self::Data(data) => format!(" --data {}", data.display()),
            Self::Server(url) => format!(" --server {url}"),
        }
    }
}

/// The detail of a problem as the command line says it. `code` is the problem's stable code.
pub fn detail(place: &Place, code: &str, detail: &str) -> String {
    let flag = place.flag();
    match (code, place) {
        ("index_empty", _) => format!(
            "no class has a dictionary yet; run `shapelex index DIR{flag}` to upload and learn a folder per class, or \
             `shapelex reindex{flag}` to learn the shapes that are there"
        ),
        ("nothing_to_index", _) => {
            format!("no class has a shape yet; run `shapelex index DIR{flag}` with a folder per class")
        }
        ("baselines_missing", _) => format!(
            "the index was learnt without what this --rank-by needs; run `shapelex reindex{flag}`, or rank by objective"
        ),
        ("index_incomplete", _) => format!("{detail}; run `shapelex reindex --all{flag}`"),
        ("body_too_large", _) => detail.replace("the body is", "the file is"),
        ("one_mesh_expected", _) => {
            "the file holds more than one mesh; unpack it and query the folder".to_owned()
        }
        ("unsupported_media_type" | "no_files", _) => {
            "the format was not recognised; shapelex reads OBJ, glTF, GLB, PLY, STL and OFF".to_owned()
        }
        ("empty_body", _) => {
            "the file is empty; expected a mesh as OBJ, glTF, GLB, PLY, STL or OFF".to_owned()
        }
        ("missing_buffer", _) => missing_buffer(detail),
        ("invalid_snapshot", _) => detail.replace("send a snapshot's file as the body", "the file is empty"),
        ("recovery_mode", Place::Data(_)) => {
            "the data directory can be read only and was not changed; the lines above say why".to_owned()
        }
        ("store_unavailable", Place::Data(_)) => {
            "the data directory takes no writes since one failed; the lines above say why".to_owned()
        }
        ("storage_full", Place::Data(_)) => {
            "the disk is full and nothing was changed; free some space and run this again".to_owned()
        }
        ("internal" | "coding_failed", Place::Data(_)) if detail.contains("request id") => {
            "an unexpected fault; the lines above say which, SHAPELEX_LOG=debug shows more".to_owned()
        }
        ("not_ready", Place::Data(_)) => {
            "the data directory is not ready; the lines above say why".to_owned()
        }
        _ => detail.to_owned(),
    }
}

/// A reader's error as the command line says it.
pub fn mesh_error(error: &MeshError) -> String {
    match error {
        MeshError::MissingBuffer { .. } => missing_buffer(&error.to_string()),
        MeshError::Empty => error
            .to_string()
            .replace("; send a mesh as", "; expected a mesh as"),
        other => other.to_string(),
    }
}

/// A buffer lies beside its file, or nowhere.
fn missing_buffer(detail: &str) -> String {
    match detail.split_once("', which ") {
        Some((refers, _)) => {
            format!("{refers}', which does not lie beside it; put it there, or export a GLB")
        }
        None => detail.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::http::problem::Problem;
    use crate::store::StoreError;

    const LOCAL: [&str; 8] = [
        "POST",
        "GET",
        "/v1",
        "/readyz",
        "request",
        "multipart",
        "body",
        "upload;",
    ];

    /// The problems whose detail speaks of requests, as the service makes them.
    fn problems() -> Vec<Problem> {
        let mesh = MeshError::MissingBuffer {
            uri: "a.bin".to_owned(),
        };
        vec![
            crate::http::problem::Problem::internal("x"),
            StoreError::ReadOnly { why: String::new() }.into(),
            StoreError::RecoveryMode { why: String::new() }.into(),
            StoreError::Full {
                detail: String::new(),
            }
            .into(),
            shapelex_core::ranking::RankingError::EmptyIndex.into(),
            mesh.into(),
            MeshError::Empty.into(),
        ]
    }

    #[test]
    fn without_a_service_nothing_is_said_about_requests() {
        let place = Place::Data(PathBuf::from("d"));
        for problem in problems() {
            let said = detail(&place, problem.code.name(), &problem.detail);
            for word in LOCAL {
                assert!(!said.contains(word), "{}: {said}", problem.code.name());
            }
        }
    }

    #[test]
    fn the_next_step_is_a_command_at_the_same_place() {
        let said = |place: &Place| detail(place, "index_empty", "POST /v1/reindex");
        assert!(said(&Place::Data(PathBuf::from(DEFAULT_DATA))).contains("`shapelex index DIR`"));
        assert!(said(&Place::Data(PathBuf::from("d"))).contains("`shapelex index DIR --data d`"));
        let url = "http://127.0.0.1:1";
        assert!(said(&Place::Server(url.to_owned())).contains(&format!("DIR --server {url}`")));
    }

    #[test]
    fn other_details_stay() {
        let place = Place::Data(PathBuf::from("d"));
        assert_eq!(detail(&place, "no_faces", "as it was"), "as it was");
        let missing = MeshError::MissingBuffer {
            uri: "a.bin".to_owned(),
        };
        assert_eq!(
            mesh_error(&missing),
            "the glTF file refers to 'a.bin', which does not lie beside it; put it there, or export a GLB"
        );
    }
}
