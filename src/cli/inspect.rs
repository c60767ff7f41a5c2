//! `shapelex inspect`: what is read of a file, what cleaning did, how its spectrum begins.

use super::files::MeshFile;
use super::output::note_line;
use super::query_inputs::gather;
use super::refused::Refused;
use super::values::poses;
use super::{CliError, ParameterArgs, figures, output};
use serde::Serialize;
use serde_json::json;
use shapelex_core::cancel::Cancel;
use shapelex_core::mesh::{
    Format, Limits, PrepareReport, ReadContext, TriangleSoup, prepare, read_poses_within, read_within,
};
use shapelex_core::parameters::Parameters;
use shapelex_core::pipeline::describe_shape;
use shapelex_core::pipeline::prepared::refined_to;
use shapelex_eval::figure::{GalleryRow, RowView, as_large_as, gallery};
use std::path::PathBuf;

/// Arguments of `inspect`.
#[derive(Debug, clap::Args)]
pub struct InspectArgs {
    /// Mesh files (OBJ, glTF, GLB, PLY, STL or OFF), folders of such, or - for standard input
    #[arg(required = true, value_name = "FILE")]
    pub files: Vec<PathBuf>,
    /// Sample this many poses of an animated glTF and inspect each
    #[arg(long, value_name = "COUNT", value_parser = poses)]
    pub poses: Option<usize>,
    /// Draw every mesh, as read and as prepared, into one SVG file
    #[arg(long, value_name = "FILE")]
    pub svg: Option<PathBuf>,
    /// The method's parameters.
    #[command(flatten)]
    pub parameters: ParameterArgs,
}

/// What is known of one mesh.
#[derive(Debug, Serialize)]
struct Inspection {
    file: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    pose: Option<String>,
    format: Format,
    report: PrepareReport,
    /// Vertices the prepared mesh is refined to before its spectrum is solved for, where it is coarse.
    refined_to: Option<usize>,
    /// The first eigenvalues, dimensionless, ascending from 0.
    eigenvalues: Vec<f64>,
    signatures: usize,
}

/// Inspects every file; goes on after one that is refused.
///
/// # Errors
/// [`CliError::Reported`] where a file was refused.
pub fn run(args: &InspectArgs, json: bool) -> Result<(), CliError> {
    let parameters = args.parameters.parameters()?;
    let mut refused = false;
    let mut drawn = args.svg.is_some().then(Vec::new);
    for input in gather(&args.files, None)? {
        let path = &input.path;
        let file = path.display().to_string();
        let result = input
            .load(Limits::default().max_bytes)
            .and_then(|mesh| inspect(&file, &mesh, args.poses, &parameters, drawn.as_mut()));
        match result {
            Ok(inspections) => {
                for inspection in inspections {
                    for warning in &inspection.report.warnings {
                        note_line!("shapelex: {}: {warning}", inspection.title());
                    }
                    if json {
                        output::json(&inspection)?;
                    } else {
                        output::line(&inspection.text())?;
                    }
                }
            }
            Err(error) => {
                refused = true;
                let refusal = Refused::new(path, error);
                refusal.warn();
                if json {
                    output::json(&json!({ "file": refusal.file, "error": refusal.reason }))?;
                }
            }
        }
    }
    if let (Some(path), Some(rows)) = (&args.svg, &drawn)
        && !rows.is_empty()
    {
        let columns = ["as read", "as prepared"].map(str::to_owned);
        figures::write_one(path, &gallery("Meshes as read and as prepared", &columns, rows)?)?;
    }
    if refused { Err(CliError::Reported) } else { Ok(()) }
}

