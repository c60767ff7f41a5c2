//! The query as a use case.

use super::judge::judged_by;
use super::{AtDeadline, Deadline, QueryError, QueryOutcome, RankingMethod, SearchIndex};
use crate::baseline::Baseline;
use crate::memory::{MemoryBudget, Reservation};
use crate::mesh::TriangleSoup;
use crate::parameters::RankBy;
use crate::pipeline::estimate::{self, Role};
use crate::pipeline::{
    Description, PipelineError, Stage, Within, describe_plain_within, describe_query_within,
};
use crate::ranking::{JUDGED, NotJudged, rank, rank_top, rank_until};
use std::collections::BTreeSet;

/// What is asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct QuerySpec {
    /// What the classes are ordered by.
    pub method: RankingMethod,
    /// How many classes and shapes are asked for; all where it is `None`. At least [`JUDGED`] are ranked, as the verdict
    /// is about these.
    pub top: Option<usize>,
}

/// Answers queries. A stage that begins is reported to `observer`, so that a caller with a clock can time it.
pub struct QueryEngine<'a> {
    /// Called at the beginning of every stage.
    pub observer: &'a dyn Fn(Stage),
    /// The memory that is granted to the query, reserved before it is taken and given back at the end; it is not limited
    /// where this is `None`.
    pub memory: Option<&'a Reservation>,
}

/// What ranking is asked for, and what it may take.
#[derive(Clone, Copy, Debug)]
struct Terms<'a> {
    top: Option<usize>,
    within: Within<'a>,
    then: AtDeadline,
}

impl Default for QueryEngine<'_> {
    /// Reports no stage, and takes any memory.
    fn default() -> Self {
        Self {
            observer: &|_| (),
            memory: None,
        }
    }
}

impl QueryEngine<'_> {
    /// Describes a mesh, ranks the classes of the index for it and judges the ranking.
    ///
    /// # Errors
    /// [`QueryError::EmptyIndex`] without classes; [`QueryError::NoBaselines`] where a baseline is asked for and the index
    /// has nothing for it; [`QueryError::NothingScored`] where the deadline passes before any class is scored;
    /// [`QueryError::Pipeline`] where a stage fails or the query is cancelled.
    pub fn run(
        &self,
        index: &SearchIndex,
        mesh: TriangleSoup,
        spec: &QuerySpec,
        deadline: &Deadline,
    ) -> Result<QueryOutcome, QueryError> {
        if index.dictionaries.classes.is_empty() {
            return Err(QueryError::EmptyIndex);
        }
        let unlimited = MemoryBudget::unlimited().reservation();
        let within = Within {
            cancel: &deadline.passed,
            memory: self.memory.unwrap_or(&unlimited),
        };
        let answered = match spec.method {
            RankingMethod::SparseCoding(rank_by) => {
                let terms = Terms {
                    top: spec.top,
                    within,
                    then: deadline.then,
                };
                self.code(index, mesh, rank_by, &terms)
            }
            RankingMethod::Baseline(baseline) => self.compare(index, mesh, baseline, within),
        };
        answered.map_err(|error| match deadline.then {
            AtDeadline::BestSoFar if error.is_cancelled() => QueryError::NothingScored,
            _ => error,
        })
    }

    /// Ranks by sparse coding.
    fn code(
        &self,
        index: &SearchIndex,
        mesh: TriangleSoup,
        rank_by: RankBy,
        terms: &Terms<'_>,
    ) -> Result<QueryOutcome, QueryError> {
        let Terms { top, within, then } = *terms;
        let (dictionaries, passed) = (&index.dictionaries, within.cancel);
        let parameters = &dictionaries.parameters;
        let description = describe_query_within(mesh, parameters, within, self.observer)?;
        let bytes = ranking_bytes(&description, index);
        let _ranking = within.memory.hold(bytes).map_err(PipelineError::from)?;
        (self.observer)(Stage::Ranking);
        let views = &description.views;
        let ranking = match (then, top) {
            (AtDeadline::BestSoFar, _) => rank_until(views, dictionaries, rank_by, passed),
            (AtDeadline::Fail, Some(top)) => rank_top(views, dictionaries, rank_by, top.max(JUDGED), passed),
            (AtDeadline::Fail, None) => rank(views, dictionaries, rank_by, passed),
        }?;
        let calibration = match ranking.not_compared.is_empty() {
            true => judged_by(&index.calibration, parameters, rank_by, &description),
            false => Err(NotJudged::Partial),
        };
        Ok(QueryOutcome::coded(description, ranking, calibration, |label| {
            index.name(label).to_owned()
        }))
    }

    /// Ranks by the distance to the nearest training shape.
    fn compare(
        &self,
        index: &SearchIndex,
        mesh: TriangleSoup,
        baseline: Baseline,
        within: Within<'_>,
    ) -> Result<QueryOutcome, QueryError> {
        let baselines = index.baselines.as_ref().ok_or(QueryError::NoBaselines)?;
        let parameters = &index.dictionaries.parameters;
        let description = describe_plain_within(mesh, parameters, within, self.observer)?;
        (self.observer)(Stage::Ranking);
        let nearest = baselines
            .nearest(&description, baseline)
            .ok_or(QueryError::NoBaselines)?;
        let known: BTreeSet<&str> = nearest.iter().map(|shape| shape.class.as_str()).collect();
        let labels = index.dictionaries.classes.iter().map(|class| &class.label);
        let unknown = labels.filter(|l| !known.contains(l.as_str())).cloned().collect();
        Ok(QueryOutcome::nearest(description, nearest, unknown, |label| {
            index.name(label).to_owned()
        }))
    }
}

/// Memory that ranking a description takes with its views, in bytes. The spectra are gone then.
fn ranking_bytes(description: &Description, index: &SearchIndex) -> u64 {
    let parameters = &index.dictionaries.parameters;
    let largest = (index.dictionaries.classes.iter())
        .flat_map(|class| class.dictionaries.values())
        .map(|dictionary| dictionary.len())
        .max();
    let prepared = description.report.vertices + description.report.holes_filled;
    let vertices = description.report.refined_to.unwrap_or(prepared);
    let threads = rayon::current_num_threads();
    estimate::ranking_bytes(vertices, largest.unwrap_or(0), threads, parameters)
        + estimate::description_bytes(vertices, parameters, Role::Query)
}
