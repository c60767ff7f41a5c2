//! Fine marching surface → as many well-shaped triangles as asked for.

use super::body::Body;
use super::topology::{is_sphere, next, twins};
use super::vector::{Vec3, add, add_scaled, cross, dot, norm, scale, sub};
use meshopt::SimplifyOptions;
use shapelex_core::mesh::TriangleSoup;

/// Rounds of flipping, smoothing and projection after simplification.
const ROUNDS: usize = 5;
/// Simplification does not check the link condition, so it may pinch a limb three edges around; another target takes
/// another order of collapses and mostly does not.
const TARGETS: [f64; 4] = [1.0, 0.985, 1.015, 0.97];

/// Simplifies the surface to about `vertices` vertices by quadric error, then evens it out: edges are flipped towards
/// the Delaunay condition, vertices move towards their neighbours' centre within the tangent plane and back onto
/// the body. Returns `None` when simplification pinched a thin limb, whatever number near `vertices` was tried.
pub fn remesh(body: &Body, fine: &TriangleSoup, vertices: usize) -> Option<TriangleSoup> {
    let mut mesh = TARGETS.iter().find_map(|share| {
        let mesh = simplify(fine, (share * vertices as f64) as usize);
        is_sphere(mesh.vertices.len(), &mesh.faces).then_some(mesh)
    })?;
    project(body, &mut mesh.vertices, 2);
    for _ in 0..ROUNDS {
        flip(&mut mesh);
        smooth(&mut mesh);
        project(body, &mut mesh.vertices, 1);
    }
    Some(mesh)
}

/// Quadric-error simplification on single-precision copies of the coordinates; unused vertices are dropped.
fn simplify(fine: &TriangleSoup, vertices: usize) -> TriangleSoup {
    let positions: Vec<[f32; 3]> = fine.vertices.iter().map(|v| v.map(|x| x as f32)).collect();
    let indices: Vec<u32> = fine.faces.iter().flatten().copied().collect();
    // A sphere has 2 V − 4 faces.
    let target = 3 * (2 * vertices).saturating_sub(4);
    let kept = meshopt::simplify_decoder(
        &indices,
        &positions,
        target,
        f32::MAX,
        SimplifyOptions::Regularize,
        None,
    );
    let mut place = vec![u32::MAX; fine.vertices.len()];
    let mut mesh = TriangleSoup::default();
    for face in kept.chunks_exact(3) {
        let face = [face[0], face[1], face[2]].map(|v| {
            let slot = &mut place[v as usize];
            if *slot == u32::MAX {
                *slot = mesh.vertices.len() as u32;
                mesh.vertices.push(fine.vertices[v as usize]);
            }
            *slot
        });
        mesh.faces.push(face);
    }
    mesh
}

/// Newton steps along the gradient onto the zero set.
fn project(body: &Body, vertices: &mut [Vec3], steps: usize) {
    for v in vertices {
        for _ in 0..steps {
            let (d, g) = body.value_and_gradient(*v);
            let square = dot(g, g);
            if square > 0.05 {
                *v = add_scaled(*v, g, -d / square);
            }
        }
    }
}

/// Twice the area of a triangle times its unit normal.
fn normal(v: &[Vec3], f: [u32; 3]) -> Vec3 {
    let [a, b, c] = f.map(|i| v[i as usize]);
    cross(sub(b, a), sub(c, a))
}

