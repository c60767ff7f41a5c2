//! Online dictionary learning.

use crate::bumps;
use faer::Mat;
use shapelex_core::cancel::{Cancel, Cancelled};
use shapelex_core::coding::{CodingError, Dictionary, LearnParameters, LearnReport, learn};
use std::sync::atomic::{AtomicUsize, Ordering};

fn learnt(signals: &Mat<f64>, parameters: &LearnParameters) -> (Dictionary, LearnReport) {
    learn(&[signals.as_ref()], parameters, &Cancel::new(), &|_, _| {}).unwrap()
}

/// Few signals and few mini-batches.
fn small() -> (Mat<f64>, LearnParameters) {
    let parameters = LearnParameters {
        atoms: 20,
        iterations: 8,
        batch: 64,
        ..LearnParameters::default()
    };
    (bumps(30, 400, 2), parameters)
}

#[test]
fn the_objective_falls_and_the_atoms_keep_their_contract() {
    let signals = bumps(60, 1500, 1);
    let parameters = LearnParameters {
        atoms: 40,
        lambda: 0.1,
        ..LearnParameters::default()
    };
    let (dictionary, report) = learnt(&signals, &parameters);
    assert_eq!((dictionary.dimension(), dictionary.len()), (60, 40));
    assert_eq!((report.signals, report.distinct_signals), (1500, 1500));
    assert_eq!((report.atoms_requested, report.atoms), (40, 40));
    assert!(
        report.objective < 0.99 * report.initial_objective,
        "{} from {}",
        report.objective,
        report.initial_objective
    );
    for j in 0..40 {
        assert!(dictionary.atoms().col(j).norm_l2() <= 1.0 + 1e-6);
        assert!(
            dictionary
                .atoms()
                .col(j)
                .iter()
                .all(|v| f64::from(*v as f32) == *v)
        );
    }
}

#[test]
fn a_planted_dictionary_is_nearly_recovered() {
    // Signals are single atoms of a dictionary of six: the optimum is λ − λ²/2 for each.
    let planted = bumps(40, 6, 9);
    let signals = Mat::from_fn(40, 600, |i, j| planted[(i, j % 6)] * (1.0 + 1e-6 * j as f64));
    let parameters = LearnParameters {
        atoms: 6,
        lambda: 0.2,
        ..LearnParameters::default()
    };
    let (_, report) = learnt(&signals, &parameters);
    assert!(report.objective < 0.2 - 0.02 + 1e-3, "{}", report.objective);
}

#[test]
fn the_same_seed_gives_the_same_dictionary_and_another_seed_another() {
    let (signals, parameters) = small();
    let (first, _) = learnt(&signals, &parameters);
    let (second, _) = learnt(&signals, &parameters);
    let (other, _) = learnt(
        &signals,
        &LearnParameters {
            seed: 2,
            ..parameters
        },
    );
    assert_eq!(first.atoms(), second.atoms());
    assert_ne!(first.atoms(), other.atoms());
}

#[test]
fn fewer_distinct_signals_than_atoms_lower_the_number_of_atoms() {
    let few = bumps(30, 7, 3);
    let signals = Mat::from_fn(30, 300, |i, j| few[(i, j % 7)] + 1e-13 * (j as f64));
    let (dictionary, report) = learnt(&signals, &LearnParameters::default());
    assert_eq!(
        (report.distinct_signals, report.atoms, dictionary.len()),
        (7, 7, 7)
    );
    assert_eq!(report.atoms_requested, 128);
    let zeros = Mat::zeros(30, 5);
    let (dictionary, report) = learnt(&zeros, &LearnParameters::default());
    assert_eq!(
        (report.distinct_signals, dictionary.len(), report.objective),
        (1, 1, 0.0)
    );
}

#[test]
fn copies_among_the_initial_atoms_are_replaced() {
    // Half the signals are one signal to within 1e-7, so most initial atoms are copies of each other.
    let various = bumps(40, 800, 4);
    let signals = Mat::from_fn(40, 800, |i, j| {
        if j % 2 == 0 {
            various[(i, j)]
        } else {
            various[(i, 0)] + 1e-7 * various[(i, j)]
        }
    });
    let parameters = LearnParameters {
        atoms: 30,
        lambda: 0.1,
        ..LearnParameters::default()
    };
    let (dictionary, report) = learnt(&signals, &parameters);
    assert!(report.replaced > 0);
    assert!(report.objective <= report.initial_objective);
    assert_eq!(dictionary.len(), 30);
}

#[test]
fn progress_is_told_and_cancellation_obeyed() {
    let signals = bumps(30, 300, 5);
    let parameters = LearnParameters {
        atoms: 10,
        iterations: 6,
        batch: 50,
        ..LearnParameters::default()
    };
    let seen = AtomicUsize::new(0);
    let told = |done, total| {
        assert_eq!((done, total), (seen.fetch_add(1, Ordering::Relaxed) + 1, 6));
    };
    learn(&[signals.as_ref()], &parameters, &Cancel::new(), &told).unwrap();
    assert_eq!(seen.load(Ordering::Relaxed), 6);
    let cancel = Cancel::new();
    let stop = |done, _| {
        if done == 2 {
            cancel.cancel();
        }
    };
    let result = learn(&[signals.as_ref()], &parameters, &cancel, &stop);
    assert_eq!(result.err(), Some(CodingError::Cancelled(Cancelled)));
}

#[test]
fn how_the_signals_are_divided_does_not_matter() {
    let (signals, parameters) = small();
    let (whole, report) = learnt(&signals, &parameters);
    // One of the parts is empty, and one row by row in memory.
    let rows = signals.subcols(150, 200).transpose().to_owned();
    let parts = [
        signals.subcols(0, 150),
        rows.transpose(),
        signals.subcols(350, 0),
        signals.subcols(350, 50),
    ];
    let (divided, divided_report) = learn(&parts, &parameters, &Cancel::new(), &|_, _| {}).unwrap();
    assert_eq!(whole.atoms(), divided.atoms());
    assert_eq!(report, divided_report);
    let other = bumps(31, 5, 2);
    let unequal = [signals.as_ref(), other.as_ref()];
    assert!(matches!(
        learn(&unequal, &parameters, &Cancel::new(), &|_, _| {}),
        Err(CodingError::DimensionMismatch { .. })
    ));
}

#[test]
fn bad_input_is_refused() {
    let signals = bumps(10, 20, 6);
    let attempt = |signals: &Mat<f64>, parameters: LearnParameters| {
        learn(&[signals.as_ref()], &parameters, &Cancel::new(), &|_, _| {}).err()
    };
    let plain = LearnParameters::default();
    assert_eq!(
        attempt(&Mat::zeros(10, 0), plain),
        Some(CodingError::NoSignatures)
    );
    assert_eq!(
        attempt(&Mat::zeros(0, 10), plain),
        Some(CodingError::NoSignatures)
    );
    for bad in [
        LearnParameters { atoms: 0, ..plain },
        LearnParameters { batch: 0, ..plain },
        LearnParameters { lambda: 0.0, ..plain },
    ] {
        assert!(matches!(
            attempt(&signals, bad),
            Some(CodingError::BadParameter { .. })
        ));
    }
    let mut poisoned = signals.clone();
    poisoned[(3, 3)] = f64::NAN;
    assert!(matches!(
        attempt(&poisoned, plain),
        Some(CodingError::NotFinite { .. })
    ));
}
