//! Products, sums, diagonals, and all entries.

use super::Sparse;
use super::block::BlockScalar;
use crate::backends::local;
use crate::backends::rows::amortized;

amortized!([T: BlockScalar] Sparse<T>, T, invert: local::invert);
