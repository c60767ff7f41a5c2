//! A ranking and a calibration → what the answer says.

use super::RankedClass;
use crate::parameters::{Parameters, RankBy};
use crate::pipeline::Description;
use crate::ranking::{Calibration, Candidate, JUDGED, NotJudged, Verdict};

/// What a ranking by sparse coding can be judged by.
///
/// # Errors
/// Why it cannot be judged.
pub fn judged_by<'a>(
    calibration: &'a Result<Calibration, NotJudged>,
    parameters: &Parameters,
    rank_by: RankBy,
    description: &Description,
) -> Result<&'a Calibration, NotJudged> {
    if rank_by != parameters.rank_by || rank_by == RankBy::Frobenius {
        return Err(NotJudged::OtherMeasure);
    }
    if description.report.is_open() {
        return Err(NotJudged::Open);
    }
    calibration.as_ref().map_err(|reason| *reason)
}

/// What can be told of a ranking.
#[derive(Clone, Debug, PartialEq)]
pub struct Judged {
    /// p-values in the order of the ranking; `None` where a class has none.
    pub p_values: Vec<Option<f64>>,
    /// Whether no class is possible; `None` where that cannot be told.
    pub none_of_these: Option<bool>,
    /// What it comes to, in words.
    pub verdict: Verdict,
}

/// Judges a ranking, best first.
pub fn judge(calibration: Result<&Calibration, NotJudged>, ranked: &[RankedClass]) -> Judged {
    let calibration = match calibration {
        Ok(calibration) => calibration,
        Err(reason) => {
            return Judged {
                p_values: vec![None; ranked.len()],
                none_of_these: None,
                verdict: Verdict::not_judged(ranked.first().map(|class| class.name.as_str()), reason),
            };
        }
    };
    let judgement = calibration.judge(ranked.iter().map(|class| (class.label.as_str(), class.score)));
    let first = ranked.iter().zip(&judgement.p_values).take(JUDGED);
    let candidates: Vec<Candidate<'_>> = first
        .map(|(class, p_value)| Candidate {
            name: &class.name,
            p_value: *p_value,
        })
        .collect();
    let verdict = Verdict::of(&candidates, calibration.least_p_value());
    Judged {
        none_of_these: verdict.reason.is_none().then_some(judgement.none_of_these),
        p_values: judgement.p_values.into_iter().map(Result::ok).collect(),
        verdict,
    }
}
