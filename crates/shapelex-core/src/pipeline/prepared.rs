//! A clean mesh and its spectra, from which every view is taken.

use super::estimate::{self, Role};
use super::{Description, PipelineError, Stage, Within};
use crate::cancel::Cancel;
use crate::memory::MemoryBudget;
use crate::mesh::boundary::{boundary_vertices, smooth_boundary};
use crate::mesh::edges::separator_excess;
use crate::mesh::refine::refine_until;
use crate::mesh::whiten::whiten;
use crate::mesh::{PrepareReport, TriMesh, TriangleSoup, prepare_within};
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

/// A mesh whose spectra can be solved for.
#[derive(Clone, Debug)]
pub(super) struct CleanShape {
    mesh: TriMesh,
    report: PrepareReport,
    role: Role,
}

impl CleanShape {
    /// Cleans a mesh, and refines one that is too coarse.
    ///
    /// # Errors
    /// [`PipelineError::Mesh`], [`PipelineError::Cancelled`].
    pub fn new(
        soup: TriangleSoup,
        parameters: &Parameters,
        role: Role,
        within: Within<'_>,
        observer: &dyn Fn(Stage),
    ) -> Result<Self, PipelineError> {
        observer(Stage::Prepare);
        let (mesh, mut report) =
            prepare_within(soup, &parameters.prepare_options(), within.cancel, within.memory)?;
        let mesh = if taken_as_part(&report, parameters) {
            smooth_boundary(mesh)?
        } else {
            let coarse = mesh.vertices().len();
            let mesh = refine_until(mesh, refined_to(&report, parameters), within.cancel)?;
            report.refined_to = Some(mesh.vertices().len()).filter(|fine| *fine > coarse);
            mesh
        };
        within.cancel.check()?;
        Ok(Self { mesh, report, role })
    }

    /// Bytes at the peak of what follows, with what the factorisation takes on a mesh that is no surface.
    ///
    /// # Errors
    /// [`PipelineError::Mesh`] where there is no memory to look at the edges, [`PipelineError::Cancelled`].
    pub fn bytes(&self, parameters: &Parameters, within: Within<'_>) -> Result<u64, PipelineError> {
        let excess = separator_excess(&self.mesh, within.cancel, within.memory)?;
        let vertices = self.mesh.vertices().len();
        Ok(
            estimate::prepared_describing_bytes(vertices, parameters, self.role)
                + estimate::factor_excess_bytes(vertices, excess, parameters),
        )
    }

    /// Solves for the spectra; what the views of a query do not need is not solved for.
    ///
    /// # Errors
    /// [`PipelineError::Spectral`], [`PipelineError::Cancelled`].
    pub fn solve(
        self,
        parameters: &Parameters,
        cancel: &Cancel,
        observer: &dyn Fn(Stage),
    ) -> Result<PreparedShape, PipelineError> {
        let Self { mesh, report, role } = self;
        let part = taken_as_part(&report, parameters);
        let training = role == Role::Training;
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
        Ok(PreparedShape {
            mesh,
            operators,
            eigenpairs,
            whitened,
            report,
        })
    }
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
        let memory = MemoryBudget::unlimited().reservation();
        let within = Within {
            cancel,
            memory: &memory,
        };
        CleanShape::new(soup, parameters, Role::Training, within, observer)?
            .solve(parameters, cancel, observer)
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
