//! What is ranked, and by which measure.

use crate::cancel::Cancel;
use crate::coding::Dictionary;
use crate::parameters::{Channel, RankBy};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Something with dictionaries to be ranked by: a class or a shape.
#[derive(Clone, Copy)]
pub(super) struct Candidate<'a> {
    pub label: &'a str,
    pub dictionaries: &'a BTreeMap<Channel, Arc<Dictionary>>,
}

/// How a candidate is measured.
#[derive(Clone, Copy)]
pub(super) struct Measure<'a> {
    pub lambda: f64,
    pub rank_by: RankBy,
    pub cancel: &'a Cancel,
}
