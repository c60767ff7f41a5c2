//! The baselines over an index: what each training shape is kept as, and the ranking of a query's classes.

use super::shape_dna::EIGENVALUES;
use super::{SignatureDistances, Vocabulary, distance, shape_dna};
use crate::parameters::Channel;
use crate::pipeline::Description;
use crate::signature::Signatures;
use faer::Mat;

/// Words of the vocabulary (docs/method.md#baselines).
pub const WORDS: usize = 64;
/// Signatures of one shape that may take part in finding range and words.
const THINNED: usize = 120;

/// A method to rank by instead of sparse coding.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Baseline {
    /// The first 13 eigenvalues of the surface at unit area.
    ShapeDna,
    /// The same, divided by the first of them.
    ShapeDnaRelative,
    /// The histogram of distances between signatures.
    SignatureDistances,
    /// The histogram of words.
    BagOfWords,
}

/// What the shapes of an index share: the range of the distance histograms and the words.
#[derive(Clone, Debug)]
pub struct BaselineModel {
    /// The range.
    pub distances: SignatureDistances,
    /// The words, M × 64, or fewer where there are fewer signatures.
    pub vocabulary: Vocabulary,
    /// Seed of the pairs the distances are taken of.
    pub seed: u64,
}

/// What a shape is kept as.
#[derive(Clone, Debug, PartialEq)]
pub struct BaselineShape {
    /// Whatever the caller calls it.
    pub label: String,
    /// The first eigenvalues at unit area, up to 20.
    pub eigenvalues: Vec<f64>,
    /// Histogram of signature distances, 100 shares.
    pub distances: Vec<f32>,
    /// Histogram of words, a share per word.
    pub words: Vec<f32>,
}

/// A class and its shapes.
#[derive(Clone, Debug, PartialEq)]
pub struct BaselineClass {
    /// Whatever the caller calls it.
    pub label: String,
    /// Its training shapes.
    pub shapes: Vec<BaselineShape>,
}

/// Everything the baselines need of an index.
#[derive(Clone, Debug)]
pub struct BaselineIndex {
    /// What the shapes share.
    pub model: BaselineModel,
    /// Classes, each with at least one shape.
    pub classes: Vec<BaselineClass>,
}

/// A class, or a shape of it, and how far the query is.
#[derive(Clone, Debug, PartialEq)]
pub struct Nearest {
    /// The class's label.
    pub class: String,
    /// The label of the shape; of a class, its nearest.
    pub shape: String,
    /// ‖a − b‖₂ of the two descriptors.
    pub distance: f64,
}

/// The signatures of the plain view; `None` where there are none.
fn plain(description: &Description) -> Option<&Signatures> {
    let view = description.views.iter().find(|v| v.channel == Channel::Plain)?;
    (!view.signatures.is_empty()).then_some(&view.signatures)
}

/// At most [`THINNED`] of a shape's plain signatures, evenly spread over them; `None` where there are none.
pub fn thinned(description: &Description) -> Option<Signatures> {
    let all = plain(description)?;
    let kept = all.len().min(THINNED);
    let at = |j: usize| j * all.len() / kept;
    Some(Signatures {
        matrix: Mat::from_fn(all.dimension(), kept, |i, j| all.matrix[(i, at(j))]),
        vertices: (0..kept).map(|j| all.vertices[at(j)]).collect(),
    })
}

impl BaselineModel {
    /// Chooses range and words by the signatures of training shapes; the same signatures in the same order and the same
    /// seed give the same model.
    pub fn learn(training: &[Signatures], seed: u64) -> Self {
        let training: Vec<&Signatures> = training.iter().collect();
        Self {
            distances: SignatureDistances::fit(&training, seed),
            vocabulary: Vocabulary::learn(&training, WORDS, seed),
            seed,
        }
    }

    /// What a training shape is kept as; `None` where it has no signatures of the words' length.
    pub fn describe(&self, label: String, description: &Description) -> Option<BaselineShape> {
        let single = |values: Vec<f64>| values.into_iter().map(|v| v as f32).collect();
        Some(BaselineShape {
            label,
            eigenvalues: description.eigenvalues.clone(),
            distances: single(self.vector(description, Baseline::SignatureDistances)?),
            words: single(self.vector(description, Baseline::BagOfWords)?),
        })
    }

    /// The descriptor of a shape under one method.
    fn vector(&self, description: &Description, by: Baseline) -> Option<Vec<f64>> {
        let signatures = plain(description).filter(|s| s.dimension() == self.vocabulary.words.nrows());
        match by {
            Baseline::ShapeDna => Some(shape_dna(&description.eigenvalues, EIGENVALUES, false)),
            Baseline::ShapeDnaRelative => Some(shape_dna(&description.eigenvalues, EIGENVALUES, true)),
            Baseline::SignatureDistances => Some(self.distances.describe(signatures?, self.seed)),
            Baseline::BagOfWords => Some(self.vocabulary.describe(signatures?)),
        }
    }
}

impl BaselineShape {
    fn vector(&self, by: Baseline) -> Vec<f64> {
        let double = |values: &[f32]| values.iter().map(|v| f64::from(*v)).collect();
        match by {
            Baseline::ShapeDna => shape_dna(&self.eigenvalues, EIGENVALUES, false),
            Baseline::ShapeDnaRelative => shape_dna(&self.eigenvalues, EIGENVALUES, true),
            Baseline::SignatureDistances => double(&self.distances),
            Baseline::BagOfWords => double(&self.words),
        }
    }
}

