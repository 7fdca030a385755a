//! Parameters of a linear solver and properties of its matrix.

use thiserror::Error;

use super::{SolveError, SolveReport, StopReason};

/// The symmetry of a matrix, declared by the assembler when it creates a solver.
///
/// Cholesky and LDL^T factorizations read only one triangle, so that they cannot detect an unsymmetric matrix.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "app", derive(serde::Serialize, serde::Deserialize))]
pub enum Symmetry {
    /// Symmetric and usually positive definite: Cholesky, and LDL^T if Cholesky fails.
    #[default]
    Definite,
    /// Symmetric: LDL^T.
    Symmetric,
    /// Unsymmetric: LU.
    None,
}

/// The fill-reducing ordering of a sparse direct solver for symmetric matrices.
///
/// The ordering determines the fill-in of the factor. For unsymmetric matrices a column ordering is always used.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "app", derive(serde::Serialize, serde::Deserialize))]
pub enum Ordering {
    /// Of the available orderings, the one with the fewest predicted operations; minimum degree for small systems, and
    /// where the other orderings save little.
    #[default]
    Auto,
    /// Approximate minimum degree.
    MinimumDegree,
    /// Nested dissection.
    NestedDissection,
    /// Nested dissection by the METIS library, if compiled in (cargo feature `metis`).
    Metis,
}

/// A Krylov method.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "app", derive(serde::Serialize, serde::Deserialize))]
pub enum Krylov {
    /// Conjugate gradients, for positive definite matrices (Hestenes and Stiefel 1952).
    Cg,
    /// Stabilized biconjugate gradients, for any matrix (van der Vorst 1992).
    BiCgStab,
    /// Generalized minimal residuals, for any matrix, restarted after `restart` steps (Saad and Schultz 1986).
    Gmres {
        /// Number of steps, and of stored basis vectors, between restarts.
        restart: usize,
    },
}

/// The preconditioner of a Krylov method.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "app", derive(serde::Serialize, serde::Deserialize))]
pub enum Preconditioner {
    /// No preconditioner.
    None,
    /// The inverse of the diagonal (Jacobi).
    Diagonal,
    /// Incomplete LU factorization with a drop tolerance, ILUT (Saad 1994).
    Ilut {
        /// Multipliers (entries of `L`) up to this size are dropped, and so are entries of `U` up to this fraction of
        /// the mean absolute value of their row of the matrix.
        drop_tolerance: f64,
        /// Number of off-diagonal entries kept in each row of either factor, the largest ones; `usize::MAX` keeps all.
        fill: usize,
    },
    /// Algebraic multigrid by smoothed aggregation: that of `sparse` (the module `backends::sparse::multigrid`), or
    /// PETSc's GAMG. Elasticity needs the rigid motions ([`Solver::set_near_null_space`]).
    ///
    /// [`Solver::set_near_null_space`]: super::Solver::set_near_null_space
    Multigrid,
}

/// An iterative method and its stopping criteria.
///
/// ```
/// use biotissue::las::{Iterative, Krylov, SolverParams, Symmetry};
///
/// let cg = Iterative { tolerance: 1e-8, ..Iterative::new(Krylov::Cg) };
/// let params = SolverParams::new(Symmetry::Definite).iterative(cg); // for Backend::analyze
/// assert!(params.check().is_ok());
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "app", derive(serde::Serialize, serde::Deserialize))]
pub struct Iterative {
    /// The method.
    pub krylov: Krylov,
    /// The preconditioner.
    pub preconditioner: Preconditioner,
    /// The relative residual `|b - A x| / |b|` (Euclidean norms) at which the iteration stops.
    pub tolerance: f64,
    /// Maximum number of iterations.
    pub max_iterations: usize,
}

impl Default for Iterative {
    /// BiCGSTAB with ILUT(1e-3, 20), tolerance 1e-10, at most 1000 iterations.
    fn default() -> Self {
        Self::new(Krylov::BiCgStab)
    }
}

impl Iterative {
    /// A method with tolerance 1e-10, at most 1000 iterations, and a default preconditioner: the diagonal for conjugate
    /// gradients, which need a symmetric positive definite preconditioner; ILUT(1e-3, 20) for the others.
    ///
    /// Only the backend `sparse` supports ILUT: choose another preconditioner on other backends.
    pub fn new(krylov: Krylov) -> Self {
        let preconditioner = match krylov {
            Krylov::Cg => Preconditioner::Diagonal,
            Krylov::BiCgStab | Krylov::Gmres { .. } => Preconditioner::Ilut { drop_tolerance: 1e-3, fill: 20 },
        };
        Self { krylov, preconditioner, tolerance: 1e-10, max_iterations: 1000 }
    }

