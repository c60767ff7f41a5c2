//! Lower bounds of a class's score from a few dozen Lassos.
//!
//! By duality f(s) = min_a ½‖s − Da‖² + λ‖a‖₁ = max θᵀs − ½‖θ‖² over all θ with ‖Dᵀθ‖∞ ≤ λ, and the best θ is the
//! residual s − Da. The residuals of a few anchors c_g all meet the condition, which is convex, so mixtures of them do:
//! with weights w_ig ≥ 0 that sum to 1 and s_i ≈ Σ_g w_ig c_g,
//!
//! (1/N) Σ_i f(s_i) ≥ (1/N) Σ_i (θ_iᵀs_i − ½‖θ_i‖²), θ_i = Σ_g w_ig θ_g.
//!
//! The weights do not depend on the class, so the sums over signals are formed once per query
//! ([`Anchors`]); a class costs one Lasso per anchor and one product per pair of neighbours. The residual is
//! piecewise linear in the signal, so the bound is nearly tight where anchors lie closer than its kinks.
//!
//! The trimmed objective is bounded by the trimmed mean of the signals' bounds, since it grows with each of them. That
//! takes a product for each anchor of each signal, too.

use super::RankingError;
use super::anchors::Anchors;
use super::candidate::{Candidate, Measure};
use super::score::{PreparedView, combine, trimmed_mean};
use crate::coding::{Codes, CodingError, Dictionary, Signals, encode_signals};
use crate::parameters::{Channel, Hypothesis, RankBy};
use faer::Mat;

/// Residuals meet ‖Dᵀθ‖∞ ≤ λ to 1e-6 λ at worst. Made shorter by that much they meet it, which takes up to 1e-6 of
/// θᵀs off the bound; the rest is for rounding.
const SLACK: f64 = 3e-6;

/// All views of a query by anchors.
pub(super) struct Level<'a> {
    views: Vec<CoarseView<'a>>,
}

struct CoarseView<'a> {
    hypothesis: Hypothesis,
    channel: Channel,
    signals: &'a Mat<f64>,
    points: Signals<'a>,
    anchors: &'a Anchors,
}

/// Memory that bounds reuse from class to class.
#[derive(Default)]
pub(super) struct BoundMemory {
    residuals: Vec<f64>,
    products: Vec<f64>,
    bounds: Vec<f64>,
}

impl<'a> Level<'a> {
    /// Makes the anchors of number `level` ready for coding.
    pub fn new(
        views: &'a [PreparedView<'_>],
        anchors: &'a [Vec<Anchors>],
        level: usize,
    ) -> Result<Self, CodingError> {
        let views = views
            .iter()
            .zip(anchors)
            .map(|(view, anchors)| {
                Ok(CoarseView {
                    hypothesis: view.hypothesis(),
                    channel: view.channel(),
                    signals: view.matrix(),
                    points: Signals::new(anchors[level].points.as_ref())?,
                    anchors: &anchors[level],
                })
            })
            .collect::<Result<_, CodingError>>()?;
        Ok(Self { views })
    }

    /// A number no larger than the candidate's score by what the search ranks by, the mean or the trimmed objective.
    pub fn bound(
        &self,
        measure: &Measure<'_>,
        candidate: Candidate<'_>,
        memory: &mut BoundMemory,
    ) -> Result<f64, RankingError> {
        let (mut plain, mut whitened, mut doubled) = (f64::NEG_INFINITY, None, Vec::new());
        for view in &self.views {
            let dictionary =
                candidate
                    .dictionaries
                    .get(&view.channel)
                    .ok_or_else(|| RankingError::MissingChannel {
                        class: candidate.label.to_owned(),
                        channel: view.channel,
                    })?;
            let codes = encode_signals(dictionary, &view.points, measure.lambda, measure.cancel)?;
            residuals(dictionary, &view.anchors.points, &codes, &mut memory.residuals);
            let bound = if measure.rank_by == RankBy::TrimmedObjective {
                trimmed_dual_value(view, memory)
            } else {
                dual_value(view.anchors, &memory.residuals)
            };
            match view.hypothesis {
                Hypothesis::Plain => plain = bound,
                Hypothesis::Whitened => whitened = Some(bound),
                Hypothesis::Doubled => doubled.push(bound),
            }
        }
        Ok(combine(plain, whitened, &doubled).0)
    }
}

/// θ_g = c_g − D a_g, one after the other.
fn residuals(dictionary: &Dictionary, points: &Mat<f64>, codes: &Codes, residuals: &mut Vec<f64>) {
    residuals.clear();
    for g in 0..points.ncols() {
        let first = residuals.len();
        residuals.extend_from_slice(points.col_as_slice(g));
        let code = codes.offsets[g]..codes.offsets[g + 1];
        dictionary.subtract(
            &codes.atoms[code.clone()],
            &codes.values[code],
            &mut residuals[first..],
        );
    }
}

/// Σ_g θ_gᵀ (1/N) Σ_i w_ig s_i − ½ Σ_gh (1/N) Σ_i w_ig w_ih θ_gᵀθ_h, less what rounding may have added.
fn dual_value(anchors: &Anchors, residuals: &[f64]) -> f64 {
    let m = anchors.points.nrows();
    let residual = |g: u32| &residuals[g as usize * m..][..m];
    let linear: f64 = (0..anchors.sums.ncols())
        .map(|g| dot(residual(g as u32), anchors.sums.col_as_slice(g)))
        .sum();
    let square: f64 = anchors
        .pairs
        .iter()
        .map(|(g, h, weight)| weight * dot(residual(*g), residual(*h)))
        .sum();
    linear - 0.5 * square - SLACK * (linear.abs() + square.abs())
}

/// The trimmed mean of θ_iᵀs_i − ½‖θ_i‖² with θ_i = Σ_g w_ig θ_g, each less what rounding may have added.
fn trimmed_dual_value(view: &CoarseView<'_>, memory: &mut BoundMemory) -> f64 {
    let (m, k) = (view.anchors.points.nrows(), view.anchors.points.ncols());
    let BoundMemory {
        residuals,
        products,
        bounds,
    } = memory;
    let residual = |g: u32| &residuals[g as usize * m..][..m];
    products.clear();
    products.resize(k * k, 0.0);
    for &(g, h, _) in &view.anchors.pairs {
        products[g as usize * k + h as usize] = dot(residual(g), residual(h));
    }
    bounds.clear();
    bounds.extend(view.anchors.mixtures.iter().enumerate().map(|(i, mixture)| {
        let signal = view.signals.col_as_slice(i);
        let linear: f64 = mixture
            .iter()
            .map(|&(g, weight)| weight * dot(residual(g), signal))
            .sum();
        let square: f64 = mixture
            .iter()
            .flat_map(|&(g, weight)| mixture.iter().map(move |&(h, other)| (g, h, weight * other)))
            .map(|(g, h, weight)| weight * products[g.min(h) as usize * k + g.max(h) as usize])
            .sum();
        linear - 0.5 * square - SLACK * (linear.abs() + square.abs())
    }));
    trimmed_mean(bounds)
}

fn dot(x: &[f64], y: &[f64]) -> f64 {
    let mut sums = [0.0; 8];
    let (x8, y8) = (x.chunks_exact(8), y.chunks_exact(8));
    let tail: f64 = x8
        .remainder()
        .iter()
        .zip(y8.remainder())
        .map(|(a, b)| a * b)
        .sum();
    for (a, b) in x8.zip(y8) {
        for k in 0..8 {
            sums[k] += a[k] * b[k];
        }
    }
    sums.iter().sum::<f64>() + tail
}
