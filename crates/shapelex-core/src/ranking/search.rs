//! The best few of many candidates, without coding the query under all of them.

use super::RankingError;
use super::anchors::anchors;
use super::bound::{BoundMemory, Level};
use super::candidate::{Candidate, Measure};
use super::score::{PreparedView, Score, score};
use crate::coding::CodingError;
use crate::parameters::RankBy;
use rayon::prelude::*;

/// Anchors of the bounds, coarse to fine: the first is for all candidates, the second for those it leaves.
const SIZES: [usize; 2] = [24, 96];
/// Fewer signals than this many per anchor of the coarse bound are coded as they are.
const SIGNALS_PER_ANCHOR: usize = 4;
/// Fewer candidates than this many times those wanted are all coded.
const WORTHWHILE: usize = 4;
/// Candidates coded together. Fixed, so that what is left out does not depend on the number of threads.
const BATCH: usize = 16;

/// Ranks candidates for one query.
pub(super) struct Search<'a> {
    pub views: &'a [PreparedView<'a>],
    pub measure: Measure<'a>,
}

/// Candidates' numbers and their scores.
pub(super) type Scored = Vec<(usize, Score)>;

/// A candidate's number and its lower bound.
type Bounded = (f64, usize);

impl Search<'_> {
    /// The candidates' numbers and scores, best first: all of them, or at least the `wanted` best, which are exactly
    /// those that coding all would put first.
    ///
    /// A candidate is left out when a lower bound of its score ([`Level::bound`]) exceeds the score of `wanted` others.
    /// Eq. 5 has no such bound; ranked by it, all are coded.
    pub fn best(&self, candidates: &[Candidate<'_>], wanted: Option<usize>) -> Result<Scored, RankingError> {
        let signals = self.views.iter().map(|v| v.matrix().ncols()).min().unwrap_or(0);
        let mut found = match wanted {
            Some(wanted)
                if self.measure.rank_by != RankBy::Frobenius
                    && candidates.len() / WORTHWHILE > wanted
                    && signals >= SIZES[0] * SIGNALS_PER_ANCHOR =>
            {
                self.few(candidates, wanted.max(1), signals)?
            }
            _ => self.code(candidates, 0..candidates.len())?,
        };
        order(&mut found, candidates);
        Ok(found)
    }

    /// The candidates' numbers and scores, best first, of those that were scored before the flag was set.
    pub fn in_time(&self, candidates: &[Candidate<'_>]) -> Result<Scored, RankingError> {
        let in_time = |i: usize| match self.score(candidates, i) {
            Err(RankingError::Coding(CodingError::Cancelled(_))) => None,
            done => Some(done),
        };
        let mut found = (0..candidates.len())
            .into_par_iter()
            .filter_map(in_time)
            .collect::<Result<Scored, RankingError>>()?;
        order(&mut found, candidates);
        Ok(found)
    }

    fn few(
        &self,
        candidates: &[Candidate<'_>],
        wanted: usize,
        signals: usize,
    ) -> Result<Scored, RankingError> {
        let sizes = SIZES.map(|size| size.min(signals / 2));
        let anchors: Vec<_> = self
            .views
            .par_iter()
            .map(|view| anchors(view.matrix().as_ref(), &sizes))
            .collect();
        let coarse = Level::new(self.views, &anchors, 0)?;
        let fine = Level::new(self.views, &anchors, 1)?;
        let first = self.bound(candidates, &coarse, (0..candidates.len()).collect())?;
        // The likeliest candidates set the score that the others' bounds are held against.
        let mut found = self.code(candidates, first.iter().take(wanted).map(|(_, i)| *i))?;
        let mut worst = nth_best(&found, wanted);
        let rest = first[wanted..].iter().filter(|(bound, _)| *bound <= worst);
        let rest = self.bound(candidates, &fine, rest.map(|(_, i)| *i).collect())?;
        for batch in rest.chunks(BATCH) {
            let batch = batch.iter().filter(|(bound, _)| *bound <= worst);
            found.extend(self.code(candidates, batch.map(|(_, i)| *i))?);
            worst = nth_best(&found, wanted);
        }
        Ok(found)
    }

    /// Scores of the numbered candidates, in their order.
    fn code(
        &self,
        candidates: &[Candidate<'_>],
        numbers: impl Iterator<Item = usize>,
    ) -> Result<Scored, RankingError> {
        numbers
            .collect::<Vec<_>>()
            .into_par_iter()
            .map(|i| self.score(candidates, i))
            .collect()
    }

    /// The number and the score of one candidate.
    fn score(&self, candidates: &[Candidate<'_>], i: usize) -> Result<(usize, Score), RankingError> {
        let Candidate { label, dictionaries } = candidates[i];
        let Measure {
            lambda,
            rank_by,
            cancel,
        } = self.measure;
        let score = score(self.views, dictionaries, lambda, rank_by, label, cancel)?;
        Ok((i, score))
    }

    /// Bounds of the numbered candidates, the least first.
    fn bound(
        &self,
        candidates: &[Candidate<'_>],
        level: &Level<'_>,
        numbers: Vec<usize>,
    ) -> Result<Vec<Bounded>, RankingError> {
        let mut bounds = numbers
            .into_par_iter()
            .map_init(BoundMemory::default, |memory, i| {
                let bound = level.bound(&self.measure, candidates[i], memory)?;
                Ok((bound, i))
            })
            .collect::<Result<Vec<Bounded>, RankingError>>()?;
        bounds.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        Ok(bounds)
    }
}

/// Puts the best first; equal scores are in the order of their labels.
fn order(found: &mut Scored, candidates: &[Candidate<'_>]) {
    let label = |i: usize| candidates[i].label;
    found.sort_by(|(i, a), (j, b)| a.value.total_cmp(&b.value).then_with(|| label(*i).cmp(label(*j))));
}

/// The `wanted`-th best score, infinity where there are fewer.
fn nth_best(found: &[(usize, Score)], wanted: usize) -> f64 {
    let mut values: Vec<f64> = found.iter().map(|(_, s)| s.value).collect();
    if values.len() < wanted {
        return f64::INFINITY;
    }
    *values.select_nth_unstable_by(wanted - 1, f64::total_cmp).1
}
