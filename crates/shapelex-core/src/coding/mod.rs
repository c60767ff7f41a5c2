//! Signatures → dictionary, signatures → codes.

mod active_set;
mod cholesky;
mod columns;
pub mod dictionary;
mod dictionary_update;
mod dispatch;
mod dot;
pub mod error;
mod initialise;
pub mod kkt;
pub mod lasso;
pub mod learn;
mod path;
mod prepared;
mod scan;
mod screen;
pub mod signals;
#[cfg(target_arch = "x86_64")]
mod wide;
#[cfg(target_arch = "x86_64")]
mod wide_factor;
mod workspace;

pub use dictionary::{Dictionary, PreparedRoom};
pub use error::CodingError;
pub use kkt::kkt_violation;
pub use lasso::{CodeScore, Codes, encode, encode_signals, score_signals};
pub use learn::{LearnParameters, LearnReport, learn};
pub use signals::Signals;
