//! Meshes through the public interface: what is read, what is refused and in which words.

mod bad_input;
mod cases_gltf;
mod encode;
mod gltf;
mod gltf_oracle;
mod gltf_work;
mod readers;
mod real_data;
