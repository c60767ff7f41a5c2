//! The spectrum of an open surface glued to its mirror copy, without building the copy (docs/method.md#hypotheses).
//!
//! On the doubled surface every eigenfunction is even or odd under the mirror. The even ones are the eigenfunctions of
//! the open surface with its natural (Neumann) boundary, the odd ones those with zero (Dirichlet) boundary values; so
//! two solves of the open surface's size replace one of twice the size.
//!
//! Normalisation. Let the open mesh have masses a summing to 1. On the doubled mesh of area 1 an interior vertex has
//! mass a/2 in each copy and a shared boundary vertex a/2 + a/2, while the stiffness forms of the copies add up. Both
//! give λ' = 2 λ, and a function of unit norm on the open mesh has unit norm on the doubled one.

use super::eigen::eigenpairs_of;
use super::normalised::Normalised;
use super::shift_invert::Analysis;
use super::{EigenOptions, Eigenpairs, Operators, SpectralError};
use crate::cancel::Cancel;
use faer::Mat;

/// The `n` smallest eigenpairs with zero values on `boundary` (V entries); fewer where there are not so many free
/// vertices. Vectors are V × n, zero on the boundary, ΦᵀAΦ = I. Errors as for
/// [`smallest_eigenpairs`](super::smallest_eigenpairs).
pub fn dirichlet_eigenpairs(
    operators: &Operators,
    boundary: &[bool],
    n: usize,
    options: &EigenOptions,
    cancel: &Cancel,
) -> Result<Eigenpairs, SpectralError> {
    cancel.check()?;
    let interior = interior(boundary);
    let s = Normalised::new(operators, Some(&interior))?;
    interior_eigenpairs(
        &s,
        &interior,
        boundary.len(),
        n.min(interior.len()),
        options,
        cancel,
    )
}

fn interior(boundary: &[bool]) -> Vec<usize> {
    (0..boundary.len()).filter(|&i| !boundary[i]).collect()
}

/// Solves on the interior and spreads the vectors over all vertices.
fn interior_eigenpairs(
    s: &Normalised,
    interior: &[usize],
    vertices: usize,
    n: usize,
    options: &EigenOptions,
    cancel: &Cancel,
) -> Result<Eigenpairs, SpectralError> {
    let pairs = eigenpairs_of(s, n, options, cancel)?;
    let mut vectors = Mat::<f64>::zeros(vertices, n);
    for k in 0..n {
        for (local, &i) in interior.iter().enumerate() {
            vectors[(i, k)] = pairs.vectors[(local, k)];
        }
    }
    Ok(Eigenpairs { vectors, ..pairs })
}

/// The `n` smallest eigenpairs of the doubled surface of area 1, restricted to the original copy.
///
/// `operators` are those of the open mesh (mass summing to 1) and `even` its own eigenpairs, the even half of the
/// answer: n of them, or all V − 1. `boundary` (V entries) marks the vertices shared by the copies. Vectors are V × n;
/// fewer than n where `even` holds fewer. Errors as for [`smallest_eigenpairs`](super::smallest_eigenpairs).
pub fn doubled_eigenpairs(
    operators: &Operators,
    even: &Eigenpairs,
    boundary: &[bool],
    n: usize,
    options: &EigenOptions,
    cancel: &Cancel,
) -> Result<Eigenpairs, SpectralError> {
    let vertices = boundary.len();
    let interior = interior(boundary);
    let n = n.min((vertices + interior.len()).saturating_sub(1));
    if interior.is_empty() {
        return Ok(merge(even, &no_eigenpairs(vertices), n));
    }
    let s = Normalised::new(operators, Some(&interior))?;
    let analysis = Analysis::new(&s)?;
    // Even functions outnumber odd ones by the boundary's share, a few in a hundred. Odd eigenvalues up to the last
    // even one are counted, not guessed.
    let known = even.values.len();
    let mut even_count = (n * 6 / 10 + 6).min(known);
    let odd_count = loop {
        if even_count == known {
            break n;
        }
        cancel.check()?;
        let top = even.values[even_count - 1];
        let odd_count = analysis.count_below(top * (1.0 + 1e-9))?;
        if even_count + odd_count >= n {
            break odd_count;
        }
        let ratio = n as f64 / (even_count + odd_count) as f64;
        even_count = ((1.05 * ratio * even_count as f64) as usize + 4).min(known);
    };
    let odd_count = odd_count.min(n).min(interior.len());
    let odd = interior_eigenpairs(&s, &interior, vertices, odd_count, options, cancel)?;
    Ok(merge(even, &odd, n))
}

fn no_eigenpairs(vertices: usize) -> Eigenpairs {
    Eigenpairs {
        values: Vec::new(),
        vectors: Mat::zeros(vertices, 0),
        residual: 0.0,
    }
}

/// The `n` smallest of both, eigenvalues doubled.
fn merge(even: &Eigenpairs, odd: &Eigenpairs, n: usize) -> Eigenpairs {
    let (mut e, mut o) = (0, 0);
    let n = n.min(even.values.len() + odd.values.len());
    let mut values = Vec::with_capacity(n);
    let mut vectors = Mat::<f64>::zeros(even.vectors.nrows(), n);
    for k in 0..n {
        let take_even = match (even.values.get(e), odd.values.get(o)) {
            (Some(a), Some(b)) => a <= b,
            (left, _) => left.is_some(),
        };
        let (source, at) = if take_even { (even, &mut e) } else { (odd, &mut o) };
        values.push(2.0 * source.values[*at]);
        vectors.col_mut(k).copy_from(source.vectors.col(*at));
        *at += 1;
    }
    Eigenpairs {
        values,
        vectors,
        residual: even.residual.max(odd.residual),
    }
}
