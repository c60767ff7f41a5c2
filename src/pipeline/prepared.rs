//! A clean mesh and its spectrum, from which every view is taken.

use super::{Description, PipelineError, Stage};
use crate::cancel::Cancel;
use crate::mesh::boundary::boundary_vertices;
use crate::mesh::refine::refine;
use crate::mesh::whiten::whiten;
use crate::mesh::{PrepareReport, TriMesh, TriangleSoup, prepare_until};
use crate::parameters::{Channel, Hypothesis, Parameters};
use crate::ranking::View;
use crate::signature::describe_vertices;
use crate::signature::descriptor::{Descriptor, DescriptorParameters, WksRange};
use crate::signature::normalise::normalise;
use crate::signature::sample::sample_by_area;
use crate::spectral::{
    EigenOptions, Eigenpairs, Operators, assemble, doubled_eigenpairs, smallest_eigenpairs,
};

/// A query with a boundary longer than this many √area is open: a single view has 8 to 16, a half sphere 2.507.
pub const OPEN_ABOVE: f64 = 2.5;
/// Full area over visible area, as assumed for an open query (method, step 10).
const AREA_SCALES: [f64; 4] = [2.0, 2.5, 3.0, 4.0];
/// How many eigenvalues a description reports.
const REPORTED_EIGENVALUES: usize = 20;
/// The grid that doubled surfaces and training shapes share: 100 energies from log 10 to log 3000, σ of 6 steps.
const FIXED_GRID: DescriptorParameters = DescriptorParameters {
    descriptor: Descriptor::Wks,
    dimension: 100,
    sigma_steps: 6.0,
    range: WksRange::Fixed {
        low: std::f64::consts::LN_10,
        high: 8.006_367_567_650_246,
    },
};

/// How many vertices a prepared mesh is refined to before its spectrum is solved for; 0 where it stays as it is.
///
/// An open mesh does: it is likely a part of a shape, and a part sampled as densely as the whole has the whole's
/// errors of discretisation, which a finer one has not.
pub fn refined_to(report: &PrepareReport, parameters: &Parameters) -> usize {
    let enough = report.vertices + report.holes_filled >= parameters.refine_below;
    if enough || report.openness > OPEN_ABOVE {
        0
    } else {
        parameters.refine_below
    }
}

/// Whether a query is compared as a part of a shape: it is open, and the parameters ask for that hypothesis.
///
/// Then all of its views are coded under the dictionaries of the fixed grid, so that the errors of the doubled surface
/// compare with those of the surface as it is; and it is not whitened, as a part's moments are not the whole's.
fn taken_as_part(report: &PrepareReport, parameters: &Parameters) -> bool {
    report.openness > OPEN_ABOVE && parameters.hypotheses.contains(&Hypothesis::Doubled)
}

