//! What a factorization and a solution did.

/// The factorization that served.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Factorization {
    /// `L L^T`.
    Cholesky,
    /// `L D L^T` with pivoting in blocks: the matrix is symmetric but not (numerically) definite.
    Ldlt,
    /// `L U` with pivoting.
    Lu,
    /// None: an approximate inverse was made for an iterative method.
    Approximate,
}

/// What a factorization found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FactorReport {
    /// The one that served.
    pub kind: Factorization,
    /// The unknown at whose pivot Cholesky gave up, where LDL^T had to take over.
    pub indefinite_at: Option<usize>,
    /// Smallest over largest pivot, by absolute value: a cheap sign of how near to singular the matrix is. An estimate of
    /// the reciprocal condition number where a library does not show its pivots (large sparse LU); 1 where nothing was
    /// factored.
    pub pivot_ratio: f64,
    /// How many pivots are negative, 2x2 blocks counted by their eigenvalues: as many as the matrix has negative
    /// eigenvalues, by Sylvester's law of inertia. 0 for Cholesky; `None` for LU, whose pivots say nothing about that, and for iterative methods.
    pub negative_pivots: Option<usize>,
}

/// What a solve did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolveReport {
    /// Iterations of an iterative method, of all right-hand sides together; 0 for a direct one.
    pub iterations: usize,
    /// The largest residual over its right-hand side that an iterative method left; 0 for a direct one, which does not look.
    pub residual: f64,
}

impl SolveReport {
    /// That of a direct method.
    pub const DIRECT: Self = Self { iterations: 0, residual: 0.0 };

    /// Both together.
    #[must_use]
    pub fn and(self, other: Self) -> Self {
        Self { iterations: self.iterations + other.iterations, residual: self.residual.max(other.residual) }
    }
}
