//! Eigenpairs of a mesh in many pieces, piece by piece.
//!
//! S is block diagonal over connected components, so its eigenpairs are those of the blocks, each zero elsewhere. One
//! solve for all of them is quicker, but a block Lanczos finds at most as many copies of an eigenvalue as its block is
//! wide: dozens of equal pieces are beyond it. This is the way out.

use super::normalised::Normalised;
use super::pairs::Pairs;
use super::rows::Rows;
use super::{EigenOptions, SpectralError};
use crate::cancel::Cancel;

/// What was found of one part: values ascending, vectors row by row.
struct Found {
    values: Vec<f64>,
    vectors: Rows,
    /// Whether there is no more that could be wanted.
    all: bool,
}

/// The `wanted` smallest eigenpairs outside the null space, as values (ascending) and vectors (n × wanted, row by
/// row): `solve` is asked for those of every part, for more where the part may hold more of the smallest.
///
/// # Errors
/// Those of `solve`, and [`SpectralError::Cancelled`].
pub fn smallest_by_parts(
    s: &Normalised,
    parts: &[Vec<usize>],
    wanted: usize,
    options: &EigenOptions,
    cancel: &Cancel,
    solve: impl Fn(&Normalised, usize, &EigenOptions, &Cancel) -> Result<Pairs, SpectralError>,
) -> Result<(Vec<f64>, Vec<f64>), SpectralError> {
    // Even shares with room to spare; a part that needs more is asked again for twice as many.
    let share = 2 * wanted / parts.len() + 8;
    let ask = |part: &[usize], count: usize| -> Result<Found, SpectralError> {
        cancel.check()?;
        let block = s.block(part);
        let most = wanted.min(part.len() - block.null.count);
        let count = count.min(most);
        let (values, vectors) = match count {
            0 => (Vec::new(), Rows::default()),
            _ => {
                let pairs = solve(&block, count, options, cancel)?;
                (pairs.values, pairs.vectors)
            }
        };
        Ok(Found {
            values,
            vectors,
            all: count == most,
        })
    };
    let mut found: Vec<Found> = parts
        .iter()
        .map(|part| ask(part, share))
        .collect::<Result<_, _>>()?;
    loop {
        // (value, part, place), so that equal values keep the parts' order.
        let mut merged: Vec<(f64, usize, usize)> = found
            .iter()
            .enumerate()
            .flat_map(|(p, f)| f.values.iter().enumerate().map(move |(k, &v)| (v, p, k)))
            .collect();
        merged.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
        merged.truncate(wanted);
        let last = match merged.get(wanted - 1) {
            Some(&(value, ..)) => value,
            None => f64::INFINITY,
        };
        let short: Vec<usize> = (0..parts.len())
            .filter(|&p| !found[p].all && found[p].values.last().is_none_or(|&v| v < last))
            .collect();
        if short.is_empty() {
            return Ok(assemble(s.n, parts, &found, &merged));
        }
        for p in short {
            found[p] = ask(&parts[p], 2 * found[p].values.len())?;
        }
    }
}

fn assemble(
    n: usize,
    parts: &[Vec<usize>],
    found: &[Found],
    merged: &[(f64, usize, usize)],
) -> (Vec<f64>, Vec<f64>) {
    let wanted = merged.len();
    let mut vectors = vec![0.0; n * wanted];
    for (column, &(_, p, k)) in merged.iter().enumerate() {
        for (row, &vertex) in parts[p].iter().enumerate() {
            vectors[vertex * wanted + column] = found[p].vectors.row(row)[k];
        }
    }
    (merged.iter().map(|m| m.0).collect(), vectors)
}
