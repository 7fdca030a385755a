//! Every backend runs the same suite.

macro_rules! conforms {
    ($($feature:literal: $test:ident, $backend:ty;)*) => {$(
        #[test]
        #[cfg(feature = $feature)]
        fn $test() {
            biotissue::las::conformance::all::<$backend>(&());
        }
    )*};
}

conforms! {
    "dense": dense_f64, biotissue::backends::dense::Dense<f64>;
    "dense": dense_f32, biotissue::backends::dense::Dense<f32>;
    "sparse": sparse_f64, biotissue::backends::sparse::Sparse<f64>;
    "sparse": sparse_f32, biotissue::backends::sparse::Sparse<f32>;
}
