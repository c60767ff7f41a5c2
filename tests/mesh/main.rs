//! Meshes through the public interface: what is read, what is refused and in which words.

mod bad_input;
mod encode;
mod gltf;
mod readers;
mod real_data;
