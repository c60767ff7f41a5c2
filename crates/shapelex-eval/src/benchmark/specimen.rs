//! What a benchmark keeps of a mesh: spectra that several methods share, and the views of those that need more.
//!
//! Numbers are kept at single precision: half the memory and half the cache, and no count of ours changed by it.

use faer::Mat;
use serde::{Deserialize, Serialize};
use shapelex_core::cancel::Cancel;
use shapelex_core::mesh::{PrepareOptions, TriangleSoup, prepare};
use shapelex_core::parameters::{Channel, Hypothesis, Parameters};
use shapelex_core::pipeline::prepared::{refined_to, taken_as_part};
use shapelex_core::pipeline::{Description, PipelineError, PreparedShape};
use shapelex_core::ranking::View;
use shapelex_core::signature::normalise::normalise;
use shapelex_core::signature::{Signatures, describe_vertices};
use shapelex_core::spectral::{Eigenpairs, SpectralError};

/// Eigenpairs at single precision.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Spectrum {
    /// n eigenvalues.
    pub values: Vec<f64>,
    /// V × n, column by column, of the vertices that carry signatures.
    vectors: Vec<f32>,
    vertices: usize,
}

/// A view at single precision.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct StoredView {
    hypothesis: Hypothesis,
    channel: Channel,
    area_scale: f64,
    bounded: bool,
    vertices: Vec<u32>,
    /// M × N, column by column.
    values: Vec<f32>,
}

/// How one set of parameters sees a mesh.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
enum Seen {
    /// By the plain hypothesis only: its views follow from a spectrum.
    Plain {
        spectrum: usize,
        training: Vec<u32>,
        query: Vec<u32>,
        bounded: bool,
    },
    /// By several.
    Views {
        training: Vec<StoredView>,
        query: Vec<StoredView>,
    },
}

/// A mesh, described for several sets of parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Specimen {
    spectra: Vec<Spectrum>,
    seen: Vec<Seen>,
    /// The spectrum of the mesh as the paper prepares it, which the baselines use.
    literal: Option<usize>,
}

/// A spectrum solved for, with what it was prepared with.
struct Solved {
    options: PrepareOptions,
    refined_to: usize,
    part: bool,
    eigenpairs: usize,
    on_fixed_grid: usize,
    whitened: bool,
    shape: PreparedShape,
}

impl Specimen {
    /// Describes a mesh once for all of `coding`, and for baselines on the mesh that `literal` prepares. A spectrum is
    /// solved for once per different mesh that preparing gives.
    ///
    /// # Errors
    /// The error of the stage that failed, or [`PipelineError::Cancelled`].
    pub fn describe(
        soup: &TriangleSoup,
        coding: &[Parameters],
        literal: Option<&Parameters>,
        cancel: &Cancel,
    ) -> Result<Self, PipelineError> {
        let mut solved: Vec<Solved> = Vec::new();
        let mut spectra = Vec::new();
        let mut seen = Vec::new();
        // Those that whiten need a spectrum more than the others, whom they then serve too.
        let mut places = vec![0; coding.len()];
        let (whitened, others): (Vec<_>, Vec<_>) =
            (0..coding.len()).partition(|&i| coding[i].hypotheses.contains(&Hypothesis::Whitened));
        for i in whitened.into_iter().chain(others) {
            places[i] = solve(soup, &coding[i], &mut solved, &mut spectra, cancel)?;
        }
        for (parameters, at) in coding.iter().zip(places) {
            let shape = &mut solved[at].shape;
            seen.push(if parameters.hypotheses == [Hypothesis::Plain] {
                Seen::Plain {
                    spectrum: at,
                    training: shape.sample(parameters.samples_per_shape, parameters.seed),
                    query: shape.sample(parameters.query_samples, parameters.seed),
                    bounded: shape.report().openness > 0.0,
                }
            } else {
                let store = |views: Vec<View>| views.iter().map(StoredView::of).collect();
                Seen::Views {
                    training: store(shape.training_views(parameters, cancel)?),
                    query: store(shape.query_views(parameters, cancel)?),
                }
            });
        }
        let literal = literal
            .map(|parameters| solve(soup, parameters, &mut solved, &mut spectra, cancel))
            .transpose()?;
        Ok(Self {
            spectra,
            seen,
            literal,
        })
    }

    /// The spectrum for baselines, where it was asked for.
    pub fn literal(&self) -> Option<&Spectrum> {
        self.literal.map(|at| &self.spectra[at])
    }

