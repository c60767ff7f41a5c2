//! How time and memory grow with the size of things. Prints a line of JSON per point.
//!
//! `cargo bench --bench scale -- classes 100 1000 10000`, `-- vertices 1000 100000 1000000`, `-- shapes 1 10 100`,
//! `-- limits`; without a subject it does nothing. `-- plot FILE DIR` draws the lines of a file as curves, those of
//! `cargo bench --bench load -- --json` too.

mod plot;
mod zoo;

use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, Par};
use serde_json::json;
use shapelex_core::cancel::Cancel;
use shapelex_core::mesh::{Limits, Source, read};
use shapelex_core::parameters::{Parameters, RankBy};
use shapelex_core::pipeline::{Description, describe_query, describe_shape, held_out_scores, learn_model};
use shapelex_core::ranking::{rank, rank_top};
use std::error::Error;
use std::f64::consts::TAU;
use std::hint::black_box;
use std::time::Instant;

type Outcome<T> = Result<T, Box<dyn Error>>;

/// Queries per number of classes: creatures and mixtures.
const QUERIES: [usize; 6] = [3, 20, 31, 60, 75, 90];
/// Classes that are asked for.
const TOP: usize = 10;

fn main() -> Outcome<()> {
    let words: Vec<String> = std::env::args()
        .skip(1)
        .filter(|word| !word.starts_with("--"))
        .collect();
    let Some((subject, sizes)) = words.split_first() else {
        return Ok(());
    };
    if let ("plot", [lines, directory]) = (subject.as_str(), sizes) {
        return plot::plot(lines.as_ref(), directory.as_ref());
    }
    let sizes = sizes
        .iter()
        .map(|size| size.parse())
        .collect::<Result<Vec<usize>, _>>()?;
    match subject.as_str() {
        "classes" => sizes.into_iter().try_for_each(classes),
        "vertices" => sizes.into_iter().try_for_each(vertices),
        "shapes" => shapes(&sizes),
        "limits" => {
            limits();
            Ok(())
        }
        other => Err(format!("{other} is none of classes, vertices, shapes, limits, plot").into()),
    }
}

/// The best ten of so many classes, bounded and by brute force.
fn classes(count: usize) -> Outcome<()> {
    let before = resident_kilobytes();
    let index = zoo::index(count)?;
    let memory = resident_kilobytes().saturating_sub(before);
    let (mut ratios, mut all_ms, mut top_ms, mut pruned, mut same) = (vec![], vec![], vec![], 0, true);
    for number in QUERIES {
        let views = zoo::query(number)?;
        let started = Instant::now();
        let all = rank(&views, &index, RankBy::Objective, &Cancel::new())?;
        all_ms.push(milliseconds(started));
        let started = Instant::now();
        let top = rank_top(&views, &index, RankBy::Objective, TOP, &Cancel::new())?;
        top_ms.push(milliseconds(started));
        ratios.push(all_ms[all_ms.len() - 1] / top_ms[top_ms.len() - 1]);
        pruned += top.pruned;
        same &= top.classes == all.classes[..TOP.min(count)];
    }
    println!(
        "{}",
        json!({
            "classes": count, "brute_ms": median(all_ms), "top_ms": median(top_ms), "ratio": median(ratios),
            "evaluated": count as f64 - pruned as f64 / QUERIES.len() as f64, "same": same,
            "kilobytes_per_class": memory / count.max(1),
        })
    );
    Ok(())
}

/// A class of so many training shapes: describing them, learning, and calibrating its confidence.
fn shapes(sizes: &[usize]) -> Outcome<()> {
    let parameters = Parameters::default();
    let mut described: Vec<Description> = Vec::new();
    let mut describe_ms = 0.0;
    for &count in sizes {
        while described.len() < count {
            let started = Instant::now();
            // Poses are five apart, as the next three are tried where one has no surface.
            let pose = 5 * described.len();
            described.push(zoo::describe(0, pose, &zoo::TRAINING, |soup| {
                describe_shape(soup, &parameters, &Cancel::new(), &|_| ())
            })?);
            describe_ms += milliseconds(started);
        }
        let shapes: Vec<&Description> = described[..count].iter().collect();
        let started = Instant::now();
        black_box(learn_model(&shapes, &parameters, &Cancel::new(), &|_, _| ())?);
        let learn_ms = milliseconds(started);
        let started = Instant::now();
        let held_out = black_box(held_out_scores(&shapes, &parameters, &Cancel::new())?);
        let calibrate_ms = milliseconds(started);
        println!(
            "{}",
            json!({ "shapes": count, "describe_ms": describe_ms / described.len() as f64 * count as f64,
                "learn_ms": learn_ms, "calibrate_ms": (!held_out.distinct.is_empty()).then_some(calibrate_ms),
                "resident_kilobytes": resident_kilobytes() })
        );
    }
    Ok(())
}