    /// Checks that all parameters are in range; [`Backend::analyze`](crate::las::Backend::analyze) calls it.
    ///
    /// # Errors
    /// Returns the first parameter that is out of range.
    pub fn check(&self) -> Result<(), InvalidParameter> {
        let positive = |name: &'static str, value: usize| match value {
            0 => Err(InvalidParameter { name, found: "0".into(), allowed: "at least 1" }),
            _ => Ok(()),
        };
        positive("max_iterations", self.max_iterations)?;
        if !(self.tolerance > 0.0 && self.tolerance < 1.0) {
            let found = self.tolerance.to_string();
            return Err(InvalidParameter { name: "tolerance", found, allowed: "above 0 and below 1" });
        }
        if let Krylov::Gmres { restart } = self.krylov {
            positive("restart", restart)?;
        }
        match self.preconditioner {
            Preconditioner::Ilut { drop_tolerance, .. } if !(drop_tolerance >= 0.0 && drop_tolerance.is_finite()) => {
                let found = drop_tolerance.to_string();
                Err(InvalidParameter { name: "drop_tolerance", found, allowed: "0 or above, and finite" })
            }
            _ => Ok(()),
        }
    }

    /// The error of a solve that ended with this report before it reached the tolerance.
    pub(crate) fn not_converged<F>(&self, report: SolveReport, stop_reason: StopReason) -> SolveError<F> {
        let method = match self.krylov {
            Krylov::Cg => "CG",
            Krylov::BiCgStab => "BiCGSTAB",
            Krylov::Gmres { .. } => "GMRES",
        };
        let SolveReport { iterations, residual, .. } = report;
        SolveError::NotConverged { method, iterations, residual, tolerance: self.tolerance, stop_reason }
    }
}

/// A parameter of [`Iterative`] that is out of range.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("`{name}` is {found}; it must be {allowed}")]
pub struct InvalidParameter {
    /// Name of the parameter.
    pub name: &'static str,
    /// Its value.
    pub found: String,
    /// The allowed range.
    pub allowed: &'static str,
}

/// Direct or iterative solution.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "app", derive(serde::Serialize, serde::Deserialize))]
pub enum Method {
    /// Solution by a factorization.
    #[default]
    Direct,
    /// Solution by a Krylov method.
    Iterative(Iterative),
}

/// The parameters of a linear solver.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "app", derive(serde::Serialize, serde::Deserialize))]
pub struct SolverParams {
    /// The declared symmetry of the matrix.
    pub symmetry: Symmetry,
    /// A factorization is reported as singular if its smallest pivot is below this fraction of the largest pivot.
    ///
    /// With `None`, the default, a smallest pivot below the square root of the machine epsilon times the largest
    /// triggers a second test: with `A` scaled to rows and columns of unit size, the matrix is singular if
    /// `|A v| < (32 + 2 sqrt(unknowns)) epsilon |v|` for some vector `v`. This test does not reject a regular matrix
    /// because its unknowns have different units.
    pub singular_below: Option<f64>,
    /// The fill-reducing ordering; ignored by a backend that offers no choice.
    pub ordering: Ordering,
    /// Direct or iterative solution.
    pub method: Method,
    /// Whether to solve directly where an iterative method fails: it does not converge, or there is no preconditioner.
    /// The direct method is then used until the next [`Solver::factor`](super::Solver::factor). Default false.
    pub fallback: bool,
}

impl Default for SolverParams {
    fn default() -> Self {
        Self::new(Symmetry::Definite)
    }
}

impl SolverParams {
    /// The default parameters for a matrix of the given symmetry.
    pub fn new(symmetry: Symmetry) -> Self {
        Self { symmetry, singular_below: None, ordering: Ordering::Auto, method: Method::Direct, fallback: false }
    }

    /// Checks that all parameters are in range.
    ///
    /// # Errors
    /// Returns the error of [`Iterative::check`].
    pub fn check(&self) -> Result<(), InvalidParameter> {
        match &self.method {
            Method::Direct => Ok(()),
            Method::Iterative(iterative) => iterative.check(),
        }
    }

    /// Replaces the method by an iterative one.
    #[must_use]
    pub fn iterative(mut self, iterative: Iterative) -> Self {
        self.method = Method::Iterative(iterative);
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_method_takes_the_preconditioner_that_suits_it() {
        assert_eq!(Iterative::new(Krylov::Cg).preconditioner, Preconditioner::Diagonal);
        assert_eq!(Iterative::default(), Iterative::new(Krylov::BiCgStab));
        assert!(SolverParams::default().iterative(Iterative::default()).check().is_ok());
    }

    #[test]
    fn numbers_out_of_range_are_rejected() {
        let good = Iterative::new(Krylov::Gmres { restart: 30 });
        let ilut = |drop_tolerance| Preconditioner::Ilut { drop_tolerance, fill: 5 };
        let cases = [
            (Iterative { tolerance: 0.0, ..good }, "`tolerance` is 0; it must be above 0 and below 1"),
            (Iterative { tolerance: f64::NAN, ..good }, "`tolerance` is NaN; it must be above 0 and below 1"),
            (Iterative { max_iterations: 0, ..good }, "`max_iterations` is 0; it must be at least 1"),
            (Iterative { krylov: Krylov::Gmres { restart: 0 }, ..good }, "`restart` is 0; it must be at least 1"),
            (
                Iterative { preconditioner: ilut(-1.0), ..good },
                "`drop_tolerance` is -1; it must be 0 or above, and finite",
            ),
        ];
        for (method, said) in cases {
            let error = SolverParams::default().iterative(method).check().unwrap_err();
            assert_eq!(error.to_string(), said);
        }
    }
}
