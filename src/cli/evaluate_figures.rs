//! The figures of an evaluation as files.

use super::evaluate_describe::poses_of;
use super::folders::LabelledFile;
use super::{CliError, figures};
use shapelex_core::mesh::TriangleSoup;
use shapelex_eval::benchmark::retrieval::RetrievalOutcome;
use shapelex_eval::benchmark::{Evaluation, OpenSet, QueryResult};
use shapelex_eval::figure::{
    WorstQuery, evaluation_figures, open_set_figure, retrieval_figure, worst_queries,
};
use std::path::Path;

/// Queries that are shown in pictures.
const PICTURES: usize = 6;

/// Where figures go, and where their meshes come from.
pub struct Figures<'a> {
    dir: Option<&'a Path>,
    poses: Option<usize>,
    files: &'a [LabelledFile],
}

impl<'a> Figures<'a> {
    /// Makes the folder, where figures are wanted: better now than after an hour.
    ///
    /// # Errors
    /// [`CliError::Failed`] where it cannot be made.
    pub fn new(
        dir: Option<&'a Path>,
        poses: Option<usize>,
        files: &'a [LabelledFile],
    ) -> Result<Self, CliError> {
        if let Some(dir) = dir {
            std::fs::create_dir_all(dir).map_err(|error| CliError::at(dir, error))?;
        }
        Ok(Self { dir, poses, files })
    }

    /// Those of a protocol, the worst queries among them.
    ///
    /// # Errors
    /// [`CliError::Failed`] where one cannot be drawn or written.
    pub fn evaluation(&self, evaluation: &Evaluation) -> Result<(), CliError> {
        let Some(dir) = self.dir else { return Ok(()) };
        let mut sheets = evaluation_figures(evaluation)?;
        let worst: Vec<WorstQuery> = evaluation
            .queries
            .iter()
            .take(PICTURES)
            .map(|q| self.picture(q))
            .collect();
        sheets.push(worst_queries(evaluation.protocol.name(), worst)?);
        figures::write(dir, &sheets)
    }

    /// Precision over recall, where shapes were asked for that have others of their class.
    ///
    /// # Errors
    /// As [`Figures::evaluation`].
    pub fn retrieval(&self, outcome: &RetrievalOutcome) -> Result<(), CliError> {
        match self.dir {
            Some(dir) if outcome.total > 0 => figures::write(dir, &[retrieval_figure(outcome)?]),
            _ => Ok(()),
        }
    }

    /// Coverage over level, where answers were judged.
    ///
    /// # Errors
    /// As [`Figures::evaluation`].
    pub fn open_set(&self, outcome: Option<&OpenSet>) -> Result<(), CliError> {
        match (self.dir, outcome) {
            (Some(dir), Some(outcome)) => figures::write(dir, &[open_set_figure(outcome)?]),
            _ => Ok(()),
        }
    }

    fn picture(&self, query: &QueryResult) -> WorstQuery {
        let answered = query.ranked.first().map_or("", |(class, _)| class.as_str());
        let other = |class: &str| self.mesh(class, |name| name != query.name || class != query.class);
        let stem = query
            .name
            .rsplit_once('.')
            .map_or(query.name.as_str(), |(stem, _)| stem);
        WorstQuery {
            label: if answered == query.class {
                stem.to_owned()
            } else {
                format!("{stem} as {answered}")
            },
            query: self.mesh(&query.class, |name| name == query.name),
            answered: other(answered),
            own: other(&query.class),
        }
    }

    /// The first mesh of a class whose name fits; none where its file can no longer be read.
    fn mesh(&self, class: &str, fits: impl Fn(&str) -> bool) -> Option<TriangleSoup> {
        let of_class = self.files.iter().filter(|file| file.class == class);
        of_class
            .filter_map(|file| poses_of(file, self.poses).ok())
            .flatten()
            .find(|(name, _)| fits(name))
            .map(|(_, soup)| soup)
    }
}
