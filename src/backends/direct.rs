//! Shared code of the in-memory direct solvers: the assessment of pivots, and their working memory.
#![cfg_attr(not(feature = "sparse"), allow(dead_code, unused_imports, reason = "some backends need only a part"))]

use faer::dyn_stack::{MemBuffer, MemStack, StackReq};
use faer::linalg::cholesky::lblt::factor::LbltParams;
use faer::linalg::cholesky::llt::factor::LltError;
use faer::traits::RealField;
use faer::{Auto, Spec};

use crate::las::{FactorReport, Factorization, Scalar, SolveError};

/// Returns the pivoting parameters of LDL^T: unblocked, because faer's blocked variant keeps stale entries where a
/// column cancels exactly.
pub(super) fn ldlt_params<T: RealField>() -> Spec<LbltParams, T> {
    Spec::new(LbltParams { block_size: 0, ..<LbltParams as Auto<T>>::auto() })
}

/// The smallest and largest pivots of a factorization, collected in elimination order.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pivots {
    smallest: f64,
    position: usize,
    largest: f64,
    negative: usize,
}

impl Pivots {
    /// Creates the pivots of an empty matrix.
    pub(super) fn empty() -> Self {
        Self { smallest: f64::INFINITY, position: 0, largest: 0.0, negative: 0 }
    }

    /// Collects pivots given in elimination order.
    pub(super) fn of(pivots: impl Iterator<Item = f64>) -> Self {
        let mut collected = Self::empty();
        pivots.enumerate().for_each(|(position, pivot)| collected.record(pivot, position));
        collected
    }

    /// Records the next pivot.
    ///
    /// A pivot that is not finite counts as zero. It can only follow a pivot of exactly zero or result from overflow;
    /// since the first of equal pivots counts, the reported pivot is the one that caused the others.
    #[inline]
    pub(super) fn record(&mut self, pivot: f64, position: usize) {
        let size = if pivot.is_finite() { pivot.abs() } else { 0.0 };
        if size < self.smallest {
            self.smallest = size;
            self.position = position;
        }
        self.largest = self.largest.max(size);
        self.negative += usize::from(pivot < 0.0);
    }

    /// Records the 2x2 pivot block `[[a, b], [b, c]]` at `position` by its eigenvalues.
    #[inline]
    pub(super) fn record_block(&mut self, a: f64, b: f64, c: f64, position: usize) {
        let mean = 0.5 * (a + c);
        let radius = (0.5 * (a - c)).hypot(b);
        let large = if mean < 0.0 { mean - radius } else { mean + radius };
        // The smaller eigenvalue follows from the determinant: the difference of mean and radius would lose its digits.
        let small = if large == 0.0 { 0.0 } else { (a / large) * c - (b / large) * b };
        self.record(large, position);
        // The eigenvector of `small` is (b, small - a); the pivot is attributed to the unknown with the larger
        // component.
        let second = (small - a).abs() > b.abs();
        self.record(small, position + usize::from(second));
    }

    /// Creates the pivots of a factorization that provides only an estimate of their ratio.
    pub(super) fn from_ratio(ratio: f64) -> Self {
        Self { smallest: ratio, position: 0, largest: 1.0, negative: 0 }
    }

    /// Creates the pivots of a block-diagonal `D` with 1x1 and 2x2 blocks; a block is 2x2 if its subdiagonal entry is
    /// not zero.
    pub(super) fn from_blocks<T: Scalar>(len: usize, diagonal: impl Fn(usize) -> T, subdiagonal: &[T]) -> Self {
        let mut pivots = Self::empty();
        let mut position = 0;
        while position < len {
            let coupling = subdiagonal[position];
            if coupling.is_zero() || position + 1 == len {
                pivots.record(diagonal(position).as_f64(), position);
                position += 1;
            } else {
                let (a, c) = (diagonal(position).as_f64(), diagonal(position + 1).as_f64());
                pivots.record_block(a, coupling.as_f64(), c, position);
                position += 2;
            }
        }
        pivots
    }

