//! Products, sums, diagonals and the traversal of all entries.

use super::{Batched, Lanes};
use crate::backends::csr::impl_matrix_ops;
use crate::las::{Scalar, SolveError};

impl_matrix_ops!([T: Scalar, const N: usize] Batched<T, N>, Lanes<T, N>, invert: invert);

fn invert<T: Scalar, const N: usize, F>(d: &mut [Lanes<T, N>]) -> Result<(), SolveError<F>> {
    if let Some(row) = d.iter().position(|d| d.0.iter().any(T::is_zero)) {
        return Err(SolveError::ZeroDiagonal { row });
    }
    d.iter_mut().for_each(|d| *d = Lanes(d.0.map(T::recip)));
    Ok(())
}
