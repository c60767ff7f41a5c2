//! Signatures → dictionary, signatures → codes.

mod active_set;
mod cholesky;
pub mod codes;
mod columns;
mod coordinate_descent;
pub mod dictionary;
mod dictionary_update;
mod dispatch;
mod dot;
mod encoder;
pub mod error;
mod homotopy;
mod initialise;
pub mod lasso;
pub mod learn;
pub mod optimality;
mod packed;
mod prepared;
mod problem;
mod rows;
mod scan;
mod screen;
pub mod signals;
#[cfg(target_arch = "x86_64")]
mod wide;
#[cfg(target_arch = "x86_64")]
mod wide_factor;

pub use codes::{CodeScore, Codes};
pub use dictionary::{Dictionary, PreparedRoom};
pub use error::CodingError;
pub use lasso::{encode, encode_signals, score_signals};
pub use learn::{LearnParameters, LearnReport, learn};
pub use optimality::kkt_violation;
pub use signals::Signals;
