//! What `shapelex evaluate` is asked to do.

use super::ParameterArgs;
use super::values::{at_least_one, poses};
use std::path::PathBuf;

/// A protocol by name; the numbers come from other flags.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum ProtocolName {
    /// Every shape is queried once, all others train
    LeaveOneOut,
    /// In order of the names the 1st, 3rd, 5th … shape of a class trains, the others are queried
    EvenOdd,
    /// One shape per class trains, drawn at random, all others are queried
    OneShot,
    /// Every class is dealt into folds, each is queried once
    KFold,
    /// Shape against shape: every shape asks for the others of its class
    Retrieval,
    /// How often a shape of a class that is not indexed is answered "none of these", and what the possible classes
    /// promise: half of every class trains, drawn at random
    OpenSet,
}

/// Arguments of `evaluate`.
#[derive(Debug, clap::Args)]
pub struct EvaluateArgs {
    /// Folder with a folder per class, which may have subfolders
    #[arg(value_name = "DIR")]
    pub dir: PathBuf,
    /// Query the shapes of this folder, a folder per class, and let all of DIR train; no split then
    #[arg(long, value_name = "DIR", conflicts_with_all = ["protocol", "min_shapes", "draws", "folds", "split_seed"])]
    pub queries: Option<PathBuf>,
    /// How shapes are split into training shapes and queries; may be repeated
    #[arg(long, value_enum, value_name = "PROTOCOL",
          default_values_t = [ProtocolName::LeaveOneOut, ProtocolName::EvenOdd, ProtocolName::OneShot,
                              ProtocolName::Retrieval])]
    pub protocol: Vec<ProtocolName>,
    /// Classes that count as one another's right answer, such as --same michael,david; may be repeated
    #[arg(long, value_name = "CLASS,CLASS…")]
    pub same: Vec<String>,
    /// Leave out classes with fewer shapes
    #[arg(long, value_name = "COUNT", default_value_t = 2, value_parser = at_least_one)]
    pub min_shapes: usize,
    /// Sample this many poses of every animated glTF; other files count once
    #[arg(long, value_name = "COUNT", value_parser = poses)]
    pub poses: Option<usize>,
    /// Independent draws of one-shot and open-set
    #[arg(long, value_name = "COUNT", default_value_t = 5, value_parser = at_least_one)]
    pub draws: usize,
    /// Folds of k-fold
    #[arg(long, value_name = "COUNT", default_value_t = 6)]
    pub folds: usize,
    /// Seed of the draws and folds
    #[arg(long, value_name = "SEED", default_value_t = 1)]
    pub split_seed: u64,
    /// How many of the worst queries are listed
    #[arg(long, value_name = "COUNT", default_value_t = 10)]
    pub worst: usize,
    /// Draw confusion, accuracy, dissimilarity and embedding of the classes, the worst queries, precision over recall
    /// and coverage over level into this folder, an SVG file each
    #[arg(long, value_name = "DIR")]
    pub figures: Option<PathBuf>,
    /// The method's parameters.
    #[command(flatten)]
    pub parameters: ParameterArgs,
}
