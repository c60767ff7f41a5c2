//! The query as a use case.

use super::judge::judged_by;
use super::{AtDeadline, Deadline, QueryError, QueryOutcome, RankingMethod, SearchIndex};
use crate::baseline::Baseline;
use crate::mesh::TriangleSoup;
use crate::parameters::RankBy;
use crate::pipeline::estimate::{self, Role};
use crate::pipeline::{Stage, describe_plain, describe_query};
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
}

impl Default for QueryEngine<'_> {
    /// Reports no stage.
    fn default() -> Self {
        Self { observer: &|_| () }
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
        let answered = match spec.method {
            RankingMethod::SparseCoding(rank_by) => self.code(index, mesh, rank_by, spec.top, deadline),
            RankingMethod::Baseline(baseline) => self.compare(index, mesh, baseline, deadline),
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
        top: Option<usize>,
        deadline: &Deadline,
    ) -> Result<QueryOutcome, QueryError> {
        let (dictionaries, passed) = (&index.dictionaries, &deadline.passed);
        let parameters = &dictionaries.parameters;
        let description = describe_query(mesh, parameters, passed, self.observer)?;
        (self.observer)(Stage::Ranking);
        let views = &description.views;
        let ranking = match (deadline.then, top) {
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
        deadline: &Deadline,
    ) -> Result<QueryOutcome, QueryError> {
        let baselines = index.baselines.as_ref().ok_or(QueryError::NoBaselines)?;
        let parameters = &index.dictionaries.parameters;
        let description = describe_plain(mesh, parameters, &deadline.passed, self.observer)?;
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

    /// Memory that a query takes beside its mesh, in bytes, on a pool of `threads`: what a caller with a memory budget
    /// reserves before it calls [`run`](Self::run).
    pub fn bytes(index: &SearchIndex, mesh: &TriangleSoup, threads: usize) -> u64 {
        let (vertices, parameters) = (mesh.vertices.len(), &index.dictionaries.parameters);
        let largest = (index.dictionaries.classes.iter())
            .flat_map(|class| class.dictionaries.values())
            .map(|dictionary| dictionary.len())
            .max();
        let preparing = estimate::preparing_bytes(vertices, mesh.faces.len());
        let describing = estimate::describing_bytes(vertices, parameters, Role::Query);
        let ranking = estimate::ranking_bytes(vertices, largest.unwrap_or(0), threads, parameters);
        let prepared = estimate::prepared_vertices(vertices, parameters);
        let views = estimate::description_bytes(prepared, parameters, Role::Query);
        // The views are held while they are ranked; the spectra are gone then.
        preparing.max(describing).max(ranking + views)
    }
}