/// A mesh with the spectra its views are taken from.
#[derive(Clone, Debug)]
pub struct PreparedShape {
    mesh: TriMesh,
    operators: Operators,
    eigenpairs: Eigenpairs,
    /// Of the whitened mesh, where it is wanted. Without it a query can still be compared.
    whitened: Option<Result<Eigenpairs, PipelineError>>,
    report: PrepareReport,
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
        parts_whitened: bool,
        cancel: &Cancel,
        observer: &dyn Fn(Stage),
    ) -> Result<Self, PipelineError> {
        observer(Stage::Prepare);
        let (mesh, report) = prepare_until(soup, &parameters.prepare_options(), cancel)?;
        let mesh = refine(mesh, refined_to(&report, parameters))?;
        cancel.check()?;
        observer(Stage::Laplacian);
        let operators = assemble(&mesh)?;
        observer(Stage::Eigenpairs);
        let solve = |operators: &Operators| {
            smallest_eigenpairs(operators, parameters.eigenpairs, &EigenOptions::default(), cancel)
        };
        let whitened = parameters.hypotheses.contains(&Hypothesis::Whitened)
            && (parts_whitened || !taken_as_part(&report, parameters));
        let (eigenpairs, whitened) = if whitened {
            let (plain, whitened) = rayon::join(
                || solve(&operators),
                || -> Result<Eigenpairs, PipelineError> { Ok(solve(&assemble(&whiten(&mesh)?)?)?) },
            );
            (plain?, Some(whitened))
        } else {
            (solve(&operators)?, None)
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

    /// The plain view's eigenpairs.
    pub fn eigenpairs(&self) -> &Eigenpairs {
        &self.eigenpairs
    }

    /// The views of a training shape: one per channel.
    pub fn training_views(&self, parameters: &Parameters) -> Result<Vec<View>, PipelineError> {
        let vertices = self.sample(parameters.samples_per_shape, parameters.seed);
        let mut views = Vec::new();
        for hypothesis in &parameters.hypotheses {
            match hypothesis {
                Hypothesis::Plain => views.push(self.plain(&vertices, parameters)?),
                Hypothesis::Whitened => views.extend(self.whitened(&vertices, parameters)?),
                Hypothesis::Doubled => {
                    views.push(self.fixed_grid(&vertices, parameters, Hypothesis::Doubled)?);
                }
            }
        }
        Ok(views)
    }

    /// The views of a query: one per hypothesis and assumed area. A hypothesis other than the plain one that fails is
    /// left out, with a warning in the report.
    ///
    /// # Errors
    /// That of the plain view, or [`PipelineError::Cancelled`].
    pub fn query_views(
        &mut self,
        parameters: &Parameters,
        cancel: &Cancel,
    ) -> Result<Vec<View>, PipelineError> {
        let vertices = self.sample(parameters.query_samples, parameters.seed);
        let part = taken_as_part(&self.report, parameters);
        let mut views = Vec::new();
        for hypothesis in &parameters.hypotheses {
            let (seen, what) = match hypothesis {
                Hypothesis::Plain => {
                    views.push(if part {
                        self.fixed_grid(&vertices, parameters, Hypothesis::Plain)?
                    } else {
                        self.plain(&vertices, parameters)?
                    });
                    continue;
                }
                Hypothesis::Whitened if part => continue,
                Hypothesis::Whitened => {
                    let whitened = self.whitened(&vertices, parameters);
                    (whitened.map(Vec::from_iter), "affinely normalised")
                }
                Hypothesis::Doubled if part => (self.doubled(&vertices, parameters, cancel), "as a part"),
                Hypothesis::Doubled => continue,
            };
            match seen {
                Ok(seen) => views.extend(seen),
                Err(PipelineError::Cancelled(cancelled)) => return Err(cancelled.into()),
                Err(error) => {
                    let warning = format!("The shape was not compared {what}: {error}.");
                    self.report.warnings.push(warning);
                }
            }
        }
        Ok(views)
    }

    /// Vertices that give signatures: those on the file's surface, at most `count` of them, drawn by area.
    pub fn sample(&self, count: usize, seed: u64) -> Vec<u32> {
        sample_by_area(
            &self.operators.mass[..self.mesh.signature_vertices()],
            count,
            seed,
        )
    }

    fn plain(&self, vertices: &[u32], parameters: &Parameters) -> Result<View, PipelineError> {
        view(
            &self.eigenpairs,
            vertices,
            parameters,
            Hypothesis::Plain,
            Channel::Plain,
            1.0,
        )
    }

    fn fixed_grid(
        &self,
        vertices: &[u32],
        parameters: &Parameters,
        hypothesis: Hypothesis,
    ) -> Result<View, PipelineError> {
        view(
            &self.eigenpairs,
            vertices,
            parameters,
            hypothesis,
            Channel::FixedGrid,
            1.0,
        )
    }

    fn whitened(&self, vertices: &[u32], parameters: &Parameters) -> Result<Option<View>, PipelineError> {
        self.whitened
            .as_ref()
            .map(|eigenpairs| {
                view(
                    eigenpairs.as_ref().map_err(PipelineError::clone)?,
                    vertices,
                    parameters,
                    Hypothesis::Whitened,
                    Channel::Whitened,
                    1.0,
                )
            })
            .transpose()
    }

    /// One view per assumed area: the doubled surface has area 1, so a full area of s times the visible half's
    /// multiplies its eigenvalues by s/2.
    fn doubled(
        &self,
        vertices: &[u32],
        parameters: &Parameters,
        cancel: &Cancel,
    ) -> Result<Vec<View>, PipelineError> {
        let boundary = boundary_vertices(&self.mesh);
        let options = EigenOptions::default();
        let doubled = doubled_eigenpairs(
            &self.operators,
            &self.eigenpairs,
            &boundary,
            parameters.eigenpairs,
            &options,
            cancel,
        )?;
        AREA_SCALES
            .iter()
            .map(|&scale| {
                let mut scaled = doubled.clone();
                scaled.values.iter_mut().for_each(|v| *v *= scale / 2.0);
                view(
                    &scaled,
                    vertices,
                    parameters,
                    Hypothesis::Doubled,
                    Channel::FixedGrid,
                    scale,
                )
            })
            .collect()
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

/// Signals of the given vertices, normalised.
fn view(
    eigenpairs: &Eigenpairs,
    vertices: &[u32],
    parameters: &Parameters,
    hypothesis: Hypothesis,
    channel: Channel,
    area_scale: f64,
) -> Result<View, PipelineError> {
    let descriptor = match channel {
        Channel::FixedGrid => FIXED_GRID,
        Channel::Plain | Channel::Whitened => parameters.descriptor_parameters(),
    };
    let mut signatures = describe_vertices(eigenpairs, vertices, &descriptor)?;
    normalise(&mut signatures, parameters.normalisation);
    Ok(View {
        hypothesis,
        channel,
        area_scale,
        signatures,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cancel::Cancelled;
    use crate::parameters::Preset;
    use crate::spectral::SpectralError;
    use std::f64::consts::TAU;

    /// A torus of 30 × 60 vertices, uneven enough to have no multiple eigenvalues.
    fn torus() -> TriangleSoup {
        let mut soup = TriangleSoup::default();
        for i in 0..60u32 {
            for j in 0..30u32 {
                let (u, v) = (TAU * f64::from(i) / 60.0, TAU * f64::from(j) / 30.0);
                let r = 1.0 + (0.4 + 0.05 * (3.0 * u).sin()) * v.cos();
                soup.vertices
                    .push([1.3 * r * u.cos(), r * u.sin(), 0.4 * v.sin()]);
                let at = |i: u32, j: u32| i % 60 * 30 + j % 30;
                soup.faces.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
                soup.faces.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
            }
        }
        soup
    }

    #[test]
    fn a_query_is_compared_without_a_hypothesis_that_fails() {
        let parameters = Parameters::preset(Preset::Robust);
        let mut shape = PreparedShape::new(torus(), &parameters, &Cancel::new(), &|_| ()).unwrap();
        let hypotheses = |views: &[View]| views.iter().map(|view| view.hypothesis).collect::<Vec<_>>();
        let views = shape.query_views(&parameters, &Cancel::new()).unwrap();
        assert_eq!(hypotheses(&views), [Hypothesis::Plain, Hypothesis::Whitened]);
        assert!(shape.report.warnings.is_empty(), "{:?}", shape.report.warnings);

        let failed = SpectralError::NotConverged {
            detail: "a test".to_owned(),
        };
        shape.whitened = Some(Err(failed.clone().into()));
        let views = shape.query_views(&parameters, &Cancel::new()).unwrap();
        assert_eq!(hypotheses(&views), [Hypothesis::Plain]);
        assert!(shape.report.warnings[0].contains("affinely normalised") && shape.report.warnings.len() == 1);
        // A training shape needs every channel.
        assert_eq!(shape.training_views(&parameters).unwrap_err(), failed.into());

        shape.whitened = Some(Err(Cancelled.into()));
        let stopped = shape.query_views(&parameters, &Cancel::new());
        assert_eq!(stopped.unwrap_err(), Cancelled.into());
    }
}
