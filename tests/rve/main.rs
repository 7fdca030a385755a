//! Tests of networks and single RVEs: files, zero modes, laws, equilibrium, tangent, published results.

#[cfg(feature = "sparse")]
#[path = "../support/counting.rs"]
mod counting;
#[cfg(feature = "sparse")]
#[path = "../support/mod.rs"]
mod support;

#[cfg(all(feature = "sparse", feature = "dense"))]
mod acceptance;
mod damaged_files;
#[cfg(all(feature = "sparse", feature = "dense"))]
mod doubled;
#[cfg(all(feature = "sparse", feature = "dense"))]
mod frozen;
#[cfg(all(feature = "sparse", feature = "generate"))]
mod ladder;
#[cfg(feature = "sparse")]
mod laws;
#[cfg(feature = "sparse")]
mod no_allocation;
#[cfg(feature = "sparse")]
mod predictor;
#[cfg(feature = "sparse")]
mod relaxation;
#[cfg(all(feature = "sparse", feature = "dense"))]
mod rigidity;
#[cfg(all(feature = "sparse", feature = "generate"))]
mod stability;
#[cfg(all(feature = "sparse", feature = "dense"))]
mod stress_gradient;
#[cfg(all(feature = "sparse", feature = "dense"))]
mod tangent;
#[cfg(feature = "generate")]
mod truss;

#[cfg(feature = "sparse")]
#[global_allocator]
static ALLOCATOR: counting::Counting = counting::Counting;
