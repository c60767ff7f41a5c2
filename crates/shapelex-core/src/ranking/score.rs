//! How well one set of dictionaries regenerates a query (docs/method.md#ranking; Eq. 5).

use super::{RankingError, View};
use crate::cancel::Cancel;
use crate::coding::{CodeScore, CodingError, Dictionary, Signals, score_signals};
use crate::parameters::{Channel, Hypothesis, RankBy};
use faer::Mat;
use std::collections::BTreeMap;
use std::sync::Arc;

/// What a class whitened by its second moments must be better by, in units of the mean objective: the prior against
/// the less specific hypothesis (docs/method.md#hypotheses).
const WHITENED_OFFSET: f64 = 0.0003;
/// What an open query taken as it is must be better by.
const OPEN_PLAIN_OFFSET: f64 = 0.001;
/// Temperature τ of the soft minimum over the areas assumed for a doubled surface.
const AREA_TEMPERATURE: f64 = 0.002;
/// Share of the signatures, those with the smallest objectives, that the trimmed mean keeps.
const TRIMMED_SHARE: f64 = 0.8;

/// The mean of the smallest 80 % of some numbers, which are put in order; 0 where there are none.
pub(super) fn trimmed_mean(values: &mut [f64]) -> f64 {
    let kept = ((values.len() as f64 * TRIMMED_SHARE).ceil() as usize).min(values.len());
    values.sort_unstable_by(f64::total_cmp);
    values[..kept].iter().sum::<f64>() / kept.max(1) as f64
}

/// Errors of N coded signatures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Errors {
    /// ‖S − DA‖_F (Eq. 5).
    pub frobenius: f64,
    /// ‖S − DA‖_F / ‖S‖_F.
    pub relative: f64,
    /// Mean of ½‖s − Da‖² + λ‖a‖₁.
    pub mean_objective: f64,
    /// Mean of the smallest 80 % of the objectives.
    pub trimmed_objective: f64,
    /// Mean number of non-zeros of a code.
    pub mean_nonzeros: f64,
}

impl Errors {
    /// Sums up the costs of N codes of signals with ‖S‖²_F = `energy`.
    pub fn of(codes: &[CodeScore], energy: f64) -> Self {
        let n = codes.len().max(1) as f64;
        let frobenius = codes.iter().map(|c| c.residual2).sum::<f64>().max(0.0).sqrt();
        let mut objectives: Vec<f64> = codes.iter().map(|c| c.objective).collect();
        let mean_objective = objectives.iter().sum::<f64>() / n;
        Self {
            frobenius,
            relative: if energy > 0.0 {
                frobenius / energy.sqrt()
            } else {
                0.0
            },
            mean_objective,
            trimmed_objective: trimmed_mean(&mut objectives),
            mean_nonzeros: codes.iter().map(|c| c.nonzeros).sum::<usize>() as f64 / n,
        }
    }

    fn by(&self, rank_by: RankBy) -> f64 {
        match rank_by {
            RankBy::Objective => self.mean_objective,
            RankBy::TrimmedObjective => self.trimmed_objective,
            RankBy::Frobenius => self.frobenius,
        }
    }
}

/// A view made ready for coding, once for all classes.
pub struct PreparedView<'a> {
    view: &'a View,
    signals: Signals<'a>,
    energy: f64,
}

impl PreparedView<'_> {
    /// The hypothesis it was prepared under.
    pub(super) fn hypothesis(&self) -> Hypothesis {
        self.view.hypothesis
    }

    /// The channel it is coded under.
    pub(super) fn channel(&self) -> Channel {
        self.view.channel
    }

    /// The signals, M × N.
    pub(super) fn matrix(&self) -> &Mat<f64> {
        &self.view.signatures.matrix
    }
}

/// Makes views ready for coding. A ranking by Eq. 5 knows the plain hypothesis only.
///
/// # Errors
/// [`CodingError::NotFinite`] where a signal is not finite.
pub fn prepare_views(views: &[View], rank_by: RankBy) -> Result<Vec<PreparedView<'_>>, CodingError> {
    views
        .iter()
        .filter(|view| rank_by != RankBy::Frobenius || view.hypothesis == Hypothesis::Plain)
        .map(|view| {
            let signals = Signals::new(view.signatures.matrix.as_ref())?;
            Ok(PreparedView {
                view,
                signals,
                energy: view.signatures.energy(),
            })
        })
        .collect()
}

/// A score, where it comes from, and the plain hypothesis's errors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Score {
    /// What the ranking is ordered by.
    pub value: f64,
    /// The hypothesis it comes from.
    pub hypothesis: Hypothesis,
    /// The plain hypothesis's errors.
    pub plain: Errors,
}

