//! One RVE: laws, equilibrium, tangent, published numbers.

#[cfg(feature = "sparse")]
#[path = "../support/mod.rs"]
mod support;

#[cfg(all(feature = "sparse", feature = "dense"))]
mod acceptance;
#[cfg(all(feature = "sparse", feature = "dense"))]
mod frozen;
#[cfg(all(feature = "sparse", feature = "generate"))]
mod ladder;
#[cfg(feature = "sparse")]
mod laws;
#[cfg(feature = "sparse")]
mod predictor;
#[cfg(feature = "sparse")]
mod relaxation;
#[cfg(all(feature = "sparse", feature = "dense"))]
mod tangent;
#[cfg(feature = "generate")]
mod truss;
