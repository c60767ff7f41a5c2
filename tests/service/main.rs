//! The service, driven through its router: one binary, no sockets.
#![cfg(feature = "service")]

mod bad_input;
mod baselines;
mod batch;
mod catalogue;
mod contract;
mod flow;
mod harness;
mod meshes;
mod operation;
mod security;
mod uploads;
