//! Linear solvers (Tobin 2018, table 5.2), deliberately not zero-overhead.
//!
//! A call takes microseconds to seconds, so the cost of a virtual call is negligible: [`Solver`] and
//! [`MatVec`](super::MatVec) are object-safe.

mod choice;
mod error;
mod params;
mod report;

pub use choice::SolverChoice;
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
    /// Factors `a`, or sets up the preconditioner of an iterative method, and discards the previous factorization, also if
    /// it fails.
    ///
    /// # Errors
    /// Returns [`SolveError::Singular`], [`SolveError::NotFinite`], [`SolveError::Size`], [`SolveError::Pattern`].
    fn factor(&mut self, a: &B::Matrix) -> Result<FactorReport, SolveError<B::Error>>;

    /// Prepares solves with `a` like [`Solver::factor`], but an iterative method may keep the preconditioner of an
    /// earlier matrix while it serves: the next solves need hardly more iterations. Results then depend on the matrices
    /// since the last [`Solver::factor`], within the tolerance. The default calls [`Solver::factor`].
    ///
    /// # Errors
    /// As for [`Solver::factor`].
    fn update(&mut self, a: &B::Matrix) -> Result<FactorReport, SolveError<B::Error>> {
        self.factor(a)
    }

    /// Sets the relative residual at which an iterative method stops in the next solves, which return
    /// [`SolveError::Parameter`] if it is not above 0 and below 1. A direct method ignores it.
    fn set_tolerance(&mut self, tolerance: f64) {
        let _ = tolerance;
    }

    /// Returns true if the preconditioner uses the vectors of [`Solver::set_near_null_space`].
    fn uses_near_null_space(&self) -> bool {
        false
    }

    /// Passes vectors on which the matrix is almost zero to the preconditioner, for the next [`Solver::factor`]: for
    /// elasticity, the six rigid motions. Each has the entries of a vector of this rank. Direct methods and preconditioners
    /// other than multigrid ignore them.
    ///
    /// # Errors
    /// With multigrid, returns [`SolveError::Size`] if the length of a vector is not the number of unknowns.
    fn set_near_null_space(&mut self, vectors: &[Vec<B::Scalar>]) -> Result<(), SolveError<B::Error>> {
        let _ = vectors;
        Ok(())
    }

    /// Factors `a` if it is positive definite, and stops early otherwise: for callers that modify an indefinite matrix
    /// rather than solve with it.
    ///
    /// An iterative method detects indefiniteness only through its preconditioner: by the signs of the diagonal
    /// ([`Preconditioner::Diagonal`], [`Preconditioner::Multigrid`]), or of the pivots of an incomplete factorization.
    /// Without a preconditioner it accepts every matrix. On `petsc`, it tests the signs of the diagonal with any
    /// preconditioner.
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
    /// [`SolveError::NotConverged`], [`SolveError::RhsNotFinite`] and [`SolveError::Parameter`].
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