/// Codes every view under the dictionary of its channel and combines the hypotheses.
///
/// With p = min(m₀, m₁ + 0.0003): the score is p, or for an open query min(p + 0.001, m₂), m₂ the soft minimum
/// −τ ln mean exp(−m/τ) over the areas assumed (docs/method.md#hypotheses).
/// Offsets are in units of the mean objective, so a
/// ranking by Eq. 5 knows the plain hypothesis only. Views of a surface with a boundary are measured by their trimmed
/// objective where `rank_by` is the mean one.
pub fn score(
    views: &[PreparedView<'_>],
    dictionaries: &BTreeMap<Channel, Arc<Dictionary>>,
    lambda: f64,
    rank_by: RankBy,
    label: &str,
    cancel: &Cancel,
) -> Result<Score, RankingError> {
    let mut plain = None;
    let mut whitened = None;
    let mut doubled = Vec::new();
    let rank_by = measure(views, rank_by);
    for PreparedView {
        view,
        signals,
        energy,
    } in views
    {
        let dictionary = dictionaries
            .get(&view.channel)
            .ok_or_else(|| RankingError::MissingChannel {
                class: label.to_owned(),
                channel: view.channel,
            })?;
        let codes = score_signals(dictionary, signals, lambda, cancel)?;
        let errors = Errors::of(&codes, *energy);
        match view.hypothesis {
            Hypothesis::Plain => plain = Some(errors),
            Hypothesis::Whitened => whitened = Some(errors.by(rank_by)),
            Hypothesis::Doubled => doubled.push(errors.by(rank_by)),
        }
    }
    let plain = plain.ok_or(RankingError::NoPlainView)?;
    let (value, hypothesis) = combine(plain.by(rank_by), whitened, &doubled);
    Ok(Score {
        value,
        hypothesis,
        plain,
    })
}

/// What a query is measured by: where something of the shape is missing, the trimmed objective stands for the mean,
/// since what is near a boundary looks different on the whole and is regenerated by no class.
pub(super) fn measure(views: &[PreparedView<'_>], rank_by: RankBy) -> RankBy {
    match rank_by {
        RankBy::Objective if views.iter().any(|v| v.view.bounded) => RankBy::TrimmedObjective,
        other => other,
    }
}

/// The hypotheses' errors of one class → its score and the hypothesis it comes from; see [`score`]. Grows with each of
/// the errors, so bounds of them give a bound of it.
pub(super) fn combine(plain: f64, whitened: Option<f64>, doubled: &[f64]) -> (f64, Hypothesis) {
    let mut best = (plain, Hypothesis::Plain);
    if let Some(m1) = whitened.map(|m| m + WHITENED_OFFSET)
        && m1 < best.0
    {
        best = (m1, Hypothesis::Whitened);
    }
    if !doubled.is_empty() {
        best.0 += OPEN_PLAIN_OFFSET;
        let m2 = soft_minimum(doubled, AREA_TEMPERATURE);
        if m2 < best.0 {
            best = (m2, Hypothesis::Doubled);
        }
    }
    best
}

/// −τ ln mean_s exp(−m_s/τ), the minimum subtracted first so that nothing underflows.
fn soft_minimum(values: &[f64], temperature: f64) -> f64 {
    let least = values.iter().copied().fold(f64::INFINITY, f64::min);
    let mean = values
        .iter()
        .map(|m| (-(m - least) / temperature).exp())
        .sum::<f64>()
        / values.len() as f64;
    least - temperature * mean.ln()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_soft_minimum_lies_between_the_minimum_and_the_mean() {
        let values = [0.375, 0.376, 0.380];
        let soft = soft_minimum(&values, AREA_TEMPERATURE);
        assert!(soft > 0.375 && soft < values.iter().sum::<f64>() / 3.0, "{soft}");
        assert!((soft_minimum(&[0.4; 4], AREA_TEMPERATURE) - 0.4).abs() < 1e-15);
        // Far apart, only the number of hypotheses is left of the others: m + τ ln n.
        let far = soft_minimum(&[0.1, 50.0], AREA_TEMPERATURE);
        assert!(
            (far - (0.1 + AREA_TEMPERATURE * 2f64.ln())).abs() < 1e-12,
            "{far}"
        );
    }

    #[test]
    fn errors_sum_up_codes() {
        let code = |objective, residual2, nonzeros| CodeScore {
            objective,
            residual2,
            nonzeros,
        };
        let codes = [
            code(0.5, 1.0, 1),
            code(0.1, 0.5, 2),
            code(0.2, 0.5, 0),
            code(0.3, 1.0, 1),
            code(9.0, 1.0, 1),
        ];
        let errors = Errors::of(&codes, 16.0);
        assert_eq!(errors.frobenius, 2.0);
        assert_eq!(errors.relative, 0.5);
        assert!((errors.trimmed_objective - (0.1 + 0.2 + 0.3 + 0.5) / 4.0).abs() < 1e-15);
        assert_eq!(errors.mean_nonzeros, 1.0);
    }
}
