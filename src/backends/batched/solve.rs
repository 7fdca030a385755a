//! The solver: factorizations side by side where the matrices allow it, and one after the other where they do not.

use std::sync::Arc;

use super::{Batched, Failure, Lanes, Matrix, Vector};
use crate::backends::checks::{check_columns, check_pattern, immediate_singular_limit};
use crate::backends::networks::lanes::{LaneAnalysis, LaneCholesky, LanePivots, MOST_OPERATIONS};
use crate::backends::null_vector::null_vector_limit;
use crate::backends::sparse::{self, Sparse, SparseScalar};
use crate::las::{
    Backend, FactorReport, Factorization, SolveError, SolveReport, Solver as _, SolverParams, Sparsity, Symmetry,
};

/// The symbolic analysis of one pattern, shared by all its solvers.
pub struct Symbolic {
    /// For the lanes that are solved one after the other.
    single: Arc<sparse::Symbolic>,
    params: SolverParams,
    pattern: Arc<Sparsity>,
    lanes: Option<Arc<LaneAnalysis>>,
}

impl Symbolic {
    pub(super) fn new<T: SparseScalar, const N: usize>(
        pattern: &Arc<Sparsity>,
        params: &SolverParams,
    ) -> Result<Self, Failure> {
        let single = Sparse::<T>::analyze(&(), pattern, params)?;
        let is_f64 = size_of::<T>() == size_of::<f64>();
        // Only symmetric matrices with a direct solver have operations. Those of a large system are not listed for
        // lanes.
        let may_use = is_f64 && single.operations().is_some_and(|operations| operations <= MOST_OPERATIONS);
        let lanes = if may_use { LaneAnalysis::new(N, pattern, single.order()) } else { None };
        Ok(Self { single, params: *params, pattern: Arc::clone(pattern), lanes: lanes.map(Arc::new) })
    }

    /// Returns true if definite matrices are factored in the lanes of vector registers, and not one after the other.
    pub fn uses_vectors(&self) -> bool {
        self.lanes.is_some()
    }

    pub(super) fn single(&self) -> &sparse::Symbolic {
        &self.single
    }
}

/// The solver for `N` matrices with one sparsity pattern.
///
/// It factors positive definite matrices of `f64` that consist of 3x3 blocks by Cholesky in all lanes at once, if the
/// machine has vector registers of `N` numbers (4 with AVX2, 8 with AVX-512) and a factorization has at most 1.5e8
/// operations. Each other lane gets a solver of the backend [`sparse`](crate::backends::sparse), with the same
/// parameters, reports and errors: pivots differ between lanes, and so do the iterations of Krylov methods. A lane does
/// not depend on the others.
///
/// [`factor`](crate::las::Solver::factor) fails if the matrix of any lane cannot be factored; [`Solver::factor_lanes`]
/// leaves that decision to the caller.
pub struct Solver<T: SparseScalar = f64, const N: usize = 4> {
    symbolic: Arc<Symbolic>,
    lanes: Option<LaneCholesky>,
    /// How each lane is solved.
    way: [Way; N],
    singles: [Option<Single<T>>; N],
    tolerance: Option<f64>,
    near_null_space: Vec<Vec<Lanes<T, N>>>,
}

/// How a lane is solved.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Way {
    /// Not at all: its matrix was not factored.
    None,
    InLanes,
    Single,
}

/// The system of one lane.
struct Single<T: SparseScalar> {
    solver: sparse::Solver<T>,
    matrix: sparse::Matrix<T>,
}

/// The factorization that is asked for.
#[derive(Clone, Copy)]
enum Request {
    Factor,
    Update,
    Definite,
}

impl<T: SparseScalar, const N: usize> Solver<T, N> {
    pub(super) fn new(symbolic: &Arc<Symbolic>) -> Result<Self, Failure> {
        let mut solver = Self {
            symbolic: Arc::clone(symbolic),
            lanes: symbolic.lanes.as_ref().map(LaneCholesky::new),
            way: [Way::None; N],
            singles: [const { None }; N],
            tolerance: None,
            near_null_space: Vec::new(),
        };
        if solver.lanes.is_none() {
            (0..N).try_for_each(|lane| solver.single(lane).map(drop))?;
        }
        Ok(solver)
    }