/// Inspects a mesh, or its poses; adds a row of the gallery for each where one is drawn.
fn inspect(
    file: &str,
    mesh: &MeshFile,
    poses: Option<usize>,
    parameters: &Parameters,
    mut drawn: Option<&mut Vec<GalleryRow>>,
) -> Result<Vec<Inspection>, CliError> {
    let context = ReadContext::new(Limits::default());
    let (format, soups): (Format, Vec<(Option<String>, TriangleSoup)>) = match poses {
        None => {
            let (format, soup) = read_within(&mesh.source(), &context)?;
            (format, vec![(None, soup)])
        }
        Some(count) => {
            let (format, poses) = read_poses_within(&mesh.source(), count, &context)?;
            (
                format,
                poses.into_iter().map(|p| (Some(p.label), p.soup)).collect(),
            )
        }
    };
    soups
        .into_iter()
        .map(|(pose, soup)| {
            if let Some(rows) = &mut drawn {
                let (prepared, _) = prepare(soup.clone(), &parameters.prepare_options())?;
                let prepared = TriangleSoup {
                    vertices: prepared.vertices().to_vec(),
                    faces: prepared.faces().to_vec(),
                    ..TriangleSoup::default()
                };
                rows.push(GalleryRow {
                    view: RowView::Shared,
                    label: pose.clone().unwrap_or_else(|| mesh.name.clone()),
                    meshes: vec![Some(soup.clone()), Some(as_large_as(&soup, prepared))],
                });
            }
            let mut description = describe_shape(soup, parameters, &Cancel::new(), &|_| ())?;
            description.report.warnings.splice(0..0, context.warnings.list());
            Ok(Inspection {
                file: file.to_owned(),
                pose,
                format,
                signatures: description.views.first().map_or(0, |v| v.signatures.len()),
                refined_to: Some(refined_to(&description.report, parameters)).filter(|&to| to > 0),
                report: description.report,
                eigenvalues: description.eigenvalues,
            })
        })
        .collect()
}

impl Inspection {
    fn title(&self) -> String {
        match &self.pose {
            Some(pose) => format!("{} ({pose})", self.file),
            None => self.file.clone(),
        }
    }

    fn text(&self) -> String {
        let r = &self.report;
        let mut lines = vec![format!("{}: {}", self.title(), self.format)];
        let mut row = |label: &str, value: String| lines.push(format!("  {label:<12} {value}"));
        row(
            "read",
            format!("{} vertices, {} faces", r.input_vertices, r.input_faces),
        );
        row("cleaned", cleaned(r));
        let simplified = match r.simplified_from {
            Some(_) => "simplified to ",
            None => "",
        };
        let refined = match r.refined_to {
            Some(to) => format!(", refined to {to} vertices for the spectrum"),
            None => String::new(),
        };
        row(
            "prepared",
            format!("{simplified}{} vertices, {} faces{refined}", r.vertices, r.faces),
        );
        let boundary = if r.boundary_edges == 0 {
            "closed".to_owned()
        } else {
            format!(
                "{} boundary edges, boundary length {:.2} √area",
                r.boundary_edges, r.openness
            )
        };
        row("surface", format!("area {:.6}, {boundary}", r.area));
        let eigenvalues: Vec<String> = self
            .eigenvalues
            .iter()
            .take(10)
            .map(|v| format!("{v:.3}"))
            .collect();
        row("eigenvalues", format!("{} …", eigenvalues.join(" ")));
        row("signatures", self.signatures.to_string());
        lines.join("\n")
    }
}

/// Only what cleaning did; nothing is the usual case.
fn cleaned(r: &PrepareReport) -> String {
    let done: Vec<String> = [
        (r.welded_vertices, "vertices welded"),
        (r.degenerate_faces, "degenerate faces dropped"),
        (r.repaired_faces, "faces without area repaired"),
        (r.duplicate_faces, "duplicate faces dropped"),
        (r.unreferenced_vertices, "unreferenced vertices dropped"),
        (r.components_dropped, "components dropped"),
        (r.holes_filled, "holes filled"),
        (r.non_manifold_edges, "non-manifold edges kept"),
    ]
    .iter()
    .filter(|(count, _)| *count > 0)
    .map(|(count, what)| format!("{count} {what}"))
    .collect();
    if done.is_empty() {
        "nothing to do".to_owned()
    } else {
        done.join(", ")
    }
}
