//! Soup → welded faces without slivers, degenerate or duplicate ones, of the components that are kept.

use super::components::{Selection, select};
use super::lost::merge_lost;
use super::noise::weld_noise;
use super::repair::{repair, slivers};
use super::sliver::may_be_sliver;
use super::sort::sort;
use super::trimesh::face_area;
use super::weld::weld;
use super::work::{Watch, Work};
use super::{Components, MeshError, PrepareReport, TriangleSoup};
use crate::cancel::Cancelled;

/// A face has no area when it has less than this share of the total.
const NO_AREA: f64 = 1e-12;

/// A face is a line up to rounding when its area is below this times the square of its longest edge.
const COLLINEAR: f64 = 1e-14;

/// Faces with the same smallest vertex from which on the memory of their comparison counts.
const LARGE_BUCKET: usize = 1 << 12;

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
/// In this order: unused vertices go; coincident vertices are welded ([`weld`]), and those that differ in the file's last
/// digit where the faces fit together only then ([`weld_noise`]); slivers are taken out without opening the surface
/// ([`repair`]); faces with area below 1e-12 of the total or collinear up to rounding are closed where they join others
/// ([`merge_lost`]), the rest of them and faces with a repeated vertex go; of faces with the same three vertices the first
/// stays; components are selected ([`select`]); vertices nothing uses any more go.
/// Vertices and faces keep their order.
///
/// Errors: [`MeshError::NoFaces`], [`MeshError::IndexOutOfRange`], [`MeshError::NotFinite`] for soups that break
/// their promise; [`MeshError::Degenerate`] when no face is left; [`MeshError::Cancelled`], [`MeshError::Memory`].
pub(super) fn clean(
    soup: TriangleSoup,
    keep: Components,
    report: &mut PrepareReport,
    work: Work,
) -> Result<Cleaned, MeshError> {
    let TriangleSoup {
        mut vertices,
        mut faces,
        resolution,
    } = soup;
    report.input_vertices = vertices.len();
    report.input_faces = faces.len();
    check(&vertices, &faces, work)?;
    drop_unreferenced(&mut vertices, &mut faces, work)?;
    let referenced = vertices.len();

    let scale = to_frame(&mut vertices, work)?;
    if scale == 0.0 {
        return Err(MeshError::Degenerate);
    }
    let welded = weld(vertices, 0.0, work)?;
    for (i, f) in faces.iter_mut().enumerate() {
        work.look(i)?;
        *f = f.map(|v| welded.index[v as usize]);
    }
    let mut vertices = welded.vertices;
    drop(welded.index);
    let within = weld_noise(&mut vertices, &mut faces, resolution / scale, work)?;
    report.welded_within = within.map(|distance| distance * scale);
    report.welded_vertices = referenced - vertices.len();

    let _areas = work.hold(faces.len(), 8)?;
    let areas = filter_faces(&vertices, &mut faces, report, work)?;
    if report.degenerate_faces + report.duplicate_faces + report.repaired_faces > 0 {
        drop_unreferenced(&mut vertices, &mut faces, work)?;
    }
    report.unreferenced_vertices = report.input_vertices - report.welded_vertices - vertices.len();

    let Selection {
        faces: kept,
        found,
        dropped,
        area_dropped,
    } = select(&vertices, faces, &areas, keep, work)?;
    faces = kept;
    report.components = found;
    report.components_dropped = dropped;
    report.area_dropped = area_dropped;
    if dropped > 0 {
        drop_unreferenced(&mut vertices, &mut faces, work)?;
    }
    Ok(Cleaned {
        vertices,
        faces,
        scale,
    })
}

/// The same filters after a simplification, whose counts are not the user's business. Returns the share of the area that
/// was left out with components.
pub(super) fn clean_again(mesh: &mut Cleaned, keep: Components, work: Work) -> Result<f64, MeshError> {
    let _areas = work.hold(mesh.faces.len(), 8)?;
    let areas = filter_faces(
        &mesh.vertices,
        &mut mesh.faces,
        &mut PrepareReport::default(),
        work,
    )?;
    let faces = std::mem::take(&mut mesh.faces);
    let selection = select(&mesh.vertices, faces, &areas, keep, work)?;
    mesh.faces = selection.faces;
    drop_unreferenced(&mut mesh.vertices, &mut mesh.faces, work)?;
    Ok(selection.area_dropped)
}

