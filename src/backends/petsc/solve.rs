//! The solver: it selects the method and owns a copy of the matrix.

use std::sync::Arc;

use super::context::Context;
use super::direct::{Factor, Failure, Outcome};
use super::iterative::ByIterations;
use super::{Matrix, Petsc, SolverError, Vector};
use crate::backends::checks::{
    check_analyzable, check_columns, check_pattern, check_size, definite, parameters, singular_limit,
};
use crate::backends::local;
use crate::las::{
    Backend, FactorReport, Factorization, Iterative, MatVec, Method, Preconditioner, SolveError, SolveReport,
    SolverParams, Sparsity, Symmetry, VectorOps,
};

/// The context, the sparsity pattern and the solver parameters. PETSc's own symbolic analyses belong to the individual
/// factorizations and are made with the first one of every solver.
#[derive(Debug)]
pub struct Symbolic {
    pub(super) context: Context,
    pattern: Arc<Sparsity>,
    pub(super) params: SolverParams,
    /// The numbers of unknowns and of entries of all ranks.
    pub(super) unknowns: usize,
    entries: f64,
}

impl Symbolic {
    pub(super) fn new(context: &Context, pattern: &Arc<Sparsity>, params: &SolverParams) -> Result<Self, SolverError> {
        match context.parts() {
            Some(parts) => {
                context.agree(parts.check_pattern(pattern))?;
                parameters(params)?;
            }
            None => check_analyzable(pattern, params)?,
        }
        let (unknowns, entries) = (context.unknowns(pattern), context.sum_of_parts(pattern.nnz() as f64));
        Ok(Self { context: context.clone(), pattern: Arc::clone(pattern), params: *params, unknowns, entries })
    }
}

/// The solver for matrices with one sparsity pattern, by PETSc's KSP.
///
/// A matrix declared [`Symmetry::Definite`] is factored by Cholesky or, if a pivot is not positive, by LDL^T. A
/// symmetric matrix is factored by LDL^T, any other by LU. The package is MUMPS if PETSc has it, else PETSc itself on
/// one rank and SuperLU_DIST (LU) on several. The options database overrides these choices (`ksp_type`, `pc_type`,
/// `pc_factor_mat_solver_type`, `mat_mumps_icntl_14` and so on, with the prefix of the context).
///
/// No package reports which unknown has a pivot that is not positive: reports and errors name the unknown with the
/// smallest diagonal entry. For a singular matrix, they name the unknown with the largest component in the null space.
/// Unknowns and rows in reports and errors are numbered over all ranks, and all ranks get the same report.
#[derive(Debug)]
pub struct Solver {
    pub(super) symbolic: Arc<Symbolic>,
    pub(super) limit: f64,
    /// A copy of the matrix, because its owner may change it.
    pub(super) a: Matrix,
    /// The factors by Cholesky, LDL^T and LU (see [`index`]).
    pub(super) factors: [Option<Factor>; 3],
    iterative: Option<ByIterations>,
    active: Option<Factorization>,
    pub(super) diagonal: Vector,
}

impl Solver {
    pub(super) fn new(symbolic: &Arc<Symbolic>) -> Result<Self, SolverError> {
        let context = &symbolic.context;
        let a = Matrix::zeros_aij(context, &symbolic.pattern)?;
        let iterative = match symbolic.params.method {
            Method::Direct => None,
            Method::Iterative(method) => Some(ByIterations::new(&a, method)?),
        };
        Ok(Self {
            limit: singular_limit::<f64>(&symbolic.params),
            a,
            factors: [None, None, None],
            iterative,
            active: None,
            diagonal: Vector::zeros(context, symbolic.pattern.rows())?,
            symbolic: Arc::clone(symbolic),
        })
    }

    /// Checks a matrix and copies its values.
    fn copy_matrix(&mut self, a: &Matrix) -> Result<(), SolverError> {
        self.active = None;
        let (found, expected) = (a.pattern(), &self.symbolic.pattern);
        let context = &self.symbolic.context;
        context.agree(check_pattern(found, expected))?;
        let row =
            if a.values.slices().into_iter().all(local::all_finite) { usize::MAX } else { self.first_not_finite(a) };
        let row = context.min(row);
        if row != usize::MAX {
            return Err(SolveError::NotFinite { row });
        }
        // No package accepts a matrix without entries.
        if self.symbolic.entries == 0.0 && self.symbolic.unknowns > 0 {
            return Err(SolveError::Singular { unknown: 0, ratio: 0.0, limit: self.limit });
        }
        Ok(self.a.copy_values(a)?)
    }

