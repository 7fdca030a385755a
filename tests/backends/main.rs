//! Every backend runs the same suite, and keeps the same properties; memory; files and other backends.

#[cfg(any(feature = "sparse", feature = "dense"))]
#[path = "../support/counting.rs"]
mod counting;
#[cfg(any(feature = "sparse", feature = "dense", feature = "batched"))]
#[path = "../properties/mod.rs"]
mod properties;

#[cfg(all(feature = "sparse", feature = "dense"))]
mod matrix_market;
#[cfg(any(feature = "sparse", feature = "dense"))]
mod no_allocation;
#[cfg(all(feature = "sparse", feature = "dense"))]
mod singular;

#[cfg(any(feature = "sparse", feature = "dense"))]
#[global_allocator]
static ALLOCATOR: counting::Counting = counting::Counting;

macro_rules! conforms {
    ($($feature:literal: $test:ident, $backend:ty;)*) => {$(
        #[test]
        #[cfg(feature = $feature)]
        fn $test() {
            biotissue::las::conformance::all::<$backend>(&());
        }
    )*};
}

macro_rules! keeps_properties {
    ($($feature:literal: $test:ident, $($backend:ty),*;)*) => {$(
        #[test]
        #[cfg(feature = $feature)]
        fn $test() {
            let trials = properties::Trials { cases: 4000, shrink: true };
            $(properties::all::<$backend>(&(), trials);)*
        }
    )*};
}

/// A backend with several numbers an entry, and no solver.
#[cfg(feature = "batched")]
fn conforms_in_lanes<B: biotissue::las::Backend<Context = ()>>() {
    use biotissue::las::conformance::{algebra, matrices, products, vectors};
    vectors::<B>(&());
    matrices::<B>(&());
    products::<B>(&());
    algebra::<B>(&());
}

#[test]
#[cfg(feature = "batched")]
fn batched() {
    use biotissue::backends::batched::Batched;
    conforms_in_lanes::<Batched<f64, 4>>();
    conforms_in_lanes::<Batched<f64, 1>>();
    conforms_in_lanes::<Batched<f32, 7>>();
}

conforms! {
    "dense": dense_f64, biotissue::backends::dense::Dense<f64>;
    "dense": dense_f32, biotissue::backends::dense::Dense<f32>;
    "sparse": sparse_f64, biotissue::backends::sparse::Sparse<f64>;
    "sparse": sparse_f32, biotissue::backends::sparse::Sparse<f32>;
}

keeps_properties! {
    "dense": properties_of_dense, biotissue::backends::dense::Dense<f64>, biotissue::backends::dense::Dense<f32>;
    "sparse": properties_of_sparse, biotissue::backends::sparse::Sparse<f64>, biotissue::backends::sparse::Sparse<f32>;
    "batched": properties_of_batched,
        biotissue::backends::batched::Batched<f64, 1>,
        biotissue::backends::batched::Batched<f64, 4>,
        biotissue::backends::batched::Batched<f32, 7>;
}
