//! From S to its smallest eigenpairs: which solver, which shift, how large a subspace, and what happens on failure.
//!
//! The shift sits *inside* the wanted interval, at about 58 % of the eigenvalues. The wanted part of the spectrum of
//! (S − c I)⁻¹ then has eigenvalues of both signs and only one end with unwanted neighbours, and a third less subspace
//! converges than with a shift below zero.

use super::basis::Basis;
use super::dense;
use super::lanczos::{Lanczos, Ritz};
use super::normalised::{Normalised, NullSpace};
use super::pairs::Pairs;
use super::parts::smallest_by_parts;
use super::residual::{self};
use super::rows::Rows;
use super::shift_invert::{Analysis, Factor};
use super::simd::Row;
use super::{EigenOptions, SpectralError};
use crate::cancel::Cancel;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// Share of the wanted eigenvalues that should lie below the shift, and how far off is good enough.
const BELOW_SHIFT: f64 = 0.58;
const BELOW_SHIFT_RANGE: std::ops::RangeInclusive<f64> = 0.5..=0.66;

/// Largest mesh the dense solver, which cannot be interrupted, is the last resort for (72 MB per matrix, seven seconds).
const DENSE_LAST_RESORT: usize = 3000;

/// Eigenvalues below this share of the largest are zero as far as double precision can tell.
pub const ZERO: f64 = 1e-9;

/// Accepted ‖XᵀX − I‖_F. Re-orthogonalisation keeps it near 1e-9; what it can cost the tolerance is its own size.
const ORTHOGONALITY: f64 = 1e-7;

/// Pairs beyond the wanted ones that are looked at, for a gap to count eigenvalues in.
const BEYOND: usize = 8;

/// Block sizes in the order they are tried. Small blocks need the smallest subspace; a block finds at most its own size
/// of copies of an eigenvalue in exact arithmetic, so larger ones follow when the count does not come out.
const BLOCKS: [usize; 4] = [4, 8, 16, WIDEST];
const WIDEST: usize = 32;

/// By how much the shift of an attempt differs from that of the one before.
const NEXT_SHIFT: f64 = 1.013;

/// How fast the last pair converges once it does: measured 0.12 to 0.21 on meshes of 1000 to 20 000 vertices, whatever
/// the number of pairs.
const DECADES_PER_COLUMN: f64 = 0.175;

/// Size from which a step costs so much more than a look at the projection that looking early pays.
const LOOK_EARLY: usize = 4000;

/// Size from which blocks of eight come first: reading the factor and the basis half as often outweighs a larger
/// subspace once neither fits the caches.
const WIDE_FROM: usize = 40_000;

/// The block sizes for n unknowns.
fn blocks(n: usize) -> &'static [usize] {
    &BLOCKS[usize::from(n >= WIDE_FROM)..]
}

/// Columns of the subspace of n unknowns at which convergence is first looked at for `wanted` pairs.
fn first_subspace(n: usize, wanted: usize, block: usize) -> usize {
    let ratio = match block {
        0..=4 if n >= LOOK_EARLY => 1.52,
        0..=4 => 1.64,
        5..=8 if n >= LOOK_EARLY => 1.68,
        5..=8 => 1.86,
        _ => 2.25,
    };
    ((ratio * wanted as f64) as usize + 4 * block).next_multiple_of(block)
}

/// Whether a problem of n unknowns is solved densely at once: where the subspace would be most of the space.
fn is_dense(n: usize, wanted: usize) -> bool {
    n < 6 * first_subspace(n, wanted, BLOCKS[0]) / 5 + 40
}

/// Bytes at the peak of a solve for `wanted` pairs of n unknowns, from the sizes of what is held at once.
pub fn estimated_bytes(n: usize, wanted: usize) -> usize {
    let wanted = wanted.min(n);
    let vectors = 8 * n * wanted;
    if is_dense(n, wanted) {
        // The matrix, its eigenvectors, as much workspace, and the result twice.
        return 8 * 4 * n * n + 2 * vectors;
    }
    let block = blocks(n)[0];
    // The first room of the basis, and as much as it grows by at a time.
    let m = first_subspace(n, wanted, block) * 17 / 16;
    // The factor of a surface mesh has about 5 log2(n) entries per row, held twice while it is packed; S and its
    // permuted copy take another 40 numbers per row.
    let factor = 8 * n * 10 * n.ilog2() as usize;
    // Projected problem: T, its eigenvectors, workspace, coefficients.
    let projected = 8 * 5 * m * m;
    // The basis with the factor; then the rows that take its place, and the result in columns.
    let basis = 8 * n * (m + 8 * block);
    let operator = 8 * n * 40;
    projected + operator + (basis + factor).max(2 * vectors)
}

