//! Signatures against independent golden values and their defining properties.

use faer::Mat;
use serde_json::Value;
use shapelex_core::cancel::Cancel;
use shapelex_core::mesh::{Limits, Source, TriMesh, read};
use shapelex_core::signature::descriptor::{Descriptor, DescriptorParameters, WksRange, describe_vertices};
use shapelex_core::signature::normalise::{Normalisation, normalise};
use shapelex_core::signature::sample::sample_by_area;
use shapelex_core::signature::{Signatures, wks::EnergyGrid};
use shapelex_core::spectral::{EigenOptions, Eigenpairs, assemble, smallest_eigenpairs};
use std::path::PathBuf;

const MESHES: [&str; 3] = ["bumpy_closed", "lobed_closed", "saddle_open_hole"];

fn golden_directory() -> PathBuf {
    shapelex_testing::data("golden")
}

fn golden() -> Value {
    let text = std::fs::read_to_string(golden_directory().join("spectral.json")).unwrap();
    serde_json::from_str(&text).unwrap()
}

fn eigenpairs(mesh: &str, n: usize) -> Eigenpairs {
    let bytes = std::fs::read(golden_directory().join(format!("{mesh}.off"))).unwrap();
    let source = Source {
        bytes: &bytes,
        ..Default::default()
    };
    let (_, soup) = read(&source, &Limits::default()).unwrap();
    let count = soup.vertices.len();
    // As it is: the golden values know no hole filling.
    let mesh = TriMesh::new(soup.vertices, soup.faces, count).unwrap();
    let operators = assemble(&mesh).unwrap();
    smallest_eigenpairs(&operators, n, &EigenOptions::default(), &Cancel::new()).unwrap()
}

fn numbers(value: &Value) -> Vec<f64> {
    value
        .as_array()
        .unwrap()
        .iter()
        .map(|v| v.as_f64().unwrap())
        .collect()
}

#[test]
fn wks_agrees_with_the_golden_values() {
    let golden = golden();
    for mesh in MESHES {
        let reference = &golden["meshes"][mesh];
        let pairs = eigenpairs(mesh, 100);
        let vertices: Vec<u32> = numbers(&reference["vertex_index"])
            .iter()
            .map(|v| *v as u32)
            .collect();
        for (reading, dimension, range) in [
            ("code_n100_M100", 100, WksRange::Code),
            ("code_n100_M500", 500, WksRange::Code),
            ("scalefree_n100_M100", 100, WksRange::ScaleFree),
            ("paper7_n100_M100", 100, WksRange::Paper7),
        ] {
            let reference = &reference["wks"][reading];
            let parameters = DescriptorParameters {
                descriptor: Descriptor::Wks,
                dimension,
                sigma_steps: 6.0,
                range,
            };
            let grid = EnergyGrid::new(&pairs.values[1..], &parameters);
            for (name, ours) in [
                ("e_min", grid.energies[0]),
                ("e_max", grid.energies[dimension - 1]),
                ("sigma", grid.sigma),
            ] {
                let theirs = reference[name].as_f64().unwrap();
                assert!(
                    (ours - theirs).abs() < 1e-6 * theirs,
                    "{mesh} {reading} {name}: {ours} against {theirs}"
                );
            }
            let signatures = describe_vertices(&pairs, &vertices, &parameters).unwrap();
            for (i, row) in reference["values"].as_array().unwrap().iter().enumerate() {
                for (e, theirs) in numbers(row).into_iter().enumerate() {
                    let ours = signatures.matrix[(e, i)];
                    assert!(
                        (ours - theirs).abs() <= 1e-5 * theirs.abs(),
                        "{mesh} {reading} vertex {i} energy {e}: {ours} against {theirs}"
                    );
                }
            }
        }
    }
}

