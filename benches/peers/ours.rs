//! The shapelex side of the comparison with the Python peers: reads one JSON command per line, does the work, answers
//! with one JSON line that names the milliseconds it took. Arrays go through files of little-endian f64, column by
//! column, so that both sides work on the same numbers. Run by `benches/peers/run`; without input it does nothing.

use faer::Mat;
use rayon::prelude::*;
use serde_json::{Value, json};
use shapelex_core::cancel::Cancel;
use shapelex_core::coding::{Dictionary, LearnParameters, encode, learn};
use shapelex_core::mesh::{Limits, PrepareOptions, Source, TriangleSoup, prepare, read};
use shapelex_core::parameters::{Channel, Parameters, Preset};
use shapelex_core::pipeline::views::channel_descriptor;
use shapelex_core::pipeline::{Description, describe_query, describe_shape, learn_model};
use shapelex_core::ranking::{Index, IndexedClass, rank};
use shapelex_core::signature::descriptor::WksRange;
use shapelex_core::spectral::{EigenOptions, Operators, assemble, smallest_eigenpairs};
use std::error::Error;
use std::io::{BufRead, Read, Write};
use std::path::Path;
use std::time::Instant;

type Outcome = Result<Value, Box<dyn Error>>;

#[derive(Default)]
struct State {
    operators: Option<Operators>,
    signals: Option<Mat<f64>>,
    dictionary: Option<Dictionary>,
    index: Option<Index>,
}

fn main() -> Result<(), Box<dyn Error>> {
    // Cargo passes --bench; anything else on the command line is not for us either.
    let mut state = State::default();
    let mut answer = std::io::stdout();
    for line in std::io::stdin().lock().lines() {
        let command: Value = serde_json::from_str(&line?)?;
        // Lets the peak of the resident memory start afresh (Linux); without it there are no figures of memory.
        let _ = std::fs::write("/proc/self/clear_refs", "5");
        let mut reply = state
            .run(&command)
            .unwrap_or_else(|e| json!({ "error": e.to_string() }));
        reply["mb"] = peak_megabytes().into();
        writeln!(answer, "{reply}")?;
        answer.flush()?;
    }
    Ok(())
}

impl State {
    fn run(&mut self, command: &Value) -> Outcome {
        match text(command, "op")? {
            "setup" => setup(command),
            "operators" => self.operators(command),
            "eigen" => self.eigen(command),
            "describe" => self.describe(command),
            "learn" => Self::learn(command),
            "dictionary" => self.dictionary(command),
            "lasso" => self.lasso(command),
            "index" => self.index(command),
            "load" => self.load(command),
            "query" => self.query(command),
            "read" => read_clean(command),
            other => Err(format!("unknown op {other}").into()),
        }
    }

    /// Reads a mesh as it is and writes W (CSC) and A.
    fn operators(&mut self, command: &Value) -> Outcome {
        let options = PrepareOptions {
            fill_holes_below: 0.0,
            working_size: 0,
            ..Default::default()
        };
        let (mesh, _) = prepare(soup(text(command, "mesh")?)?, &options)?;
        let operators = assemble(&mesh)?;
        let out = Path::new(text(command, "out")?);
        let w = &operators.stiffness;
        let pointers: Vec<f64> = w.indptr().raw_storage().iter().map(|&p| p as f64).collect();
        let indices: Vec<f64> = w.indices().iter().map(|&i| i as f64).collect();
        write(&out.join("indptr"), &pointers)?;
        write(&out.join("indices"), &indices)?;
        write(&out.join("data"), w.data())?;
        write(&out.join("mass"), &operators.mass)?;
        let vertices = operators.mass.len();
        self.operators = Some(operators);
        Ok(json!({ "vertices": vertices }))
    }

    fn eigen(&mut self, command: &Value) -> Outcome {
        let operators = self.operators.as_ref().ok_or("no operators")?;
        let n = number(command, "n")? as usize;
        let started = Instant::now();
        let pairs = smallest_eigenpairs(operators, n, &EigenOptions::default(), &Cancel::new())?;
        let ms = milliseconds(started);
        write(Path::new(text(command, "values")?), &pairs.values)?;
        Ok(json!({ "ms": ms, "residual": pairs.residual }))
    }

    /// The signals of a training shape under a preset.
    fn describe(&mut self, command: &Value) -> Outcome {
        let mut parameters = parameters(command)?;
        if let Some(samples) = command["samples"].as_u64() {
            parameters.samples_per_shape = samples as usize;
        }
        let described = describe_shape(
            soup(text(command, "mesh")?)?,
            &parameters,
            &Cancel::new(),
            &|_| (),
        )?;
        let matrix = described.views[0].signatures.matrix.clone();
        write_matrix(Path::new(text(command, "signals")?), &matrix)?;
        let shape = [matrix.nrows(), matrix.ncols()];
        self.signals = Some(matrix);
        Ok(json!({ "shape": shape }))
    }