    /// Returns the ratio of the smallest to the largest pivot; 1 for a matrix without unknowns.
    pub(super) fn ratio(&self) -> f64 {
        if self.smallest == f64::INFINITY {
            1.0
        } else if self.smallest == 0.0 {
            0.0
        } else {
            self.smallest / self.largest
        }
    }

    /// Returns the number of negative pivots.
    pub(super) fn negative(&self) -> usize {
        self.negative
    }

    /// Returns the report of a factorization of this kind.
    pub(super) fn report(&self, kind: Factorization, indefinite_at: Option<usize>) -> FactorReport {
        let negative_pivots = (kind != Factorization::Lu).then_some(self.negative);
        FactorReport { kind, indefinite_at, pivot_ratio: self.ratio(), negative_pivots }
    }

    /// Returns [`SolveError::Singular`] if the ratio of the pivots is below `limit`; `unknown` maps a position to the
    /// caller's numbering.
    pub(super) fn check_singular<F>(
        &self,
        limit: f64,
        unknown: impl FnOnce(usize) -> usize,
    ) -> Result<(), SolveError<F>> {
        let ratio = self.ratio();
        if ratio < limit { Err(SolveError::Singular { unknown: unknown(self.position), ratio, limit }) } else { Ok(()) }
    }
}

/// The reason why a Cholesky factorization stopped: a pivot that is not positive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct NotPositiveDefinite {
    /// The position of the pivot in the elimination order.
    pub(super) position: usize,
}

impl From<LltError> for NotPositiveDefinite {
    fn from(LltError::NonPositivePivot { index: position }: LltError) -> Self {
        Self { position }
    }
}

/// Working memory for faer, which grows to the largest request and is kept.
pub(super) struct Scratch {
    granted: StackReq,
    memory: MemBuffer,
}

impl Scratch {
    pub(super) fn new(request: StackReq) -> Self {
        Self { granted: request, memory: MemBuffer::new(request) }
    }

    /// Grows the working memory if `request` does not fit.
    pub(super) fn reserve(&mut self, request: StackReq) {
        let both = self.granted.or(request);
        if both.unaligned_bytes_required() > self.granted.unaligned_bytes_required() {
            *self = Self::new(both);
        }
    }

    pub(super) fn memory(&mut self) -> &mut MemStack {
        MemStack::new(&mut self.memory)
    }
}

