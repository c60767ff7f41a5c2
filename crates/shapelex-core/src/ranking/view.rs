//! One way a shape is seen.

use crate::parameters::{Channel, Hypothesis};
use crate::signature::Signatures;

/// A shape seen in one way.
#[derive(Clone, Debug)]
pub struct View {
    /// The hypothesis it was prepared under.
    pub hypothesis: Hypothesis,
    /// The channel its signatures are coded under.
    pub channel: Channel,
    /// Full area over visible area that was assumed; 1 unless doubled.
    pub area_scale: f64,
    /// Whether the surface has a boundary. Something is missing then, and what is near to that looks different on the
    /// whole.
    pub bounded: bool,
    /// The signals, M × N.
    pub signatures: Signatures,
}
