//! LAS, the linear-algebra abstraction: the traits of a backend, and what is written on top of them once for all backends
//! (Newton, Krylov methods, Matrix Market files, copies from one backend to another, the suite that every backend passes).
//!
//! This module names no library of linear algebra. A [`Backend`] is a zero-sized marker with a vector, a matrix and a solver;
//! the verbs that assembly loops call ([`VectorOps`], [`MatrixOps`]) inline away, the operations that are amortized ([`Solver`],
//! [`MatVec`]) do not need to. After chapter 5 of W. R. Tobin, *The Adaptive Multiscale Simulation Infrastructure*
//! (PhD thesis, Rensselaer Polytechnic Institute, 2018).
//!
//! # Who solves how
//! | backend | directly | CG, BiCGSTAB, GMRES with |
//! |---|---|---|
//! | `sparse` | Cholesky, LDL^T, LU | nothing, the diagonal, ILUT |
//! | `dense` | Cholesky, LDL^T, LU | nothing, the diagonal |
//! | `petsc` | MUMPS, SuperLU_DIST or PETSc's own | nothing, the diagonal, multigrid; more by its options |
//! | `batched` | no | no |
//!
//! What a backend cannot do is [`SolveError::Unsupported`], said before anything is solved.

mod backend;
mod comm;
pub mod conformance;
pub mod krylov;
pub mod market;
mod newton;
mod ops;
mod products;
mod scalar;
mod solve;
mod sparsity;
pub mod transfer;

pub use backend::Backend;
pub use comm::{Comm, CommError, Disagreement, Layout, Message, Payload, Receiving, Sending, Tag};
pub use newton::{
    Curvature, Departure, NewtonError, NewtonFailure, NewtonParams, NewtonReport, NewtonSeconds, NewtonSystem,
    NonlinearProblem, Potential, RegularizedParams, ResidualScale,
};
pub use ops::{MatrixOps, VectorOps};
pub use products::{Entries, MatMat, MatVec};
pub use scalar::{Index, Scalar, Value};
pub use solve::{
    FactorReport, Factorization, InvalidParameter, Iterative, Krylov, Method, Ordering, Preconditioner, SolveError,
    SolveReport, Solver, SolverParams, StopReason, Symmetry,
};
pub use sparsity::{Sparsity, SparsityError};
