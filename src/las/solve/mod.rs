//! Solving (table 5.2 of the thesis), deliberately not zero-overhead.
//!
//! A call here costs microseconds to seconds, so a function call on top does not matter: [`Solver`] and
//! [`MatVec`](super::MatVec) are object-safe.

mod error;
mod params;
mod report;

pub use error::{SolveError, StopReason};
pub use params::{InvalidParameter, Iterative, Krylov, Method, Ordering, Preconditioner, SolverParams, Symmetry};
pub use report::{FactorReport, Factorization, SolveReport};

use super::Backend;

/// Factors matrices of one pattern and solves with them.
///
/// Cholesky and LDL^T factorizations and solves allocate nothing after their first time.
pub trait Solver<B: Backend>: Send {
    /// Factors `a`, or makes what an iterative method needs; whatever was factored before is forgotten.
    ///
    /// # Errors
    /// [`SolveError::Singular`], [`SolveError::NotFinite`], [`SolveError::Size`], [`SolveError::Pattern`].
    fn factor(&mut self, a: &B::Matrix) -> Result<FactorReport, SolveError<B::Fault>>;

    /// Factors `a` if it is positive definite, and wastes no time on it if not: for those who would rather change such a
    /// matrix than solve with it.
    ///
    /// An iterative method knows of definiteness what its preconditioner shows: the signs of the diagonal, or of the pivots
    /// of an incomplete factorization. It refuses what these show, and without a preconditioner nothing.
    ///
    /// # Errors
    /// [`SolveError::Indefinite`], and what [`Solver::factor`] says; nothing is factored then. [`SolveError::Unsupported`]
    /// where the matrix is stated to be [`Symmetry::None`]: the pivots of LU do not tell.
    fn factor_definite(&mut self, a: &B::Matrix) -> Result<FactorReport, SolveError<B::Fault>>;

    /// `A x = b`. What `x` held does not matter: iterative methods begin at zero.
    ///
    /// # Errors
    /// [`SolveError::NotFactored`], [`SolveError::Size`]; of an iterative method [`SolveError::NotConverged`] and
    /// [`SolveError::RhsNotFinite`].
    fn solve(&mut self, b: &B::Vector, x: &mut B::Vector) -> Result<SolveReport, SolveError<B::Fault>>;

    /// `A x_k = b_k` for several right-hand sides at once.
    ///
    /// # Errors
    /// As for [`Solver::solve`]; solutions before the one that failed stand.
    fn solve_many(&mut self, b: &[B::Vector], x: &mut [B::Vector]) -> Result<SolveReport, SolveError<B::Fault>>;
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::las::MatVec;

    /// A compile-time fact: both traits can stand behind `dyn`.
    #[allow(dead_code, reason = "that it compiles is the test")]
    fn object_safe<B: Backend>(_: &dyn Solver<B>, _: &dyn MatVec<B>) {}
}
