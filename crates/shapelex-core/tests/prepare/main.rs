//! Soup → clean mesh, and the mesh transforms of the hypotheses, on procedural, hostile, golden and real input.

mod cleaning;
mod hostile;
mod hubs;
mod hypotheses;
mod large;
mod noise;
mod real;
mod refinement;
mod shapes;
mod simplification;
mod slivers;
