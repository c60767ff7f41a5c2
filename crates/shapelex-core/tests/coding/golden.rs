//! Codes and objectives of an independent solver, polished to 1e-15.

use faer::Mat;
use serde::Deserialize;
use shapelex_core::cancel::Cancel;
use shapelex_core::coding::{Dictionary, encode, kkt_violation};
use std::collections::BTreeMap;

#[derive(Deserialize)]
struct Golden {
    dictionary_atoms: Vec<Vec<f64>>,
    signals: Vec<Vec<f64>>,
    cases: Vec<Case>,
}

#[derive(Deserialize)]
struct Case {
    lam: f64,
    nnz: Vec<usize>,
    objective: Vec<f64>,
    /// Atom and value of each non-zero, by signal.
    codes: Vec<BTreeMap<u32, f64>>,
}

fn columns(values: &[Vec<f64>]) -> Mat<f64> {
    Mat::from_fn(values[0].len(), values.len(), |i, j| values[j][i])
}

#[test]
fn objectives_and_codes_agree_with_the_reference() {
    let golden: Golden =
        serde_json::from_str(include_str!("../../../../tests/data/golden/lasso.json")).unwrap();
    let dictionary = Dictionary::new(columns(&golden.dictionary_atoms)).unwrap();
    let signals = columns(&golden.signals);
    assert_eq!(golden.cases.len(), 4);
    for case in &golden.cases {
        let codes = encode(&dictionary, signals.as_ref(), case.lam, &Cancel::new()).unwrap();
        for (i, expected) in case.objective.iter().enumerate() {
            let found = codes.objective[i];
            assert!(
                (found - expected).abs() <= 1e-9 * expected,
                "λ {}, signal {i}: {found:e} against {expected:e}",
                case.lam
            );
        }
        let nonzeros: Vec<usize> = codes.offsets.windows(2).map(|w| w[1] - w[0]).collect();
        assert_eq!(nonzeros, case.nnz, "λ {}", case.lam);
        for (i, expected) in case.codes.iter().enumerate() {
            let range = codes.offsets[i]..codes.offsets[i + 1];
            let found = codes.atoms[range.clone()].iter().zip(&codes.values[range]);
            for ((atom, value), (expected_atom, expected)) in found.zip(expected) {
                assert_eq!(atom, expected_atom, "λ {}, signal {i}", case.lam);
                assert!(
                    (value - expected).abs() <= 1e-8,
                    "λ {}, signal {i}: {value} {expected}",
                    case.lam
                );
            }
        }
        let violations = kkt_violation(&dictionary, signals.as_ref(), case.lam, &codes).unwrap();
        for (i, violation) in violations.iter().enumerate() {
            assert!(
                *violation <= 1e-9 * case.lam + 1e-13,
                "λ {}, signal {i}: {violation:e}",
                case.lam
            );
        }
    }
}
