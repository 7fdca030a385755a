//! Products, sums, diagonals and the traversal of all entries.

use super::{Batched, Lanes};
use crate::backends::csr::impl_matrix_ops;
use crate::las::Scalar;

impl_matrix_ops!([T: Scalar, const N: usize] Batched<T, N>, Lanes<T, N>);
