//! Krylov methods, written with the operations of the abstraction: they run on every backend whose `norm` and `dot`
//! return a single number.
//!
//! All methods start from zero and stop by the relative norm of the true residual. They recompute that residual before
//! they report convergence, because the residual of the recurrence drifts away from it. A backend's solver passes its
//! matrix and its preconditioner as functions and keeps the work vectors in a [`KrylovSpace`], so that only the first
//! solve allocates memory.

mod bicgstab;
mod cg;
mod gmres;
#[cfg(test)]
mod tests;

use num_traits::{Float, One, Zero};

use super::{Backend, Failure, Iterative, Krylov, Scalar, SingleLane, SolveError, SolveReport, StopReason, VectorOps};

/// `y = f(x)`: the product with the matrix or with the preconditioner.
pub type Apply<'a, B> = &'a mut dyn FnMut(&Vector<B>, &mut Vector<B>) -> Result<(), SolveError<<B as Backend>::Error>>;

type Vector<B> = <B as Backend>::Vector;

/// The work vectors of a Krylov method.
pub struct KrylovSpace<B: Backend> {
    method: Iterative,
    vectors: Vec<B::Vector>,
    /// Coefficients of GMRES (Hessenberg matrix, rotations, right-hand side).
    coefficients: Vec<B::Scalar>,
}

/// The reason why an inner loop ended.
enum Ended {
    /// The recurrence residual is small enough, or a restart is due: the true residual has to be computed.
    CheckResidual,
    /// The next step is undefined.
    Breakdown,
}

/// Input of an inner loop, and its iteration count.
struct Run<'a, B: Backend> {
    a: Apply<'a, B>,
    m: Apply<'a, B>,
    /// The residual norm at which to stop.
    target: B::Scalar,
    iterations: usize,
    max_iterations: usize,
}

impl<B: SingleLane> KrylovSpace<B> {
    /// Allocates the work vectors for systems of `len` unknowns (of this rank, on a distributed backend).
    ///
    /// # Errors
    /// Returns the backend's error if it cannot create a vector.
    pub fn new(context: &B::Context, len: usize, mut method: Iterative) -> Result<Self, B::Error> {
        if let Krylov::Gmres { restart } = &mut method.krylov {
            // There is no basis vector without an iteration.
            *restart = (*restart).min(method.max_iterations);
        }
        let (vectors, coefficients) = match method.krylov {
            Krylov::Cg => (cg::VECTORS, 0),
            Krylov::BiCgStab => (bicgstab::VECTORS, 0),
            Krylov::Gmres { restart } => (gmres::vectors(restart), gmres::coefficients(restart)),
        };
        let vectors = (0..vectors).map(|_| B::vector(context, len)).collect::<Result<_, _>>()?;
        Ok(Self { method, vectors, coefficients: vec![B::Scalar::default(); coefficients] })
    }

    /// Sets the relative residual at which the next solves stop, above 0 and below 1.
    pub fn set_tolerance(&mut self, tolerance: f64) {
        self.method.tolerance = tolerance;
    }

    /// Returns the method.
    #[cfg(any(feature = "sparse", feature = "dense"))]
    pub(crate) fn method(&self) -> &Iterative {
        &self.method
    }

    /// Returns a vector that the next solve overwrites.
    #[cfg(any(feature = "sparse", feature = "dense"))]
    pub(crate) fn scratch(&mut self) -> &mut B::Vector {
        &mut self.vectors[0]
    }

    /// Solves `A x = b` with the matrix `a` and the preconditioner `m`.
    ///
    /// # Errors
    /// Returns [`SolveError::NotConverged`], [`SolveError::RhsNotFinite`], [`SolveError::Parameter`] for a tolerance out of
    /// range, and the errors of `a` and `m`.
    pub fn solve(
        &mut self,
        a: Apply<'_, B>,
        m: Apply<'_, B>,
        b: &B::Vector,
        x: &mut B::Vector,
    ) -> Result<SolveReport, SolveError<B::Error>> {
        self.method.check().map_err(SolveError::Parameter)?;
        let Iterative { krylov, tolerance, max_iterations, .. } = self.method;
        VectorOps::zero(x)?;
        let rhs_norm = b.norm()?;
        if rhs_norm.is_zero() {
            return Ok(SolveReport::DIRECT);
        }
        if !rhs_norm.is_finite() {
            return Err(SolveError::RhsNotFinite);
        }
        let target = rhs_norm * B::Scalar::of(tolerance);
        let mut run = Run::<B> { a, m, target, iterations: 0, max_iterations };
        let mut best = B::Scalar::infinity();
        let mut ended = Ended::CheckResidual;
        loop {
            // In every method the first vector is the residual.
            run.residual(b, x, &mut self.vectors)?;
            let residual = self.vectors[0].norm()?;
            let report =
                SolveReport { iterations: run.iterations, residual: (residual / rhs_norm).as_f64(), fallbacks: 0 };
            if residual <= target {
                return Ok(report);
            }
            // The last restart reduced the residual by less than 10%: rounding errors dominate.
            let stagnated = residual > best * B::Scalar::of(0.9) && !matches!(krylov, Krylov::Gmres { .. });
            let stop_reason = if residual.is_nan() || matches!(ended, Ended::Breakdown) {
                Some(StopReason::Breakdown)
            } else if run.iterations >= max_iterations {
                Some(StopReason::MaxIterations)
            } else {
                stagnated.then_some(StopReason::Stagnated)
            };
            if let Some(stop_reason) = stop_reason {
                return Err(self.method.not_converged(report, stop_reason));
            }
            best = best.min(residual);
            ended = match krylov {
                Krylov::Cg => cg::run(&mut run, x, &mut self.vectors)?,
                Krylov::BiCgStab => bicgstab::run(&mut run, x, &mut self.vectors)?,
                Krylov::Gmres { restart } => {
                    gmres::run(&mut run, x, &mut self.vectors, &mut self.coefficients, restart)?
                }
            };
        }
    }
}

impl<B: SingleLane> Run<'_, B> {
    /// `vectors[0] = b - A x`.
    fn residual(&mut self, b: &B::Vector, x: &B::Vector, vectors: &mut [B::Vector]) -> Result<(), Failure<B>> {
        let (r, rest) = split_first_vector(vectors);
        (self.a)(x, &mut rest[0])?;
        r.axpby(B::Scalar::one(), b, B::Scalar::zero())?;
        Ok(r.axpy(-B::Scalar::one(), &rest[0])?)
    }
}

/// Splits off the first vector; every method has at least two.
fn split_first_vector<V>(vectors: &mut [V]) -> (&mut V, &mut [V]) {
    let (first, rest) = vectors.split_at_mut(1);
    (&mut first[0], rest)
}
