//! The Lasso on coherent, degenerate and invalid input.

use crate::bumps;
use faer::Mat;
use proptest::prelude::*;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use shapelex_core::cancel::{Cancel, Cancelled};
use shapelex_core::coding::{Codes, CodingError, Dictionary, Signals, encode, kkt_violation, score_signals};

/// A dictionary of bumps in which atoms are pulled towards others, up to exact copies.
fn coherent_dictionary(dimension: usize, atoms: usize, seed: u64) -> Dictionary {
    let mut random = ChaCha8Rng::seed_from_u64(seed ^ 0x5eed);
    let mut all = bumps(dimension, atoms, seed);
    for j in 1..atoms {
        // Coherence with an earlier atom from about 0.9 to 1 − 1e-14, and 1.
        let distance = [1.0, 0.3, 0.1, 1e-3, 1e-5, 1e-7, 0.0][random.random_range(0..7)];
        let i = random.random_range(0..j);
        for m in 0..dimension {
            all[(m, j)] = all[(m, i)] + distance * (all[(m, j)] - all[(m, i)]);
        }
        let norm = all.col(j).norm_l2();
        all.col_mut(j).iter_mut().for_each(|v| *v /= norm);
    }
    Dictionary::new(all).unwrap()
}

fn check(dictionary: &Dictionary, signals: &Mat<f64>, lambda: f64) -> Codes {
    let codes = encode(dictionary, signals.as_ref(), lambda, &Cancel::new()).unwrap();
    let violations = kkt_violation(dictionary, signals.as_ref(), lambda, &codes).unwrap();
    for (i, violation) in violations.iter().enumerate() {
        let norm = signals.col(i).norm_l2();
        assert!(
            *violation <= 1.1e-9 * lambda + 1e-13 * norm,
            "λ {lambda}, signal {i}: violation {violation:e}, code {:?}",
            &codes.values[codes.offsets[i]..codes.offsets[i + 1]]
        );
        let (mut residual, mut norm1) = (signals.col(i).to_owned(), 0.0);
        for k in codes.offsets[i]..codes.offsets[i + 1] {
            residual -= faer::Scale(codes.values[k]) * dictionary.atoms().col(codes.atoms[k] as usize);
            norm1 += codes.values[k].abs();
        }
        let residual2 = residual.squared_norm_l2();
        let objective = 0.5 * residual2 + lambda * norm1;
        assert!(
            (codes.objective[i] - objective).abs() <= 1e-9 * objective,
            "objective of signal {i}"
        );
        assert!(
            (codes.residual2[i] - residual2).abs() <= 1e-8 * residual2 + 1e-28 * norm * norm,
            "residual of signal {i}: {:e} against {residual2:e}",
            codes.residual2[i]
        );
    }
    codes
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(64) })]

    #[test]
    fn optimality_holds_on_coherent_dictionaries(
        seed in 0u64..1 << 40,
        dimension in 1usize..60,
        atoms in 1usize..80,
        exponent in -3.0f64..0.0,
    ) {
        let dictionary = coherent_dictionary(dimension, atoms, seed);
        let signals = bumps(dimension, 40, seed + 1);
        check(&dictionary, &signals, 10f64.powf(exponent));
    }

    #[test]
    fn optimality_holds_on_signed_noise(seed in 0u64..1 << 40, dimension in 1usize..30, atoms in 1usize..60) {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut draw = |columns, scale: f64| {
            Mat::from_fn(dimension, columns, |_, _| scale * random.random_range(-1.0..1.0))
        };
        let dictionary = Dictionary::new(draw(atoms, (dimension as f64).sqrt().recip())).unwrap();
        let signals = draw(30, 3.0);
        check(&dictionary, &signals, 0.05);
    }

    #[test]
    fn scaling_signal_and_lambda_scales_the_code(seed in 0u64..1 << 40, exponent in -17.0f64..17.0) {
        let factor = 10f64.powf(exponent);
        let dictionary = coherent_dictionary(30, 20, seed);
        let signals = bumps(30, 10, seed + 1);
        let plain = check(&dictionary, &signals, 0.1);
        let scaled = check(&dictionary, &(faer::Scale(factor) * &signals), 0.1 * factor);
        for (a, b) in plain.objective.iter().zip(&scaled.objective) {
            prop_assert!((a * factor * factor - b).abs() <= 1e-8 * b);
        }
    }
}

