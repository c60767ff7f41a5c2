//! The Laplacian and its eigenpairs against golden values, analytic spectra and their own definitions.

mod doubled;
mod eigenpairs;
mod operators;
mod support;
