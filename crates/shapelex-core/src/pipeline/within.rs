//! What the pipeline may take.

use crate::cancel::Cancel;
use crate::memory::Reservation;

/// What describing works within: a stop flag, and memory that is granted before it is taken and given back at the end.
#[derive(Clone, Copy, Debug)]
pub struct Within<'a> {
    /// Set when the result is no longer wanted.
    pub cancel: &'a Cancel,
    /// The memory of the request or job.
    pub memory: &'a Reservation,
}