/// The `wanted` smallest eigenpairs outside the null space, checked.
pub fn smallest(
    s: &Normalised,
    wanted: usize,
    options: &EigenOptions,
    cancel: &Cancel,
) -> Result<Pairs, SpectralError> {
    // More equal pieces than the widest block finds copies of an eigenvalue.
    if !is_dense(s.n, wanted) {
        let parts = s.parts();
        if parts.len() > WIDEST {
            let (values, vectors) = smallest_by_parts(s, &parts, wanted, options, cancel, whole)?;
            return accept(s, (values, Rows::in_order(vectors, wanted)), options.tolerance);
        }
    }
    whole(s, wanted, options, cancel)
}

/// As [`smallest`], by one solve: densely or sparsely, and where that fails by the other way, if it has a chance. The
/// dense solver is right to some 10⁴ units in the last place of ‖S‖, which thin triangles make large.
fn whole(
    s: &Normalised,
    wanted: usize,
    options: &EigenOptions,
    cancel: &Cancel,
) -> Result<Pairs, SpectralError> {
    type Way<'a> = &'a dyn Fn() -> Result<Pairs, SpectralError>;
    let dense = || dense_pairs(s, wanted, options);
    let sparse = || sparse_pairs(s, wanted, options, cancel);
    let (first, last): (Way<'_>, Option<Way<'_>>) = if is_dense(s.n, wanted) {
        // The subspace needs room for more than the pairs, and for two blocks of any width.
        let room = s.n - s.null.count >= (wanted + 2 * BLOCKS[0]).max(2 * WIDEST);
        (&dense, room.then_some(&sparse))
    } else {
        (&sparse, (s.n <= DENSE_LAST_RESORT).then_some(&dense))
    };
    let mut details = Vec::new();
    for way in std::iter::once(first).chain(last) {
        cancel.check()?;
        match way() {
            Ok(pairs) => return Ok(pairs),
            Err(SpectralError::Cancelled(c)) => return Err(c.into()),
            Err(SpectralError::NotConverged { detail }) => details.push(detail),
            Err(other) => details.push(other.to_string()),
        }
    }
    Err(SpectralError::NotConverged {
        detail: details.join("; "),
    })
}

fn accept(s: &Normalised, pairs: (Vec<f64>, Rows), tolerance: f64) -> Result<Pairs, SpectralError> {
    let (values, vectors) = pairs;
    let floor = ZERO * values.last().copied().unwrap_or(0.0);
    let check = residual::check(s, &values, &vectors, floor);
    // Negated so that NaN is refused.
    if !(check.excess <= tolerance && check.orthogonality <= ORTHOGONALITY) {
        return Err(SpectralError::NotConverged {
            detail: format!(
                "residual {:.1e} (tolerance {tolerance:.1e}), orthogonality {:.1e}",
                check.residual, check.orthogonality
            ),
        });
    }
    Ok(Pairs {
        values,
        vectors,
        check,
    })
}

fn dense_pairs(s: &Normalised, wanted: usize, options: &EigenOptions) -> Result<Pairs, SpectralError> {
    let (values, vectors) = dense::smallest(s, wanted)?;
    accept(s, (values, Rows::in_order(vectors, wanted)), options.tolerance)
}

fn sparse_pairs(
    s: &Normalised,
    wanted: usize,
    options: &EigenOptions,
    cancel: &Cancel,
) -> Result<Pairs, SpectralError> {
    let analysis = Analysis::new(s)?;
    cancel.check()?;
    let order = analysis.order();
    let null = s.null.permuted(&order);
    let (shift, factor) = choose_shift(&analysis, wanted, s.null.count, cancel)?;
    let mut factor = Some(factor);
    let mut problem = Problem {
        s,
        null: &null,
        order: &order,
        analysis: &analysis,
        shift,
        wanted,
        options,
        cancel,
    };
    let mut last = None;
    for &block in blocks(s.n) {
        let attempt = match block {
            4 => problem.attempt::<4>(factor.take()),
            8 => problem.attempt::<8>(factor.take()),
            16 => problem.attempt::<16>(factor.take()),
            _ => problem.attempt::<32>(factor.take()),
        };
        match attempt {
            Ok(pairs) => return Ok(pairs),
            Err(SpectralError::Cancelled(c)) => return Err(c.into()),
            Err(other) => last = Some(other),
        }
        // The factorisation does not pivot: at an unlucky shift it is too inaccurate for any block.
        problem.shift *= NEXT_SHIFT;
    }
    Err(last.unwrap_or(SpectralError::NotConverged {
        detail: "no attempt was made".into(),
    }))
}

