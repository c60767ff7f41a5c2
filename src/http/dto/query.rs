//! Queries and their answers on the wire.

use super::class::ClassRef;
use super::parameters::{HypothesisName, ParametersDto, QueryRankByName};
use super::shape::{PoseDto, ReportDto};
use serde::{Deserialize, Serialize};
use shapelex_core::ranking::{Verdict, VerdictKind};
use std::collections::BTreeMap;
use utoipa::{IntoParams, ToSchema};

/// How a query is asked.
#[derive(Clone, Debug, Default, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct QueryOptions {
    /// How many classes (and nearest shapes) are answered at most; all where it is left out. Among thousands of
    /// classes a query for a few is much faster, and answers the same as the head of the full ranking.
    #[param(minimum = 1)]
    pub top: Option<usize>,
    /// What classes are ordered by; the index's own parameter where it is left out. `shape_dna`, `shape_dna_relative`,
    /// `signature_distances` and `bag_of_words` rank by the distance to a class's nearest training shape instead of
    /// sparse coding.
    #[param(inline)]
    pub rank_by: Option<QueryRankByName>,
    /// What a raw body is called, such as `dog0.obj`.
    pub name: Option<String>,
    /// A stored shape to query with, instead of a body: its id, or `CLASS/ID` with the class's id or name, which has to be
    /// its class then. A shape that was sampled as a pose is queried in this pose.
    pub shape: Option<String>,
    /// Sample this many poses of every animated glTF instead of reading its resting pose. A batch answers each; a single
    /// query needs `pose` too, where there is more than one.
    #[param(minimum = 1, maximum = 64)]
    pub poses: Option<usize>,
    /// Which of the sampled `poses` is meant, from 0.
    #[param(minimum = 0, maximum = 63)]
    pub pose: Option<usize>,
    /// Milliseconds from the arrival of the mesh after which the best ranking so far is answered, marked `partial`.
    /// Where not even one class was scored by then, the query fails with `deadline_exceeded`.
    #[param(minimum = 1)]
    pub time_limit_ms: Option<u64>,
    /// What is answered beside the ranking: `samples` adds the signals that were coded.
    #[param(inline)]
    pub details: Option<DetailsName>,
}

/// What an answer has beside the ranking.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum DetailsName {
    /// The sampled vertices and their signals.
    Samples,
}

/// How well a class regenerates the query, or how near it is. What only sparse coding knows is `null` where the
/// classes are ranked by another method.
#[derive(Clone, Debug, PartialEq, Serialize, ToSchema)]
pub struct RankedClass {
    /// 1 is best.
    pub rank: usize,
    /// The class.
    pub class: ClassRef,
    /// What the ranking is ordered by, ascending; by a method other than sparse coding the distance to the class's
    /// nearest training shape.
    pub score: f64,
    /// ‖S − DA‖, the paper's Eq. 5.
    pub reconstruction_error: Option<f64>,
    /// The same over ‖S‖, 0 to about 1.
    pub relative_error: Option<f64>,
    /// Mean Lasso objective per signature.
    pub mean_objective: Option<f64>,
    /// Mean of the smallest 80 % of the objectives.
    pub trimmed_objective: Option<f64>,
    /// Mean number of atoms a signature was built from.
    pub mean_nonzeros: Option<f64>,
    /// The way of preparing the query the score comes from.
    pub hypothesis: Option<HypothesisName>,
    /// By how much the next class is worse, relative to it; `null` for the last.
    pub margin: Option<f64>,
    /// The share of training shapes that fit their own class no better than the query fits this one, when the class
    /// had been learnt without them; `null` where that cannot be told (see `none_of_these`).
    pub p_value: Option<f64>,
}

/// What an answer is taken to be.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum VerdictKindName {
    /// One class is possible.
    Class,
    /// Several classes are possible.
    Several,
    /// No class is possible.
    NoneOfThese,
    /// What is possible cannot be told.
    NotJudged,
}

