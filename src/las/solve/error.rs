//! Why there is no solution.

use thiserror::Error;

use crate::las::SparsityError;

use super::params::InvalidParameter;

/// Why a system was not solved.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum SolveError<F> {
    /// Only square systems are solved.
    #[error("the matrix has {rows} rows and {cols} columns; a system to solve is square")]
    NotSquare {
        /// Rows.
        rows: usize,
        /// Columns.
        cols: usize,
    },
    /// A vector or matrix of another size than the others have.
    #[error("{what} has size {found} where {expected} is needed")]
    Size {
        /// Which argument.
        what: &'static str,
        /// Its size.
        found: usize,
        /// The size that fits.
        expected: usize,
    },
    /// A matrix of the right size whose entries stand in other places than those analyzed.
    #[error("the entries of the matrix are not where the analyzed pattern has them")]
    Pattern,
    /// A matrix that was stated to be symmetric has an entry without its mirror image: perhaps one triangle alone was stored.
    #[error(
        "the matrix was stated to be symmetric, but ({row}, {column}) is in its pattern and ({column}, {row}) is not: store \
         both triangles, or state no symmetry"
    )]
    OneTriangle {
        /// Row of the entry.
        row: usize,
        /// Its column.
        column: usize,
    },
    /// `solve` before `factor`, or after one that failed.
    #[error("there is no factorization to solve with: call factor first, and only solve if it succeeds")]
    NotFactored,
    /// A pivot vanished, or the matrix does not resist some vector.
    #[error(
        "the matrix is singular: unknown {unknown} meets {ratio:.1e} of the resistance of others (limit {limit:.1e})"
    )]
    Singular {
        /// The unknown of the smallest pivot, or the one that moves most in the vector.
        unknown: usize,
        /// The pivot over the largest; or what the matrix, scaled to rows and columns of size one, makes of the vector, over its
        /// length.
        ratio: f64,
        /// The limit that it fell below.
        limit: f64,
    },
    /// The matrix is not positive definite, and nothing else was asked for.
    #[error("the matrix is not positive definite{}", at_pivot(*.unknown))]
    Indefinite {
        /// The unknown of a pivot that is not positive, where one is known.
        unknown: Option<usize>,
    },
    /// The matrix holds a NaN or an infinity.
    #[error("the matrix holds a value that is not finite in row {row}")]
    NotFinite {
        /// The first such row.
        row: usize,
    },
    /// The right-hand side of an iterative method holds a NaN or an infinity.
    #[error("the right-hand side holds a value that is not finite")]
    RhsNotFinite,
    /// Numbers that no iterative method can work with.
    #[error("{0}")]
    Parameter(#[from] InvalidParameter),
    /// Even a factorization of the matrix itself leaves a residual.
    #[error("the matrix is too ill-conditioned: solving leaves a relative residual of {residual:.1e}")]
    Inaccurate {
        /// Norm of the residual over that of the right-hand side.
        residual: f64,
    },
    /// The factorization library failed for a reason of its own.
    #[error("{library} failed: {reason}")]
    Library {
        /// Which one.
        library: &'static str,
        /// What it said.
        reason: String,
    },
    /// A Krylov method came to no solution.
    #[error(
        "{method} left a relative residual of {residual:.1e} after {iterations} iterations (tolerance {tolerance:.1e}): {stop_reason}"
    )]
    NotConverged {
        /// Which one.
        method: &'static str,
        /// How many it took.
        iterations: usize,
        /// Norm of the residual over that of the right-hand side.
        residual: f64,
        /// What it should have fallen to.
        tolerance: f64,
        /// Why it stopped.
        stop_reason: StopReason,
    },
    /// The diagonal has no inverse.
    #[error("the diagonal entry of row {row} is zero")]
    ZeroDiagonal {
        /// The first such row.
        row: usize,
    },
    /// The result has more entries than can be addressed.
    #[error("the result is too large: {0}")]
    TooLarge(SparsityError),
    /// The backend has no such method.
    #[error("the backend `{backend}` has no {what}: {cure}")]
    Unsupported {
        /// Which backend.
        backend: &'static str,
        /// What was asked for.
        what: &'static str,
        /// What there is instead.
        cure: &'static str,
    },
    /// A verb of the backend failed.
    #[error("{0}")]
    Fault(F),
}

/// Why a Krylov method stopped short of its tolerance.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
pub enum StopReason {
    /// The iterations allowed are used up.
    #[error("allow more iterations, or give it a better preconditioner")]
    MaxIterations,
    /// Begun again from where it was, it came no nearer: rounding allows no better.
    #[error("it comes no nearer; rounding allows no less with this matrix: raise the tolerance, or solve directly")]
    Stagnated,
    /// Its next step does not exist; for conjugate gradients because the matrix or the preconditioner is not positive.
    #[error(
        "it broke down: conjugate gradients need a positive definite matrix and preconditioner; take another method or preconditioner"
    )]
    Breakdown,
}

fn at_pivot(unknown: Option<usize>) -> String {
    unknown.map_or_else(String::new, |unknown| format!(": the pivot of unknown {unknown} is not positive"))
}
