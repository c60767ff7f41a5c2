//! Signatures → dictionary, signatures → codes.

mod active_set;
mod cholesky;
pub mod dictionary;
mod dictionary_update;
mod dispatch;
pub mod error;
mod initialise;
pub mod kkt;
pub mod lasso;
pub mod learn;
mod path;
mod scan;
mod screen;
pub mod signals;
#[cfg(target_arch = "x86_64")]
mod wide;

pub use dictionary::Dictionary;
pub use error::CodingError;
pub use kkt::kkt_violation;
pub use lasso::{CodeScore, Codes, Workspace, encode, encode_signals, encode_with, score_signals};
pub use learn::{LearnParameters, LearnReport, learn};
pub use signals::Signals;
