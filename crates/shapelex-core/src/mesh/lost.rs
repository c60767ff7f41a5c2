//! Faces without area between others: they are closed by merging corners instead of being dropped.
//!
//! To merge two vertices of a surface without border leaves one: faces that lose a corner vanish, two faces with the same
//! corners vanish together, and each edge keeps an even number of faces.

use super::MeshError;
use super::boundary::distance;
use super::components::DisjointSets;
use super::edges::for_each_edge;
use super::trimesh::face_area;
use super::work::{Watch, Work};
use std::cmp::Ordering;
use std::collections::{HashMap, HashSet};

/// Rounds at most. Each halves a chain of vertices.
const ROUNDS: usize = 48;

/// Faces without area above which they are dropped: they would take too long.
const MOST_FACES: usize = 500_000;

/// Share of the area that may vanish with faces that come to lie on each other; above it one of each pair stays.
const MOST_AREA: f64 = 1e-3;

/// Merges the ends of the shortest edge of each face without area that joins faces with an area, as long as there are
/// some, and returns how many of them vanished. `is_lost` tells from a face's area whether it has none.
///
/// # Errors
/// [`MeshError::Cancelled`], [`MeshError::Memory`].
pub(super) fn merge_lost(
    vertices: &[[f64; 3]],
    faces: &mut Vec<[u32; 3]>,
    is_lost: &dyn Fn(&[u32; 3]) -> bool,
    work: Work,
) -> Result<usize, MeshError> {
    let mut vanished = 0;
    for _ in 0..ROUNDS {
        let joining = joining(vertices.len(), faces, is_lost, work)?;
        if joining.is_empty() {
            break;
        }
        let _held = work.hold(vertices.len(), 4)?;
        let mut target: Vec<u32> = (0..vertices.len() as u32).collect();
        choose(vertices, faces, &joining, &mut target);
        vanished += joining.len();
        let moved = merge(faces, &target, work)?;
        drop_pairs(vertices, faces, moved);
    }
    Ok(vanished)
}

fn has_three_corners(f: &[u32; 3]) -> bool {
    f[0] != f[1] && f[1] != f[2] && f[2] != f[0]
}

/// The faces without area that a path over edges of such faces joins to one with an area.
fn joining(
    vertex_count: usize,
    faces: &[[u32; 3]],
    is_lost: &dyn Fn(&[u32; 3]) -> bool,
    work: Work,
) -> Result<Vec<u32>, MeshError> {
    let _marks = work.hold(vertex_count, 1)?;
    let mut lost = Vec::new();
    let mut mark = vec![false; vertex_count];
    for (i, f) in faces.iter().enumerate() {
        work.look(i)?;
        if has_three_corners(f) && is_lost(f) {
            lost.push(i as u32);
            f.iter().for_each(|v| mark[*v as usize] = true);
        }
    }
    if lost.is_empty() || lost.len() > MOST_FACES {
        return Ok(Vec::new());
    }
    // Of the others only those with an edge between marked vertices matter. The faces without area come first.
    let is_near = |f: &[u32; 3]| has_three_corners(f) && f.iter().filter(|v| mark[**v as usize]).count() >= 2;
    let _near = work.hold(faces.iter().filter(|f| is_near(f)).count(), 12)?;
    let mut near: Vec<[u32; 3]> = lost.iter().map(|i| faces[*i as usize]).collect();
    let mut next = 0;
    for (i, f) in faces.iter().enumerate() {
        work.look(i)?;
        if lost.get(next) == Some(&(i as u32)) {
            next += 1;
        } else if is_near(f) {
            near.push(*f);
        }
    }
    let mut groups = DisjointSets::new(lost.len());
    let mut touches = vec![false; lost.len()];
    for_each_edge(vertex_count, &near, &work, |_, _, half_edges| {
        let face = |h: u32| (h >> 1) as usize / 3;
        let mut there = half_edges.iter().map(|h| face(*h)).filter(|f| *f < lost.len());
        let Some(first) = there.next() else {
            return;
        };
        for other in there {
            groups.union(first as u32, other as u32);
        }
        touches[first] |= half_edges.iter().any(|h| face(*h) >= lost.len());
    })?;
    let mut joins = vec![false; lost.len()];
    for (i, touches) in touches.into_iter().enumerate() {
        joins[groups.find(i as u32) as usize] |= touches;
    }
    lost.retain({
        let mut i = 0..;
        move |_| i.next().is_some_and(|i| joins[groups.find(i) as usize])
    });
    Ok(lost)
}