/// What the answer says, for people: about the first five classes of the ranking, however many are asked for.
#[derive(Clone, Debug, PartialEq, Serialize, ToSchema)]
pub struct VerdictDto {
    /// What the answer is taken to be.
    pub kind: VerdictKindName,
    /// One sentence, ready to be shown: "cat (at least 97 % of such answers are right)", "cat or dog (…)", "none of the known
    /// classes; nearest: michael", "nearest: cat (not judged: …)".
    pub text: String,
    /// 1 less the largest p-value of the classes the text does not name as possible: of all queries of known classes, at most
    /// the rest gets so clear an answer that is wrong. `null` where it cannot be told.
    pub probability: Option<f64>,
    /// Why it is not judged; `null` where it is.
    pub reason: Option<String>,
}

impl From<Verdict> for VerdictDto {
    fn from(verdict: Verdict) -> Self {
        Self {
            kind: match verdict.kind {
                VerdictKind::Class => VerdictKindName::Class,
                VerdictKind::Several => VerdictKindName::Several,
                VerdictKind::NoneOfThese => VerdictKindName::NoneOfThese,
                VerdictKind::NotJudged => VerdictKindName::NotJudged,
            },
            text: verdict.text,
            probability: verdict.probability,
            reason: verdict.reason.map(|reason| reason.to_string()),
        }
    }
}

/// Which vertices of the prepared mesh were sampled, and their signals under one view.
#[derive(Clone, Debug, PartialEq, Serialize, ToSchema)]
pub struct SampledView {
    /// The way of preparing the query.
    pub hypothesis: HypothesisName,
    /// The dictionaries it is coded under: `plain`, `whitened` or `fixed_grid`.
    pub channel: &'static str,
    /// Full area over visible area that was assumed; 1 unless doubled.
    pub area_scale: f64,
    /// Whether the mean of the smallest 80 % of the objectives stands for the mean, since something of the surface is missing.
    pub bounded: bool,
    /// Vertices of the prepared mesh, in the order of the signals.
    pub vertices: Vec<u32>,
    /// The signals that were coded, M values each.
    pub signals: Vec<Vec<f64>>,
}

/// How well a single training shape regenerates the query, or how near it is.
#[derive(Clone, Debug, PartialEq, Serialize, ToSchema)]
pub struct RankedShape {
    /// 1 is best.
    pub rank: usize,
    /// The shape's id.
    pub shape: String,
    /// Its class.
    pub class: ClassRef,
    /// What the ranking is ordered by, ascending.
    pub score: f64,
    /// ‖S − DA‖, the paper's Eq. 5; `null` where the ranking is not by sparse coding.
    pub reconstruction_error: Option<f64>,
}

