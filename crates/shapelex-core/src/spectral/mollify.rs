//! Intrinsic mollification: edge lengths under which every triangle is safely non-degenerate.
//!
//! Sharp and Crane, "A Laplacian for Nonmanifold Triangle Meshes" (2020), section 4.5: one number ε is added to *all*
//! edge lengths, the smallest for which every triangle satisfies l_ij + l_jk ≥ l_ki + δ at each corner, with
//! δ = 1e-5 times the mean edge length. A mesh without needles and caps has ε = 0 and keeps its own lengths.

/// δ over the mean edge length.
const SLACK: f64 = 1e-5;

/// The lengths of a face's edges: entry k is the edge opposite corner k.
pub type EdgeLengths = [f64; 3];

/// The smallest ε ≥ 0 that, added to every length, leaves every triangle inequality a slack of 1e-5 mean lengths.
pub fn mollification(lengths: &[EdgeLengths]) -> f64 {
    let mean = lengths.iter().flatten().sum::<f64>() / (3 * lengths.len()) as f64;
    let delta = SLACK * mean;
    let tightest = lengths
        .iter()
        .map(|&[a, b, c]| {
            let longest = a.max(b).max(c);
            // The two shorter edges minus the longest, small differences first.
            let (x, y) = if longest == a {
                (b, c)
            } else if longest == b {
                (a, c)
            } else {
                (a, b)
            };
            x.min(y) - (longest - x.max(y))
        })
        .fold(f64::INFINITY, f64::min);
    (delta - tightest).max(0.0)
}

/// Area and the three cotangents of a triangle given by its lengths (entry k opposite corner k).
///
/// The area is Kahan's form of Heron's formula, accurate for needles and caps.
pub fn intrinsic_triangle(lengths: EdgeLengths) -> (f64, [f64; 3]) {
    let mut s = lengths;
    s.sort_by(f64::total_cmp);
    let [c, b, a] = s;
    let product = (a + (b + c)) * (c - (a - b)) * (c + (a - b)) * (a + (b - c));
    let area = 0.25 * product.max(0.0).sqrt();
    let cot = |k: usize| {
        let (o, p, q) = (lengths[k], lengths[(k + 1) % 3], lengths[(k + 2) % 3]);
        // p² + q² − o², with the difference of squares factored.
        (p * p + (q - o) * (q + o)) / (4.0 * area)
    };
    (area, [cot(0), cot(1), cot(2)])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn good_triangles_are_left_alone() {
        assert_eq!(mollification(&[[1.0, 1.0, 1.0], [3.0, 4.0, 5.0]]), 0.0);
    }

    #[test]
    fn a_flat_triangle_gets_its_slack() {
        let lengths = [[1.0, 1.0, 2.0], [1.0, 1.0, 1.0]];
        let eps = mollification(&lengths);
        let mean = 7.0 / 6.0;
        assert!((eps - 1e-5 * mean).abs() < 1e-15);
        let (area, cot) = intrinsic_triangle(lengths[0].map(|l| l + eps));
        assert!(area > 0.0 && cot.iter().all(|c| c.is_finite()));
    }

    #[test]
    fn lengths_give_the_textbook_triangle() {
        let (area, cot) = intrinsic_triangle([5.0, 3.0, 4.0]);
        assert!((area - 6.0).abs() < 1e-14);
        assert!(cot[0].abs() < 1e-15, "right angle opposite the hypotenuse");
        assert!((cot[1] - 4.0 / 3.0).abs() < 1e-14);
        assert!((cot[2] - 3.0 / 4.0).abs() < 1e-14);
    }
}
