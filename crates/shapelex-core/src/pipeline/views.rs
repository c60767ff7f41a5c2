//! Spectra → the ways a shape is seen, as one that trains and as a query (docs/method.md#hypotheses).

use super::fixed_grid::{AREA_SCALES, fixed_grid};
use super::prepared::taken_as_part;
use super::{PipelineError, PreparedShape};
use crate::cancel::Cancel;
use crate::parameters::{Channel, Hypothesis, Parameters};
use crate::ranking::View;
use crate::signature::describe_vertices;
use crate::signature::descriptor::DescriptorParameters;
use crate::signature::normalise::normalise;
use crate::spectral::Eigenpairs;

/// How many eigenpairs the signatures of a channel are built from, and their descriptor.
pub fn channel_descriptor(channel: Channel, parameters: &Parameters) -> (usize, DescriptorParameters) {
    match channel {
        Channel::FixedGrid => (parameters.part_eigenpairs, fixed_grid(parameters.part_eigenpairs)),
        Channel::Plain | Channel::Whitened => (parameters.eigenpairs, parameters.descriptor_parameters()),
    }
}

/// How a view sees the shape.
struct Seen {
    hypothesis: Hypothesis,
    channel: Channel,
    /// Full area over visible area that is assumed.
    area_scale: f64,
}

impl PreparedShape {
    /// The views of a training shape: one per channel. One that is a part is doubled, as a query is; its full area is
    /// not known either, so the fixed grid gets a view for each that is assumed, of a share of the vertices.
    ///
    /// # Errors
    /// That of a hypothesis's spectrum, or [`PipelineError::Cancelled`].
    pub fn training_views(
        &self,
        parameters: &Parameters,
        cancel: &Cancel,
    ) -> Result<Vec<View>, PipelineError> {
        let vertices = self.sample(parameters.samples_per_shape, parameters.seed);
        let doubled = taken_as_part(&self.report, parameters)
            .then(|| self.doubled_eigenpairs(parameters, cancel))
            .transpose()?;
        let mut views = Vec::new();
        for hypothesis in &parameters.hypotheses {
            match (hypothesis, &doubled) {
                (Hypothesis::Plain, doubled) => {
                    views.push(self.plain(&vertices, parameters)?);
                    if let Some(doubled) = doubled {
                        views.push(self.view(
                            doubled,
                            &vertices,
                            parameters,
                            Seen {
                                hypothesis: Hypothesis::Doubled,
                                channel: Channel::Plain,
                                area_scale: AREA_SCALES[0],
                            },
                        )?);
                    }
                }
                (Hypothesis::Whitened, _) => views.extend(self.whitened(&vertices, parameters)?),
                (Hypothesis::Doubled, Some(doubled)) => {
                    let share = |i: usize| every(AREA_SCALES.len(), i, &vertices);
                    views.extend(self.by_area(doubled, share, parameters)?);
                }
                (Hypothesis::Doubled, None) => {
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
                Hypothesis::Doubled if part => {
                    let doubled = self.doubled_eigenpairs(parameters, cancel);
                    let seen = doubled.and_then(|d| self.by_area(&d, |_| vertices.clone(), parameters));
                    (seen, "as a part")
                }
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

    /// The plain view of a training shape, which is the first of [`training_views`](Self::training_views).
    ///
    /// # Errors
    /// [`PipelineError::Spectral`] where the spectrum is too short.
    pub fn training_plain(&self, parameters: &Parameters) -> Result<View, PipelineError> {
        let vertices = self.sample(parameters.samples_per_shape, parameters.seed);
        self.plain(&vertices, parameters)
    }

    fn plain(&self, vertices: &[u32], parameters: &Parameters) -> Result<View, PipelineError> {
        self.view(
            &self.eigenpairs,
            vertices,
            parameters,
            Seen {
                hypothesis: Hypothesis::Plain,
                channel: Channel::Plain,
                area_scale: 1.0,
            },
        )
    }

    fn fixed_grid(
        &self,
        vertices: &[u32],
        parameters: &Parameters,
        hypothesis: Hypothesis,
    ) -> Result<View, PipelineError> {
        self.view(
            &self.eigenpairs,
            vertices,
            parameters,
            Seen {
                hypothesis,
                channel: Channel::FixedGrid,
                area_scale: 1.0,
            },
        )
    }

    fn whitened(&self, vertices: &[u32], parameters: &Parameters) -> Result<Option<View>, PipelineError> {
        self.whitened
            .as_ref()
            .map(|eigenpairs| {
                self.view(
                    eigenpairs.as_ref().map_err(PipelineError::clone)?,
                    vertices,
                    parameters,
                    Seen {
                        hypothesis: Hypothesis::Whitened,
                        channel: Channel::Whitened,
                        area_scale: 1.0,
                    },
                )
            })
            .transpose()
    }

    /// One view per assumed area, of the vertices named for its number: the doubled surface has area 1, so a full area of s
    /// times the visible half's multiplies its eigenvalues by s/2.
    fn by_area(
        &self,
        doubled: &Eigenpairs,
        vertices: impl Fn(usize) -> Vec<u32>,
        parameters: &Parameters,
    ) -> Result<Vec<View>, PipelineError> {
        let mut scaled = doubled.clone();
        AREA_SCALES
            .iter()
            .enumerate()
            .map(|(i, &scale)| {
                for (value, unscaled) in scaled.values.iter_mut().zip(&doubled.values) {
                    *value = unscaled * (scale / 2.0);
                }
                self.view(
                    &scaled,
                    &vertices(i),
                    parameters,
                    Seen {
                        hypothesis: Hypothesis::Doubled,
                        channel: Channel::FixedGrid,
                        area_scale: scale,
                    },
                )
            })
            .collect()
    }

    /// Signals of the given vertices, normalised.
    fn view(
        &self,
        eigenpairs: &Eigenpairs,
        vertices: &[u32],
        parameters: &Parameters,
        seen: Seen,
    ) -> Result<View, PipelineError> {
        let Seen {
            hypothesis,
            channel,
            area_scale,
        } = seen;
        let (n, descriptor) = channel_descriptor(channel, parameters);
        let mut signatures = describe_vertices(&eigenpairs.first(n), vertices, &descriptor)?;
        normalise(&mut signatures, parameters.normalisation);
        Ok(View {
            hypothesis,
            channel,
            area_scale,
            bounded: self.report.openness > 0.0,
            signatures,
        })
    }
}

/// Every `n`-th vertex from the `first`; all of them where there are fewer than `n`.
fn every(n: usize, first: usize, vertices: &[u32]) -> Vec<u32> {
    if vertices.len() < n {
        return vertices.to_vec();
    }
    vertices.iter().copied().skip(first).step_by(n).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cancel::Cancelled;
    use crate::mesh::TriangleSoup;
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
        assert_eq!(
            shape.training_views(&parameters, &Cancel::new()).unwrap_err(),
            failed.into()
        );

        shape.whitened = Some(Err(Cancelled.into()));
        let stopped = shape.query_views(&parameters, &Cancel::new());
        assert_eq!(stopped.unwrap_err(), Cancelled.into());
    }
}
