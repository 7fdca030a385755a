//! The iterative solver: a Krylov method with a preconditioner that a backend provides.
#![cfg_attr(not(feature = "sparse"), allow(dead_code, unused_imports, reason = "some backends need only a part"))]

use std::sync::{Mutex, PoisonError};

use num_traits::{One, Zero};

use crate::backends::checks::check_columns;
use crate::backends::direct::Pivots;
use crate::backends::kept::KeptPreconditioner;
use crate::las::krylov::KrylovSpace;
use crate::las::{
    Backend, FactorReport, Factorization, Failure, Iterative, MatVec, Preconditioner, Scalar, SingleLane, SolveError,
    SolveReport, VectorOps,
};

/// A preconditioner that a backend provides for a Krylov method.
pub(super) trait ApproximateInverse<B: Backend>: Send + Sync {
    /// Computes the preconditioner of `a`; returns its pivots if it has any.
    fn compute(&mut self, a: &B::Matrix) -> Result<Option<Pivots>, Failure<B>>;

    /// Computes `y`, an approximation of `A^-1 x`.
    fn apply(&mut self, x: &B::Vector, y: &mut B::Vector) -> Result<(), Failure<B>>;

    /// Returns the number of values in the incomplete factorization; `None` for other preconditioners.
    fn entries(&self) -> Option<usize> {
        None
    }

    /// Takes over the matrix `a` but keeps the preconditioner. Returns false if the preconditioner does not support it.
    fn keep(&mut self, a: &B::Matrix) -> Result<bool, Failure<B>> {
        let _ = a;
        Ok(false)
    }

    /// Computes the preconditioner of the matrix that [`ApproximateInverse::keep`] took over.
    fn refresh(&mut self) -> Result<(), Failure<B>> {
        Ok(())
    }

    /// Returns true if the preconditioner stores the matrix, so that no other copy is needed.
    fn stores_matrix(&self) -> bool {
        false
    }

    /// Computes `y = A x` with the stored matrix.
    fn product(&mut self, x: &B::Vector, y: &mut B::Vector) -> Result<(), Failure<B>> {
        let _ = (x, y);
        Err(SolveError::NotFactored)
    }

    /// Returns a copy of the stored matrix.
    fn matrix(&self) -> Option<B::Matrix> {
        None
    }

    /// Returns true if the preconditioner uses vectors on which the matrix is almost zero.
    fn uses_near_null_space(&self) -> bool {
        false
    }

    /// Sets vectors on which the matrix is almost zero.
    fn set_near_null_space(&mut self, vectors: &[Vec<B::Scalar>]) -> Result<(), Failure<B>> {
        let _ = vectors;
        Ok(())
    }
}

/// No preconditioner, or the inverse diagonal.
pub(super) enum SimplePreconditioner<B: Backend> {
    None,
    /// In a lock that is never taken, because a vector need not be `Sync`.
    Diagonal(Mutex<B::Vector>),
}

impl<B: Backend> SimplePreconditioner<B> {
    /// Creates the inverse diagonal with this vector.
    pub(super) fn diagonal(vector: B::Vector) -> Self {
        Self::Diagonal(Mutex::new(vector))
    }
}

impl<B: Backend<Scalar: Scalar>> ApproximateInverse<B> for SimplePreconditioner<B> {
    fn compute(&mut self, a: &B::Matrix) -> Result<Option<Pivots>, Failure<B>> {
        let Self::Diagonal(d) = self else { return Ok(None) };
        let d = d.get_mut().unwrap_or_else(PoisonError::into_inner);
        a.inverse_diagonal(d)?;
        let pivots = |d: &[B::Scalar]| Pivots::of(d.iter().map(|d| 1.0 / d.as_f64()));
        Ok(Some(d.with_local(pivots)?))
    }

    fn apply(&mut self, x: &B::Vector, y: &mut B::Vector) -> Result<(), Failure<B>> {
        match self {
            Self::None => y.axpby(B::Scalar::one(), x, B::Scalar::zero())?,
            Self::Diagonal(d) => y.multiply(d.get_mut().unwrap_or_else(PoisonError::into_inner), x)?,
        }
        Ok(())
    }
}

/// A Krylov solver with its matrix and preconditioner.
pub(super) struct IterativeSolver<B: Backend> {
    unknowns: usize,
    /// A copy of the matrix, because its owner may change it between two solves; `None` if the preconditioner has one.
    a: Option<B::Matrix>,
    ready: bool,
    inverse: Box<dyn ApproximateInverse<B>>,
    space: KrylovSpace<B>,
    kept: KeptPreconditioner,
}

impl<B: SingleLane<Matrix: Clone>> IterativeSolver<B> {
    pub(super) fn new(
        context: &B::Context,
        unknowns: usize,
        method: Iterative,
        inverse: Box<dyn ApproximateInverse<B>>,
    ) -> Result<Self, Failure<B>> {
        let space = KrylovSpace::new(context, unknowns, method)?;
        Ok(Self { unknowns, a: None, ready: false, inverse, space, kept: KeptPreconditioner::default() })
    }

    /// Returns the number of values in the incomplete factorization, if there is one.
    pub(super) fn entries(&self) -> Option<usize> {
        self.inverse.entries()
    }

    /// Sets the relative residual at which the next solves stop.
    pub(super) fn set_tolerance(&mut self, tolerance: f64) {
        self.space.set_tolerance(tolerance);
    }

