//! The vector and matrix operations: those of compressed rows, on all lanes at once.

use num_traits::Zero;

use super::{Batched, Lanes};
use crate::backends::csr::impl_backend_ops;
use crate::backends::local;
use crate::backends::sparse::SparseScalar;
use crate::las::Scalar;

impl_backend_ops!(
    [T: SparseScalar, const N: usize] Batched<T, N>, Lanes<T, N>, Lanes<T, N>, norm: norm, dot: dot, axpy: local::axpy
);

/// Returns `sum_i x[i] y[i]` for every lane.
#[inline(always)]
fn dot<T: Scalar, const N: usize>(x: &[Lanes<T, N>], y: &[Lanes<T, N>]) -> Lanes<T, N> {
    debug_assert_eq!(x.len(), y.len(), "vectors of one length");
    // Two independent sums shorten the dependency chain of the additions.
    let mut sums = [Lanes::<T, N>::zero(); 2];
    let (x_pairs, x_last) = x.as_chunks::<2>();
    let (y_pairs, y_last) = y.as_chunks::<2>();
    for (x, y) in x_pairs.iter().zip(y_pairs) {
        sums[0] += x[0] * y[0];
        sums[1] += x[1] * y[1];
    }
    for (&x, &y) in x_last.iter().zip(y_last) {
        sums[0] += x * y;
    }
    sums[0] + sums[1]
}

/// Returns the Euclidean norm for every lane. Lanes whose sum of squares leaves the range of the scalar are recomputed
/// with scaling.
#[inline(always)]
fn norm<T: Scalar, const N: usize>(x: &[Lanes<T, N>]) -> Lanes<T, N> {
    let squares = dot(x, x);
    let mut norms = Lanes(squares.0.map(T::sqrt));
    if !squares.0.iter().all(|&square| local::is_in_range(square)) {
        sum_scaled(x, &squares, &mut norms);
    }
    norms
}

#[cold]
fn sum_scaled<T: Scalar, const N: usize>(x: &[Lanes<T, N>], squares: &Lanes<T, N>, norms: &mut Lanes<T, N>) {
    for (lane, norm) in norms.0.iter_mut().enumerate() {
        if !local::is_in_range(squares.0[lane]) {
            *norm = local::norm(&x.iter().map(|x| x.0[lane]).collect::<Vec<T>>());
        }
    }
}
