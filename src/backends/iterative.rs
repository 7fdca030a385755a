//! The iterative solver: a Krylov method with a preconditioner that a backend provides.
#![cfg_attr(not(feature = "sparse"), allow(dead_code, unused_imports, reason = "some backends need only a part"))]

use crate::backends::checks::check_columns;
use crate::backends::direct::Pivots;
use crate::las::krylov::KrylovSpace;
use crate::las::{
    Backend, FactorReport, Factorization, Failure, Iterative, MatVec, Scalar, SingleLane, SolveError, SolveReport,
    VectorOps,
};

/// A preconditioner that a backend provides for a Krylov method.
pub(super) trait ApproximateInverse<B: Backend>: Send + Sync {
    /// Computes the preconditioner of `a`; returns its pivots if it has any.
    fn compute(&mut self, a: &B::Matrix) -> Result<Option<Pivots>, Failure<B>>;

    /// Computes `y`, an approximation of `A^-1 x`.
    fn apply(&self, x: &B::Vector, y: &mut B::Vector) -> Result<(), Failure<B>>;

    /// Returns the number of values in the incomplete factorization; `None` for other preconditioners.
    fn entries(&self) -> Option<usize> {
        None
    }
}

/// No preconditioner, or the inverse diagonal.
pub(super) enum SimplePreconditioner<B: Backend> {
    None,
    Diagonal(B::Vector),
}

impl<B: Backend<Scalar: Scalar, Vector: Sync>> ApproximateInverse<B> for SimplePreconditioner<B> {
    fn compute(&mut self, a: &B::Matrix) -> Result<Option<Pivots>, Failure<B>> {
        let Self::Diagonal(d) = self else { return Ok(None) };
        a.inverse_diagonal(d)?;
        let pivots = |d: &[B::Scalar]| Pivots::of(d.iter().map(|d| 1.0 / d.as_f64()));
        Ok(Some(d.with_local(pivots)?))
    }

    fn apply(&self, x: &B::Vector, y: &mut B::Vector) -> Result<(), Failure<B>> {
        let product = |y: &mut [B::Scalar]| {
            x.with_local(|x| match self {
                Self::None => {
                    y.copy_from_slice(x);
                    Ok(())
                }
                Self::Diagonal(d) => d.with_local(|d| {
                    for ((y, &x), &d) in y.iter_mut().zip(x).zip(d) {
                        *y = x * d;
                    }
                }),
            })
        };
        Ok(y.with_local_mut(product)???)
    }
}

/// A Krylov solver with its matrix and preconditioner.
pub(super) struct IterativeSolver<B: Backend> {
    unknowns: usize,
    /// A copy of the matrix, because its owner may change it between two solves.
    a: Option<B::Matrix>,
    ready: bool,
    inverse: Box<dyn ApproximateInverse<B>>,
    space: KrylovSpace<B>,
}

impl<B: SingleLane<Matrix: Clone>> IterativeSolver<B> {
    pub(super) fn new(
        context: &B::Context,
        unknowns: usize,
        method: Iterative,
        inverse: Box<dyn ApproximateInverse<B>>,
    ) -> Result<Self, Failure<B>> {
        let space = KrylovSpace::new(context, unknowns, method)?;
        Ok(Self { unknowns, a: None, ready: false, inverse, space })
    }

    /// Returns the number of values in the incomplete factorization, if there is one.
    pub(super) fn entries(&self) -> Option<usize> {
        self.inverse.entries()
    }

    /// Copies the matrix and computes its preconditioner; the caller has checked its size. Also returns the pivots of
    /// the preconditioner if it has any.
    pub(super) fn factor(&mut self, a: &B::Matrix) -> Result<(FactorReport, Option<Pivots>), Failure<B>> {
        self.ready = false;
        let pivots = self.inverse.compute(a)?;
        match &mut self.a {
            Some(kept) => kept.clone_from(a),
            None => self.a = Some(a.clone()),
        }
        self.ready = true;
        let pivot_ratio = pivots.as_ref().map_or(1.0, Pivots::ratio);
        let kind = Factorization::Approximate;
        Ok((FactorReport { kind, indefinite_at: None, pivot_ratio, negative_pivots: None }, pivots))
    }

    /// Does the same as `factor`, but returns [`SolveError::Indefinite`] if a pivot of the preconditioner is negative.
    /// For a symmetric matrix, ILUT without dropping has as many negative pivots as the matrix has negative
    /// eigenvalues; with little dropping, this nearly always holds.
    pub(super) fn factor_definite(&mut self, a: &B::Matrix) -> Result<FactorReport, Failure<B>> {
        let (report, pivots) = self.factor(a)?;
        if pivots.is_some_and(|pivots| pivots.negative() > 0) {
            self.ready = false;
            return Err(SolveError::Indefinite { unknown: None });
        }
        Ok(report)
    }

    pub(super) fn solve_columns(&mut self, b: &[B::Vector], x: &mut [B::Vector]) -> Result<SolveReport, Failure<B>> {
        check_columns(self.unknowns, b.iter().map(VectorOps::len), x.iter().map(VectorOps::len))?;
        let Self { a: Some(a), ready: true, inverse, space, .. } = self else { return Err(SolveError::NotFactored) };
        let mut sum = SolveReport::DIRECT;
        for (b, x) in b.iter().zip(x) {
            let mut product = |x: &B::Vector, y: &mut B::Vector| a.mul(x, y);
            let mut precondition = |x: &B::Vector, y: &mut B::Vector| inverse.apply(x, y);
            sum = sum.merge(space.solve(&mut product, &mut precondition, b, x)?);
        }
        Ok(sum)
    }
}
