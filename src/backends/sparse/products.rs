//! Implements products, sums, diagonals and the traversal of all entries for [`Sparse`].

use super::Sparse;
use super::block::BlockScalar;
use crate::backends::csr::amortized;
use crate::backends::local;

amortized!([T: BlockScalar] Sparse<T>, T, invert: local::invert);