    /// The mesh as a training shape and as a query of the `which`-th set of parameters it was described for; the views
    /// that are not wanted stay empty.
    ///
    /// # Errors
    /// [`PipelineError::Spectral`] where the spectrum is too short.
    pub fn descriptions(
        &self,
        which: usize,
        parameters: &Parameters,
        wanted: Wanted,
    ) -> Result<(Description, Description), PipelineError> {
        let (training, query) = match &self.seen[which] {
            Seen::Plain {
                spectrum,
                training,
                query,
                bounded,
            } => {
                let pairs = self.spectra[*spectrum].eigenpairs();
                let plain = |vertices: &[u32]| -> Result<Vec<View>, SpectralError> {
                    let mut signatures =
                        describe_vertices(&pairs, vertices, &parameters.descriptor_parameters())?;
                    normalise(&mut signatures, parameters.normalisation);
                    Ok(vec![View {
                        hypothesis: Hypothesis::Plain,
                        channel: Channel::Plain,
                        area_scale: 1.0,
                        bounded: *bounded,
                        signatures,
                    }])
                };
                (
                    if wanted.training {
                        plain(training)?
                    } else {
                        Vec::new()
                    },
                    if wanted.query { plain(query)? } else { Vec::new() },
                )
            }
            Seen::Views { training, query } => {
                let load = |views: &[StoredView], wanted: bool| -> Vec<View> {
                    views.iter().filter(|_| wanted).map(StoredView::view).collect()
                };
                (load(training, wanted.training), load(query, wanted.query))
            }
        };
        let description = |views| Description {
            views,
            report: Default::default(),
            eigenvalues: Vec::new(),
        };
        Ok((description(training), description(query)))
    }
}

/// Which views are made.
#[derive(Clone, Copy, Debug)]
pub struct Wanted {
    /// Those of a training shape.
    pub training: bool,
    /// Those of a query.
    pub query: bool,
}

/// The number of the spectrum of the mesh that `parameters` prepare, solved for where no equal mesh was before.
fn solve(
    soup: &TriangleSoup,
    parameters: &Parameters,
    solved: &mut Vec<Solved>,
    spectra: &mut Vec<Spectrum>,
    cancel: &Cancel,
) -> Result<usize, PipelineError> {
    let options = parameters.prepare_options();
    // Preparing is deterministic and reports all it does: equal reports of one soup are equal meshes.
    let (_, report) = prepare(soup.clone(), &options)?;
    let refined_to = refined_to(&report, parameters);
    let part = taken_as_part(&report, parameters);
    let whitened = parameters.hypotheses.contains(&Hypothesis::Whitened);
    let on_fixed_grid = if parameters.hypotheses.contains(&Hypothesis::Doubled) {
        parameters.part_eigenpairs
    } else {
        0
    };
    let equal = |s: &Solved| {
        s.eigenpairs == parameters.eigenpairs
            && s.on_fixed_grid >= on_fixed_grid
            && s.refined_to == refined_to
            && s.part == part
            && (s.whitened || !whitened)
            && s.options.components == options.components
            && *s.shape.report() == report
    };
    if let Some(at) = solved.iter().position(equal) {
        return Ok(at);
    }
    let shape = PreparedShape::new(soup.clone(), parameters, cancel, &|_| ())?;
    spectra.push(Spectrum::of(
        &shape.eigenpairs().first(parameters.eigenpairs),
        shape.signature_vertices(),
    ));
    solved.push(Solved {
        options,
        refined_to,
        part,
        eigenpairs: parameters.eigenpairs,
        on_fixed_grid,
        whitened,
        shape,
    });
    Ok(solved.len() - 1)
}

impl Spectrum {
    fn of(pairs: &Eigenpairs, vertices: usize) -> Self {
        let n = pairs.values.len();
        let vectors = (0..n)
            .flat_map(|k| (0..vertices).map(move |i| pairs.vectors[(i, k)] as f32))
            .collect();
        Self {
            values: pairs.values.clone(),
            vectors,
            vertices,
        }
    }

    /// The eigenpairs; those of the vertices that carry signatures.
    pub fn eigenpairs(&self) -> Eigenpairs {
        let at = |i: usize, k: usize| f64::from(self.vectors[k * self.vertices + i]);
        Eigenpairs {
            values: self.values.clone(),
            vectors: Mat::from_fn(self.vertices, self.values.len(), at),
            residual: 0.0,
        }
    }

    /// Vertices that carry signatures.
    pub fn vertices(&self) -> u32 {
        self.vertices as u32
    }
}

impl StoredView {
    fn of(view: &View) -> Self {
        let matrix = &view.signatures.matrix;
        let values = (0..matrix.ncols())
            .flat_map(|j| (0..matrix.nrows()).map(move |i| matrix[(i, j)] as f32))
            .collect();
        Self {
            hypothesis: view.hypothesis,
            channel: view.channel,
            area_scale: view.area_scale,
            bounded: view.bounded,
            vertices: view.signatures.vertices.clone(),
            values,
        }
    }

    fn view(&self) -> View {
        let rows = self.values.len() / self.vertices.len().max(1);
        let matrix = Mat::from_fn(rows, self.vertices.len(), |i, j| {
            f64::from(self.values[j * rows + i])
        });
        View {
            hypothesis: self.hypothesis,
            channel: self.channel,
            area_scale: self.area_scale,
            bounded: self.bounded,
            signatures: Signatures {
                matrix,
                vertices: self.vertices.clone(),
            },
        }
    }
}
