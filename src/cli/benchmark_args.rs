//! What `shapelex benchmark` is asked to do.

use super::benchmark_nulls::Null;
use super::{CliError, ParameterArgs};
use shapelex_core::parameters::Preset;
use shapelex_eval::benchmark::{Category, Method, Robustness, Setting};
use std::path::PathBuf;

/// Eigenpairs where only Shape DNA is asked for.
const FEW_EIGENPAIRS: usize = 24;

/// Arguments of `benchmark`.
#[derive(Debug, clap::Args)]
pub struct BenchmarkArgs {
    /// Null shapes: mesh files, or folders of a file or a folder per class; without any, creatures of the zoo
    #[arg(value_name = "PATH")]
    pub paths: Vec<PathBuf>,
    /// Classes that count as one another's right answer, such as --same michael,david; may be repeated
    #[arg(long, value_name = "CLASS,CLASS…")]
    pub same: Vec<String>,
    /// in, hold, null, retrieval, similarity_holes_range
    #[arg(long, value_name = "PROTOCOL,…", value_delimiter = ',', value_parser = parse_protocol,
          default_values_t = Robustness::ALL.map(Named), hide_default_value = true)]
    pub protocols: Vec<Named<Robustness>>,
    /// default, robust, paper, shape_dna, shape_dna_relative, sdd_wks, sdd_hks, sdd_si_hks, bow_wks, bow_hks, bow_si_hks
    #[arg(long, value_name = "METHOD,…", value_delimiter = ',', value_parser = parse_method,
          default_values_t = Method::ALL.map(Named), hide_default_value = true)]
    pub methods: Vec<Named<Method>>,
    /// affine, holes, micro_holes, scale, sampling, noise, shot_noise, topology, view; isometry and local_scale, which
    /// are on where classes come with several poses
    #[arg(long, value_name = "CATEGORY,…", value_delimiter = ',', value_parser = parse_category)]
    pub categories: Option<Vec<Named<Category>>>,
    /// Seed of the deformations, and of the zoo where no PATH is given
    #[arg(long, value_name = "SEED", default_value_t = 1)]
    pub seed: u64,
    /// Creatures of the zoo, where no PATH is given
    #[arg(long, value_name = "COUNT", default_value_t = 12)]
    pub classes: usize,
    /// Null shapes with more vertices are simplified to this many
    #[arg(long, value_name = "COUNT", default_value_t = 1500)]
    pub vertices: usize,
    /// Signatures of a query that are coded; 0 codes all
    #[arg(long, value_name = "COUNT", default_value_t = 250)]
    pub query_samples: usize,
    /// One parameter over every preset, such as --set atoms=64; may be repeated
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// Folder for the tables as Markdown, CSV and JSON
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Folder for what a later run need not compute again; without it, one in the user's cache directory
    #[arg(long, value_name = "DIR")]
    pub cache: Option<PathBuf>,
    /// Compute everything, keep nothing
    #[arg(long, conflicts_with = "cache")]
    pub no_cache: bool,
}

/// A value that the command line names.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Named<T>(pub T);

impl std::fmt::Display for Named<Robustness> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.0.name())
    }
}

impl std::fmt::Display for Named<Method> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.0.name())
    }
}

fn expected<'a>(names: impl Iterator<Item = &'a str>) -> String {
    format!("expected one of {}", names.collect::<Vec<_>>().join(", "))
}

fn parse_protocol(text: &str) -> Result<Named<Robustness>, String> {
    let names = Robustness::ALL.iter().map(|p| p.name());
    Robustness::named(text).map(Named).ok_or_else(|| expected(names))
}

fn parse_method(text: &str) -> Result<Named<Method>, String> {
    let names = Method::ALL.iter().map(|m| m.name());
    Method::named(text).map(Named).ok_or_else(|| expected(names))
}

fn parse_category(text: &str) -> Result<Named<Category>, String> {
    let mut all = Category::PAPER.iter().chain(&Category::POSED);
    let names = all.clone().map(|c| c.name());
    let found = all.find(|c| c.name() == text);
    found.map(|c| Named(*c)).ok_or_else(|| expected(names))
}

/// The methods with their parameters; baselines see the mesh as the paper prepares it.
pub fn settings(args: &BenchmarkArgs) -> Result<Vec<Setting>, CliError> {
    let mut place = 0;
    let only_dna = args
        .methods
        .iter()
        .all(|m| matches!(m.0, Method::ShapeDna { .. }));
    args.methods
        .iter()
        .map(|&Named(method)| {
            let preset = match method {
                Method::Coding(preset) => preset,
                _ => Preset::Paper,
            };
            let mut parameters = ParameterArgs {
                preset: Some(preset),
                set: args.set.clone(),
            }
            .parameters()?;
            parameters.query_samples = args.query_samples;
            if only_dna {
                parameters.eigenpairs = FEW_EIGENPAIRS;
            }
            let setting = Setting {
                method,
                parameters,
                place,
            };
            place += usize::from(matches!(method, Method::Coding(_)));
            Ok(setting)
        })
        .collect()
}

/// The categories to run, those of the similarity protocol last.
pub fn categories(args: &BenchmarkArgs, nulls: &[Null]) -> Vec<Category> {
    let mut list: Vec<Category> = match &args.categories {
        Some(chosen) => chosen.iter().map(|c| c.0).collect(),
        None => Category::PAPER.to_vec(),
    };
    if args.categories.is_none() && nulls.iter().any(|n| !n.poses.is_empty()) {
        list.extend(Category::POSED);
    }
    let asked = |p: Robustness| args.protocols.contains(&Named(p));
    if !Robustness::ALL
        .iter()
        .any(|&p| asked(p) && p != Robustness::SimilarityHolesRange)
    {
        list.clear();
    }
    if asked(Robustness::SimilarityHolesRange) {
        list.extend(Category::SIMILARITY);
    }
    list
}
