//! `petsc`: vectors, matrices and solvers of PETSc, on one rank or many.
//!
//! # Distribution of data
//! **Copies** ([`Distribution::Copies`], the default): all ranks of a communicator run the same program on the same
//! data. Every rank stores whole vectors: reading them, norms and dot products need no communication and are bitwise
//! identical on all ranks. Every rank writes all entries of a matrix but stores only the rows that it owns. Reading a
//! matrix, multiplying and solving are collective and give every rank the whole result. Code that is generic over the
//! backend therefore runs unchanged on any number of ranks: every rank repeats the assembly, and the ranks share
//! factorizations and products.
//!
//! **Parts** ([`Distribution::Parts`], by [`Backend::with_rows`]): every rank holds a part of the system, and no rank
//! needs memory for all of it. Indices are the local numbers of [`RankRows`]: a rank owns a range of rows, and reads
//! copies of the entries of vectors in its ghost rows.
//!
//! | operation | copies | parts |
//! |---|---|---|
//! | pattern and vector | `n` by `n`, `n` entries | own rows by local numbers, own entries |
//! | writing to other rows than the own | stored in vectors, dropped by matrices | dropped |
//! | reading a matrix | collective, all rows | own rows, zeros elsewhere |
//! | `finish` of a vector | nothing | collective: updates the ghosts |
//! | norm, dot product, [`Backend::sum`], [`Backend::max`] | no communication | collective, the same bits on all ranks |
//! | product, diagonal, solve | collective, whole vectors | collective, own entries and ghosts |
//! | [`Entries`](crate::las::Entries), [`MatMat`](crate::las::MatMat) | yes | an error, except `scale` |
//! | storage of matrices | [`MatrixType`] | AIJ |
//!
//! Products and solvers of parts work on the vectors themselves, without copying. Where an operation could fail on one
//! rank alone (creating a context, a matrix or a solver, factoring), the ranks exchange the outcome, and it fails on
//! all. Vectors that do not fit a product or a solver are the exception: that error must be made by all ranks.
//!
//! # Sessions
//! [`Session`] initializes MPI and PETSc and finalizes them after the last object is dropped; [`Context`] adds a
//! communicator and a prefix of options. Errors of PETSc are returned as [`PetscError`], with PETSc's own text.
//!
//! ```no_run
//! use std::sync::Arc;
//! use biotissue::backends::petsc::{Context, Petsc};
//! use biotissue::las::{Backend, MatrixOps, Solver, SolverParams, Sparsity, VectorOps};
//!
//! let context = Context::world()?;
//! context.set_option("mat_mumps_icntl_7", "5")?; // orders by METIS
//! // Two springs in a row, fixed at the left: [[2, -1], [-1, 1]] x = [0, 1].
//! let pattern = Arc::new(Sparsity::from_elements(2, [[-1, 0], [0, 1]])?);
//! let mut stiffness = Petsc::matrix(&context, &pattern)?;
//! for spring in [[-1, 0], [0, 1]] {
//!     stiffness.add(&spring, &spring, &[1.0, -1.0, -1.0, 1.0])?;
//! }
//! stiffness.finish()?;
//! let mut solver = Petsc::solver(&Petsc::analyze(&context, &pattern, &SolverParams::default())?)?;
//! solver.factor(&stiffness)?;
//! let (mut load, mut displacement) = (Petsc::vector(&context, 2)?, Petsc::vector(&context, 2)?);
//! load.set(&[1], &[1.0])?;
//! solver.solve(&load, &mut displacement)?;
//! assert!((displacement.as_slice()[1] - 2.0).abs() < 1e-15);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![allow(unsafe_code, reason = "the interface to a C library")]

mod context;
mod direct;
mod error;
mod ffi;
mod ghosts;
mod handle;
mod iterative;
mod judgments;
mod ksp;
mod layout;
mod matrix;
mod near_null_space;
mod ops;
mod products;
mod reduce;
mod rows;
mod session;
mod solve;
mod vector;
mod vector_ops;

use std::sync::Arc;

pub use context::{Context, Distribution, MatrixType};
pub use error::PetscError;
pub use matrix::Matrix;
pub use session::{Session, SessionError};
pub use solve::{Solver, Symbolic};
pub use vector::Vector;

use crate::las::{Backend, RankRows, SolveError, SolverParams, Sparsity};

type SolverError = SolveError<PetscError>;

/// The backend of PETSc.
#[derive(Clone, Copy, Debug, Default)]
pub struct Petsc;

impl Backend for Petsc {
    const NAME: &'static str = "petsc";
    const HAS_MULTIGRID: bool = true;

    type Scalar = f64;
    type Index = i32;
    type Reduced = f64;
    type Context = Context;
    type Error = PetscError;
    type Slot = u32;
    type Vector = Vector;
    type Matrix = Matrix;
    type Symbolic = Symbolic;
    type Solver = Solver;

    /// Always returns a context, with [`Distribution::Parts`]. An error on any rank is an error on all.
    fn with_rows(context: &Context, rows: RankRows) -> Result<Option<Context>, PetscError> {
        context.with_rows(rows).map(Some)
    }

    fn sum(context: &Context, values: &mut [f64]) -> Result<(), PetscError> {
        if let Some(parts) = context.parts() {
            parts.sum(values);
        }
        Ok(())
    }

    /// The maximum is NaN if a value is.
    fn max(context: &Context, values: &mut [f64]) -> Result<(), PetscError> {
        if let Some(parts) = context.parts() {
            parts.max(values);
        }
        Ok(())
    }

    fn vector(context: &Context, len: usize) -> Result<Vector, PetscError> {
        Vector::zeros(context, len)
    }

    fn matrix(context: &Context, pattern: &Arc<Sparsity>) -> Result<Matrix, PetscError> {
        Matrix::zeros(context, pattern)
    }

    fn analyze(
        context: &Context,
        pattern: &Arc<Sparsity>,
        params: &SolverParams,
    ) -> Result<Arc<Symbolic>, SolverError> {
        Symbolic::new(context, pattern, params).map(Arc::new)
    }

    fn solver(symbolic: &Arc<Symbolic>) -> Result<Solver, SolverError> {
        Solver::new(symbolic)
    }
}
