//! Coding and learning on smooth synthetic signals of the presets' sizes.

use criterion::{Criterion, criterion_group, criterion_main};
use faer::Mat;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use shapelex_core::cancel::Cancel;
use shapelex_core::coding::{Dictionary, LearnParameters, Signals, encode, learn, score_signals};
use std::hint::black_box;

/// Bumps that move and swell smoothly from signal to signal, as signatures do along a mesh; unit norm times `norm`.
fn signals(dimension: usize, count: usize, norm: f64, seed: u64) -> Mat<f64> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut draw = |low: f64, high: f64| random.random_range(low..high);
    let bumps: Vec<[f64; 5]> = (0..12)
        .map(|_| {
            [
                draw(0.0, 1.0),
                draw(0.02, 0.15),
                draw(0.0, 1.0),
                draw(1.0, 9.0),
                draw(0.0, 6.3),
            ]
        })
        .collect();
    let mut all = Mat::from_fn(dimension, count, |i, j| {
        let (x, t) = (i as f64 / dimension as f64, j as f64 / count as f64);
        let bump = |b: &[f64; 5]| {
            let phase = (b[3] * t * 6.3 + b[4]).sin();
            b[2] * (1.0 + phase) * (-((x - b[0] - 0.05 * phase) / b[1]).powi(2)).exp()
        };
        1.0 + bumps.iter().map(bump).sum::<f64>()
    });
    for j in 0..count {
        let scale = norm / all.col(j).norm_l2();
        all.col_mut(j).iter_mut().for_each(|v| *v *= scale);
    }
    all
}

fn coding(criterion: &mut Criterion) {
    let cancel = Cancel::new();
    let mut group = criterion.benchmark_group("coding");
    group.sample_size(10);
    for (name, dimension, atoms, norm) in [
        ("default", 100, 128, 1.0),
        ("paper_unit", 500, 500, 1.0),
        ("paper_raw", 500, 500, 25.0),
    ] {
        let training = signals(dimension, 3000, norm, 1);
        let query = signals(dimension, 1500, norm, 2);
        let Ok(ready) = Signals::new(query.as_ref()) else {
            continue;
        };
        let parameters = LearnParameters {
            atoms,
            ..LearnParameters::default()
        };
        group.bench_function(format!("learn/{name}"), |bencher| {
            bencher.iter(|| black_box(learn(&[training.as_ref()], &parameters, &cancel, &|_, _| {})));
        });
        let Ok((dictionary, _)) = learn(&[training.as_ref()], &parameters, &cancel, &|_, _| {}) else {
            continue;
        };
        group.bench_function(format!("dictionary/{name}"), |bencher| {
            bencher.iter(|| black_box(Dictionary::new(dictionary.atoms().into_owned())));
        });
        for lambda in [0.5, 0.05] {
            group.bench_function(format!("encode/{name}/{lambda}"), |bencher| {
                bencher.iter(|| black_box(encode(&dictionary, query.as_ref(), lambda, &cancel)));
            });
            group.bench_function(format!("score/{name}/{lambda}"), |bencher| {
                bencher.iter(|| black_box(score_signals(&dictionary, &ready, lambda, &cancel)));
            });
        }
    }
    group.finish();
}

criterion_group!(benches, coding);
criterion_main!(benches);
