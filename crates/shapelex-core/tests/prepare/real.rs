//! Every file of the shared data sets becomes a mesh with default options.

use crate::shapes::*;
use shapelex_core::mesh::{PrepareOptions, prepare};
use std::time::Instant;

#[test]
fn every_real_mesh_is_prepared() {
    let Some(data) = shared("data", "every_real_mesh_is_prepared") else {
        return;
    };
    eprintln!(
        "{:<20} {:>5} {:>12} {:>9} {:>7} {:>5} {:>6} {:>6} {:>8} {:>6} {:>7} {:>8} {:>7}",
        "set",
        "files",
        "vertices",
        "simplified",
        "welded",
        "degen",
        "dupl",
        "nonman",
        "dropped",
        "holes",
        "open>0",
        "warnings",
        "ms/file"
    );
    for set in ["tosca_lowres", "sumner", "quaternius_animals"] {
        let mut files: Vec<_> = (std::fs::read_dir(data.join(set)).unwrap())
            .flat_map(|class| std::fs::read_dir(class.unwrap().path()).unwrap())
            .map(|file| file.unwrap().path())
            .collect();
        files.sort();
        assert!(!files.is_empty());
        let mut total = shapelex_core::mesh::PrepareReport::default();
        let (mut simplified, mut open, mut warnings, mut seconds) = (0, 0, 0, 0.0);
        let (mut low, mut high) = (usize::MAX, 0);
        for file in &files {
            let soup = read(file);
            let clock = Instant::now();
            let (mesh, report) = prepare(soup, &PrepareOptions::default())
                .unwrap_or_else(|e| panic!("{}: {e}", file.display()));
            seconds += clock.elapsed().as_secs_f64();
            assert_prepared(&mesh, &report);
            assert!(report.vertices <= 2000);
            assert!(
                report.simplified_from.is_none() || report.vertices >= 1950,
                "{}: {report:?}",
                file.display()
            );
            simplified += usize::from(report.simplified_from.is_some());
            open += usize::from(report.openness > 0.0);
            let others = report.warnings.len();
            if others > 0 && warnings == 0 {
                eprintln!(
                    "{}: {:?}",
                    file.strip_prefix(&data).unwrap().display(),
                    report.warnings
                );
            }
            warnings += others;
            low = low.min(report.vertices);
            high = high.max(report.vertices);
            total.welded_vertices += report.welded_vertices;
            total.degenerate_faces += report.degenerate_faces;
            total.duplicate_faces += report.duplicate_faces;
            total.non_manifold_edges += report.non_manifold_edges;
            total.components_dropped += report.components_dropped;
            total.holes_filled += report.holes_filled;
        }
        eprintln!(
            "{set:<20} {:>5} {:>12} {simplified:>9} {:>7} {:>5} {:>6} {:>6} {:>8} {:>6} {open:>7} {warnings:>8} {:>7.1}",
            files.len(),
            format!("{low}–{high}"),
            total.welded_vertices,
            total.degenerate_faces,
            total.duplicate_faces,
            total.non_manifold_edges,
            total.components_dropped,
            total.holes_filled,
            seconds * 1e3 / files.len() as f64
        );
    }
}
