//! A clean mesh and its spectra, from which every view is taken.

use super::{Description, PipelineError, Stage};
use crate::cancel::Cancel;
use crate::mesh::boundary::{boundary_vertices, smooth_boundary};
use crate::mesh::refine::refine_until;
use crate::mesh::whiten::whiten;
use crate::mesh::{PrepareReport, TriMesh, TriangleSoup, prepare_until};
use crate::parameters::{Hypothesis, Parameters};
use crate::ranking::View;
use crate::signature::sample::sample_by_area;
use crate::spectral::{
    EigenOptions, Eigenpairs, Operators, assemble, doubled_eigenpairs, smallest_eigenpairs,
};

/// How many eigenvalues a description reports.
const REPORTED_EIGENVALUES: usize = 20;

/// How many vertices a prepared mesh is refined to before its spectrum is solved for; 0 where it stays as it is.
///
/// An open mesh does: it is likely a part of a shape, and a part sampled as densely as the whole has the whole's
/// errors of discretisation, which a finer one has not.
pub fn refined_to(report: &PrepareReport, parameters: &Parameters) -> usize {
    let enough = report.vertices + report.holes_filled >= parameters.refine_below;
    if enough || report.is_open() {
        0
    } else {
        parameters.refine_below
    }
}

/// Whether a query is compared as a part of a shape: it is open, and the parameters ask for that hypothesis.
///
/// Then all of its views are coded under the dictionaries of the fixed grid, so that the errors of the doubled surface
/// compare with those of the surface as it is; and it is not whitened, as a part's moments are not the whole's.
pub fn taken_as_part(report: &PrepareReport, parameters: &Parameters) -> bool {
    report.is_open() && parameters.hypotheses.contains(&Hypothesis::Doubled)
}

/// A mesh with the spectra its views are taken from.
#[derive(Clone, Debug)]
pub struct PreparedShape {
    mesh: TriMesh,
    operators: Operators,
    pub(super) eigenpairs: Eigenpairs,
    /// Of the whitened mesh, where it is wanted. Without it a query can still be compared.
    pub(super) whitened: Option<Result<Eigenpairs, PipelineError>>,
    pub(super) report: PrepareReport,
}

impl PreparedShape {
    /// Cleans a mesh and solves for its spectrum; with the whitened hypothesis also for the whitened mesh's, at the
    /// same time where the thread pool has room. For a training shape, which may be a query too.
    ///
    /// # Errors
    /// The error of the stage that failed, or [`PipelineError::Cancelled`].
    pub fn new(
        soup: TriangleSoup,
        parameters: &Parameters,
        cancel: &Cancel,
        observer: &dyn Fn(Stage),
    ) -> Result<Self, PipelineError> {
        Self::solve(soup, parameters, true, cancel, observer)
    }

    /// As [`new`](Self::new), for a query: what its views do not need is not solved for.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn query(
        soup: TriangleSoup,
        parameters: &Parameters,
        cancel: &Cancel,
        observer: &dyn Fn(Stage),
    ) -> Result<Self, PipelineError> {
        Self::solve(soup, parameters, false, cancel, observer)
    }

    fn solve(
        soup: TriangleSoup,
        parameters: &Parameters,
        training: bool,
        cancel: &Cancel,
        observer: &dyn Fn(Stage),
    ) -> Result<Self, PipelineError> {
        observer(Stage::Prepare);
        let (mesh, mut report) = prepare_until(soup, &parameters.prepare_options(), cancel)?;
        let part = taken_as_part(&report, parameters);
        let mesh = if part {
            smooth_boundary(mesh)?
        } else {
            let coarse = mesh.vertices().len();
            let mesh = refine_until(mesh, refined_to(&report, parameters), cancel)?;
            report.refined_to = Some(mesh.vertices().len()).filter(|fine| *fine > coarse);
            mesh
        };
        cancel.check()?;
        observer(Stage::Laplacian);
        let operators = assemble(&mesh)?;
        observer(Stage::Eigenpairs);
        let solve = |operators: &Operators, n: usize| {
            smallest_eigenpairs(operators, n, &EigenOptions::default(), cancel)
        };
        let on_fixed_grid = part || (training && parameters.hypotheses.contains(&Hypothesis::Doubled));
        let n = if on_fixed_grid {
            parameters.eigenpairs.max(parameters.part_eigenpairs)
        } else {
            parameters.eigenpairs
        };
        let whitened = parameters.hypotheses.contains(&Hypothesis::Whitened) && (training || !part);
        let (eigenpairs, whitened) = if whitened {
            let (plain, whitened) = rayon::join(
                || solve(&operators, n),
                || -> Result<Eigenpairs, PipelineError> {
                    Ok(solve(&assemble(&whiten(&mesh)?)?, parameters.eigenpairs)?)
                },
            );
            (plain?, Some(whitened))
        } else {
            (solve(&operators, n)?, None)
        };
        observer(Stage::Signatures);
        Ok(Self {
            mesh,
            operators,
            eigenpairs,
            whitened,
            report,
        })
    }

    /// What preparing did.
    pub fn report(&self) -> &PrepareReport {
        &self.report
    }

    /// How many vertices, counted from the first, carry signatures.
    pub fn signature_vertices(&self) -> usize {
        self.mesh.signature_vertices()
    }

    /// The eigenpairs of the surface: those of the plain view first, then what the fixed grid needs beyond.
    pub fn eigenpairs(&self) -> &Eigenpairs {
        &self.eigenpairs
    }

    /// Vertices that give signatures: those on the file's surface, at most `count` of them, drawn by area.
    pub fn sample(&self, count: usize, seed: u64) -> Vec<u32> {
        sample_by_area(
            &self.operators.mass[..self.mesh.signature_vertices()],
            count,
            seed,
        )
    }

    /// Eigenpairs of the surface with a mirrored copy glued on along its boundary, of area 1.
    pub(super) fn doubled_eigenpairs(
        &self,
        parameters: &Parameters,
        cancel: &Cancel,
    ) -> Result<Eigenpairs, PipelineError> {
        let boundary = boundary_vertices(&self.mesh);
        let doubled = doubled_eigenpairs(
            &self.operators,
            &self.eigenpairs,
            &boundary,
            parameters.eigenpairs.max(parameters.part_eigenpairs),
            &EigenOptions::default(),
            cancel,
        )?;
        Ok(doubled)
    }

    /// Keeps the views and what is reported, gives up the rest.
    pub fn into_description(self, views: Vec<View>) -> Description {
        let eigenvalues = self.first_eigenvalues();
        Description {
            views,
            report: self.report,
            eigenvalues,
        }
    }

    /// The first eigenvalues of the plain view, dimensionless.
    pub fn first_eigenvalues(&self) -> Vec<f64> {
        self.eigenpairs
            .values
            .iter()
            .take(REPORTED_EIGENVALUES)
            .copied()
            .collect()
    }
}
