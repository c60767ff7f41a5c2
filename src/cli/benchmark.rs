//! `shapelex benchmark`: the paper's robustness benchmark, on any null shapes.

use super::benchmark_args::{BenchmarkArgs, categories, settings};
use super::benchmark_cache::{Cache, Key};
use super::benchmark_nulls::{self, Null};
use super::output::note_line;
use super::peak_memory::{peak_bytes, reset_peak};
use super::progress::Progress;
use super::{CliError, benchmark_report, figures, output};
use rayon::prelude::*;
use shapelex_core::cancel::Cancel;
use shapelex_core::mesh::TriangleSoup;
use shapelex_core::parameters::Parameters;
use shapelex_eval::benchmark::evaluate::Models;
use shapelex_eval::benchmark::report::{BenchmarkReport, Cost, NullInfo};
use shapelex_eval::benchmark::{
    Category, Member, Method, Outcome, Robustness, Setting, Shapes, Specimen, null_models, run_unit,
};
use shapelex_eval::figure::{benchmark_figures, deformation_gallery};
use std::collections::HashMap;
use std::path::Path;
use std::time::Instant;

/// Strength of the deformations in the gallery: strong enough to be seen, weak enough to recognise the shape.
const GALLERY_STRENGTH: usize = 4;

/// A deformed shape.
struct Deformed {
    member: Member,
    soup: TriangleSoup,
    digest: Key,
}

/// Makes the deformed shapes, runs every method under every protocol, and writes the tables.
///
/// # Errors
/// [`CliError::Usage`] where there are fewer than two null shapes or a class of `--same` is unknown;
/// [`CliError::Failed`] where a null shape is no usable mesh.
pub fn run(args: &BenchmarkArgs, json: bool) -> Result<(), CliError> {
    let began = Instant::now();
    let settings = settings(args)?;
    let posed = args
        .categories
        .as_ref()
        .is_some_and(|list| list.iter().any(|c| Category::POSED.contains(&c.0)));
    let nulls = if args.paths.is_empty() {
        benchmark_nulls::of_the_zoo(args.classes, posed, args.seed, args.vertices)?
    } else {
        benchmark_nulls::of_files(&args.paths, args.vertices)?
    };
    let classes: Vec<String> = nulls.iter().map(|n| n.class.clone()).collect();
    let same = benchmark_nulls::groups(&args.same, &classes)?;
    let cache = if args.no_cache {
        Cache::none()
    } else {
        Cache::open(args.cache.as_deref())?
    };
    let mut bench = Bench {
        args,
        settings,
        classes,
        same,
        cache,
        nulls: Vec::new(),
        models: HashMap::new(),
        report: BenchmarkReport::default(),
        describing: Cost {
            method: "describe".to_owned(),
            ..Cost::default()
        },
    };
    bench.report = BenchmarkReport {
        seed: args.seed,
        query_samples: args.query_samples,
        nulls: nulls.iter().map(info).collect(),
        same: bench.same.clone(),
        costs: bench.settings.iter().map(cost_of).collect(),
        ..BenchmarkReport::default()
    };
    for category in categories(args, &nulls) {
        bench.category(category, &nulls)?;
    }
    let mut report = bench.report;
    report.costs.insert(0, bench.describing);
    report.seconds = began.elapsed().as_secs_f64();
    if let Some(dir) = &args.out {
        write_files(dir, &report, &nulls)?;
    }
    if json {
        output::json(&report.counts)
    } else {
        output::line(&benchmark_report::text(&report))
    }
}

/// Everything that `--out` asks for. Figures are drawn here too, from the report and the null shapes.
fn write_files(dir: &Path, report: &BenchmarkReport, nulls: &[Null]) -> Result<(), CliError> {
    benchmark_report::write(dir, report)?;
    let shapes: Vec<(&str, &TriangleSoup)> = nulls.iter().map(|n| (n.class.as_str(), &n.soup)).collect();
    let deform = |at: usize, kind| nulls[at].member(Category::Deformed(kind), GALLERY_STRENGTH, report.seed);
    let mut sheets = vec![deformation_gallery(&shapes, GALLERY_STRENGTH as u32, &deform)?];
    sheets.extend(benchmark_figures(report)?);
    figures::write(dir, &sheets)
}

