//! What is known of a system, and how it is to be solved.

use thiserror::Error;

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
    /// Stabilized biconjugate gradients, for any (van der Vorst 1992).
    BiCgStab,
    /// Generalized minimal residuals, for any, begun again after `restart` steps (Saad and Schultz 1986).
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
    /// An incomplete LU factorization with a threshold (Saad 1994).
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
///
/// ```
/// use biotissue::las::{Iterative, Krylov, SolverParams, Symmetry};
///
/// let cg = Iterative { tolerance: 1e-8, ..Iterative::new(Krylov::Cg) };
/// let params = SolverParams::new(Symmetry::Definite).iterative(cg); // for Backend::analyze
/// assert!(params.check().is_ok());
/// ```
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
        Self::new(Krylov::BiCgStab)
    }
}

impl Iterative {
    /// A method to 1e-10 within 1000 iterations, with the preconditioner that suits it: conjugate gradients need one that is
    /// symmetric and positive, the inverse of the diagonal; the others take ILUT(1e-3, 20), which is neither.
    ///
    /// The backend `petsc` has no ILUT: state another there.
    #[must_use]
    pub fn new(krylov: Krylov) -> Self {
        let preconditioner = match krylov {
            Krylov::Cg => Preconditioner::Diagonal,
            Krylov::BiCgStab | Krylov::Gmres { .. } => Preconditioner::Ilut { drop_tolerance: 1e-3, fill: 20 },
        };
        Self { krylov, preconditioner, tolerance: 1e-10, max_iterations: 1000 }
    }

    /// Refuses numbers that no iteration can work with; [`Backend::analyze`](crate::las::Backend::analyze) calls it.
    ///
    /// # Errors
    /// The first number that is out of its range.
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
}

/// A number of [`Iterative`] that is out of its range.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("`{name}` is {found}; it must be {allowed}")]
pub struct InvalidParameter {
    /// Which one.
    pub name: &'static str,
    /// What it is.
    pub found: String,
    /// What it may be.
    pub allowed: &'static str,
}

/// How a system is solved.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Method {
    /// By a factorization.
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
    /// `None`, the default: where a pivot is below the root of the machine epsilon times the largest, the matrix counts as
    /// singular if, scaled to rows and columns of size one, it resists some vector by less than `32 + 2 sqrt(unknowns)` machine
    /// epsilons times its length. However unlike the units of its unknowns are, a regular matrix is not refused.
    pub singular_below: Option<f64>,
    /// The order of elimination; a backend without a choice ignores it.
    pub ordering: Ordering,
    /// By a factorization or by iterations.
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

    /// Refuses numbers that nothing can work with.
    ///
    /// # Errors
    /// As for [`Iterative::check`].
    pub fn check(&self) -> Result<(), InvalidParameter> {
        match &self.method {
            Method::Direct => Ok(()),
            Method::Iterative(iterative) => iterative.check(),
        }
    }

    /// The same, by iterations.
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
    fn numbers_out_of_range_are_refused() {
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
