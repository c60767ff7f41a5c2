//! What is known of a shape before it is coded.

use crate::mesh::PrepareReport;
use crate::ranking::View;

/// Everything a shape's coding needs.
#[derive(Clone, Debug)]
pub struct Description {
    /// The ways the shape is seen. For a training shape one per channel; the first is always plain.
    pub views: Vec<View>,
    /// What preparing did.
    pub report: PrepareReport,
    /// The first eigenvalues of the plain view (up to 20), dimensionless.
    pub eigenvalues: Vec<f64>,
}
