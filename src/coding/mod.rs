//! Signatures → dictionary, signatures → codes.

mod active_set;
mod cholesky;
pub mod dictionary;
mod dictionary_update;
pub mod error;
mod initialise;
pub mod kkt;
pub mod lasso;
pub mod learn;

pub use dictionary::Dictionary;
pub use error::CodingError;
pub use kkt::kkt_violation;
pub use lasso::{CodeScore, Codes, Workspace, encode, encode_with, score_with};
pub use learn::{LearnParameters, LearnReport, learn};