fn check(vertices: &[[f64; 3]], faces: &[[u32; 3]], work: Work) -> Result<(), MeshError> {
    if faces.is_empty() {
        return Err(MeshError::NoFaces {
            vertices: vertices.len(),
        });
    }
    for (vertex, p) in vertices.iter().enumerate() {
        work.look(vertex)?;
        if !p.iter().all(|x| x.is_finite()) {
            return Err(MeshError::NotFinite { vertex });
        }
    }
    for (face, f) in faces.iter().enumerate() {
        work.look(face)?;
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
fn to_frame(vertices: &mut [[f64; 3]], work: Work) -> Result<f64, Cancelled> {
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
    work.check()?;
    if half > 0.0 {
        for p in vertices {
            for k in 0..3 {
                p[k] = ((p[k] - centre[k]) / half).clamp(-1.0, 1.0);
            }
        }
    }
    Ok(half)
}

/// Drops degenerate and duplicate faces; returns the areas of those left.
fn filter_faces(
    vertices: &[[f64; 3]],
    faces: &mut Vec<[u32; 3]>,
    report: &mut PrepareReport,
    work: Work,
) -> Result<Vec<f64>, MeshError> {
    let mut areas = Vec::with_capacity(faces.len());
    if measure(vertices, faces, &mut areas, work)? == Thin::Some
        && !slivers(vertices, faces, work)?.is_empty()
    {
        take_out_slivers(vertices, faces, report, work)?;
        measure(vertices, faces, &mut areas, work)?;
    }
    let threshold = NO_AREA * areas.iter().sum::<f64>();
    let is_lost = |area: f64| area <= 0.0 || area < threshold;
    if areas.iter().any(|area| is_lost(*area)) {
        let is_lost = |f: &[u32; 3]| is_lost(proper_area(vertices, f).0);
        let vanished = merge_lost(vertices, faces, &is_lost, work)?;
        if vanished > 0 {
            report.repaired_faces += vanished;
            measure(vertices, faces, &mut areas, work)?;
        }
    }
    let before = faces.len();
    retain(faces, &mut areas, |_, _, area| area > 0.0 && area >= threshold);
    report.degenerate_faces += before - faces.len();
    if faces.is_empty() {
        return Err(MeshError::Degenerate);
    }
    let before = faces.len();
    let duplicate = duplicates(vertices.len(), faces, work)?;
    retain(faces, &mut areas, |i, _, _| !duplicate[i]);
    report.duplicate_faces += before - faces.len();
    Ok(areas)
}

/// Drops faces with a repeated vertex and duplicates, then takes out slivers.
fn take_out_slivers(
    vertices: &[[f64; 3]],
    faces: &mut Vec<[u32; 3]>,
    report: &mut PrepareReport,
    work: Work,
) -> Result<(), MeshError> {
    let before = faces.len();
    faces.retain(|f| f[0] != f[1] && f[1] != f[2] && f[2] != f[0]);
    report.degenerate_faces = before - faces.len();
    let duplicate = duplicates(vertices.len(), faces, work)?;
    let mut i = 0;
    faces.retain(|_| {
        i += 1;
        !duplicate[i - 1]
    });
    report.duplicate_faces = before - report.degenerate_faces - faces.len();
    let repaired = repair(vertices, faces, work)?;
    report.repaired_faces = repaired.joined;
    report.degenerate_faces += repaired.loose;
    Ok(())
}

/// Whether faces with three different vertices are thin enough to be looked at as slivers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Thin {
    None,
    Some,
}

/// Fills in the areas of the faces.
fn measure(
    vertices: &[[f64; 3]],
    faces: &[[u32; 3]],
    areas: &mut Vec<f64>,
    work: Work,
) -> Result<Thin, MeshError> {
    areas.clear();
    let mut thin = Thin::None;
    for (i, f) in faces.iter().enumerate() {
        work.look(i)?;
        let (area, of_face) = proper_area(vertices, f);
        areas.push(area);
        if of_face == Thin::Some {
            thin = Thin::Some;
        }
    }
    Ok(thin)
}

/// Area of a face, or 0 where a vertex is repeated or the three are collinear up to rounding.
fn proper_area(vertices: &[[f64; 3]], f: &[u32; 3]) -> (f64, Thin) {
    if f[0] == f[1] || f[1] == f[2] || f[2] == f[0] {
        return (0.0, Thin::None);
    }
    let area = face_area(vertices, f);
    let square = |a: u32, b: u32| {
        let (a, b) = (&vertices[a as usize], &vertices[b as usize]);
        (0..3).map(|k| (a[k] - b[k]) * (a[k] - b[k])).sum::<f64>()
    };
    let edges = [square(f[0], f[1]), square(f[1], f[2]), square(f[2], f[0])];
    let longest = edges[0].max(edges[1]).max(edges[2]);
    let shortest = edges[0].min(edges[1]).min(edges[2]);
    let thin = if may_be_sliver(area, shortest, longest) {
        Thin::Some
    } else {
        Thin::None
    };
    (if area > COLLINEAR * longest { area } else { 0.0 }, thin)
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
pub(super) fn duplicates(
    vertex_count: usize,
    faces: &[[u32; 3]],
    work: Work,
) -> Result<Vec<bool>, MeshError> {
    let _held = (work.hold(vertex_count, 4)?, work.hold(faces.len(), 5)?);
    // Buckets by smallest vertex, in the order of the faces; each is compared by the other two. Counted two places up and
    // filled one place up, so that in the end `start[v]` is where the bucket of v starts.
    let mut start = vec![0u32; vertex_count + 2];
    let smallest = |f: &[u32; 3]| f[0].min(f[1]).min(f[2]) as usize;
    for (i, f) in faces.iter().enumerate() {
        work.look(i)?;
        start[smallest(f) + 2] += 1;
    }
    for v in 1..=vertex_count {
        start[v + 1] += start[v];
    }
    let mut bucketed = vec![0u32; faces.len()];
    for (i, f) in faces.iter().enumerate() {
        work.look(i)?;
        let slot = &mut start[smallest(f) + 1];
        bucketed[*slot as usize] = i as u32;
        *slot += 1;
    }
    let mut duplicate = vec![false; faces.len()];
    let mut entries: Vec<(u64, u32)> = Vec::new();
    for v in 0..vertex_count {
        work.look(v)?;
        let (from, to) = (start[v] as usize, start[v + 1] as usize);
        work.pass(from, to)?;
        let bucket = &bucketed[from..to];
        if bucket.len() < 2 {
            continue;
        }
        let _entries = if bucket.len() > LARGE_BUCKET {
            Some(work.hold(bucket.len(), size_of::<(u64, u32)>())?)
        } else {
            None
        };
        entries.clear();
        entries.extend(bucket.iter().map(|&i| {
            let mut sorted = faces[i as usize];
            sorted.sort_unstable();
            (u64::from(sorted[1]) << 32 | u64::from(sorted[2]), i)
        }));
        sort(&mut entries, &work)?;
        for pair in entries.windows(2) {
            if pair[0].0 == pair[1].0 {
                duplicate[pair[1].1 as usize] = true;
            }
        }
    }
    Ok(duplicate)
}

/// Drops vertices no face uses and renumbers; the order of the others stays.
///
/// # Errors
/// [`MeshError::Cancelled`], [`MeshError::Memory`].
pub(super) fn drop_unreferenced(
    vertices: &mut Vec<[f64; 3]>,
    faces: &mut [[u32; 3]],
    work: Work,
) -> Result<(), MeshError> {
    let _held = work.hold(vertices.len(), 4)?;
    let mut index = vec![0u32; vertices.len()];
    for (i, f) in faces.iter().enumerate() {
        work.look(i)?;
        for v in f {
            index[*v as usize] = 1;
        }
    }
    if index.iter().all(|used| *used == 1) {
        return Ok(());
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
    for (i, f) in faces.iter_mut().enumerate() {
        work.look(i)?;
        *f = f.map(|v| index[v as usize]);
    }
    Ok(())
}