    /// Loads signals (M × N) and learns a dictionary.
    fn learn(command: &Value) -> Outcome {
        let signals = read_matrix(
            Path::new(text(command, "signals")?),
            number(command, "rows")? as usize,
        )?;
        let learning = LearnParameters {
            atoms: number(command, "atoms")? as usize,
            lambda: number(command, "lambda")?,
            iterations: number(command, "iterations")? as usize,
            batch: number(command, "batch")? as usize,
            seed: 1,
        };
        let started = Instant::now();
        let (dictionary, report) = learn(&[signals.as_ref()], &learning, &Cancel::new(), &|_, _| ())?;
        let ms = milliseconds(started);
        write_matrix(Path::new(text(command, "dictionary")?), &dictionary.atoms())?;
        Ok(json!({ "ms": ms, "atoms": report.atoms }))
    }

    fn dictionary(&mut self, command: &Value) -> Outcome {
        let rows = number(command, "rows")? as usize;
        self.dictionary = Some(Dictionary::new(read_matrix(
            Path::new(text(command, "dictionary")?),
            rows,
        )?)?);
        self.signals = Some(read_matrix(Path::new(text(command, "signals")?), rows)?);
        Ok(json!({}))
    }

    /// Codes the signals so many times, as a query does under its classes, on all threads; the time of one of them.
    fn lasso(&mut self, command: &Value) -> Outcome {
        let dictionary = self.dictionary.as_ref().ok_or("no dictionary")?;
        let signals = self.signals.as_ref().ok_or("no signals")?;
        let (lambda, calls) = (number(command, "lambda")?, number(command, "calls")? as usize);
        let call = || encode(dictionary, signals.as_ref(), lambda, &Cancel::new());
        let started = Instant::now();
        (0..calls).into_par_iter().try_for_each(|_| call().map(drop))?;
        let ms = milliseconds(started) / calls as f64;
        let codes = call()?;
        let objective: f64 = codes.objective.iter().sum();
        let nonzeros = codes.values.len() as f64 / codes.objective.len() as f64;
        Ok(json!({ "ms": ms, "objective": objective, "nonzeros": nonzeros }))
    }

    /// Loads an index of one plain dictionary per class, each a file: the channel closed queries are coded in.
    fn load(&mut self, command: &Value) -> Outcome {
        let parameters = parameters(command)?;
        let mut files: Vec<_> = std::fs::read_dir(text(command, "dir")?)?.collect::<Result<_, _>>()?;
        files.sort_by_key(std::fs::DirEntry::file_name);
        let classes = files.iter().map(|file| -> Result<IndexedClass, Box<dyn Error>> {
            let dictionary = Dictionary::new(read_matrix(&file.path(), parameters.energies)?)?;
            Ok(IndexedClass {
                label: file.file_name().to_string_lossy().into_owned(),
                dictionaries: [(Channel::Plain, dictionary.into())].into(),
                shapes: Vec::new(),
            })
        });
        self.index = Some(Index {
            classes: classes.collect::<Result<_, _>>()?,
            parameters,
        });
        Ok(json!({}))
    }

    /// Learns one class per folder of training meshes: the whole reindex without service and store.
    fn index(&mut self, command: &Value) -> Outcome {
        let parameters = parameters(command)?;
        let classes = command["classes"].as_array().ok_or("classes")?;
        let started = Instant::now();
        let classes: Result<Vec<IndexedClass>, String> = classes
            .par_iter()
            .map(|class| index_class(class, &parameters).map_err(|e| e.to_string()))
            .collect();
        let index = Index {
            classes: classes?,
            parameters,
        };
        let ms = milliseconds(started);
        let out = Path::new(text(command, "out")?);
        for class in &index.classes {
            write_matrix(
                &out.join(&class.label),
                &class.dictionaries[&Channel::Plain].atoms(),
            )?;
        }
        self.index = Some(index);
        Ok(json!({ "ms": ms }))
    }

    /// Mesh bytes to ranking.
    fn query(&mut self, command: &Value) -> Outcome {
        let index = self.index.as_ref().ok_or("no index")?;
        let bytes = std::fs::read(text(command, "mesh")?)?;
        let started = Instant::now();
        let source = Source {
            bytes: &bytes,
            ..Default::default()
        };
        let (_, soup) = read(&source, &Limits::default())?;
        let query = describe_query(soup, &index.parameters, &Cancel::new(), &|_| ())?;
        let ranking = rank(&query.views, index, index.parameters.rank_by, &Cancel::new())?;
        let ms = milliseconds(started);
        let best = &ranking.classes[0];
        let vertices = &query.views[0].signatures.vertices;
        Ok(json!({ "ms": ms, "best": best.label, "score": best.score, "vertices": vertices }))
    }
}

