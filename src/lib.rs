//! # shapelex
//!
//! Retrieval of deformable 3D shapes. A mesh comes in as bytes; out comes a ranking of the classes it may belong to,
//! by the method of Boscaini and Castellani, *Local Signature Quantization by Sparse Coding* (2013): every vertex gets
//! a Wave Kernel Signature, every class a dictionary learnt by sparse coding, and the class that regenerates the
//! query's signatures with the least error wins.
//!
//! Data flows one way, and a module uses only what stands to its left:
//!
//! `cancel → memory → mesh → spectral → signature → coding → parameters → ranking → pipeline → (baseline, sample, benchmark) → figure →
//! model → store → jobs → http → cli → main`
//!
//! The modules up to `benchmark` are the numeric core: no I/O, no clock, no globals; randomness comes from a seed in
//! the parameters. They build without the `service` feature.

pub mod baseline;
pub mod benchmark;
pub mod cancel;
pub mod coding;
pub mod memory;
pub mod mesh;
pub mod parameters;
pub mod pipeline;
pub mod ranking;
pub mod sample;
pub mod signature;
pub mod spectral;

#[cfg(feature = "service")]
pub mod cli;
#[cfg(feature = "service")]
pub mod config;
#[cfg(feature = "service")]
pub mod figure;
#[cfg(feature = "service")]
pub mod http;
#[cfg(feature = "service")]
pub mod jobs;
#[cfg(feature = "service")]
pub mod model;
#[cfg(feature = "service")]
pub mod store;
#[cfg(feature = "service")]
pub mod telemetry;
