//! Meshes through the public interface: what is read, what is refused and in which words, and at what cost.

mod bad_input;
mod budget;
mod cases;
mod cases_gltf;
mod differential;
mod encode;
mod gltf;
mod gltf_oracle;
mod gltf_work;
mod readers;
mod real_data;