/// Fills in which vertex becomes which: of each face the ends of the shortest edge become one, the shortest of all first,
/// where neither has a part in another merge.
fn choose(vertices: &[[f64; 3]], faces: &[[u32; 3]], joining: &[u32], target: &mut [u32]) {
    let place = |v: u32| vertices[v as usize];
    let before = |a: u32, b: u32| place(a).partial_cmp(&place(b)).is_some_and(|o| o.is_lt());
    let mut edges: Vec<(f64, [u32; 2])> = joining
        .iter()
        .flat_map(|i| {
            let f = faces[*i as usize];
            let all = [[f[0], f[1]], [f[1], f[2]], [f[2], f[0]]]
                .map(|[a, b]| if before(b, a) { [b, a] } else { [a, b] })
                .map(|[a, b]| (distance(&place(a), &place(b)), [a, b]));
            all.into_iter().min_by(|x, y| {
                let by_place = place(x.1[0]).partial_cmp(&place(y.1[0]));
                x.0.total_cmp(&y.0).then(by_place.unwrap_or(Ordering::Equal))
            })
        })
        .collect();
    edges.sort_by(|x, y| {
        let places = |e: &[u32; 2]| [place(e[0]), place(e[1])];
        let by_place = places(&x.1).partial_cmp(&places(&y.1));
        x.0.total_cmp(&y.0).then(by_place.unwrap_or(Ordering::Equal))
    });
    let mut taken = HashSet::new();
    for (_, [kept, gone]) in edges {
        if !taken.contains(&kept) && !taken.contains(&gone) {
            taken.extend([kept, gone]);
            target[gone as usize] = kept;
        }
    }
}

/// Faces at merged vertices, by their corners in ascending order.
type Moved = HashMap<[u32; 3], Vec<u32>>;

/// Moves corners to their targets.
fn merge(faces: &mut [[u32; 3]], target: &[u32], work: Work) -> Result<Moved, MeshError> {
    let mut moved = Moved::new();
    let mut touched = vec![false; target.len()];
    for (v, t) in target.iter().enumerate().filter(|(v, t)| *v as u32 != **t) {
        touched[v] = true;
        touched[*t as usize] = true;
    }
    for (i, f) in faces.iter_mut().enumerate() {
        work.look(i)?;
        if !f.iter().any(|v| touched[*v as usize]) {
            continue;
        }
        *f = f.map(|v| target[v as usize]);
        if has_three_corners(f) {
            let mut key = *f;
            key.sort_unstable();
            moved.entry(key).or_default().push(i as u32);
        }
    }
    Ok(moved)
}

/// Drops faces without three corners, and pairs of faces that have come to lie on each other.
fn drop_pairs(vertices: &[[f64; 3]], faces: &mut Vec<[u32; 3]>, moved: Moved) {
    let total: f64 = faces.iter().map(|f| face_area(vertices, f)).sum();
    let area = |same: &Vec<u32>| (same.len() / 2 * 2) as f64 * face_area(vertices, &faces[same[0] as usize]);
    let keep_one = moved.values().map(area).sum::<f64>() > MOST_AREA * total;
    let mut gone: Vec<u32> = Vec::new();
    for same in moved.into_values() {
        gone.extend(&same[if keep_one { 1 } else { same.len() % 2 }..]);
    }
    for i in gone {
        faces[i as usize] = [0; 3];
    }
    faces.retain(has_three_corners);
}
