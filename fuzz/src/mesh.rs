//! Bytes → mesh → prepared mesh, as one format or as whatever they look like.

use shapelex_core::mesh::{
    Components, Format, Limits, PrepareOptions, Source, TriMesh, TriangleSoup, prepare, read, read_poses,
};

/// Small, so that an input is done in milliseconds.
const LIMITS: Limits = Limits {
    max_vertices: 3000,
    max_faces: 6000,
    max_bytes: 1 << 20,
    max_poses: 3,
};

/// Reads and prepares; whatever is read keeps what its type promises.
pub fn check(bytes: &[u8], format: Option<Format>) {
    let name = format.map(|f| format!("mesh.{}", f.extension()));
    let source = Source {
        bytes,
        name: name.as_deref(),
        ..Source::default()
    };
    if let Ok((_, soup)) = read(&source, &LIMITS) {
        check_soup(soup);
    }
    if let Ok((_, poses)) = read_poses(&source, 3, &LIMITS) {
        assert!(!poses.is_empty() && poses.len() <= 3, "{} poses", poses.len());
        for pose in poses {
            check_soup(pose.soup);
        }
    }
}

fn check_soup(soup: TriangleSoup) {
    let vertices = soup.vertices.len();
    assert!(vertices <= LIMITS.max_vertices && soup.faces.len() <= LIMITS.max_faces);
    assert!(soup.vertices.iter().flatten().all(|x| x.is_finite()));
    assert!(soup.faces.iter().flatten().all(|&k| (k as usize) < vertices));
    let small = PrepareOptions {
        components: Components::All,
        fill_holes_below: 4.0,
        working_size: 40,
    };
    for options in [PrepareOptions::default(), small] {
        let Ok((mesh, report)) = prepare(soup.clone(), &options) else {
            continue;
        };
        assert!(mesh.vertices().iter().flatten().all(|x| x.is_finite()));
        // Needles a million times as long as they are wide have areas that rounding moves.
        let extent = mesh
            .vertices()
            .iter()
            .flatten()
            .fold(1.0, |e: f64, x| e.max(x.abs()));
        let rounding = 1e-14 * extent * extent;
        let anew = TriMesh::new(mesh.vertices().to_vec(), mesh.faces().to_vec(), usize::MAX);
        let area = anew.expect("what was prepared is a mesh").area();
        assert!(
            (area - 1.0).abs() < 1e-9 + rounding,
            "area {area} of extent {extent}"
        );
        assert!(mesh.signature_vertices() <= mesh.vertices().len());
        assert!(report.vertices <= options.working_size.max(4));
        assert!(report.area.is_finite() && report.openness.is_finite());
    }
}