    /// Factors the copied matrix, with more memory if the package requests it.
    fn attempt(&mut self, kind: Factorization) -> Result<(Factorization, Outcome), SolverError> {
        let Self { a, limit, factors, .. } = self;
        let stored = &mut factors[index(kind)];
        let mut found = None;
        // In percent; delayed pivots increase the memory needed.
        for extra_memory in [30, 100, 400, 1600] {
            let factor = match stored.take() {
                Some(factor) => factor,
                None => Factor::new(a, kind, *limit, extra_memory)?,
            };
            let now = factor.factor(a)?;
            found = Some((factor.kind, now));
            match now.failure {
                // A failed factorization cannot be used again.
                Some(Failure::OutOfMemory) => {}
                Some(failure @ Failure::Other(_)) if kind != Factorization::Cholesky => {
                    return Err(failure.error(factor.package()));
                }
                _ => {
                    *stored = Some(factor);
                    break;
                }
            }
        }
        match found {
            Some((_, Outcome { failure: Some(failure @ Failure::OutOfMemory), .. })) => Err(failure.error("mumps")),
            Some(found) => Ok(found),
            None => Err(SolveError::NotFactored),
        }
    }

    fn factor_by(&mut self, kind: Factorization, indefinite_at: Option<usize>) -> Result<FactorReport, SolverError> {
        let (kind, found) = self.attempt(kind)?;
        if found.failure.is_some() {
            return Err(self.singular(kind, &found));
        }
        self.active = Some(kind);
        self.check_near_singular(kind, found.ratio).inspect_err(|_| self.active = None)?;
        let negative_pivots = found.negative;
        Ok(FactorReport { kind, indefinite_at, pivot_ratio: found.ratio, negative_pivots })
    }

    /// Factors by Cholesky; returns `None` if the matrix is not positive definite.
    fn factor_by_cholesky(&mut self) -> Result<Option<FactorReport>, SolverError> {
        let (kind, found) = self.attempt(Factorization::Cholesky)?;
        let is_definite = found.failure.is_none() && found.negative.is_none_or(|negative| negative == 0);
        if !is_definite {
            if found.aborted {
                self.factors[index(Factorization::Cholesky)] = None;
            }
            return Ok(None);
        }
        self.active = Some(kind);
        self.check_near_singular(kind, found.ratio).inspect_err(|_| self.active = None)?;
        let negative_pivots = found.negative;
        Ok(Some(FactorReport { kind, indefinite_at: None, pivot_ratio: found.ratio, negative_pivots }))
    }

    fn factor_taken(&mut self) -> Result<FactorReport, SolverError> {
        if self.symbolic.unknowns == 0 {
            return Ok(self.report_nothing());
        }
        match self.symbolic.params.symmetry {
            Symmetry::None => self.factor_by(Factorization::Lu, None),
            Symmetry::Symmetric => self.factor_by(Factorization::Ldlt, None),
            Symmetry::Definite => match self.factor_by_cholesky()? {
                Some(report) => Ok(report),
                None => {
                    let (unknown, _) = self.smallest_diagonal()?;
                    self.factor_by(Factorization::Ldlt, Some(unknown))
                }
            },
        }
    }

    /// Returns the report for a system without unknowns.
    fn report_nothing(&mut self) -> FactorReport {
        let kind = match self.symbolic.params.symmetry {
            Symmetry::None => Factorization::Lu,
            Symmetry::Symmetric => Factorization::Ldlt,
            Symmetry::Definite => Factorization::Cholesky,
        };
        self.active = Some(kind);
        let negative_pivots = (kind != Factorization::Lu).then_some(0);
        FactorReport { kind, indefinite_at: None, pivot_ratio: 1.0, negative_pivots }
    }

    /// Computes the preconditioner or the factorization of the copied matrix.
    fn prepare_taken(&mut self) -> Result<FactorReport, SolverError> {
        match self.symbolic.params.method {
            Method::Iterative(method) => match self.prepare_iterations(method.preconditioner) {
                Err(_) if self.symbolic.params.fallback => self.factor_taken(),
                outcome => outcome,
            },
            Method::Direct => self.factor_taken(),
        }
    }

    fn prepare_iterations(&mut self, method: Preconditioner) -> Result<FactorReport, SolverError> {
        if method == Preconditioner::Diagonal {
            self.a.inverse_diagonal(&mut self.diagonal)?;
        }
        if let Some(iterative) = self.iterative.as_mut().filter(|_| self.symbolic.unknowns > 0) {
            // The next step must be the same on all ranks.
            self.symbolic.context.agree(iterative.set_up(&self.a))?;
        }
        let kind = Factorization::Approximate;
        self.active = Some(kind);
        Ok(FactorReport { kind, indefinite_at: None, pivot_ratio: 1.0, negative_pivots: None })
    }
}

/// Returns the index of the factor of this kind in [`Solver::factors`].
pub(super) fn index(kind: Factorization) -> usize {
    match kind {
        Factorization::Cholesky => 0,
        Factorization::Ldlt => 1,
        Factorization::Lu | Factorization::Approximate | Factorization::Kept => 2,
    }
}

pub(super) fn solve_one(factor: &Factor, a: &Matrix, b: &Vector, x: &mut Vector) -> Result<SolveReport, SolverError> {
    let ended = factor.solve(a, b, x)?;
    if ended.reason < 0 {
        return Err(SolveError::Library { library: "PETSc", reason: format!("KSPConvergedReason {}", ended.reason) });
    }
    let iterations = if factor.iterates { ended.iterations } else { 0 };
    Ok(SolveReport { iterations, ..SolveReport::DIRECT })
}