/// A shift with about 58 % of the wanted eigenvalues below it, found by counting (Sylvester's inertia) from Weyl's law
/// λ_k ≈ 4π k on a surface of area 1.
fn choose_shift(
    analysis: &Analysis,
    wanted: usize,
    null: usize,
    cancel: &Cancel,
) -> Result<(f64, Factor), SpectralError> {
    let target = BELOW_SHIFT * wanted as f64;
    let mut shift = 4.0 * std::f64::consts::PI * target;
    // Bracket in shift; the count is monotone.
    let (mut low, mut high) = (0.0, f64::INFINITY);
    let mut best: Option<(f64, f64, Factor)> = None;
    for _ in 0..12 {
        cancel.check()?;
        let factor = match analysis.factorise(shift) {
            Ok(factor) => factor,
            // The shift hit an eigenvalue of a leading block: step aside.
            Err(_) => {
                shift *= 1.0 + 1e-3;
                continue;
            }
        };
        let below = factor.below.saturating_sub(null) as f64;
        let miss = (below / wanted as f64 - BELOW_SHIFT).abs();
        if below < target {
            low = shift;
        } else {
            high = shift;
        }
        let next = {
            let linear = shift * (target / below.max(0.5)).clamp(0.125, 8.0);
            let inside = linear > low && linear < high;
            if inside || !high.is_finite() {
                linear
            } else {
                0.5 * (low + high)
            }
        };
        if best.as_ref().is_none_or(|b| miss < b.1) {
            best = Some((shift, miss, factor));
        }
        if BELOW_SHIFT_RANGE.contains(&(below / wanted as f64)) || high - low <= 1e-6 * high {
            break;
        }
        shift = next;
    }
    best.map(|(shift, _, factor)| (shift, factor))
        .ok_or_else(|| SpectralError::Factorisation {
            detail: "no shift could be factorised".into(),
        })
}

/// Places of the few wanted pairs that converge last: those farthest from the shift, at both ends; ascending.
fn outermost(places: &[usize], wanted: usize) -> Vec<usize> {
    let (low, high) = (2.min(wanted), 6.min(wanted));
    let mut ends: Vec<usize> = places[..low]
        .iter()
        .chain(&places[wanted - high..wanted])
        .copied()
        .collect();
    ends.sort_unstable();
    ends.dedup();
    ends
}

struct Problem<'a> {
    s: &'a Normalised,
    /// The null space in the order of the factor, and that order.
    null: &'a NullSpace,
    order: &'a [usize],
    analysis: &'a Analysis,
    shift: f64,
    wanted: usize,
    options: &'a EigenOptions,
    cancel: &'a Cancel,
}

