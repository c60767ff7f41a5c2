//! # shapelex-eval
//!
//! Evaluation of [`shapelex_core`]: procedural articulated creatures to try it on, deformations, protocols over labelled
//! shapes, retrieval measures, and figures.
//!
//! Data flows one way: `sample → benchmark → figure`.

#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

pub mod benchmark;
pub mod figure;
pub mod sample;
