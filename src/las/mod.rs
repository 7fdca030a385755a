//! LAS, the linear-algebra abstraction: the traits that every backend implements, and the algorithms that use only
//! these traits (Newton's method, Krylov methods, Matrix Market files, transfers between backends, and the conformance
//! test suite).
//!
//! This module depends on no linear-algebra library. A [`Backend`] is a zero-sized marker type with a vector, a matrix
//! and a solver type. The operations in assembly loops ([`VectorOps`], [`MatrixOps`]) are inlined; the amortized
//! operations ([`Solver`], [`MatVec`]) need not be. After chapter 5 of W. R. Tobin, *The Adaptive Multiscale Simulation
//! Infrastructure* (PhD thesis, Rensselaer Polytechnic Institute, 2018).
//!
//! # Solvers by backend
//! | backend | direct | preconditioners of CG, BiCGSTAB and GMRES |
//! |---|---|---|
//! | `sparse` | Cholesky, LDL^T, LU | none, diagonal, ILUT, multigrid |
//! | `dense` | Cholesky, LDL^T, LU | none, diagonal |
//! | `petsc` | MUMPS, SuperLU_DIST or PETSc's own | none, diagonal, multigrid; others through PETSc options |
//! | `cuda` | those of `sparse`, on the host | none, diagonal, multigrid |
//! | `batched` | those of `sparse`, side by side where that is faster | those of `sparse`, lane by lane |
//!
//! A backend that lacks the requested method returns [`SolveError::Unsupported`].
//!
//! # Writing a backend
//! All simulation code of this crate runs on a backend of another crate if it implements:
//!
//! | item | contents |
//! |---|---|
//! | [`Backend`] | a marker type: ten associated types, its name, and four constructors |
//! | [`VectorOps`] for `Backend::Vector` | eleven methods, with rules for negative indices and for `finish`; two more are provided |
//! | [`MatrixOps`] for `Backend::Matrix` | nine methods, with rules for writes outside the pattern; two more for many blocks at once are provided |
//! | [`MatVec`] for `Backend::Matrix` | two products and the diagonal |
//! | [`Solver`] for `Backend::Solver` | two kinds of factorization, and solves; any of them may be unsupported |
//!
//! Two extensions are optional, because no simulation needs them: [`Entries`] (for [`transfer::matrix`], Matrix Market
//! files and the C interface) and [`MatMat`] (sums and products of matrices, for the C interface). [`krylov`] provides
//! iterative solvers for every backend with one number per entry ([`SingleLane`]). The [`conformance`] suite tests a
//! backend, also one with limited solvers.

mod backend;
mod block_slots;
pub(crate) mod comm;
pub mod conformance;
pub mod krylov;
pub mod market;
mod newton;
#[cfg_attr(not(feature = "sparse"), allow(dead_code, reason = "only this backend uses them"))]
mod node_positions;
mod ops;
mod products;
mod rank_rows;
mod scalar;
mod solve;
mod sparsity;
pub mod transfer;

pub use backend::{Backend, RealBackend, SingleLane};
#[cfg(any(feature = "sparse", feature = "batched"))]
pub(crate) use block_slots::BlockPositions;
pub use block_slots::BlockSlots;
/// Casts between plain data and bytes, for [`payload!`](crate::payload).
pub use bytemuck;
pub use comm::{Comm, CommError, Disagreement, Layout, Message, Payload, ReceiveRequest, SendRequest, Tag};
pub use newton::{
    Border, Curvature, Forcing, NewtonError, NewtonFailure, NewtonParams, NewtonReport, NewtonSeconds, NewtonSystem,
    NonlinearProblem, Potential, RegularizedParams, ResidualScale, SaddleExit,
};
#[cfg(any(feature = "sparse", feature = "batched"))]
pub(crate) use node_positions::{NodeBlock, NodePositions};
pub use ops::{MatrixOps, VectorOps};
pub use products::{Entries, MatMat, MatVec};
pub use rank_rows::RankRows;
pub use scalar::{Index, Scalar, Value};
pub(crate) use solve::Failure;
pub use solve::{
    FactorReport, Factorization, InvalidParameter, Iterative, Krylov, Method, Ordering, Preconditioner, SolveError,
    SolveReport, Solver, SolverChoice, SolverParams, StopReason, Symmetry,
};
#[cfg(feature = "sparse")]
pub(crate) use sparsity::offsets;
pub use sparsity::{Sparsity, SparsityError};

/// Returns the next 64 random bits of SplitMix64, whose sequence is fixed.
///
/// Reference: G. L. Steele, D. Lea, C. H. Flood, *Fast splittable pseudorandom number generators*, OOPSLA 2014.
pub(crate) fn splitmix64(state: &mut u64) -> u64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}
