//! The service, driven through its router: one binary, no sockets.

mod answers;
mod bad_input;
mod baselines;
mod batch;
mod bodies;
mod catalogue;
mod connections;
mod contract;
mod dashboards;
mod datasets;
mod flow;
mod gltf_buffers;
mod harness;
mod limits;
mod long_texts;
mod meshes;
mod operation;
mod promises;
mod recovery_mode;
mod security;
mod snapshots;
mod stored_files;
mod stored_queries;
mod strangers;
mod uploads;
mod wire;