#[test]
fn every_descriptor_is_invariant_to_the_scale_of_the_eigenvalues_it_should_be() {
    let pairs = eigenpairs("bumpy_closed", 100);
    let vertices: Vec<u32> = (0..20).map(|i| i * 30).collect();
    // A shape twice as large without normalisation of its area: λ/4, φ/2.
    let larger = Eigenpairs {
        values: pairs.values.iter().map(|v| v / 4.0).collect(),
        vectors: Mat::from_fn(pairs.vectors.nrows(), pairs.vectors.ncols(), |i, j| {
            pairs.vectors[(i, j)] / 2.0
        }),
        residual: pairs.residual,
    };
    let describe = |pairs: &Eigenpairs, descriptor, range| {
        let parameters = DescriptorParameters {
            descriptor,
            dimension: 20,
            sigma_steps: 6.0,
            range,
        };
        let mut signatures = describe_vertices(pairs, &vertices, &parameters).unwrap();
        normalise(&mut signatures, Normalisation::Unit);
        signatures.matrix
    };
    let difference = |descriptor, range| {
        let (a, b) = (
            describe(&pairs, descriptor, range),
            describe(&larger, descriptor, range),
        );
        (&a - &b).norm_l2() / a.norm_l2()
    };
    assert!(difference(Descriptor::Wks, WksRange::ScaleFree) < 1e-12);
    assert!(difference(Descriptor::Hks, WksRange::Code) < 1e-12);
    // The window of times is finite, so the shift by two octaves leaves something at its ends.
    let si_hks = difference(Descriptor::SiHks, WksRange::Code);
    assert!(si_hks < 0.05, "SI-HKS changed by {si_hks}");
    // The fixed grid is meant to see the scale.
    let fixed = WksRange::Fixed {
        low: 10f64.ln(),
        high: 3000f64.ln(),
    };
    assert!(difference(Descriptor::Wks, fixed) > 1e-3);
}

#[test]
fn hks_is_the_heat_kernel_over_the_heat_trace() {
    let pairs = eigenpairs("lobed_closed", 60);
    let parameters = DescriptorParameters {
        descriptor: Descriptor::Hks,
        dimension: 3,
        sigma_steps: 6.0,
        range: WksRange::Code,
    };
    let ours = describe_vertices(&pairs, &[7], &parameters).unwrap().matrix;
    let c = 4.0 * 10f64.ln();
    let (low, high) = (c / pairs.values[59], c / pairs.values[1]);
    for (i, t) in [low, (low * high).sqrt(), high].into_iter().enumerate() {
        let heat = |phi: &dyn Fn(usize) -> f64| -> f64 {
            (1..60).map(|k| (-pairs.values[k] * t).exp() * phi(k)).sum()
        };
        let theirs = heat(&|k| pairs.vectors[(7, k)].powi(2)) / heat(&|_| 1.0);
        assert!(
            (ours[(i, 0)] - theirs).abs() < 1e-9 * theirs,
            "t {t}: {} against {theirs}",
            ours[(i, 0)]
        );
    }
}

#[test]
fn normalisation_gives_unit_signals() {
    let matrix = Mat::from_fn(3, 2, |i, j| (i as f64 + 1.0) * if j == 0 { 1.0 } else { 100.0 });
    for how in [Normalisation::SqrtUnit, Normalisation::Unit] {
        let mut signals = Signatures {
            matrix: matrix.clone(),
            vertices: vec![0, 1],
        };
        normalise(&mut signals, how);
        assert!((signals.energy() - 2.0).abs() < 1e-14);
        assert!(
            (signals.matrix.col(0) - signals.matrix.col(1)).norm_l2() < 1e-15,
            "scale is gone"
        );
        let ratio = signals.matrix[(2, 0)] / signals.matrix[(0, 0)];
        let expected = if how == Normalisation::Unit {
            3.0
        } else {
            3f64.sqrt()
        };
        assert!((ratio - expected).abs() < 1e-14);
    }
    let mut raw = Signatures {
        matrix: matrix.clone(),
        vertices: vec![0, 1],
    };
    normalise(&mut raw, Normalisation::Raw);
    assert_eq!(raw.matrix, matrix);
}

#[test]
fn samples_follow_the_area_and_the_seed() {
    let mass: Vec<f64> = (0..1000).map(|i| if i < 500 { 3.0 } else { 1.0 }).collect();
    let sample = sample_by_area(&mass, 100, 7);
    assert_eq!(sample.len(), 100);
    assert!(sample.windows(2).all(|w| w[0] < w[1]), "ascending and distinct");
    assert_eq!(sample, sample_by_area(&mass, 100, 7));
    assert_ne!(sample, sample_by_area(&mass, 100, 8));
    let heavy: usize = (0..50)
        .map(|s| sample_by_area(&mass, 100, s).iter().filter(|&&i| i < 500).count())
        .sum();
    // Expected about 0.73 of 5000: slightly under 3/4, as draws are without replacement.
    assert!(
        (3400..3900).contains(&heavy),
        "{heavy} of 5000 draws in the heavy half"
    );
    assert_eq!(sample_by_area(&mass, 0, 1).len(), 1000);
    assert_eq!(sample_by_area(&mass, 5000, 1).len(), 1000);
}