#[test]
fn exact_copies_cost_nothing_and_change_nothing() {
    let once = bumps(40, 12, 3);
    let thrice = Mat::from_fn(40, 36, |i, j| once[(i, j % 12)]);
    let signals = bumps(40, 50, 4);
    for lambda in [0.5, 0.05, 0.001] {
        let plain = check(&Dictionary::new(once.clone()).unwrap(), &signals, lambda);
        let copied = check(&Dictionary::new(thrice.clone()).unwrap(), &signals, lambda);
        for (a, b) in plain.objective.iter().zip(&copied.objective) {
            assert!((a - b).abs() <= 1e-9 * a);
        }
    }
}

#[test]
fn an_atom_longer_than_a_combination_of_others_takes_their_place() {
    // d_3 = 0.6 (d_1 + d_2) reaches the signal (1, 1) at a lower ‖a‖₁ than d_1 and d_2 together.
    let atoms = Mat::from_fn(
        2,
        3,
        |i, j| if j == 2 { 0.6 } else { f64::from(u8::from(i == j)) },
    );
    let dictionary = Dictionary::new(atoms).unwrap();
    // The first signals keep to one of the first two atoms each.
    let signals = Mat::from_fn(2, 3, |i, j| [[3.0, 0.5], [0.5, 3.0], [1.0, 1.0]][j][i]);
    let codes = check(&dictionary, &signals, 0.05);
    assert_eq!(codes.atoms[codes.offsets[2]..], [2]);
}

#[test]
fn zero_signals_and_large_lambda_give_empty_codes() {
    let dictionary = Dictionary::new(bumps(20, 10, 1)).unwrap();
    let mut signals = bumps(20, 5, 2);
    signals.col_mut(3).fill(0.0);
    let codes = check(&dictionary, &signals, 0.1);
    assert_eq!((codes.offsets[3], codes.objective[3]), (codes.offsets[4], 0.0));
    let codes = check(&dictionary, &signals, 1.01);
    assert!(codes.atoms.is_empty());
    assert!((codes.objective[0] - 0.5).abs() < 1e-15);
    let empty = Dictionary::new(Mat::zeros(20, 0)).unwrap();
    assert!(check(&empty, &signals, 0.1).atoms.is_empty());
    let zero = Dictionary::new(Mat::zeros(20, 3)).unwrap();
    assert!(check(&zero, &signals, 0.1).atoms.is_empty());
}

#[test]
fn scores_equal_codes_and_do_not_depend_on_what_was_coded_before() {
    let dictionary = coherent_dictionary(50, 40, 5);
    let signals = bumps(50, 700, 6);
    let codes = check(&dictionary, &signals, 0.02);
    let other = Dictionary::new(bumps(20, 60, 1)).unwrap();
    let few = bumps(20, 9, 2);
    let few = Signals::new(few.as_ref()).unwrap();
    score_signals(&other, &few, 0.5, &Cancel::new()).unwrap();
    let ready = Signals::new(signals.as_ref()).unwrap();
    let scores = score_signals(&dictionary, &ready, 0.02, &Cancel::new()).unwrap();
    for (i, score) in scores.iter().enumerate() {
        assert_eq!(score.objective, codes.objective[i]);
        assert_eq!(score.residual2, codes.residual2[i]);
        assert_eq!(score.nonzeros, codes.offsets[i + 1] - codes.offsets[i]);
    }
}

#[test]
fn any_memory_layout_is_read_right() {
    let dictionary = Dictionary::new(bumps(30, 20, 1)).unwrap();
    let signals = bumps(30, 20, 2);
    let rows = signals.transpose().to_owned();
    let plain = check(&dictionary, &signals, 0.1);
    let transposed = encode(&dictionary, rows.transpose(), 0.1, &Cancel::new()).unwrap();
    assert_eq!(plain, transposed);
}

#[test]
fn bad_input_is_refused() {
    let dictionary = Dictionary::new(bumps(20, 10, 1)).unwrap();
    let signals = bumps(20, 5, 2);
    let code = |signals: &Mat<f64>, lambda| encode(&dictionary, signals.as_ref(), lambda, &Cancel::new());
    for lambda in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(
            code(&signals, lambda),
            Err(CodingError::BadParameter { name: "lambda", .. })
        ));
    }
    assert!(matches!(
        code(&bumps(21, 5, 2), 0.1),
        Err(CodingError::DimensionMismatch {
            signature: 21,
            atoms: 20
        })
    ));
    for poison in [f64::NAN, f64::INFINITY] {
        let mut signals = signals.clone();
        signals[(7, 2)] = poison;
        assert!(matches!(code(&signals, 0.1), Err(CodingError::NotFinite { .. })));
    }
    let cancel = Cancel::new();
    cancel.cancel();
    assert_eq!(
        encode(&dictionary, signals.as_ref(), 0.1, &cancel),
        Err(CodingError::Cancelled(Cancelled))
    );
}