    pub(super) fn uses_near_null_space(&self) -> bool {
        self.inverse.uses_near_null_space()
    }

    pub(super) fn set_near_null_space(&mut self, vectors: &[Vec<B::Scalar>]) -> Result<(), Failure<B>> {
        self.inverse.set_near_null_space(vectors)
    }

    /// Returns a copy of the matrix.
    pub(super) fn matrix(&self) -> Option<B::Matrix> {
        self.a.clone().or_else(|| self.inverse.matrix())
    }

    /// Copies the matrix and computes its preconditioner; the caller has checked its size. Also returns the pivots of
    /// the preconditioner if it has any.
    pub(super) fn factor(&mut self, a: &B::Matrix) -> Result<(FactorReport, Option<Pivots>), Failure<B>> {
        self.ready = false;
        let pivots = self.inverse.compute(a)?;
        self.kept = KeptPreconditioner::default();
        if !self.inverse.stores_matrix() {
            match &mut self.a {
                Some(kept) => kept.clone_from(a),
                None => self.a = Some(a.clone()),
            }
        }
        self.ready = true;
        let pivot_ratio = pivots.as_ref().map_or(1.0, Pivots::ratio);
        let kind = Factorization::Approximate;
        Ok((FactorReport { kind, indefinite_at: None, pivot_ratio, negative_pivots: None }, pivots))
    }

    /// Returns the result of a check of the next matrix. A solver that has an earlier matrix solves no more with it if the next
    /// one is of no use.
    pub(super) fn unless_invalid(
        solver: &mut Option<Box<Self>>,
        checked: Result<(), Failure<B>>,
    ) -> Result<(), Failure<B>> {
        if let Some(solver) = solver {
            solver.ready &= checked.is_ok();
        }
        checked
    }

    /// Does the same as `factor`, but keeps the preconditioner of an earlier matrix as long as the number of iterations
    /// hardly grows.
    pub(super) fn update(&mut self, a: &B::Matrix) -> Result<FactorReport, Failure<B>> {
        if !std::mem::take(&mut self.ready) || !self.inverse.keep(a)? {
            return self.factor(a).map(|(report, _)| report);
        }
        self.ready = true;
        if !self.kept.keep() {
            self.refresh()?;
        }
        Ok(FactorReport { kind: self.kept.kind(), indefinite_at: None, pivot_ratio: 1.0, negative_pivots: None })
    }

    /// Computes the preconditioner of the current matrix.
    fn refresh(&mut self) -> Result<(), Failure<B>> {
        self.ready = false;
        self.inverse.refresh()?;
        (self.kept, self.ready) = (KeptPreconditioner::default(), true);
        Ok(())
    }

    /// Does the same as `factor`, but returns [`SolveError::Indefinite`] if a pivot of the preconditioner is negative, or, with
    /// multigrid, an entry of the diagonal. For a symmetric matrix, ILUT without dropping has as many negative pivots as
    /// the matrix has negative eigenvalues; with little dropping, this nearly always holds.
    pub(super) fn factor_definite(&mut self, a: &B::Matrix) -> Result<FactorReport, Failure<B>> {
        let (report, pivots) = self.factor(a)?;
        let is_indefinite = match pivots {
            Some(pivots) => pivots.negative() > 0,
            None => self.space.method().preconditioner == Preconditioner::Multigrid && self.has_negative_diagonal(a)?,
        };
        if is_indefinite {
            self.ready = false;
            return Err(SolveError::Indefinite { unknown: None });
        }
        Ok(report)
    }

    fn has_negative_diagonal(&mut self, a: &B::Matrix) -> Result<bool, Failure<B>> {
        let d = self.space.scratch();
        a.inverse_diagonal(d)?;
        Ok(d.with_local(|d| d.iter().any(|d| d.as_f64() < 0.0))?)
    }

    pub(super) fn solve_columns(&mut self, b: &[B::Vector], x: &mut [B::Vector]) -> Result<SolveReport, Failure<B>> {
        check_columns(self.unknowns, b.iter().map(VectorOps::len), x.iter().map(VectorOps::len))?;
        if !self.ready {
            return Err(SolveError::NotFactored);
        }
        let mut sum = SolveReport::DIRECT;
        for (b, x) in b.iter().zip(x) {
            let mut report = self.solve(b, x);
            if let (Err(SolveError::NotConverged { iterations, .. }), true) = (&report, self.kept.is_kept()) {
                let wasted = *iterations;
                self.refresh()?;
                report = self.solve(b, x).map(|of| of.after(wasted)).map_err(|error| error.after(wasted));
            }
            sum = sum.merge(report?);
        }
        Ok(sum)
    }

    fn solve(&mut self, b: &B::Vector, x: &mut B::Vector) -> Result<SolveReport, Failure<B>> {
        let Self { a, inverse, space, .. } = self;
        // Both functions borrow the preconditioner, one after the other.
        let inverse = std::cell::RefCell::new(inverse);
        let mut product = |x: &B::Vector, y: &mut B::Vector| match &a {
            Some(a) => a.mul(x, y),
            None => inverse.borrow_mut().product(x, y),
        };
        let mut precondition = |x: &B::Vector, y: &mut B::Vector| inverse.borrow_mut().apply(x, y);
        let report = space.solve(&mut product, &mut precondition, b, x)?;
        self.kept.judge(&report);
        Ok(report)
    }
}