fn info(null: &Null) -> NullInfo {
    NullInfo {
        class: null.class.clone(),
        vertices: null.soup.vertices.len(),
        poses: null.poses.len(),
    }
}

fn cost_of(setting: &Setting) -> Cost {
    Cost {
        method: setting.method.name().to_owned(),
        ..Cost::default()
    }
}

/// A benchmark on its way.
struct Bench<'a> {
    args: &'a BenchmarkArgs,
    settings: Vec<Setting>,
    classes: Vec<String>,
    same: Vec<Vec<String>>,
    cache: Cache,
    /// The null shapes' descriptions, once they were needed.
    nulls: Vec<Specimen>,
    /// Dictionaries of the null shapes, by setting, once they were needed.
    models: HashMap<usize, Models>,
    report: BenchmarkReport,
    describing: Cost,
}

impl Bench<'_> {
    /// Runs all methods and protocols over one category.
    fn category(&mut self, category: Category, nulls: &[Null]) -> Result<(), CliError> {
        let name = category.name();
        let began = Instant::now();
        reset_peak();
        let shapes: Vec<Deformed> = (0..=5usize)
            .flat_map(|strength| nulls.iter().map(move |null| (null, strength)))
            .collect::<Vec<_>>()
            .into_par_iter()
            .filter_map(|(null, strength)| {
                let soup = null.member(category, strength, self.args.seed)?;
                Some(Deformed {
                    member: Member {
                        class: null.class.clone(),
                        strength,
                    },
                    digest: Key::of_mesh(&soup),
                    soup,
                })
            })
            .collect();
        let protocols: Vec<Robustness> = self.args.protocols.iter().map(|p| p.0).collect();
        let units: Vec<(usize, Robustness)> = (0..self.settings.len())
            .flat_map(|s| protocols.iter().map(move |&p| (s, p)))
            .filter(|(_, p)| p.covers(category))
            .collect();
        let keys: Vec<Key> = units
            .iter()
            .map(|&(s, p)| self.unit_key(&self.settings[s], p, name, &shapes))
            .collect();
        let mut outcomes: Vec<Option<Outcome>> = keys.par_iter().map(|key| self.cache.get(key)).collect();
        let described = if outcomes.iter().all(Option::is_some) {
            None
        } else {
            Some(self.describe(name, &shapes)?)
        };
        self.note(None, began, outcomes.iter().any(Option::is_some));
        let members: Vec<Member> = shapes.into_iter().map(|s| s.member).collect();
        let progress = Progress::new(&format!("{name}: evaluate"), units.len());
        for ((&(at, protocol), key), outcome) in units.iter().zip(&keys).zip(&mut outcomes) {
            let began = Instant::now();
            let was_cached = outcome.is_some();
            if let (None, Some(described)) = (&outcome, &described) {
                reset_peak();
                self.learn_nulls(at, protocol)?;
                let specimens = self.nulls.iter().map(Some);
                let shapes = Shapes {
                    members: members.clone(),
                    specimens: specimens.chain(described.iter().map(Option::as_ref)).collect(),
                    classes: &self.classes,
                    category: name,
                    same: &self.same,
                };
                let none = Models::new();
                let models = self.models.get(&at).unwrap_or(&none);
                let new = run_unit(&self.settings[at], protocol, &shapes, models, &Cancel::new())?;
                self.cache.put(key, &new);
                *outcome = Some(new);
            }
            self.note(Some(at), began, was_cached);
            if let Some(outcome) = outcome.take() {
                benchmark_report::add(
                    &mut self.report,
                    (protocol, self.settings[at].method.name(), name),
                    &self.classes,
                    outcome,
                );
            }
            progress.tick();
        }
        progress.finish();
        Ok(())
    }

    /// Describes the null shapes, once, and the deformed ones of a category; `None` for one that cannot be.
    fn describe(&mut self, name: &str, shapes: &[Deformed]) -> Result<Vec<Option<Specimen>>, CliError> {
        let coding: Vec<Parameters> = self
            .settings
            .iter()
            .filter(|s| matches!(s.method, Method::Coding(_)))
            .map(|s| s.parameters.clone())
            .collect();
        let literal = self
            .settings
            .iter()
            .find(|s| !matches!(s.method, Method::Coding(_)))
            .map(|s| s.parameters.clone());
        let first = if self.nulls.is_empty() {
            0
        } else {
            self.classes.len()
        };
        let mut key = Key::builder("specimen");
        for parameters in coding.iter().chain(&literal) {
            key.text(&parameters.description_fingerprint());
            key.number(parameters.query_samples as u64);
        }
        key.number(u64::from(literal.is_some()));
        let progress = Progress::new(&format!("{name}: describe"), shapes.len() - first);
        let results: Vec<Result<Specimen, String>> = shapes[first..]
            .par_iter()
            .map(|shape| {
                let key = key.clone().key(&shape.digest);
                let result = match self.cache.get(&key) {
                    Some(specimen) => Ok(specimen),
                    None => Specimen::describe(&shape.soup, &coding, literal.as_ref(), &Cancel::new())
                        .inspect(|specimen| self.cache.put(&key, specimen))
                        .map_err(|error| error.to_string()),
                };
                progress.tick();
                result
            })
            .collect();
        progress.finish();
        let mut described = Vec::new();
        for (result, shape) in results.into_iter().zip(&shapes[first..]) {
            let Member { class, strength } = &shape.member;
            match result {
                Ok(specimen) if *strength == 0 => self.nulls.push(specimen),
                Err(reason) if *strength == 0 => {
                    return Err(CliError::Failed(format!(
                        "the null shape of {class} cannot be described: {reason}"
                    )));
                }
                Ok(specimen) => described.push(Some(specimen)),
                Err(reason) => {
                    note_line!("shapelex: {class}, {name} {strength}: {reason}; it counts as a wrong answer");
                    described.push(None);
                }
            }
        }
        Ok(described)
    }

    /// Learns the null shapes' dictionaries where a setting and protocol need them and they are not there yet.
    fn learn_nulls(&mut self, at: usize, protocol: Robustness) -> Result<(), CliError> {
        let setting = &self.settings[at];
        let needed = matches!(setting.method, Method::Coding(_))
            && !matches!(protocol, Robustness::In | Robustness::Hold);
        if needed && !self.models.contains_key(&at) {
            let nulls: Vec<&Specimen> = self.nulls.iter().collect();
            let models = null_models(setting, &nulls, &Cancel::new())?;
            self.models.insert(at, models);
        }
        Ok(())
    }

    fn unit_key(&self, setting: &Setting, protocol: Robustness, category: &str, shapes: &[Deformed]) -> Key {
        let mut key = Key::builder("unit");
        key.text(setting.method.name());
        key.text(protocol.name());
        key.text(category);
        key.text(&setting.parameters.description_fingerprint());
        key.text(&setting.parameters.learning_fingerprint());
        key.number(setting.parameters.query_samples as u64);
        key.text(&format!("{:?}", setting.parameters.rank_by));
        self.same.iter().for_each(|group| key.text(&group.join(",")));
        for shape in shapes {
            key.text(&shape.member.class);
            key.number(shape.member.strength as u64);
            key = key.digest(&shape.digest);
        }
        key.end()
    }

    /// Adds the time since `began` and the peak memory to a setting's cost, or to that of describing.
    fn note(&mut self, at: Option<usize>, began: Instant, cached: bool) {
        let cost = match at {
            Some(at) => &mut self.report.costs[at],
            None => &mut self.describing,
        };
        cost.seconds += began.elapsed().as_secs_f64();
        if !cached {
            cost.peak_bytes = cost.peak_bytes.max(peak_bytes());
        }
        cost.cached |= cached;
    }
}
