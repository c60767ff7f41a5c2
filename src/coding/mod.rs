//! Signatures → dictionary, signatures → codes.

pub mod dictionary;
pub mod error;
pub mod lasso;
pub mod learn;

pub use dictionary::Dictionary;
pub use error::CodingError;
pub use lasso::{Codes, encode};
pub use learn::{LearnParameters, LearnReport, learn};
