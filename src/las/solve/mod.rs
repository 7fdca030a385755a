//! Linear solvers (Tobin 2018, table 5.2), deliberately not zero-overhead.
//!
//! A call takes microseconds to seconds, so the cost of a virtual call is negligible: [`Solver`] and
//! [`MatVec`](super::MatVec) are object-safe.

mod error;
mod params;
mod report;

pub use error::{SolveError, StopReason};
pub use params::{InvalidParameter, Iterative, Krylov, Method, Ordering, Preconditioner, SolverParams, Symmetry};
pub use report::{FactorReport, Factorization, SolveReport};

use super::Backend;

/// The error of a solver of backend `B`.
pub(crate) type Failure<B> = SolveError<<B as Backend>::Error>;

/// Factors matrices of one sparsity pattern and solves linear systems with them.
///
/// On `sparse` and `dense`, Cholesky and LDL^T factorizations and solves allocate memory only in their first call,
/// unless a small pivot requires the search for a null vector or the number of right-hand sides grows.
pub trait Solver<B: Backend>: Send {
    /// Factors `a`, or sets up the preconditioner of an iterative method, and discards the previous factorization.
    ///
    /// # Errors
    /// Returns [`SolveError::Singular`], [`SolveError::NotFinite`], [`SolveError::Size`], [`SolveError::Pattern`].
    fn factor(&mut self, a: &B::Matrix) -> Result<FactorReport, SolveError<B::Error>>;

    /// Factors `a` if it is positive definite, and stops early otherwise: for callers that modify an indefinite matrix
    /// rather than solve with it.
    ///
    /// An iterative method detects indefiniteness only through its preconditioner: by the signs of the diagonal, or of
    /// the pivots of an incomplete factorization. Without a preconditioner it accepts every matrix. On `petsc`, it
    /// tests the signs of the diagonal with any preconditioner.
    ///
    /// # Errors
    /// Returns [`SolveError::Indefinite`] if `a` is not positive definite, and the errors of [`Solver::factor`]; no
    /// factorization is available then. Returns [`SolveError::Unsupported`] if the matrix is declared
    /// [`Symmetry::None`], because the signs of LU pivots do not determine definiteness.
    fn factor_definite(&mut self, a: &B::Matrix) -> Result<FactorReport, SolveError<B::Error>>;

    /// Solves `A x = b`. The previous values of `x` are ignored: iterative methods start from zero.
    ///
    /// # Errors
    /// Returns [`SolveError::NotFactored`], [`SolveError::Size`]; an iterative method also returns
    /// [`SolveError::NotConverged`] and [`SolveError::RhsNotFinite`].
    fn solve(&mut self, b: &B::Vector, x: &mut B::Vector) -> Result<SolveReport, SolveError<B::Error>> {
        self.solve_many(std::slice::from_ref(b), std::slice::from_mut(x))
    }

    /// Solves `A x_k = b_k` for several right-hand sides.
    ///
    /// # Errors
    /// Returns the errors of [`Solver::solve`]; the solutions computed before the failure are kept.
    fn solve_many(&mut self, b: &[B::Vector], x: &mut [B::Vector]) -> Result<SolveReport, SolveError<B::Error>>;
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::las::MatVec;

    /// Compiles only if both traits are object-safe.
    #[allow(dead_code, reason = "that it compiles is the test")]
    fn object_safe<B: Backend>(_: &dyn Solver<B>, _: &dyn MatVec<B>) {}
}
