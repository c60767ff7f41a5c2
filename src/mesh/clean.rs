//! Soup → welded faces without degenerate or duplicate ones, of the components that are kept.

use super::components::{Selection, select};
use super::prepare::{Components, PrepareReport};
use super::trimesh::face_area;
use super::weld::weld;
use super::{MeshError, TriangleSoup};
use crate::cancel::Cancel;

/// A face has no area when it has less than this share of the total.
const NO_AREA: f64 = 1e-12;

/// A face is a line up to rounding when its area is below this times the square of its longest edge.
const COLLINEAR: f64 = 1e-14;

/// A cleaned mesh in its own frame: file coordinates = centre + scale · vertices, vertices within [−1, 1]³.
///
/// The frame keeps areas and lengths clear of overflow and underflow whatever the units of the file.
#[derive(Clone, Debug)]
pub(super) struct Cleaned {
    pub vertices: Vec<[f64; 3]>,
    pub faces: Vec<[u32; 3]>,
    /// Half the longest side of the bounding box, in the file's units.
    pub scale: f64,
}

/// Checks, welds and filters a soup, in near-linear time; the counts go to `report`.
///
/// In this order: unused vertices go; coincident vertices are welded ([`weld`]); faces with a repeated vertex, with
/// area below 1e-12 of the total or collinear up to rounding go; of faces with the same three vertices the first
/// stays; components are selected ([`select`]); vertices nothing uses any more go. Vertices and faces keep their
/// order.
///
/// Errors: [`MeshError::NoFaces`], [`MeshError::IndexOutOfRange`], [`MeshError::NotFinite`] for soups that break
/// their promise; [`MeshError::Degenerate`] when no face is left; [`MeshError::Cancelled`] between two steps.
pub(super) fn clean(
    soup: TriangleSoup,
    keep: Components,
    report: &mut PrepareReport,
    cancel: &Cancel,
) -> Result<Cleaned, MeshError> {
    let TriangleSoup {
        mut vertices,
        mut faces,
        ..
    } = soup;
    report.input_vertices = vertices.len();
    report.input_faces = faces.len();
    check(&vertices, &faces)?;
    drop_unreferenced(&mut vertices, &mut faces);
    cancel.check()?;
    let referenced = vertices.len();

    let scale = to_frame(&mut vertices);
    if scale == 0.0 {
        return Err(MeshError::Degenerate);
    }
    let welded = weld(&vertices);
    cancel.check()?;
    for f in &mut faces {
        *f = f.map(|v| welded.index[v as usize]);
    }
    let mut vertices = welded.vertices;
    report.welded_vertices = referenced - vertices.len();

    let areas = filter_faces(&vertices, &mut faces, report, cancel)?;
    cancel.check()?;
    if report.degenerate_faces + report.duplicate_faces > 0 {
        drop_unreferenced(&mut vertices, &mut faces);
    }
    report.unreferenced_vertices = report.input_vertices - report.welded_vertices - vertices.len();

    let Selection {
        faces: kept,
        found,
        dropped,
        area_dropped,
    } = select(&vertices, faces, &areas, keep);
    cancel.check()?;
    faces = kept;
    report.components = found;
    report.components_dropped = dropped;
    report.area_dropped = area_dropped;
    if dropped > 0 {
        drop_unreferenced(&mut vertices, &mut faces);
    }
    Ok(Cleaned {
        vertices,
        faces,
        scale,
    })
}

/// The same filters after a simplification, whose counts are not the user's business.
pub(super) fn clean_again(mesh: &mut Cleaned, keep: Components, cancel: &Cancel) -> Result<(), MeshError> {
    let areas = filter_faces(
        &mesh.vertices,
        &mut mesh.faces,
        &mut PrepareReport::default(),
        cancel,
    )?;
    let faces = std::mem::take(&mut mesh.faces);
    mesh.faces = select(&mesh.vertices, faces, &areas, keep).faces;
    drop_unreferenced(&mut mesh.vertices, &mut mesh.faces);
    Ok(())
}

fn check(vertices: &[[f64; 3]], faces: &[[u32; 3]]) -> Result<(), MeshError> {
    if faces.is_empty() {
        return Err(MeshError::NoFaces {
            vertices: vertices.len(),
        });
    }
    if let Some(vertex) = vertices.iter().position(|p| !p.iter().all(|x| x.is_finite())) {
        return Err(MeshError::NotFinite { vertex });
    }
    for (face, f) in faces.iter().enumerate() {
        if let Some(&v) = f.iter().find(|v| **v as usize >= vertices.len()) {
            return Err(MeshError::IndexOutOfRange {
                face,
                index: i64::from(v),
                vertices: vertices.len(),
            });
        }
    }
    Ok(())
}

