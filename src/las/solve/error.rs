//! Errors of linear solvers.

use thiserror::Error;

use crate::las::SparsityError;

use super::params::InvalidParameter;

/// The reason why a system was not solved.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum SolveError<F> {
    /// The matrix is not square.
    #[error("the matrix has {rows} rows and {cols} columns; a system to solve is square")]
    NotSquare {
        /// Rows.
        rows: usize,
        /// Columns.
        cols: usize,
    },
    /// The size of a vector or matrix does not match the others.
    #[error("{what} has size {found} where {expected} is needed")]
    Size {
        /// Name of the argument.
        what: &'static str,
        /// Its size.
        found: usize,
        /// The size that fits.
        expected: usize,
    },
    /// The matrix has the right size, but its sparsity pattern differs from the analyzed one.
    #[error("the sparsity pattern of the matrix differs from the analyzed one")]
    Pattern,
    /// A matrix declared symmetric has an entry without its transpose; perhaps only one triangle was stored.
    #[error(
        "the matrix was declared symmetric, but ({row}, {column}) is in its pattern and ({column}, {row}) is not: \
         store both triangles, or declare no symmetry"
    )]
    UnsymmetricPattern {
        /// Row of the entry.
        row: usize,
        /// Its column.
        column: usize,
    },
    /// `solve` was called before `factor`, or after a factorization that failed.
    #[error("there is no factorization to solve with: call factor first, and only solve if it succeeds")]
    NotFactored,
    /// A pivot is zero or too small, or the matrix maps a vector almost to zero.
    #[error("the matrix is singular: relative pivot {ratio:.1e} at unknown {unknown} (limit {limit:.1e})")]
    Singular {
        /// The unknown of the smallest pivot, or of the largest component of that vector.
        unknown: usize,
        /// The smallest over the largest pivot; or `|A v| / |v|` of that vector `v`, where `A` is the matrix scaled to
        /// rows and columns of unit size.
        ratio: f64,
        /// The smallest ratio accepted.
        limit: f64,
    },
    /// The unknowns cannot satisfy a constraint of a bordered system: they do not influence it, or only in the same way
    /// as another constraint.
    #[error(
        "constraint {} is singular: relative pivot {ratio:.1e} (limit {limit:.1e}); the free unknowns do not influence it, or not independently of the other constraints",
        constraint + 1
    )]
    SingularBorder {
        /// The constraint, from 0.
        constraint: usize,
        /// Its pivot in the Schur complement, scaled to gradients and solutions of unit size.
        ratio: f64,
        /// The smallest ratio accepted.
        limit: f64,
    },
    /// The matrix is not positive definite, and only a definite matrix was accepted.
    #[error("the matrix is not positive definite{}", at_pivot(*.unknown))]
    Indefinite {
        /// The unknown of a pivot that is not positive, if known.
        unknown: Option<usize>,
    },
    /// The matrix contains a NaN or an infinity.
    #[error("the matrix holds a value that is not finite in row {row}")]
    NotFinite {
        /// The first such row, from 0.
        row: usize,
    },
    /// The right-hand side of an iterative method contains a NaN or an infinity.
    #[error("the right-hand side holds a value that is not finite")]
    RhsNotFinite,
    /// A parameter of the iterative method is out of range.
    #[error(transparent)]
    Parameter(InvalidParameter),
    /// The matrix is too ill-conditioned: even a direct solution leaves a large residual.
    #[error("the matrix is too ill-conditioned: solving leaves a relative residual of {residual:.1e}")]
    Inaccurate {
        /// Norm of the residual over that of the right-hand side.
        residual: f64,
    },
    /// The factorization library reported an error of its own.
    #[error("{library} failed: {reason}")]
    Library {
        /// Name of the library.
        library: &'static str,
        /// Error message of the library.
        reason: String,
    },
    /// A Krylov method did not converge.
    #[error(
        "{method} left a relative residual of {residual:.1e} after {iterations} iterations (tolerance {tolerance:.1e}): {stop_reason}"
    )]
    NotConverged {
        /// Name of the method.
        method: &'static str,
        /// Number of iterations performed.
        iterations: usize,
        /// Norm of the residual over that of the right-hand side.
        residual: f64,
        /// The relative residual required.
        tolerance: f64,
        /// The reason why the iteration stopped.
        stop_reason: StopReason,
    },
    /// The diagonal cannot be inverted because an entry is zero.
    #[error("the diagonal entry of row {row} is zero")]
    ZeroDiagonal {
        /// The first such row, from 0.
        row: usize,
    },
    /// The result has more entries than 32-bit indices can address.
    #[error("the result is too large: {0}")]
    TooLarge(SparsityError),
    /// The backend does not support the requested method.
    #[error("the backend `{backend}` has no {what}: {cure}")]
    Unsupported {
        /// Name of the backend.
        backend: &'static str,
        /// The requested method.
        what: &'static str,
        /// A supported alternative.
        cure: &'static str,
    },
    /// A vector or matrix operation of the backend failed.
    #[error(transparent)]
    Backend(#[from] F),
}

