//! Implements the vector and matrix operations of assembly for [`Sparse`].

use super::Sparse;
use super::block::BlockScalar;
use crate::backends::csr::hot_verbs;
use crate::backends::local;

hot_verbs!([T: BlockScalar] Sparse<T>, T, T, norm: local::norm, dot: local::dot);