/// Moves vertices half the way to the area-weighted centre of their faces, within the tangent plane.
fn smooth(mesh: &mut TriangleSoup) {
    let n = mesh.vertices.len();
    let mut centre = vec![[0.0; 3]; n];
    let mut weight = vec![0.0; n];
    let mut normals = vec![[0.0; 3]; n];
    for &f in &mesh.faces {
        let area_normal = normal(&mesh.vertices, f);
        let area = norm(area_normal);
        let [a, b, c] = f.map(|i| mesh.vertices[i as usize]);
        let middle = scale(add(add(a, b), c), area / 3.0);
        for i in f.map(|i| i as usize) {
            centre[i] = add(centre[i], middle);
            weight[i] += area;
            normals[i] = add(normals[i], area_normal);
        }
    }
    for i in 0..n {
        let length = norm(normals[i]);
        if weight[i] <= 0.0 || length <= 0.0 {
            continue;
        }
        let unit = scale(normals[i], 1.0 / length);
        let step = sub(scale(centre[i], 1.0 / weight[i]), mesh.vertices[i]);
        let tangential = add_scaled(step, unit, -dot(step, unit));
        mesh.vertices[i] = add_scaled(mesh.vertices[i], tangential, 0.6);
    }
}

/// Cotangent of the angle at `apex` in the triangle apex, a, b.
fn cotangent(apex: Vec3, a: Vec3, b: Vec3) -> f64 {
    let (u, v) = (sub(a, apex), sub(b, apex));
    dot(u, v) / norm(cross(u, v)).max(1e-300)
}

/// One sweep of edge flips: an edge whose opposite angles add up to more than half a turn (negative sum of
/// cotangents) is replaced by the other diagonal, unless that folds the surface or the edge exists already.
fn flip(mesh: &mut TriangleSoup) {
    let Some(mut twins) = twins(&mesh.faces) else {
        return;
    };
    for h in 0..twins.len() {
        let t = twins[h] as usize;
        if t < h {
            continue;
        }
        let faces = &mesh.faces;
        let corner = |h: usize| faces[h / 3][h % 3];
        // h runs a → b with apex c; t runs b → a with apex d.
        let (hn, tn) = (next(h), next(t));
        let (hp, tp) = (next(hn), next(tn));
        let (a, b, c, d) = (corner(h), corner(t), corner(hp), corner(tp));
        let v = &mesh.vertices;
        let at = |i: u32| v[i as usize];
        if c == d || cotangent(at(c), at(a), at(b)) + cotangent(at(d), at(a), at(b)) >= -1e-3 {
            continue;
        }
        let (old, other) = (normal(v, [a, b, c]), normal(v, [b, a, d]));
        let mean = add(old, other);
        let new = [[c, d, b], [d, c, a]];
        let folds = new.iter().any(|&f| {
            let n = normal(v, f);
            dot(n, mean) <= 0.5 * norm(n) * norm(mean)
        });
        if folds || joined(faces, &twins, hp, d) || degree(&twins, h) < 4 || degree(&twins, t) < 4 {
            continue;
        }
        // Face of h becomes c, d, b and face of t becomes d, c, a; the new edge runs c → d and d → c.
        let (bc, ca) = (twins[hn], twins[hp]);
        let (ad, db) = (twins[tn], twins[tp]);
        let (f, g) = (h / 3, t / 3);
        mesh.faces[f] = new[0];
        mesh.faces[g] = new[1];
        let mut link = |x: usize, y: u32| {
            twins[x] = y;
            twins[y as usize] = x as u32;
        };
        link(3 * f, 3 * g as u32);
        link(3 * f + 1, db);
        link(3 * f + 2, bc);
        link(3 * g + 1, ca);
        link(3 * g + 2, ad);
    }
}

/// Faces around the vertex half-edge `h` starts from.
fn degree(twins: &[u32], h: usize) -> usize {
    let (mut at, mut n) = (h, 0);
    loop {
        n += 1;
        at = next(twins[at] as usize);
        if at == h || n > twins.len() {
            return n;
        }
    }
}

/// Whether an edge joins the vertex half-edge `h` starts from to vertex `to`.
fn joined(faces: &[[u32; 3]], twins: &[u32], h: usize, to: u32) -> bool {
    let mut at = h;
    for _ in 0..twins.len() {
        let end = next(at);
        if faces[end / 3][end % 3] == to {
            return true;
        }
        at = next(twins[at] as usize);
        if at == h {
            return false;
        }
    }
    true
}
