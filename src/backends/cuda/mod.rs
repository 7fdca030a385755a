//! `cuda`: graphics processors of NVIDIA.
//!
//! Building needs nothing of CUDA: the driver, the run-time compiler NVRTC and cuSPARSE are loaded when a [`Device`] is
//! opened and used. What is missing is reported by [`CudaError`].
//!
//! # What runs where
//! | on the host | on the device |
//! |---|---|
//! | single entries and blocks: `add`, `set`, `get`, `add_at`, `add_blocks` on all threads | `norm`, `dot`, `axpy`, `axpby`, `multiply` |
//! | sums and products of matrices, the diagonal | products with vectors: cuSPARSE, or a kernel of this crate without it |
//! | setup of multigrid | conjugate gradients, BiCGSTAB and GMRES with no, diagonal or multigrid preconditioner |
//! | direct solvers: those of [`sparse`](crate::backends::sparse) | |
//!
//! Vectors and matrices have a copy on the host and one on the device; each is renewed when it is needed. A vector or
//! matrix gets memory on the device by its first operation there, and from then on `finish` sends what was written on
//! the host, in one transfer. Therefore write and read many entries between two operations of the device: `set` and `get`
//! scatter and gather by any number of indices, and the first of several calls transfers all entries of the vector.
//!
//! Multigrid has the levels of [`sparse::multigrid`](crate::backends::sparse::multigrid), which the host builds, but
//! another smoother: Gauss-Seidel sweeps are sequential, so that the device runs Chebyshev iterations with the inverses
//! of the diagonal blocks, in single precision. The coarsest matrix, of at most 8192 unknowns, is inverted on the host.
//! Numbers of iterations differ a little from those of `sparse`.
//!
//! The direct solver of NVIDIA, cuSOLVER's `csrlsvchol` and its relatives, is deprecated, factors on one thread of the
//! host or with much fill, and does not separate the analysis of a pattern from the factorization; the solvers of
//! `sparse` do. They are used instead.
//!
//! All results have the same bits in every run on the same device model: sums have a fixed order, and cuSPARSE runs
//! its repeatable algorithm.
//!
//! ```no_run
//! use std::sync::Arc;
//! use biotissue::backends::cuda::{Cuda, Device};
//! use biotissue::las::{Backend, Iterative, Krylov, MatrixOps, Solver, SolverParams, Sparsity, Symmetry, VectorOps};
//!
//! let device = Device::open(0)?;
//! // Two springs in a row, fixed at the left: [[2, -1], [-1, 1]] x = [0, 1].
//! let pattern = Arc::new(Sparsity::from_elements(2, [[-1, 0], [0, 1]])?);
//! let mut stiffness = Cuda::matrix(&device, &pattern)?;
//! for spring in [[-1, 0], [0, 1]] {
//!     stiffness.add(&spring, &spring, &[1.0, -1.0, -1.0, 1.0])?;
//! }
//! stiffness.finish()?;
//! let params = SolverParams::new(Symmetry::Definite).iterative(Iterative::new(Krylov::Cg));
//! let mut solver = Cuda::solver(&Cuda::analyze(&device, &pattern, &params)?)?;
//! solver.factor(&stiffness)?;
//! let (mut load, mut displacement) = (Cuda::vector(&device, 2)?, Cuda::vector(&device, 2)?);
//! load.set(&[1], &[1.0])?;
//! load.finish()?;
//! solver.solve(&load, &mut displacement)?;
//! displacement.with_local(|x| assert!((x[0] - 1.0).abs() < 1e-8 && (x[1] - 2.0).abs() < 1e-8))?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#![allow(unsafe_code, reason = "calls of the driver and of cuSPARSE, and launches of kernels")]

mod algebra;
mod compiler;
mod cusparse;
mod device;
mod error;
mod matrix;
mod multigrid;
pub mod networks;
mod pattern;
mod solver;
mod vector;

use std::sync::Arc;

pub use device::Device;
pub use error::{CudaError, CudaErrorKind};
pub use matrix::Matrix;
pub use solver::{Solver, Symbolic};
pub use vector::Vector;

use crate::las::{Backend, SolveError, SolverParams, Sparsity};

type Failure = SolveError<CudaError>;

/// The backend of NVIDIA's graphics processors, in double precision.
#[derive(Clone, Copy, Debug, Default)]
pub struct Cuda;

impl Backend for Cuda {
    const NAME: &'static str = "cuda";
    const HAS_MULTIGRID: bool = true;

    type Scalar = f64;
    type Index = i32;
    type Reduced = f64;
    type Context = Device;
    type Error = CudaError;
    type Slot = u32;
    type Vector = Vector;
    type Matrix = Matrix;
    type Symbolic = Symbolic;
    type Solver = Solver;

    fn vector(device: &Device, len: usize) -> Result<Vector, CudaError> {
        Ok(Vector::zeros(device, len))
    }

    fn matrix(device: &Device, pattern: &Arc<Sparsity>) -> Result<Matrix, CudaError> {
        Ok(Matrix::zeros(device, pattern))
    }

    fn analyze(device: &Device, pattern: &Arc<Sparsity>, params: &SolverParams) -> Result<Arc<Symbolic>, Failure> {
        Symbolic::new(device, pattern, params).map(Arc::new)
    }

    fn solver(symbolic: &Arc<Symbolic>) -> Result<Solver, Failure> {
        Solver::new(symbolic)
    }
}