/// Defines the scalars of a backend with direct solvers: the trait `$name` with the operations of `Solver` of the
/// calling module, its implementations for `f64` and `f32`, and the implementation of `las::Solver` that calls them.
macro_rules! impl_direct_solver {
    ($name:ident: $bound:ident $(+ $more:ident)*, $backend:ident) => {
        /// A scalar type of this backend, `f64` or `f32`, with the operations of [`Solver`] for it.
        ///
        /// Each type implements them separately, so that the factorizations, including those of faer, are compiled in
        /// this crate. Functions that are generic in the scalar would be compiled again in every crate that calls them.
        pub trait $name: $bound $(+ $more)* {
            /// Creates a solver.
            fn solver(symbolic: &Arc<Symbolic>) -> Result<Solver<Self>, Failure>;

            /// See [`crate::las::Solver::factor`].
            fn factor(solver: &mut Solver<Self>, a: &Matrix<Self>) -> Result<FactorReport, Failure>;

            /// See [`crate::las::Solver::update`].
            fn update(solver: &mut Solver<Self>, a: &Matrix<Self>) -> Result<FactorReport, Failure>;

            /// See [`crate::las::Solver::factor_definite`].
            fn factor_definite(solver: &mut Solver<Self>, a: &Matrix<Self>) -> Result<FactorReport, Failure>;

            /// See [`crate::las::Solver::solve_many`].
            fn solve_many(
                solver: &mut Solver<Self>,
                b: &[Vector<Self>],
                x: &mut [Vector<Self>],
            ) -> Result<SolveReport, Failure>;
        }

        crate::backends::direct::impl_direct_solver!(@scalar $name for f64);
        crate::backends::direct::impl_direct_solver!(@scalar $name for f32);

        impl<T: $name> crate::las::Solver<$backend<T>> for Solver<T> {
            fn factor(&mut self, a: &Matrix<T>) -> Result<FactorReport, Failure> {
                T::factor(self, a)
            }

            fn update(&mut self, a: &Matrix<T>) -> Result<FactorReport, Failure> {
                T::update(self, a)
            }

            fn set_tolerance(&mut self, tolerance: f64) {
                if let Some(iterative) = &mut self.iterative {
                    iterative.set_tolerance(tolerance);
                }
            }

            fn uses_near_null_space(&self) -> bool {
                self.iterative.as_ref().is_some_and(|iterative| iterative.uses_near_null_space())
            }

            fn set_near_null_space(&mut self, vectors: &[Vec<T>]) -> Result<(), Failure> {
                self.iterative.as_mut().map_or(Ok(()), |iterative| iterative.set_near_null_space(vectors))
            }

            fn factor_definite(&mut self, a: &Matrix<T>) -> Result<FactorReport, Failure> {
                T::factor_definite(self, a)
            }

            fn solve_many(&mut self, b: &[Vector<T>], x: &mut [Vector<T>]) -> Result<SolveReport, Failure> {
                T::solve_many(self, b, x)
            }
        }
    };
    (@scalar $name:ident for $scalar:ty) => {
        impl $name for $scalar {
            fn solver(symbolic: &Arc<Symbolic>) -> Result<Solver<Self>, Failure> {
                Solver::new(symbolic)
            }

            fn factor(solver: &mut Solver<Self>, a: &Matrix<Self>) -> Result<FactorReport, Failure> {
                solver.factor_any(a)
            }

            fn update(solver: &mut Solver<Self>, a: &Matrix<Self>) -> Result<FactorReport, Failure> {
                solver.update_any(a)
            }

            fn factor_definite(solver: &mut Solver<Self>, a: &Matrix<Self>) -> Result<FactorReport, Failure> {
                solver.factor_only_definite(a)
            }

            fn solve_many(
                solver: &mut Solver<Self>,
                b: &[Vector<Self>],
                x: &mut [Vector<Self>],
            ) -> Result<SolveReport, Failure> {
                solver.solve_columns(b, x)
            }
        }
    };
}
pub(super) use impl_direct_solver;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_count_by_their_eigenvalues() {
        let mut pivots = Pivots::empty();
        pivots.record_block(0.0, 2.0, 0.0, 4);
        assert_eq!(pivots.ratio(), 1.0, "[[0, 2], [2, 0]] has the eigenvalues 2 and -2");
        assert_eq!(pivots.negative(), 1);
        let mut pivots = Pivots::empty();
        pivots.record_block(1.0, 2.0, 4.0, 4);
        assert_eq!((pivots.ratio(), pivots.position), (0.0, 4), "(2, -1) spans the kernel of [[1, 2], [2, 4]]");
        let mut pivots = Pivots::empty();
        pivots.record_block(4.0, 2.0, 1.0, 4);
        assert_eq!((pivots.ratio(), pivots.position), (0.0, 5), "(1, -2) spans the kernel of [[4, 2], [2, 1]]");
    }

    #[test]
    fn the_first_zero_pivot_is_reported() {
        let pivots = Pivots::of([3.0, 0.0, f64::NAN, 0.0, 5.0].into_iter());
        let error = pivots.check_singular::<()>(1e-15, |position| 10 * position).unwrap_err();
        assert_eq!(error, SolveError::Singular { unknown: 10, ratio: 0.0, limit: 1e-15 });
        assert_eq!(Pivots::empty().check_singular::<()>(1e-15, |p| p), Ok(()));
    }
}