/// Moves the bounding box's centre to the origin and its longest half side to 1; returns that half side.
///
/// Halves are taken before differences, so coordinates of ±1e308 do not overflow.
fn to_frame(vertices: &mut [[f64; 3]]) -> f64 {
    let mut low = [f64::INFINITY; 3];
    let mut high = [f64::NEG_INFINITY; 3];
    for p in vertices.iter() {
        for k in 0..3 {
            low[k] = low[k].min(p[k]);
            high[k] = high[k].max(p[k]);
        }
    }
    let centre: [f64; 3] = std::array::from_fn(|k| 0.5 * low[k] + 0.5 * high[k]);
    let half = (0..3).map(|k| 0.5 * high[k] - 0.5 * low[k]).fold(0.0, f64::max);
    if half > 0.0 {
        for p in vertices {
            for k in 0..3 {
                p[k] = ((p[k] - centre[k]) / half).clamp(-1.0, 1.0);
            }
        }
    }
    half
}

/// Drops degenerate and duplicate faces; returns the areas of those left.
fn filter_faces(
    vertices: &[[f64; 3]],
    faces: &mut Vec<[u32; 3]>,
    report: &mut PrepareReport,
    cancel: &Cancel,
) -> Result<Vec<f64>, MeshError> {
    let before = faces.len();
    let mut areas: Vec<f64> = faces.iter().map(|f| proper_area(vertices, f)).collect();
    let threshold = NO_AREA * areas.iter().sum::<f64>();
    retain(faces, &mut areas, |_, _, area| area > 0.0 && area >= threshold);
    report.degenerate_faces = before - faces.len();
    if faces.is_empty() {
        return Err(MeshError::Degenerate);
    }
    cancel.check()?;
    let before = faces.len();
    let duplicate = duplicates(vertices.len(), faces);
    retain(faces, &mut areas, |i, _, _| !duplicate[i]);
    report.duplicate_faces = before - faces.len();
    Ok(areas)
}

/// Area of a face, or 0 where a vertex is repeated or the three are collinear up to rounding.
fn proper_area(vertices: &[[f64; 3]], f: &[u32; 3]) -> f64 {
    if f[0] == f[1] || f[1] == f[2] || f[2] == f[0] {
        return 0.0;
    }
    let area = face_area(vertices, f);
    let square = |a: u32, b: u32| {
        let (a, b) = (&vertices[a as usize], &vertices[b as usize]);
        (0..3).map(|k| (a[k] - b[k]) * (a[k] - b[k])).sum::<f64>()
    };
    let longest = square(f[0], f[1]).max(square(f[1], f[2])).max(square(f[2], f[0]));
    if area > COLLINEAR * longest { area } else { 0.0 }
}

fn retain(
    faces: &mut Vec<[u32; 3]>,
    areas: &mut Vec<f64>,
    mut keep: impl FnMut(usize, &[u32; 3], f64) -> bool,
) {
    let mut n = 0;
    for i in 0..faces.len() {
        if keep(i, &faces[i], areas[i]) {
            faces[n] = faces[i];
            areas[n] = areas[i];
            n += 1;
        }
    }
    faces.truncate(n);
    areas.truncate(n);
}

/// Flags every face whose three vertices an earlier face has already, in any order.
fn duplicates(vertex_count: usize, faces: &[[u32; 3]]) -> Vec<bool> {
    // Buckets by smallest vertex, in the order of the faces; each is compared by the other two.
    let mut start = vec![0u32; vertex_count + 1];
    let smallest = |f: &[u32; 3]| f[0].min(f[1]).min(f[2]) as usize;
    for f in faces {
        start[smallest(f) + 1] += 1;
    }
    for v in 0..vertex_count {
        start[v + 1] += start[v];
    }
    let mut next = start.clone();
    let mut bucketed = vec![0u32; faces.len()];
    for (i, f) in faces.iter().enumerate() {
        let slot = &mut next[smallest(f)];
        bucketed[*slot as usize] = i as u32;
        *slot += 1;
    }
    let mut duplicate = vec![false; faces.len()];
    let mut entries: Vec<(u64, u32)> = Vec::new();
    for v in 0..vertex_count {
        let bucket = &bucketed[start[v] as usize..start[v + 1] as usize];
        if bucket.len() < 2 {
            continue;
        }
        entries.clear();
        entries.extend(bucket.iter().map(|&i| {
            let mut sorted = faces[i as usize];
            sorted.sort_unstable();
            (u64::from(sorted[1]) << 32 | u64::from(sorted[2]), i)
        }));
        entries.sort_unstable();
        for pair in entries.windows(2) {
            if pair[0].0 == pair[1].0 {
                duplicate[pair[1].1 as usize] = true;
            }
        }
    }
    duplicate
}

/// Drops vertices no face uses and renumbers; the order of the others stays.
pub(super) fn drop_unreferenced(vertices: &mut Vec<[f64; 3]>, faces: &mut [[u32; 3]]) {
    let mut index = vec![0u32; vertices.len()];
    for &v in faces.iter().flatten() {
        index[v as usize] = 1;
    }
    if index.iter().all(|used| *used == 1) {
        return;
    }
    let mut n = 0u32;
    for v in 0..vertices.len() {
        if index[v] == 1 {
            vertices[n as usize] = vertices[v];
            index[v] = n;
            n += 1;
        }
    }
    vertices.truncate(n as usize);
    for f in faces {
        *f = f.map(|v| index[v as usize]);
    }
}
