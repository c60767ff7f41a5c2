//! # shapelex
//!
//! The service around [`shapelex_core`]: classes of shapes are kept in a store, jobs learn their dictionaries, and
//! queries are ranked over HTTP or from the command line.
//!
//! Data flows one way, and a module uses only what stands to its left:
//!
//! `model → store → jobs → http → telemetry → config → cli → main`
//!
//! The method itself is `shapelex-core`; `shapelex-eval` measures it.

#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

pub mod cli;
pub mod config;
pub mod http;
pub mod jobs;
pub mod model;
pub mod store;
pub mod telemetry;