/// The answer to a query.
#[derive(Clone, Debug, PartialEq, Serialize, ToSchema)]
pub struct QueryAnswer {
    /// The mesh's name.
    pub name: String,
    /// Which pose of an animated file was queried; `null` for the file as it is.
    pub pose: Option<PoseDto>,
    /// What the answer says, for people.
    pub verdict: VerdictDto,
    /// Classes, best first.
    pub classes: Vec<RankedClass>,
    /// Training shapes, best first, where the index has dictionaries of single shapes or the ranking is not by sparse
    /// coding.
    pub nearest_shapes: Vec<RankedShape>,
    /// The verdict's probability, `null` where it cannot be told.
    pub probability: Option<f64>,
    /// By how much the runner-up is worse than the best class, relative to it, 0 to 1; 1 where there is only one class.
    pub margin: f64,
    /// The same as `margin`, under its former name. It is no probability.
    #[schema(deprecated)]
    pub confidence: f64,
    /// Classes that were compared with.
    pub compared: usize,
    /// Classes of these that were ruled out by a lower bound of their score instead of being evaluated in full. The
    /// answer is the same as if they had been. Above 0 only where `top` is given and small against the number of
    /// classes.
    pub pruned: usize,
    /// Whether the query is believed to be of none of the indexed classes: no answered class has a p-value above 0.05.
    /// `null` where that cannot be told: with fewer than 19 training shapes beside each class's first, where the training
    /// shapes of the best class are near copies of each other, of an open surface such as a single view, where the ranking
    /// is not by the index's own measure, and where the answer is partial.
    pub none_of_these: Option<bool>,
    /// The classes with a p-value above 0.05. For 95 of 100 queries that are like the training shapes the true class is
    /// among them. Empty where nothing can be told.
    pub possible_classes: Vec<ClassRef>,
    /// Whether the time limit came before all classes were compared with.
    pub partial: bool,
    /// The classes that were not; empty unless `partial`.
    pub not_compared: Vec<ClassRef>,
    /// Signatures that were coded; 0 where the ranking is not by sparse coding.
    pub signatures: usize,
    /// The mesh's format.
    pub format: String,
    /// What preparing did to the mesh.
    pub mesh: ReportDto,
    /// Things you should know, one sentence each.
    pub warnings: Vec<String>,
    /// The mesh's first eigenvalues.
    pub eigenvalues: Vec<f64>,
    /// The generation of the index that answered.
    pub generation: u64,
    /// What the classes were ordered by.
    pub rank_by: QueryRankByName,
    /// The parameters of the index.
    pub parameters: ParametersDto,
    /// The signals that were coded, where `details=samples` asks for them: with the dictionaries of an export, `lambda` and
    /// `rank_by` a score can be computed outside (docs/method.md#ranking).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub samples: Option<Vec<SampledView>>,
    /// Milliseconds by stage: `wait`, `read`, `prepare`, `laplacian`, `eigenpairs`, `signatures`, `ranking` and
    /// `total`.
    pub timings_ms: BTreeMap<String, f64>,
}

impl QueryAnswer {
    /// Bytes that its text takes, at most: numbers have up to 25 characters, classes and shapes a dozen numbers and a name.
    pub fn bytes(&self) -> u64 {
        let signals = self.samples.iter().flatten().map(|view| {
            let numbers: usize = view.signals.iter().map(Vec::len).sum();
            numbers + view.vertices.len()
        });
        let numbers = signals.sum::<usize>() + self.eigenvalues.len();
        let entries = self.classes.len() + self.nearest_shapes.len() + self.possible_classes.len();
        25 * numbers as u64 + 1024 * (entries + self.not_compared.len()) as u64 + (16 << 10)
    }
}

/// One line of a batch's answer. The last line has only a summary.
#[derive(Clone, Debug, Serialize, ToSchema)]
#[serde(untagged)]
pub enum BatchLine {
    /// A mesh that was answered.
    Answered {
        /// `ok`.
        status: &'static str,
        /// Which mesh, from 0, in the order they were sent.
        index: usize,
        /// The answer, its members beside these.
        #[serde(flatten)]
        answer: Box<QueryAnswer>,
    },
    /// A mesh that could not be answered. This is not "no match".
    Failed {
        /// `failed`.
        status: &'static str,
        /// Which mesh, from 0, in the order they were sent.
        index: usize,
        /// Its name.
        name: String,
        /// Which pose of an animated file; left out where the file as a whole failed.
        #[serde(skip_serializing_if = "Option::is_none")]
        pose: Option<PoseDto>,
        /// Why.
        #[schema(value_type = super::problem::ProblemDocument)]
        problem: serde_json::Value,
    },
    /// The last line. A stream that ends without it was cut short.
    Summary {
        /// How it went.
        summary: BatchSummary,
    },
}

/// How a batch went.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, ToSchema)]
pub struct BatchSummary {
    /// Meshes in the batch; each pose counts where poses were asked for.
    pub total: usize,
    /// Meshes that were answered.
    pub ok: usize,
    /// Meshes that could not be answered.
    pub failed: usize,
}
