//! Implements products, sums, diagonals and the traversal of all entries for [`Sparse`].

use super::Sparse;
use super::block::BlockScalar;
use crate::backends::csr::impl_matrix_ops;

impl_matrix_ops!([T: BlockScalar] Sparse<T>, T);
