//! Is a surface one closed sphere?

/// For every half-edge, 3 f + k running from corner k of face f to corner k + 1, the half-edge running the other
/// way, or `None` when the surface is not a closed, consistently oriented manifold along some edge.
pub fn twins(faces: &[[u32; 3]]) -> Option<Vec<u32>> {
    let key = |a: u32, b: u32| u64::from(a) << 32 | u64::from(b);
    let mut edges: Vec<(u64, u32)> = Vec::with_capacity(3 * faces.len());
    for (f, &[a, b, c]) in faces.iter().enumerate() {
        let h = 3 * f as u32;
        edges.extend([(key(a, b), h), (key(b, c), h + 1), (key(c, a), h + 2)]);
    }
    edges.sort_unstable();
    if edges.windows(2).any(|w| w[0].0 == w[1].0) {
        return None;
    }
    let mut twins = vec![0; edges.len()];
    for &(k, h) in &edges {
        let (a, b) = ((k >> 32) as u32, k as u32);
        let place = edges.binary_search_by_key(&key(b, a), |e| e.0).ok()?;
        if a == b {
            return None;
        }
        twins[h as usize] = edges[place].1;
    }
    Some(twins)
}

/// Whether a surface that is known to be a closed manifold is one sphere: Euler's V − E + F = 2 and one component.
pub fn is_sphere_if_closed(vertices: usize, faces: &[[u32; 3]]) -> bool {
    if 2 * vertices != faces.len() + 4 {
        return false;
    }
    let mut root: Vec<u32> = (0..vertices as u32).collect();
    let mut components = vertices;
    for f in faces {
        for (a, b) in [(f[0], f[1]), (f[1], f[2])] {
            let (a, b) = (find(&mut root, a), find(&mut root, b));
            if a != b {
                root[a as usize] = b;
                components -= 1;
            }
        }
    }
    components == 1
}

/// Representative of a vertex's component, halving the path to it.
fn find(root: &mut [u32], mut v: u32) -> u32 {
    while root[v as usize] != v {
        root[v as usize] = root[root[v as usize] as usize];
        v = root[v as usize];
    }
    v
}

/// Whether the faces form one closed, consistently oriented surface of genus 0 in which every one of `vertices`
/// vertices has a single fan of faces.
pub fn is_sphere(vertices: usize, faces: &[[u32; 3]]) -> bool {
    let Some(twins) = twins(faces).filter(|_| is_sphere_if_closed(vertices, faces)) else {
        return false;
    };
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
    seen.iter().all(|&s| s)
}

/// The half-edge after `h` in its face.
pub fn next(h: usize) -> usize {
    if h % 3 == 2 { h - 2 } else { h + 1 }
}
