//! `sparse`: compressed rows, direct and iterative solvers in memory; the backend for all but small systems.
//!
//! A positive definite matrix of 3x3 blocks, such as the stiffness of a fiber network, is factored by the Cholesky
//! factorization of module `block`, unless the matrix is so large that faer is faster. Some of its nodes may have only
//! one or two unknowns, such as the nodes of a body on rollers. That factorization uses AVX2 or AVX-512 if the machine
//! has them; results differ by rounding between machines with and without fused multiply-add. All other matrices are
//! factored by the crate `faer`: supernodal Cholesky; LDL^T with pivoting within the supernodes if the matrix is not
//! positive definite; sparse LU if the matrix is unsymmetric or if that pivoting does not suffice. The elimination
//! order is by default the better one of minimum degree and nested dissection (module `order`). `docs/kernel.md` in the
//! repository compares times.
//!
//! Large systems use all threads of the current rayon pool: products of a matrix and a vector, norms, dot products and
//! sums of vectors, [`MatrixOps::add_blocks`](crate::las::MatrixOps::add_blocks), and the numeric Cholesky and LU factorizations of
//! faer. Results have the same bits for any number of threads. LDL^T factorizations and solves with factors use one thread; in
//! faer, several threads would change the order of the sums of a solve.
//!
//! ```
//! use std::sync::Arc;
//! use biotissue::backends::sparse::Sparse;
//! use biotissue::las::{Backend, MatrixOps, Solver, SolverParams, Sparsity};
//!
//! // Two springs in a row, fixed at the left: [[2, -1], [-1, 1]] x = [0, 1].
//! let pattern = Arc::new(Sparsity::from_elements(2, [[-1, 0], [0, 1]])?);
//! let mut stiffness = Sparse::<f64>::matrix(&(), &pattern)?;
//! for spring in [[-1, 0], [0, 1]] {
//!     stiffness.add(&spring, &spring, &[1.0, -1.0, -1.0, 1.0])?;
//! }
//! let mut solver = Sparse::solver(&Sparse::<f64>::analyze(&(), &pattern, &SolverParams::default())?)?;
//! solver.factor(&stiffness)?;
//! let (load, mut displacement) = (vec![0.0, 1.0].into(), vec![0.0; 2].into());
//! solver.solve(&load, &mut displacement)?;
//! assert!((displacement.as_slice()[0] - 1.0).abs() < 1e-15 && (displacement.as_slice()[1] - 2.0).abs() < 1e-15);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod analysis;
mod block;
mod cholesky;
mod ilut;
mod long;
mod lu;
pub mod multigrid;
mod order;
mod preconditioner;
mod solve;

use std::convert::Infallible;
use std::marker::PhantomData;
use std::sync::Arc;

pub use analysis::{Symbolic, cholesky_entries};
pub use solve::Solver;
pub(in crate::backends) use solve::SparseScalar;

use crate::backends::csr::impl_backend_ops;
pub use crate::backends::csr::{Matrix, Vector};
use crate::las::{Backend, SolveError, SolverParams, Sparsity};

type Failure = SolveError<Infallible>;

/// The backend of compressed rows; `T` is `f64` or `f32`.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sparse<T = f64>(PhantomData<fn() -> T>);

impl_backend_ops!(
    [T: SparseScalar] Sparse<T>, T, T,
    norm: long::norm, dot: long::dot, axpy: long::axpy, axpby: long::axpby, multiply: long::multiply
);

impl<T: SparseScalar> Backend for Sparse<T> {
    const NAME: &'static str = "sparse";
    const HAS_MULTIGRID: bool = true;

    type Scalar = T;
    type Index = i32;
    type Reduced = T;
    type Context = ();
    type Error = Infallible;
    type Slot = u32;
    type Vector = Vector<T>;
    type Matrix = Matrix<T>;
    type Symbolic = Symbolic;
    type Solver = Solver<T>;

    fn vector(_: &(), len: usize) -> Result<Vector<T>, Infallible> {
        Ok(Vector::from(vec![T::zero(); len]))
    }

    fn matrix(_: &(), pattern: &Arc<Sparsity>) -> Result<Matrix<T>, Infallible> {
        Ok(Matrix::zeros(pattern))
    }

    fn analyze(_: &(), pattern: &Arc<Sparsity>, params: &SolverParams) -> Result<Arc<Symbolic>, Failure> {
        Symbolic::new(pattern, params).map(Arc::new)
    }

    fn solver(symbolic: &Arc<Symbolic>) -> Result<Solver<T>, Failure> {
        T::solver(symbolic)
    }

    fn factor_bytes(symbolic: &Symbolic) -> usize {
        symbolic.stored_values().unwrap_or(0) * size_of::<T>()
    }
}