    /// Returns the solver of one lane, made on first use.
    fn single(&mut self, lane: usize) -> Result<&mut Single<T>, Failure> {
        let Self { singles, symbolic, tolerance, near_null_space, .. } = self;
        let place = &mut singles[lane];
        if place.is_none() {
            let mut solver = Sparse::<T>::solver(&symbolic.single)?;
            tolerance.iter().for_each(|&tolerance| solver.set_tolerance(tolerance));
            if !near_null_space.is_empty() {
                solver.set_near_null_space(&of_lane(near_null_space, lane))?;
            }
            *place = Some(Single { solver, matrix: sparse::Matrix::zeros(&symbolic.pattern) });
        }
        place.as_mut().ok_or(SolveError::NotFactored)
    }

    /// Factors the matrices of all lanes; returns a report or an error for each. The next solves give NaN in the lanes
    /// that failed; if all failed, there is no factorization to solve with.
    ///
    /// # Errors
    /// Returns [`SolveError::Size`] or [`SolveError::Pattern`] if the pattern differs from the analyzed one.
    pub fn factor_lanes(&mut self, a: &Matrix<T, N>) -> Result<Vec<Result<FactorReport, Failure>>, Failure> {
        self.factor_each(a, Request::Factor)
    }

    fn factor_each(
        &mut self,
        a: &Matrix<T, N>,
        request: Request,
    ) -> Result<Vec<Result<FactorReport, Failure>>, Failure> {
        self.way = [Way::None; N];
        check_pattern(a.pattern(), &self.symbolic.pattern)?;
        let mut in_lanes = [None; N];
        if let Some(lanes) = &mut self.lanes {
            let pivots = lanes.factor(numbers(a.values()));
            let are_finite = are_finite(a.values());
            for (lane, pivots) in pivots.iter().enumerate().filter(|&(lane, _)| are_finite[lane]) {
                in_lanes[lane] = report_of::<T>(pivots, &self.symbolic);
            }
        }
        Ok((0..N).map(|lane| self.factor_lane(lane, in_lanes[lane], a, request)).collect())
    }

    fn factor_lane(
        &mut self,
        lane: usize,
        in_lanes: Option<FactorReport>,
        a: &Matrix<T, N>,
        request: Request,
    ) -> Result<FactorReport, Failure> {
        if let Some(report) = in_lanes {
            self.way[lane] = Way::InLanes;
            return Ok(report);
        }
        let Single { solver, matrix } = self.single(lane)?;
        for (to, from) in matrix.values_mut().iter_mut().zip(a.values()) {
            *to = from.0[lane];
        }
        let report = match request {
            Request::Factor => solver.factor(matrix),
            Request::Update => solver.update(matrix),
            Request::Definite => solver.factor_definite(matrix),
        }?;
        self.way[lane] = Way::Single;
        Ok(report)
    }

    /// Factors all lanes; an error of any of them leaves no factorization.
    fn factor_all(&mut self, a: &Matrix<T, N>, request: Request) -> Result<FactorReport, Failure> {
        let reports = self.factor_each(a, request)?.into_iter().collect::<Result<Vec<_>, _>>();
        let reports = reports.inspect_err(|_| self.way = [Way::None; N])?;
        Ok(combine(&reports))
    }
}

/// Returns the report of a lane that was factored side by side with the others; `None` if its matrix is not positive
/// definite, or if its pivots leave doubt whether it is regular.
fn report_of<T: SparseScalar>(pivots: &LanePivots, symbolic: &Symbolic) -> Option<FactorReport> {
    let (n, params) = (symbolic.pattern.rows(), &symbolic.params);
    let ratio = if n == 0 { 1.0 } else { pivots.smallest / pivots.largest };
    let is_regular = ratio >= immediate_singular_limit(params) && null_vector_limit::<T>(params, n, ratio).is_none();
    (pivots.are_positive && is_regular).then_some(FactorReport {
        kind: if params.symmetry == Symmetry::Definite { Factorization::Cholesky } else { Factorization::Ldlt },
        indefinite_at: None,
        pivot_ratio: ratio,
        negative_pivots: Some(0),
    })
}

/// Returns one report for all lanes: the kind that differs from the first lane's, if there is one, the first unknown at
/// which Cholesky failed, the smallest pivot ratio, and the largest number of negative pivots.
fn combine(reports: &[FactorReport]) -> FactorReport {
    let none =
        FactorReport { kind: Factorization::Cholesky, indefinite_at: None, pivot_ratio: 1.0, negative_pivots: Some(0) };
    let first = reports.first().copied().unwrap_or(none);
    reports.iter().fold(first, |all, lane| FactorReport {
        kind: if lane.kind == first.kind { all.kind } else { lane.kind },
        indefinite_at: all.indefinite_at.or(lane.indefinite_at),
        pivot_ratio: all.pivot_ratio.min(lane.pivot_ratio),
        negative_pivots: all.negative_pivots.zip(lane.negative_pivots).map(|(a, b)| a.max(b)),
    })
}