impl BaselineIndex {
    /// Memory it takes, in bytes, about.
    pub fn resident_bytes(&self) -> usize {
        let of_shape = |s: &BaselineShape| {
            size_of::<BaselineShape>()
                + s.label.capacity()
                + size_of_val(s.eigenvalues.as_slice())
                + size_of_val(s.distances.as_slice())
                + size_of_val(s.words.as_slice())
        };
        let words = &self.model.vocabulary.words;
        let shapes = self.classes.iter().flat_map(|class| &class.shapes);
        size_of::<f64>() * words.nrows() * words.ncols() + shapes.map(of_shape).sum::<usize>()
    }

    /// All training shapes, nearest first; ties are broken by label. The query must be
    /// described as a training shape is, by [`describe_plain`](crate::pipeline::describe_plain): histograms of
    /// differently sampled signatures do not compare. `None` where it has no signatures of the words' length.
    pub fn nearest(&self, query: &Description, by: Baseline) -> Option<Vec<Nearest>> {
        let query = self.model.vector(query, by)?;
        let mut nearest: Vec<Nearest> = self
            .classes
            .iter()
            .flat_map(|class| class.shapes.iter().map(move |shape| (class, shape)))
            .map(|(class, shape)| Nearest {
                class: class.label.clone(),
                shape: shape.label.clone(),
                distance: distance(&query, &shape.vector(by)),
            })
            .collect();
        nearest.sort_by(|a, b| {
            a.distance
                .total_cmp(&b.distance)
                .then_with(|| (&a.class, &a.shape).cmp(&(&b.class, &b.shape)))
        });
        Some(nearest)
    }
}

/// The nearest shape of every class, nearest class first, of shapes in that order.
pub fn nearest_classes(shapes: &[Nearest]) -> Vec<Nearest> {
    let mut seen = std::collections::BTreeSet::new();
    shapes
        .iter()
        .filter(|shape| seen.insert(shape.class.as_str()))
        .cloned()
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::PrepareReport;
    use crate::parameters::Hypothesis;
    use crate::ranking::View;

    /// A shape with eigenvalues that grow by `growth` and signatures around `centre`.
    fn shape(growth: f64, centre: f64) -> Description {
        let signatures = Signatures {
            matrix: Mat::from_fn(6, 300, |i, j| {
                centre + 0.1 * (((i * 31 + j * 17) % 23) as f64) * centre
            }),
            vertices: (0..300).collect(),
        };
        Description {
            views: vec![View {
                hypothesis: Hypothesis::Plain,
                channel: Channel::Plain,
                area_scale: 1.0,
                bounded: false,
                signatures,
            }],
            report: PrepareReport::default(),
            eigenvalues: (0..20).map(|k| growth * f64::from(k)).collect(),
        }
    }

    #[test]
    fn every_baseline_finds_the_nearest_shape_and_its_class() {
        let all = [
            ("cat", "cat0", shape(10.0, 1.0)),
            ("cat", "cat1", shape(10.5, 1.1)),
            ("dog", "dog0", shape(20.0, 3.0)),
            ("man", "man0", shape(40.0, 9.0)),
        ];
        let training: Vec<Signatures> = all.iter().filter_map(|(_, _, d)| thinned(d)).collect();
        assert!(training.iter().all(|s| s.len() == THINNED));
        let model = BaselineModel::learn(&training, 1);
        let mut classes: Vec<BaselineClass> = Vec::new();
        for (class, name, description) in &all {
            let kept = model.describe((*name).to_owned(), description).unwrap();
            match classes.iter_mut().find(|c| c.label == *class) {
                Some(class) => class.shapes.push(kept),
                None => classes.push(BaselineClass {
                    label: (*class).to_owned(),
                    shapes: vec![kept],
                }),
            }
        }
        let index = BaselineIndex { model, classes };
        for by in [
            Baseline::ShapeDna,
            Baseline::SignatureDistances,
            Baseline::BagOfWords,
        ] {
            let shapes = index.nearest(&all[2].2, by).unwrap();
            assert_eq!(shapes.len(), 4);
            assert_eq!(
                (shapes[0].class.as_str(), shapes[0].shape.as_str()),
                ("dog", "dog0")
            );
            // Histograms are kept at single precision.
            assert!(shapes[0].distance < 1e-6, "{by:?}: {}", shapes[0].distance);
            let classes = nearest_classes(&shapes);
            assert_eq!(classes.len(), 3);
            assert!(classes.windows(2).all(|w| w[0].distance <= w[1].distance));
        }
        // All are multiples of one another: relative to the first eigenvalue they are the same.
        let relative = index.nearest(&all[2].2, Baseline::ShapeDnaRelative).unwrap();
        assert_eq!(relative.len(), 4);
        assert!(relative.iter().all(|s| s.distance < 1e-9));
    }

    #[test]
    fn signatures_of_another_length_are_not_compared() {
        let cat = shape(10.0, 1.0);
        let model = BaselineModel::learn(&[thinned(&cat).unwrap()], 1);
        let mut other = shape(10.0, 1.0);
        other.views[0].signatures.matrix = Mat::zeros(5, 300);
        assert!(model.describe("x".to_owned(), &other).is_none());
        other.views.clear();
        assert!(thinned(&other).is_none());
    }
}
