//! Amortised operations (table 5.2 of the thesis): solving and multiplying, deliberately not zero-overhead.
//!
//! A call here costs microseconds to seconds, so a function call on top does not matter: [`Solver`] and [`MatVec`] are
//! object-safe.

use thiserror::Error;

use super::Backend;

/// What the assembler knows of its matrix and states when it asks for a solver.
///
/// A Cholesky or LDL^T reads one triangle and never notices that the other differs; only the assembler can tell.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Symmetry {
    /// Symmetric and, in ordinary states, positive definite: Cholesky, with LDL^T where it turns out not to be.
    #[default]
    Definite,
    /// Symmetric: LDL^T.
    Symmetric,
    /// Unsymmetric: LU.
    None,
}

/// The order in which a sparse direct solver eliminates the unknowns of a symmetric matrix.
///
/// It decides how much the factor fills in. An unsymmetric matrix is ordered by its columns, whatever is asked for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Ordering {
    /// Of those compiled in, the one that predicts the fewest operations.
    #[default]
    Auto,
    /// Approximate minimum degree.
    MinimumDegree,
    /// Nested dissection.
    NestedDissection,
    /// Nested dissection by the library METIS, where it is compiled in (cargo feature `metis`).
    Metis,
}

/// How a system is to be solved.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct SolverParams {
    /// What the assembler states.
    pub symmetry: Symmetry,
    /// A factor counts as singular when its smallest pivot is below this fraction of its largest.
    ///
    /// Default: 4 machine epsilons of the scalar, set by the backend where this is `None`.
    pub singular_below: Option<f64>,
    /// The order of elimination; a backend without a choice ignores it.
    pub ordering: Ordering,
}

impl Default for SolverParams {
    fn default() -> Self {
        Self::new(Symmetry::Definite)
    }
}

impl SolverParams {
    /// The defaults for a matrix of the stated symmetry.
    #[must_use]
    pub fn new(symmetry: Symmetry) -> Self {
        Self { symmetry, singular_below: None, ordering: Ordering::Auto }
    }
}

/// The factorisation that served.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Factorisation {
    /// `L L^T`.
    Cholesky,
    /// `L D L^T` with pivoting in blocks: the matrix is symmetric but not (numerically) definite.
    Ldlt,
    /// `L U` with pivoting.
    Lu,
}

/// What a factorisation found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FactorReport {
    /// The one that served.
    pub kind: Factorisation,
    /// The unknown at whose pivot Cholesky gave up, where LDL^T had to take over.
    pub indefinite_at: Option<usize>,
    /// Smallest over largest pivot, by absolute value: a cheap sign of how near to singular the matrix is. An estimate of
    /// the reciprocal condition number where a library does not show its pivots (large sparse LU).
    pub pivot_ratio: f64,
    /// How many pivots are negative, 2x2 blocks counted by their eigenvalues: as many as the matrix has negative
    /// eigenvalues, by Sylvester's law of inertia. 0 for Cholesky; `None` for LU, whose pivots say nothing about that.
    pub negative_pivots: Option<usize>,
}

/// What a solve did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolveReport {
    /// Iterations of an iterative method; 0 for a direct one.
    pub iterations: usize,
}

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
    /// A vector or matrix of another size than the one analysed.
    #[error("{what} has size {found}, but the analysed pattern has {expected}")]
    Size {
        /// Which argument.
        what: &'static str,
        /// Its size.
        found: usize,
        /// The size of the pattern.
        expected: usize,
    },
    /// A matrix of the right size whose entries stand in other places than those analysed.
    #[error("the entries of the matrix are not where the analysed pattern has them")]
    Pattern,
    /// `solve` before `factor`, or after one that failed.
    #[error("there is no factorisation to solve with: call factor first, and only solve if it succeeds")]
    NotFactored,
    /// A pivot vanished.
    #[error("the matrix is singular: the pivot of unknown {unknown} is {ratio:.1e} of the largest (limit {limit:.1e})")]
    Singular {
        /// The unknown of the smallest pivot.
        unknown: usize,
        /// Its size over the largest.
        ratio: f64,
        /// The limit that it fell below.
        limit: f64,
    },
    /// The matrix is not positive definite, and nothing else was asked for.
    #[error("the matrix is not positive definite: the pivot of unknown {unknown} is not positive")]
    Indefinite {
        /// The unknown at whose pivot Cholesky gave up.
        unknown: usize,
    },
    /// The matrix holds a NaN or an infinity.
    #[error("the matrix holds a value that is not finite in row {row}")]
    NotFinite {
        /// The first such row.
        row: usize,
    },
    /// Even a factorisation of the matrix itself leaves a residual.
    #[error("the matrix is too ill-conditioned: solving leaves a relative residual of {residual:.1e}")]
    Inaccurate {
        /// Norm of the residual over that of the right-hand side.
        residual: f64,
    },
    /// The factorisation library failed for a reason of its own.
    #[error("{library} failed: {reason}")]
    Library {
        /// Which one.
        library: &'static str,
        /// What it said.
        reason: String,
    },
    /// A verb of the backend failed.
    #[error("{0}")]
    Fault(F),
}

/// Factors matrices of one pattern and solves with them.
///
/// Cholesky and LDL^T factorisations and solves allocate nothing after their first time.
pub trait Solver<B: Backend>: Send {
    /// Factors `a`; whatever was factored before is forgotten.
    ///
    /// # Errors
    /// [`SolveError::Singular`], [`SolveError::NotFinite`], [`SolveError::Size`], [`SolveError::Pattern`].
    fn factor(&mut self, a: &B::Matrix) -> Result<FactorReport, SolveError<B::Fault>>;

    /// Factors `a` if it is positive definite, and wastes no time on it if not: for those who would rather change such a
    /// matrix than solve with it.
    ///
    /// # Errors
    /// [`SolveError::Indefinite`], and what [`Solver::factor`] says; nothing is factored then.
    fn factor_definite(&mut self, a: &B::Matrix) -> Result<FactorReport, SolveError<B::Fault>>;

    /// `A x = b`.
    ///
    /// # Errors
    /// [`SolveError::NotFactored`], [`SolveError::Size`].
    fn solve(&mut self, b: &B::Vector, x: &mut B::Vector) -> Result<SolveReport, SolveError<B::Fault>>;

    /// `A x_k = b_k` for several right-hand sides at once.
    ///
    /// # Errors
    /// [`SolveError::NotFactored`], [`SolveError::Size`].
    fn solve_many(&mut self, b: &[B::Vector], x: &mut [B::Vector]) -> Result<SolveReport, SolveError<B::Fault>>;
}

/// Multiplies a vector by a matrix.
pub trait MatVec<B: Backend> {
    /// `y = A x`.
    ///
    /// # Errors
    /// [`SolveError::Size`].
    fn mul(&self, x: &B::Vector, y: &mut B::Vector) -> Result<(), SolveError<B::Fault>>;
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A compile-time fact: both traits can stand behind `dyn`.
    #[allow(dead_code, reason = "that it compiles is the test")]
    fn object_safe<B: Backend>(_: &dyn Solver<B>, _: &dyn MatVec<B>) {}
}