/// Returns for each lane whether all of its values are finite; the factorization reads only one triangle.
fn are_finite<T: SparseScalar, const N: usize>(values: &[Lanes<T, N>]) -> [bool; N] {
    let zeros = values.iter().fold(Lanes([T::zero(); N]), |sum, &value| sum + value * Lanes([T::zero(); N]));
    zeros.0.map(|sum| sum.is_finite())
}

/// Returns the vectors of one lane.
fn of_lane<T: SparseScalar, const N: usize>(vectors: &[Vec<Lanes<T, N>>], lane: usize) -> Vec<Vec<T>> {
    vectors.iter().map(|vector| vector.iter().map(|entry| entry.0[lane]).collect()).collect()
}

/// The numbers of all lanes, entry after entry; only called for `f64`.
fn numbers<T: SparseScalar, const N: usize>(entries: &[Lanes<T, N>]) -> &[f64] {
    bytemuck::cast_slice(entries)
}

impl<T: SparseScalar, const N: usize> crate::las::Solver<Batched<T, N>> for Solver<T, N> {
    fn factor(&mut self, a: &Matrix<T, N>) -> Result<FactorReport, Failure> {
        self.factor_all(a, Request::Factor)
    }

    fn update(&mut self, a: &Matrix<T, N>) -> Result<FactorReport, Failure> {
        self.factor_all(a, Request::Update)
    }

    fn factor_definite(&mut self, a: &Matrix<T, N>) -> Result<FactorReport, Failure> {
        self.factor_all(a, Request::Definite)
    }

    fn set_tolerance(&mut self, tolerance: f64) {
        self.tolerance = Some(tolerance);
        self.singles.iter_mut().flatten().for_each(|single| single.solver.set_tolerance(tolerance));
    }

    fn uses_near_null_space(&self) -> bool {
        self.singles.iter().flatten().any(|single| single.solver.uses_near_null_space())
    }

    fn set_near_null_space(&mut self, vectors: &[Vec<Lanes<T, N>>]) -> Result<(), Failure> {
        self.near_null_space = vectors.to_vec();
        for (lane, single) in self.singles.iter_mut().enumerate() {
            if let Some(single) = single {
                single.solver.set_near_null_space(&of_lane(vectors, lane))?;
            }
        }
        Ok(())
    }

    fn solve_many(&mut self, b: &[Vector<T, N>], x: &mut [Vector<T, N>]) -> Result<SolveReport, Failure> {
        let n = self.symbolic.pattern.rows();
        check_columns(n, b.iter().map(|b| b.as_slice().len()), x.iter().map(|x| x.as_slice().len()))?;
        if self.way.iter().all(|&way| way == Way::None) {
            return Err(SolveError::NotFactored);
        }
        if let (Some(lanes), true) = (&mut self.lanes, self.way.contains(&Way::InLanes)) {
            for (b, x) in b.iter().zip(&mut *x) {
                lanes.solve(numbers(b.as_slice()), bytemuck::cast_slice_mut(x.as_mut_slice()));
            }
        }
        let mut report = SolveReport::DIRECT;
        for lane in 0..N {
            match self.way[lane] {
                Way::InLanes => {}
                Way::None => x.iter_mut().for_each(|x| x.as_mut_slice().iter_mut().for_each(|x| x.0[lane] = T::nan())),
                Way::Single => {
                    let of_lane = |b: &Vector<T, N>| b.as_slice().iter().map(|entry| entry.0[lane]).collect::<Vec<T>>();
                    let right: Vec<sparse::Vector<T>> = b.iter().map(|b| of_lane(b).into()).collect();
                    let mut found: Vec<sparse::Vector<T>> = x.iter().map(|x| of_lane(x).into()).collect();
                    let outcome = self.single(lane)?.solver.solve_many(&right, &mut found);
                    for (x, found) in x.iter_mut().zip(&found) {
                        x.as_mut_slice().iter_mut().zip(found.as_slice()).for_each(|(x, &found)| x.0[lane] = found);
                    }
                    report = report.merge(outcome?);
                }
            }
        }
        Ok(report)
    }
}
