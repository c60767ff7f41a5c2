//! # shapelex-core
//!
//! Retrieval of deformable 3D shapes. A mesh comes in as bytes; out comes a ranking of the classes it may belong to,
//! by the method of Boscaini and Castellani, *Local Signature Quantization by Sparse Coding* (2013): every vertex gets
//! a Wave Kernel Signature, every class a dictionary learnt by sparse coding, and the class that regenerates the
//! query's signatures with the least error wins.
//!
//! ```
//! use shapelex_core::cancel::Cancel;
//! use shapelex_core::mesh::{Limits, Source, read};
//! use shapelex_core::parameters::{Parameters, Preset};
//! use shapelex_core::pipeline::{describe_shape, learn_model};
//! use shapelex_core::ranking::{Index, IndexedClass, NotJudged};
//! use shapelex_core::retrieval::{Deadline, QueryEngine, QuerySpec, RankingMethod, SearchIndex};
//! use std::collections::BTreeMap;
//!
//! # fn ellipsoid(stretch: f64) -> Vec<u8> {
//! #     // A latitude-longitude grid as OFF.
//! #     let (rings, sectors) = (14_usize, 20_usize);
//! #     let angle = |i: usize, n: usize| std::f64::consts::PI * i as f64 / n as f64;
//! #     let mut vertices = vec![[0.0, 0.0, stretch]];
//! #     for r in 1..rings {
//! #         for s in 0..sectors {
//! #             let (p, t) = (angle(r, rings), 2.0 * angle(s, sectors));
//! #             vertices.push([p.sin() * t.cos(), 0.7 * p.sin() * t.sin(), stretch * p.cos()]);
//! #         }
//! #     }
//! #     vertices.push([0.0, 0.0, -stretch]);
//! #     let at = |r: usize, s: usize| 1 + (r - 1) * sectors + s % sectors;
//! #     let mut faces = Vec::new();
//! #     for s in 0..sectors {
//! #         faces.push([0, at(1, s), at(1, s + 1)]);
//! #         faces.push([vertices.len() - 1, at(rings - 1, s + 1), at(rings - 1, s)]);
//! #         for r in 1..rings - 1 {
//! #             faces.push([at(r, s), at(r + 1, s), at(r + 1, s + 1)]);
//! #             faces.push([at(r, s), at(r + 1, s + 1), at(r, s + 1)]);
//! #         }
//! #     }
//! #     let mut text = format!("OFF\n{} {} 0\n", vertices.len(), faces.len());
//! #     for [x, y, z] in vertices { text += &format!("{x} {y} {z}\n"); }
//! #     for [a, b, c] in faces { text += &format!("3 {a} {b} {c}\n"); }
//! #     text.into_bytes()
//! # }
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let parameters = Parameters { atoms: 16, ..Parameters::preset(Preset::Fast) };
//! let cancel = Cancel::new();
//! let mesh = |bytes: &[u8]| {
//!     let source = Source { bytes, name: Some("mesh.off"), media_type: None, companions: &[] };
//!     read(&source, &Limits::default()).map(|(_, soup)| soup)
//! };
//!
//! // Two classes of one shape each: a round and a long ellipsoid.
//! let mut classes = Vec::new();
//! for (label, stretch) in [("round", 1.0), ("long", 2.5)] {
//!     let shape = describe_shape(mesh(&ellipsoid(stretch))?, &parameters, &cancel, &|_| ())?;
//!     let model = learn_model(&[&shape], &parameters, &cancel, &|_, _| ())?;
//!     classes.push(IndexedClass { label: label.into(), dictionaries: model.dictionaries, shapes: Vec::new() });
//! }
//! let index = SearchIndex {
//!     dictionaries: Index { parameters: parameters.clone(), classes },
//!     names: BTreeMap::new(),
//!     baselines: None,
//!     calibration: Err(NotJudged::TooFewShapes),
//! };
//!
//! let query = mesh(&ellipsoid(2.4))?;
//! let spec = QuerySpec { method: RankingMethod::SparseCoding(parameters.rank_by), top: None };
//! let outcome = QueryEngine::default().run(&index, query, &spec, &Deadline::default())?;
//! assert_eq!(outcome.classes[0].label, "long");
//! # Ok(())
//! # }
//! ```
//!
//! Data flows one way, and a module uses only what stands to its left:
//!
//! `cancel → memory → mesh → spectral → signature → coding → parameters → ranking → pipeline → baseline →
//! retrieval`
//!
//! There is no I/O, no clock that changes a result, and no global state; randomness comes from a seed in the
//! parameters.

#![warn(missing_docs)]
#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

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
