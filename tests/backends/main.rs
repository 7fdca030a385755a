//! Tests of the in-memory backends: the conformance suite, memory allocations, Matrix Market files, transfers to other
//! backends, singular matrices, and multigrid.

#[cfg(any(feature = "sparse", feature = "dense"))]
#[path = "../support/counting.rs"]
mod counting;
#[cfg(feature = "batched")]
mod lanes;
#[cfg(all(feature = "sparse", feature = "dense"))]
mod matrix_market;
#[cfg(feature = "sparse")]
mod multigrid;
#[cfg(any(feature = "sparse", feature = "dense"))]
mod no_allocation;
#[cfg(all(feature = "sparse", feature = "dense"))]
mod singular;

#[cfg(any(feature = "sparse", feature = "dense", feature = "batched"))]
use biotissue::las::{
    Backend, MatMat,
    conformance::{self, Trials},
};
#[cfg(any(feature = "sparse", feature = "dense"))]
use biotissue::las::{Scalar, conformance::Capabilities};

#[cfg(any(feature = "sparse", feature = "dense"))]
#[global_allocator]
static ALLOCATOR: counting::Counting = counting::Counting;

/// Runs the suite for backends with one number per entry.
///
/// `CONFORMANCE_SEED=5 CONFORMANCE_COUNT=100000 cargo test --test backends` runs more cases, and different ones.
#[cfg(any(feature = "sparse", feature = "dense"))]
fn check_all<B>()
where
    B: Backend<Context = (), Reduced = <B as Backend>::Scalar, Scalar: Scalar, Matrix: MatMat<B>>,
{
    conformance::solvers::<B>(&(), Capabilities::ALL);
    check_operations::<B>();
}

/// Runs the part of the suite that needs no solver, for entries with any number of lanes.
#[cfg(any(feature = "sparse", feature = "dense", feature = "batched"))]
fn check_operations<B: Backend<Context = (), Matrix: MatMat<B>>>() {
    let trials = Trials { count: 4000, ..Trials::default() }.or_from_environment();
    conformance::vectors::<B>(&(), trials);
    conformance::matrices::<B>(&(), trials);
    conformance::products::<B>(&(), trials);
    conformance::entries::<B>(&(), trials);
    conformance::algebra::<B>(&(), trials);
}

#[test]
#[cfg(feature = "batched")]
fn batched() {
    use biotissue::backends::batched::Batched;
    check_operations::<Batched<f64, 4>>();
    check_operations::<Batched<f64, 1>>();
    check_operations::<Batched<f32, 7>>();
}

/// With 4 and 8 lanes of `f64`, trusses are factored in vector registers where the machine has them.
#[test]
#[cfg(feature = "batched")]
fn batched_solvers() {
    use biotissue::backends::batched::Batched;
    conformance::solvers::<Batched<f64, 4>>(&(), Capabilities::ALL);
    conformance::solvers::<Batched<f64, 8>>(&(), Capabilities::ALL);
    conformance::solvers::<Batched<f32, 3>>(&(), Capabilities::ALL);
}

#[test]
#[cfg(feature = "dense")]
fn dense_f64() {
    check_all::<biotissue::backends::dense::Dense<f64>>();
}

#[test]
#[cfg(feature = "dense")]
fn dense_f32() {
    check_all::<biotissue::backends::dense::Dense<f32>>();
}

#[test]
#[cfg(feature = "sparse")]
fn sparse_f64() {
    check_all::<biotissue::backends::sparse::Sparse<f64>>();
}

#[test]
#[cfg(feature = "sparse")]
fn sparse_f32() {
    check_all::<biotissue::backends::sparse::Sparse<f32>>();
}
