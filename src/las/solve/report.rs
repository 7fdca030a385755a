//! Reports of factorizations and solves.

/// The kind of factorization computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Factorization {
    /// `L L^T`.
    Cholesky,
    /// `L D L^T` with 1x1 and 2x2 pivots, for a symmetric matrix that is not declared positive definite, or for which
    /// Cholesky failed.
    Ldlt,
    /// `L U` with pivoting.
    Lu,
    /// No exact factorization: an iterative method set up its preconditioner.
    Approximate,
    /// An iterative method keeps the preconditioner of an earlier matrix ([`Solver::update`](super::Solver::update)).
    Kept,
}

/// The result of a factorization.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FactorReport {
    /// The kind of factorization computed.
    pub kind: Factorization,
    /// The unknown whose pivot made Cholesky fail, so that LDL^T was used instead; `None` if Cholesky succeeded or was
    /// not tried.
    pub indefinite_at: Option<usize>,
    /// Smallest over largest pivot, by absolute value: an inexpensive indicator of near singularity. For a library that
    /// does not expose its pivots (large sparse LU), an estimate of the reciprocal condition number; 1 if nothing was
    /// factored, or if the library reports neither.
    pub pivot_ratio: f64,
    /// Number of negative pivots, with 2x2 blocks counted by their eigenvalues; by Sylvester's law of inertia, the
    /// number of negative eigenvalues of the matrix. 0 for Cholesky; `None` for LU, whose pivots do not determine it,
    /// and for iterative methods.
    pub negative_pivots: Option<usize>,
}

/// The result of a solve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolveReport {
    /// Total number of iterations over all right-hand sides; 0 for a direct method.
    pub iterations: usize,
    /// Largest relative residual over all right-hand sides; 0 for a direct method, which does not compute it.
    pub residual: f64,
    /// Number of iterative solutions that failed and were replaced by direct ones ([`SolverParams::fallback`]).
    ///
    /// [`SolverParams::fallback`]: super::SolverParams::fallback
    pub fallbacks: usize,
}

impl SolveReport {
    /// The report of a direct solve.
    pub const DIRECT: Self = Self { iterations: 0, residual: 0.0, fallbacks: 0 };

    /// Combines two reports: adds the iterations and takes the larger residual.
    #[must_use]
    pub fn merge(self, other: Self) -> Self {
        Self {
            iterations: self.iterations + other.iterations,
            residual: self.residual.max(other.residual),
            fallbacks: self.fallbacks + other.fallbacks,
        }
    }

    /// Adds the iterations of an earlier attempt at the same system.
    #[cfg(any(feature = "sparse", feature = "dense", feature = "petsc"))]
    pub(crate) fn after(self, wasted: usize) -> Self {
        Self { iterations: self.iterations + wasted, ..self }
    }
}