impl<F> SolveError<F> {
    /// Adds the iterations of an earlier attempt at the same system.
    #[cfg(any(feature = "sparse", feature = "dense", feature = "petsc"))]
    pub(crate) fn after(mut self, wasted: usize) -> Self {
        if let Self::NotConverged { iterations, .. } = &mut self {
            *iterations += wasted;
        }
        self
    }

    /// Converts the error of the backend.
    #[cfg(feature = "cuda")]
    pub(crate) fn map_backend<G>(self, convert: impl FnOnce(F) -> G) -> SolveError<G> {
        match self {
            Self::NotSquare { rows, cols } => SolveError::NotSquare { rows, cols },
            Self::Size { what, found, expected } => SolveError::Size { what, found, expected },
            Self::Pattern => SolveError::Pattern,
            Self::UnsymmetricPattern { row, column } => SolveError::UnsymmetricPattern { row, column },
            Self::NotFactored => SolveError::NotFactored,
            Self::Singular { unknown, ratio, limit } => SolveError::Singular { unknown, ratio, limit },
            Self::SingularBorder { constraint, ratio, limit } => {
                SolveError::SingularBorder { constraint, ratio, limit }
            }
            Self::Indefinite { unknown } => SolveError::Indefinite { unknown },
            Self::NotFinite { row } => SolveError::NotFinite { row },
            Self::RhsNotFinite => SolveError::RhsNotFinite,
            Self::Parameter(parameter) => SolveError::Parameter(parameter),
            Self::Inaccurate { residual } => SolveError::Inaccurate { residual },
            Self::Library { library, reason } => SolveError::Library { library, reason },
            Self::NotConverged { method, iterations, residual, tolerance, stop_reason } => {
                SolveError::NotConverged { method, iterations, residual, tolerance, stop_reason }
            }
            Self::ZeroDiagonal { row } => SolveError::ZeroDiagonal { row },
            Self::TooLarge(error) => SolveError::TooLarge(error),
            Self::Unsupported { backend, what, cure } => SolveError::Unsupported { backend, what, cure },
            Self::Backend(error) => SolveError::Backend(convert(error)),
        }
    }
}

/// The reason why a Krylov method did not reach its tolerance.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
pub enum StopReason {
    /// The iteration limit was reached.
    #[error("allow more iterations, or give it a better preconditioner")]
    MaxIterations,
    /// A restart hardly reduced the residual: it is at the level of rounding errors.
    #[error("rounding errors prevent a smaller residual: raise the tolerance, or use a direct solver")]
    Stagnated,
    /// The next iterate is undefined: the matrix or the preconditioner is singular or, in conjugate gradients, not positive
    /// definite.
    #[error(
        "it broke down: the matrix or the preconditioner is singular or, which conjugate gradients need, not positive definite; use \
         another method or preconditioner"
    )]
    Breakdown,
}

fn at_pivot(unknown: Option<usize>) -> String {
    unknown.map_or_else(String::new, |unknown| format!(": the pivot of unknown {unknown} is not positive"))
}
