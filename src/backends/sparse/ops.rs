//! Implements the vector and matrix operations of assembly for [`Sparse`].

use super::Sparse;
use super::block::BlockScalar;
use crate::backends::csr::impl_assembly_ops;
use crate::backends::local;

impl_assembly_ops!([T: BlockScalar] Sparse<T>, T, T, norm: local::norm, dot: local::dot);