impl crate::las::Solver<Petsc> for Solver {
    fn factor(&mut self, a: &Matrix) -> Result<FactorReport, SolverError> {
        self.copy_matrix(a)?;
        self.prepare_taken()
    }

    /// Keeps the multigrid hierarchy of an earlier matrix while it serves, and a direct method that replaced an iterative
    /// one.
    fn update(&mut self, a: &Matrix) -> Result<FactorReport, SolverError> {
        let Some(active) = self.active.filter(|_| self.iterative.is_some()) else { return self.factor(a) };
        self.copy_matrix(a)?;
        if active != Factorization::Approximate {
            return self.factor_taken();
        }
        // The number of iterations, which decides, is the same on all ranks.
        match self.iterative.as_mut().and_then(ByIterations::keep) {
            Some(kind) => {
                self.active = Some(active);
                Ok(FactorReport { kind, indefinite_at: None, pivot_ratio: 1.0, negative_pivots: None })
            }
            None => self.prepare_taken(),
        }
    }

    /// Sets the tolerance; an error of PETSc comes back with the next solve.
    fn set_tolerance(&mut self, tolerance: f64) {
        if let Some(iterative) = &mut self.iterative {
            iterative.set_tolerance(tolerance);
        }
    }

    fn uses_near_null_space(&self) -> bool {
        matches!(
            self.symbolic.params.method,
            Method::Iterative(Iterative { preconditioner: Preconditioner::Multigrid, .. })
        )
    }

    fn set_near_null_space(&mut self, vectors: &[Vec<f64>]) -> Result<(), SolverError> {
        let rows = self.symbolic.pattern.rows();
        let mut sizes = vectors.iter().map(|vector| check_size("a vector of the near null space", vector.len(), rows));
        self.symbolic.context.agree(sizes.try_for_each(|size| size))?;
        if self.symbolic.unknowns > 0 {
            self.a.set_near_null_space(vectors)?;
        }
        Ok(())
    }

    /// With an iterative method, returns [`SolveError::Indefinite`] if a diagonal entry is not positive; no more is
    /// known.
    fn factor_definite(&mut self, a: &Matrix) -> Result<FactorReport, SolverError> {
        self.copy_matrix(a)?;
        if let Method::Iterative(method) = self.symbolic.params.method {
            let (unknown, entry) = self.smallest_diagonal()?;
            if entry <= 0.0 {
                return Err(SolveError::Indefinite { unknown: Some(unknown) });
            }
            return self.prepare_iterations(method.preconditioner);
        }
        if self.symbolic.params.symmetry == Symmetry::Definite && self.symbolic.unknowns > 0 {
            let report = self.factor_by_cholesky()?;
            if let Some(report) = report.filter(|report| report.negative_pivots.is_some()) {
                return Ok(report);
            }
            // The factorization does not count its negative pivots; only the diagonal is known.
            let (unknown, entry) = self.smallest_diagonal()?;
            return match report {
                Some(report) if entry > 0.0 => Ok(report),
                _ => {
                    self.active = None;
                    Err(SolveError::Indefinite { unknown: Some(unknown) })
                }
            };
        }
        let report = self.factor_taken()?;
        definite(Petsc::NAME, report).inspect_err(|_| self.active = None)
    }

    fn solve_many(&mut self, b: &[Vector], x: &mut [Vector]) -> Result<SolveReport, SolverError> {
        let n = self.symbolic.pattern.rows();
        check_columns(n, b.iter().map(VectorOps::len), x.iter().map(VectorOps::len))?;
        let active = self.active.ok_or(SolveError::NotFactored)?;
        let mut sum = SolveReport::DIRECT;
        if self.symbolic.unknowns == 0 {
            return Ok(sum);
        }
        let Self { a, iterative, .. } = self;
        if let (Some(iterative), Factorization::Approximate) = (iterative, active) {
            let mut outcome = Ok(());
            for (b, x) in b.iter().zip(&mut *x) {
                outcome = iterative.solve(a, b, x).map(|report| sum = sum.merge(report));
                if outcome.is_err() {
                    break;
                }
            }
            let (Err(SolveError::NotConverged { iterations, .. }), true) = (&outcome, self.symbolic.params.fallback)
            else {
                return outcome.map(|()| sum);
            };
            sum = SolveReport { iterations: sum.iterations + iterations, residual: 0.0, fallbacks: 1 };
            self.factor_taken()?;
        }
        let Self { a, factors, active: Some(active), .. } = self else { return Err(SolveError::NotFactored) };
        let active = *active;
        let factor = factors.iter().flatten().find(|factor| factor.kind == active);
        let factor = factor.ok_or(SolveError::NotFactored)?;
        if b.len() > 1 && !factor.iterates {
            factor.solve_many(a, b, x)?;
            return Ok(sum);
        }
        for (b, x) in b.iter().zip(x) {
            sum = sum.merge(solve_one(factor, a, b, x)?);
        }
        Ok(sum)
    }
}
