//! Down-sampling.

use shapelex_core::mesh::{Components, PrepareOptions, TriangleSoup, prepare};

/// Share of the vertices that is left at strengths 1 to 5; the paper's strongest leaves less than 20 %.
const SHARES: [f64; 5] = [0.75, 0.55, 0.4, 0.28, 0.18];

/// Simplifies by quadric error to the strength's share of the vertices. A mesh that cannot be simplified stays as it is.
pub fn down_sample(null: &TriangleSoup, strength: u32) -> TriangleSoup {
    let target = (SHARES[strength as usize - 1] * null.vertices.len() as f64) as usize;
    let options = PrepareOptions {
        components: Components::All,
        fill_holes_below: 0.0,
        working_size: target.max(4),
    };
    match prepare(null.clone(), &options) {
        Ok((mesh, _)) => {
            let (vertices, faces) = mesh.into_parts();
            TriangleSoup {
                vertices,
                faces,
                ..TriangleSoup::default()
            }
        }
        Err(_) => null.clone(),
    }
}