impl Problem<'_> {
    /// Runs the recurrence until the wanted pairs have converged, then checks them and their number. `factor` is that of
    /// S − shift I, where there is one yet; it is freed before the vectors are assembled.
    fn attempt<const B: usize>(&self, factor: Option<Factor>) -> Result<Pairs, SpectralError>
    where
        [f64; B]: Row,
    {
        let factor = match factor {
            Some(factor) => factor,
            None => self.analysis.factorise(self.shift)?,
        };
        let (basis, ritz, chosen) = self.converge::<B>(&factor)?;
        drop(factor);
        let wanted = &chosen[..self.wanted];
        let values = wanted.iter().map(|&i| self.value(ritz.theta[i])).collect();
        let vectors = ritz.vectors(basis, wanted, self.order);
        let pairs = accept(self.s, (values, vectors), self.options.tolerance)?;
        self.cancel.check()?;
        self.certify(&ritz, &chosen)?;
        Ok(pairs)
    }

    /// Runs the recurrence until the wanted pairs have converged: the basis, Ritz pairs, and their places by value.
    fn converge<const B: usize>(&self, factor: &Factor) -> Result<(Basis, Ritz, Vec<usize>), SpectralError>
    where
        [f64; B]: Row,
    {
        let available = (self.s.n - self.s.null.count) / B * B;
        let first = first_subspace(self.s.n, self.wanted, B).min(available - B);
        let capacity = (2 * first).min(available);
        let accepted = 0.3 * self.options.tolerance;
        let rng = ChaCha8Rng::seed_from_u64(self.options.seed);
        let mut lanczos = Lanczos::<B>::new(self.s.n, factor, self.null, first, capacity, rng)?;
        let mut next_look = first;
        loop {
            self.cancel.check()?;
            lanczos.step()?;
            let full = !lanczos.has_room();
            if lanczos.dimension() < next_look && !full {
                continue;
            }
            self.cancel.check()?;
            let theta = lanczos.ritz_values()?;
            let places = self.by_value(&theta);
            let mut worst = f64::INFINITY;
            if places.len() > self.wanted {
                let ritz = lanczos.ritz(&theta, &outermost(&places, self.wanted))?;
                worst = self.worst(
                    &ritz,
                    0..ritz.theta.len(),
                    self.value(theta[places[self.wanted - 1]]),
                );
            }
            if worst <= accepted {
                self.cancel.check()?;
                let mut which = places[..places.len().min(self.wanted + BEYOND)].to_vec();
                which.sort_unstable();
                let ritz = lanczos.ritz(&theta, &which)?;
                let chosen = self.by_value(&ritz.theta);
                let last = self.value(ritz.theta[chosen[self.wanted - 1]]);
                worst = self.worst(&ritz, chosen[..self.wanted].iter().copied(), last);
                if worst <= accepted {
                    return Ok((lanczos.into_basis(), ritz, chosen));
                }
            }
            if full {
                return Err(SpectralError::NotConverged {
                    detail: format!(
                        "block {B}, subspace {}: residual {worst:.1e}",
                        lanczos.dimension()
                    ),
                });
            }
            // As far as it takes at the usual speed, at most a quarter of the way again.
            let missing = ((worst / accepted).log10() / DECADES_PER_COLUMN).min((first / 4) as f64) as usize;
            next_look = lanczos.dimension() + (missing + 1).next_multiple_of(B);
        }
    }

    /// λ of a Ritz value.
    fn value(&self, theta: f64) -> f64 {
        self.shift + 1.0 / theta
    }

    /// Estimated relative residual of a Ritz pair after the free step of [`Ritz::vectors`]: ‖r‖ / (θ² λ).
    fn estimate(&self, ritz: &Ritz, i: usize, floor: f64) -> f64 {
        let theta = ritz.theta[i];
        ritz.tail.col(i).norm_l2() / (theta * theta) / self.value(theta).max(floor)
    }

    /// Places of Ritz values by ascending λ, those in the gap between 0 and the negative axis left out.
    fn by_value(&self, theta: &[f64]) -> Vec<usize> {
        let mut places: Vec<usize> = (0..theta.len())
            .filter(|&i| self.value(theta[i]) >= -ZERO * self.shift && theta[i] != 0.0)
            .collect();
        places.sort_by(|&a, &b| self.value(theta[a]).total_cmp(&self.value(theta[b])));
        places
    }

    /// The largest estimate of the pairs; `last` is the largest eigenvalue wanted.
    fn worst(&self, ritz: &Ritz, pairs: impl IntoIterator<Item = usize>, last: f64) -> f64 {
        let estimates = pairs.into_iter().map(|i| self.estimate(ritz, i, ZERO * last));
        // A NaN has not converged, so it stays.
        estimates.fold(0.0, |m, x| if x > m || x.is_nan() { x } else { m })
    }

    /// Proves that no eigenvalue was missed: the inertia of S − μ I must count as many eigenvalues below μ as were
    /// found. μ lies in a gap just above the last wanted one, or, where that sits in a cluster, in one just below it.
    fn certify(&self, ritz: &Ritz, chosen: &[usize]) -> Result<(), SpectralError> {
        let value = |j: usize| self.value(ritz.theta[chosen[j]]);
        // Pairs whose eigenvalue is known well enough to tell where a gap is: the error is quadratic in the residual.
        let known = (self.wanted..chosen.len())
            .take_while(|&j| self.estimate(ritz, chosen[j], 0.0) < 1e-3)
            .last()
            .unwrap_or(self.wanted - 1);
        let above = (self.wanted - 1..known).take(BEYOND);
        let below = (self.wanted.saturating_sub(40)..self.wanted - 1).rev();
        let wide = |j: &usize| value(j + 1) - value(*j) > 1e-4 * value(*j + 1);
        let Some(j) = above.chain(below).find(wide) else {
            return Err(SpectralError::NotConverged {
                detail: "no gap to count eigenvalues in".into(),
            });
        };
        let shift = 0.5 * (value(j) + value(j + 1));
        let counted = self.analysis.count_below(shift)?;
        let found = j + 1 + self.s.null.count;
        if counted == found {
            Ok(())
        } else {
            Err(SpectralError::NotConverged {
                detail: format!("{counted} eigenvalues lie below {shift:.6}, {found} were found"),
            })
        }
    }
}
