//! Signature → signal (docs/method.md#signal).

use super::Signatures;
use serde::{Deserialize, Serialize};

/// How a signature is scaled before it is coded.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Normalisation {
    /// √s / ‖√s‖: the Hellinger map.
    #[default]
    SqrtUnit,
    /// s / ‖s‖.
    Unit,
    /// As it is; λ then means something else on every data set.
    Raw,
}

/// Normalises every column in place. A column of zeros, which no vertex with a spectrum has, stays as it is.
pub fn normalise(signatures: &mut Signatures, how: Normalisation) {
    for j in 0..signatures.matrix.ncols() {
        let column = signatures.matrix.col_mut(j);
        let values = column
            .try_as_col_major_mut()
            .map(|c| c.as_slice_mut())
            .unwrap_or(&mut []);
        if how == Normalisation::SqrtUnit {
            values.iter_mut().for_each(|v| *v = v.max(0.0).sqrt());
        }
        if how != Normalisation::Raw {
            let norm = values.iter().map(|v| v * v).sum::<f64>().sqrt();
            if norm > 0.0 {
                values.iter_mut().for_each(|v| *v /= norm);
            }
        }
    }
}
