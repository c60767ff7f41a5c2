//! Meshes through the public interface: what is read, what is refused and in which words, and at what cost.

mod bad_input;
mod budget;
mod cases;
mod differential;
mod encode;
mod gltf;
mod readers;
mod real_data;
