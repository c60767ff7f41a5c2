//! # shapelex-core
//!
//! Retrieval of deformable 3D shapes. A mesh comes in as bytes; out comes a ranking of the classes it may belong to,
//! by the method of Boscaini and Castellani, *Local Signature Quantization by Sparse Coding* (2013): every vertex gets
//! a Wave Kernel Signature, every class a dictionary learnt by sparse coding, and the class that regenerates the
//! query's signatures with the least error wins.
//!
//! Data flows one way, and a module uses only what stands to its left:
//!
//! `cancel → memory → mesh → spectral → signature → coding → parameters → ranking → pipeline → baseline →
//! retrieval`
//!
//! There is no I/O, no clock that changes a result, and no global state; randomness comes from a seed in the
//! parameters.

pub mod baseline;
pub mod cancel;
pub mod coding;
pub mod memory;
pub mod mesh;
pub mod parameters;
pub mod pipeline;
pub mod ranking;
pub mod retrieval;
pub mod signature;
pub mod spectral;
