//! The hot verbs.

use super::Sparse;
use super::block::BlockScalar;
use crate::backends::local;
use crate::backends::rows::hot_verbs;

hot_verbs!([T: BlockScalar] Sparse<T>, T, T, norm: local::norm, dot: local::dot);
