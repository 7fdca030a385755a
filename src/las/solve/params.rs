//! What is known of a system, and how it is to be solved.

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

/// A Krylov method.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Krylov {
    /// Conjugate gradients, for definite matrices (Hestenes and Stiefel 1952).
    Cg,
    /// Stabilised biconjugate gradients, for any (van der Vorst 1992).
    BiCgStab,
    /// Generalised minimal residuals, for any, begun again after `restart` steps (Saad and Schultz 1986).
    Gmres {
        /// Steps, and vectors kept, between restarts.
        restart: usize,
    },
}

/// An approximate inverse that a Krylov method works with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Preconditioner {
    /// None.
    None,
    /// The inverse of the diagonal.
    Diagonal,
    /// An incomplete LU factorisation with a threshold (Saad 1994).
    Ilut {
        /// Entries below this part of the mean absolute value of their row are dropped.
        drop_tolerance: f64,
        /// How many entries a row of either factor keeps beside the diagonal, the largest; `usize::MAX` for all.
        fill: usize,
    },
    /// Algebraic multigrid of the backend's library.
    Multigrid,
}

/// An iterative method and when it stops.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Iterative {
    /// The method.
    pub krylov: Krylov,
    /// What it works with.
    pub preconditioner: Preconditioner,
    /// Residual over right-hand side, both by their Euclidean norm, at which it stops.
    pub tolerance: f64,
    /// Iterations after which it gives up.
    pub max_iterations: usize,
}

impl Default for Iterative {
    /// BiCGSTAB with ILUT(1e-3, 20) to 1e-10 within 1000 iterations.
    fn default() -> Self {
        Self {
            krylov: Krylov::BiCgStab,
            preconditioner: Preconditioner::Ilut { drop_tolerance: 1e-3, fill: 20 },
            tolerance: 1e-10,
            max_iterations: 1000,
        }
    }
}

/// How a system is solved.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Method {
    /// By a factorisation.
    #[default]
    Direct,
    /// By a Krylov method.
    Iterative(Iterative),
}

/// How a system is to be solved, and what is known of it.
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
    /// By a factorisation or by iterations.
    pub method: Method,
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
        Self { symmetry, singular_below: None, ordering: Ordering::Auto, method: Method::Direct }
    }

    /// The same, by iterations.
    #[must_use]
    pub fn iterative(mut self, iterative: Iterative) -> Self {
        self.method = Method::Iterative(iterative);
        self
    }
}
