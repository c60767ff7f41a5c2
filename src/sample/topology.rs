//! Is a surface one closed sphere?

use std::collections::HashMap;

/// For every half-edge, 3 f + k running from corner k of face f to corner k + 1, the half-edge running the other
/// way, or `None` when the surface is not a closed, consistently oriented manifold along some edge.
pub fn twins(faces: &[[u32; 3]]) -> Option<Vec<u32>> {
    let mut half_edges: HashMap<(u32, u32), u32> = HashMap::with_capacity(3 * faces.len());
    for (f, face) in faces.iter().enumerate() {
        for k in 0..3 {
            let edge = (face[k], face[(k + 1) % 3]);
            if edge.0 == edge.1 || half_edges.insert(edge, (3 * f + k) as u32).is_some() {
                return None;
            }
        }
    }
    let mut twins = vec![0; 3 * faces.len()];
    for (&(a, b), &h) in &half_edges {
        twins[h as usize] = *half_edges.get(&(b, a))?;
    }
    Some(twins)
}

/// Whether the faces form one closed, consistently oriented surface of genus 0 in which every one of `vertices`
/// vertices has a single fan of faces.
pub fn is_sphere(vertices: usize, faces: &[[u32; 3]]) -> bool {
    let Some(twins) = twins(faces) else {
        return false;
    };
    if faces.is_empty() || vertices + faces.len() != faces.len() / 2 * 3 + 2 {
        return false;
    }
    let mut degree = vec![0usize; vertices];
    for &v in faces.iter().flatten() {
        degree[v as usize] += 1;
    }
    // One turn around a vertex must meet all faces it has.
    let mut seen = vec![false; vertices];
    for h in 0..twins.len() {
        let v = faces[h / 3][h % 3] as usize;
        if seen[v] {
            continue;
        }
        seen[v] = true;
        let (mut at, mut turned) = (h, 0);
        loop {
            turned += 1;
            at = next(twins[at] as usize);
            if at == h {
                break;
            }
            if turned > degree[v] {
                return false;
            }
        }
        if turned != degree[v] {
            return false;
        }
    }
    seen.iter().all(|&s| s) && connected(&twins)
}

/// The half-edge after `h` in its face.
pub fn next(h: usize) -> usize {
    if h % 3 == 2 { h - 2 } else { h + 1 }
}

fn connected(twins: &[u32]) -> bool {
    let mut reached = vec![false; twins.len() / 3];
    let mut stack = vec![0];
    reached[0] = true;
    let mut count = 1;
    while let Some(f) = stack.pop() {
        for k in 0..3 {
            let g = twins[3 * f + k] as usize / 3;
            if !reached[g] {
                reached[g] = true;
                count += 1;
                stack.push(g);
            }
        }
    }
    count == reached.len()
}