/// Everything the other side needs to do the same work: the parameters, and the descriptor of each channel.
fn setup(command: &Value) -> Outcome {
    let parameters = parameters(command)?;
    let channels = parameters.channels().into_iter().map(|channel| {
        let (eigenpairs, descriptor) = channel_descriptor(channel, &parameters);
        let (low, high) = match descriptor.range {
            WksRange::Fixed { low, high } => (Some(low), Some(high)),
            _ => (None, None),
        };
        json!({
            "name": channel,
            "eigenpairs": eigenpairs,
            "energies": descriptor.dimension,
            "sigma_steps": descriptor.sigma_steps,
            "low": low,
            "high": high,
        })
    });
    let channels: Vec<Value> = channels.collect();
    Ok(json!({ "parameters": parameters, "channels": channels }))
}

fn index_class(class: &Value, parameters: &Parameters) -> Result<IndexedClass, Box<dyn Error>> {
    let described = class["meshes"]
        .as_array()
        .ok_or("meshes")?
        .iter()
        .map(|mesh| {
            let soup = soup(mesh.as_str().ok_or("mesh")?)?;
            Ok(describe_shape(soup, parameters, &Cancel::new(), &|_| ())?)
        })
        .collect::<Result<Vec<Description>, Box<dyn Error>>>()?;
    let shapes: Vec<&Description> = described.iter().collect();
    let model = learn_model(&shapes, parameters, &Cancel::new(), &|_, _| ())?;
    Ok(IndexedClass {
        label: text(class, "label")?.to_owned(),
        dictionaries: model.dictionaries,
        shapes: Vec::new(),
    })
}

/// Bytes to triangles, or with `clean` to a clean mesh, without simplification.
fn read_clean(command: &Value) -> Outcome {
    let bytes = std::fs::read(text(command, "mesh")?)?;
    let started = Instant::now();
    let source = Source {
        bytes: &bytes,
        name: Some(text(command, "mesh")?),
        ..Default::default()
    };
    let (_, soup) = read(&source, &Limits::default())?;
    if command["clean"] == json!(false) {
        return Ok(json!({ "ms": milliseconds(started), "faces": soup.faces.len() }));
    }
    let options = PrepareOptions {
        fill_holes_below: 0.0,
        working_size: 0,
        ..Default::default()
    };
    let (mesh, _) = prepare(soup, &options)?;
    Ok(json!({ "ms": milliseconds(started), "faces": mesh.faces().len() }))
}

/// The peak of the resident memory in MB; 0 where the system does not tell.
fn peak_megabytes() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    let kilobytes = line.and_then(|line| line.trim().trim_end_matches(" kB").parse::<f64>().ok());
    kilobytes.unwrap_or(0.0) / 1024.0
}

fn parameters(command: &Value) -> Result<Parameters, Box<dyn Error>> {
    let preset: Preset = serde_json::from_value(command["preset"].clone())?;
    let mut parameters = Parameters::preset(preset);
    if let Some(normalisation) = command.get("normalisation") {
        parameters.normalisation = serde_json::from_value(normalisation.clone())?;
    }
    // Both sides describe the mesh they are given.
    parameters.working_size = 0;
    parameters.fill_holes_below = 0.0;
    Ok(parameters)
}

fn soup(path: &str) -> Result<TriangleSoup, Box<dyn Error>> {
    let bytes = std::fs::read(path)?;
    let source = Source {
        bytes: &bytes,
        name: Some(path),
        ..Default::default()
    };
    Ok(read(&source, &Limits::default())?.1)
}

fn text<'a>(command: &'a Value, key: &str) -> Result<&'a str, Box<dyn Error>> {
    command[key]
        .as_str()
        .ok_or_else(|| format!("{key} is missing").into())
}

fn number(command: &Value, key: &str) -> Result<f64, Box<dyn Error>> {
    command[key]
        .as_f64()
        .ok_or_else(|| format!("{key} is missing").into())
}

fn milliseconds(since: Instant) -> f64 {
    since.elapsed().as_secs_f64() * 1e3
}

fn write<'a>(path: &Path, values: impl IntoIterator<Item = &'a f64>) -> std::io::Result<()> {
    let mut file = std::io::BufWriter::new(std::fs::File::create(path)?);
    for value in values {
        file.write_all(&value.to_le_bytes())?;
    }
    file.flush()
}

fn write_matrix(path: &Path, matrix: &Mat<f64>) -> std::io::Result<()> {
    write(path, (0..matrix.ncols()).flat_map(|j| matrix.col_as_slice(j)))
}

/// Reads as it goes, so that the file is not in memory twice.
fn read_matrix(path: &Path, rows: usize) -> Result<Mat<f64>, Box<dyn Error>> {
    let columns = std::fs::metadata(path)?.len() as usize / 8 / rows;
    let mut file = std::io::BufReader::new(std::fs::File::open(path)?);
    let mut matrix = Mat::zeros(rows, columns);
    let mut value = [0; 8];
    for j in 0..columns {
        for to in matrix.col_as_slice_mut(j) {
            file.read_exact(&mut value)?;
            *to = f64::from_le_bytes(value);
        }
    }
    Ok(matrix)
}
