//! What saves an RVE when full Newton does not converge, and what it reports when nothing does.
#![cfg(feature = "sparse")]

mod support;

use biotissue::backends::sparse::Sparse;
use biotissue::fiber::equilibrium::RveError;
use biotissue::fiber::homogenise;
use nalgebra::Matrix3;
use support::Bench;