/// Binary PLY of a bumpy torus, its vertices and faces shuffled, to signatures.
fn vertices(count: usize) -> Outcome<()> {
    let bytes = torus(count);
    let source = Source {
        bytes: &bytes,
        ..Default::default()
    };
    let (mut read_ms, mut all_ms) = (vec![], vec![]);
    for _ in 0..3 {
        let started = Instant::now();
        let (_, soup) = read(&source, &Limits::default())?;
        read_ms.push(milliseconds(started));
        black_box(describe_query(
            soup,
            &Parameters::default(),
            &Cancel::new(),
            &|_| (),
        )?);
        all_ms.push(milliseconds(started));
    }
    println!(
        "{}",
        json!({ "vertices": count, "read_ms": median(read_ms), "describe_ms": median(all_ms),
            "resident_kilobytes": resident_kilobytes() })
    );
    Ok(())
}

fn torus(count: usize) -> Vec<u8> {
    let across = ((count / 2) as f64).sqrt() as usize;
    let (along, across) = (2 * across, across);
    let n = along * across;
    // A stride that shares no factor with the number of vertices or faces visits each once.
    let stride = (n * 5 / 8..)
        .find(|stride| greatest_common_divisor(*stride, 2 * n) == 1)
        .unwrap_or(1);
    let number = |i: usize, j: usize| ((i % along * across + j % across) * stride % n) as i32;
    let mut points = vec![[0f32; 3]; n];
    let mut faces = Vec::with_capacity(2 * n);
    for i in 0..along {
        for j in 0..across {
            let (u, v) = (TAU * i as f64 / along as f64, TAU * j as f64 / across as f64);
            let r = 0.35 + 0.06 * (3.0 * u).sin() * (2.0 * v).cos() + 0.03 * (7.0 * u + 2.0 * v).sin();
            let reach = 1.0 + 0.1 * (2.0 * u).cos() + r * v.cos();
            let point = [
                reach * u.cos(),
                reach * u.sin(),
                r * v.sin() * (1.0 + 0.3 * u.sin()),
            ];
            points[number(i, j) as usize] = point.map(|x| x as f32);
            let (a, b, c, d) = (
                number(i, j),
                number(i + 1, j),
                number(i + 1, j + 1),
                number(i, j + 1),
            );
            faces.extend([[a, b, c], [a, c, d]]);
        }
    }
    let mut bytes = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {n}\nproperty float x\nproperty float y\n\
         property float z\nelement face {}\nproperty list uchar int vertex_indices\nend_header\n",
        faces.len()
    )
    .into_bytes();
    bytes.extend(points.iter().flatten().flat_map(|x| x.to_le_bytes()));
    for k in 0..faces.len() {
        bytes.push(3);
        bytes.extend(
            faces[k * stride % faces.len()]
                .iter()
                .flat_map(|v| v.to_le_bytes()),
        );
    }
    bytes
}

fn greatest_common_divisor(a: usize, b: usize) -> usize {
    if b == 0 {
        a
    } else {
        greatest_common_divisor(b, a % b)
    }
}

/// Peak of a matrix product and of memory on one core.
fn limits() {
    let best = |work: &mut dyn FnMut()| {
        (0..7)
            .map(|_| {
                let started = Instant::now();
                work();
                started.elapsed().as_secs_f64()
            })
            .fold(f64::INFINITY, f64::min)
    };
    const SIDE: usize = 1024;
    let flops = 2.0 * (SIDE as f64).powi(3);
    let a = Mat::<f64>::from_fn(SIDE, SIDE, |i, j| (i + j) as f64);
    let mut c = Mat::<f64>::zeros(SIDE, SIDE);
    let double = best(&mut || matmul(c.as_mut(), Accum::Replace, a.as_ref(), a.as_ref(), 1.0, Par::Seq));
    let a = Mat::<f32>::from_fn(SIDE, SIDE, |i, j| (i + j) as f32);
    let mut c = Mat::<f32>::zeros(SIDE, SIDE);
    let single = best(&mut || matmul(c.as_mut(), Accum::Replace, a.as_ref(), a.as_ref(), 1.0, Par::Seq));
    // a ← b + s c: two values read and one written, of arrays far beyond the cache.
    const LENGTH: usize = 1 << 24;
    let (mut x, y, z) = (vec![0f64; LENGTH], vec![1f64; LENGTH], vec![2f64; LENGTH]);
    let triad = best(&mut || {
        for ((x, y), z) in x.iter_mut().zip(&y).zip(&z) {
            *x = y + 3.0 * z;
        }
        black_box(&x);
    });
    println!(
        "{}",
        json!({ "gemm_f64_gflops": flops / double / 1e9, "gemm_f32_gflops": flops / single / 1e9,
            "triad_gigabytes_per_second": 24.0 * LENGTH as f64 / triad / 1e9 })
    );
}

fn milliseconds(since: Instant) -> f64 {
    since.elapsed().as_secs_f64() * 1e3
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// Memory of this process; 0 where the system does not say.
fn resident_kilobytes() -> usize {
    std::fs::read_to_string("/proc/self/status")
        .ok()
        .and_then(|text| {
            let line = text.lines().find(|line| line.starts_with("VmRSS:"))?;
            line.split_whitespace().nth(1)?.parse().ok()
        })
        .unwrap_or(0)
}
