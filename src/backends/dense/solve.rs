//! The solver: three factorizations that share the storage of one square matrix.

use std::sync::Arc;

use faer::diag::{DiagMut, DiagRef};
use faer::dyn_stack::StackReq;
use faer::linalg::cholesky::llt::factor::LltRegularization;
use faer::linalg::cholesky::{lblt, llt};
use faer::linalg::lu::partial_pivoting as lu;
use faer::perm::PermRef;
use faer::traits::RealField;
use faer::{Conj, MatMut, MatRef, Par, Spec};

use super::{Dense, Failure, Matrix, Vector};
use crate::backends::checks::{check_columns, check_size, definite, immediate_singular_limit};
use crate::backends::direct::{NotPositiveDefinite, Pivots, Scratch, impl_direct_solver, ldlt_params};
use crate::backends::iterative::{IterativeSolver, SimplePreconditioner};
use crate::backends::local;
use crate::backends::null_vector::checked_report;
use crate::las::{
    Backend, FactorReport, Factorization, Method, Preconditioner, Scalar, SolveError, SolveReport, SolverParams,
    Symmetry,
};

/// The size of a dense system and the solver parameters.
#[derive(Clone, Copy, Debug)]
pub struct Symbolic {
    pub(super) unknowns: usize,
    pub(super) params: SolverParams,
}

/// The solver for matrices of one size: direct, or a Krylov method without preconditioner or with the diagonal.
///
/// A matrix declared [`Symmetry::Definite`] is factored by Cholesky, which reads the upper triangle of the matrix, or
/// by LDL^T with Bunch-Kaufman pivoting if a pivot is not positive. A symmetric matrix is factored by LDL^T, any other
/// by LU. After one factorization and one solve, nothing allocates.
pub struct Solver<T: DenseScalar = f64> {
    symbolic: Arc<Symbolic>,
    /// The factorization used by solves; `None` if there is no valid one.
    active: Option<Factorization>,
    /// The factors, by columns.
    factor: Vec<T>,
    /// The subdiagonal of the blocks of `D`.
    subdiagonal: Vec<T>,
    /// The permutation of the unknowns (LDL^T) or of the rows (LU) by pivoting.
    forward: Vec<u32>,
    inverse: Vec<u32>,
    /// The right-hand sides, by columns.
    columns: Vec<T>,
    scratch: Scratch,
    /// The iterative solver, if one was requested; the fields above are then unused unless a direct method replaces it.
    iterative: Option<Box<IterativeSolver<Dense<T>>>>,
}

impl<T: DenseScalar> Solver<T> {
    fn new(symbolic: &Arc<Symbolic>) -> Result<Self, Failure> {
        let Method::Iterative(method) = symbolic.params.method else {
            return Ok(Self::direct(symbolic, symbolic.unknowns));
        };
        let unknowns = symbolic.unknowns;
        let inverse: SimplePreconditioner<Dense<T>> = match method.preconditioner {
            Preconditioner::None => SimplePreconditioner::None,
            Preconditioner::Diagonal => SimplePreconditioner::diagonal(Vector::from(vec![T::zero(); unknowns])),
            Preconditioner::Ilut { .. } | Preconditioner::Multigrid => {
                return Err(SolveError::Unsupported {
                    backend: Dense::<T>::NAME,
                    what: "incomplete factorization or multigrid",
                    cure: "use the diagonal, a direct method, or the backend `sparse`",
                });
            }
        };
        let iterative = IterativeSolver::<Dense<T>>::new(&(), unknowns, method, Box::new(inverse))?;
        Ok(Self { iterative: Some(Box::new(iterative)), ..Self::direct(symbolic, 0) })
    }

    /// Creates a direct solver with room for the factors of `n` unknowns.
    fn direct(symbolic: &Arc<Symbolic>, n: usize) -> Self {
        let request = StackReq::any_of(&[
            llt::factor::cholesky_in_place_scratch::<T>(n, Par::Seq, Spec::default()),
            lblt::factor::cholesky_in_place_scratch::<u32, T>(n, Par::Seq, ldlt_params::<T>()),
            lu::factor::lu_in_place_scratch::<u32, T>(n, n, Par::Seq, Spec::default()),
            solve_scratch::<T>(n, 1),
        ]);
        Self {
            active: None,
            factor: vec![T::zero(); n * n],
            subdiagonal: vec![T::zero(); n],
            forward: vec![0; n],
            inverse: vec![0; n],
            columns: vec![T::zero(); n],
            scratch: Scratch::new(request),
            iterative: None,
            symbolic: Arc::clone(symbolic),
        }
    }

    fn check(&self, a: &Matrix<T>) -> Result<(), Failure> {
        check_size("the matrix to factor (rows)", a.rows, self.symbolic.unknowns)?;
        check_size("the matrix to factor (columns)", a.cols, self.symbolic.unknowns)?;
        if local::all_finite(a.values()) {
            return Ok(());
        }
        let bad = a.values().iter().position(|value| !value.is_finite()).unwrap_or(0);
        Err(SolveError::NotFinite { row: bad / a.cols })
    }

    /// Checks the next matrix.
    fn check_next(&mut self, a: &Matrix<T>) -> Result<(), Failure> {
        let checked = self.check(a);
        IterativeSolver::unless_invalid(&mut self.iterative, checked)
    }

    /// Factors by Cholesky.
    fn factor_cholesky(&mut self, a: &Matrix<T>) -> Result<Pivots, NotPositiveDefinite> {
        let n = self.symbolic.unknowns;
        // The rows of the matrix become the columns of the factor; the matrix is symmetric.
        self.factor.copy_from_slice(a.values());
        llt::factor::cholesky_in_place(
            MatMut::from_column_major_slice_mut(&mut self.factor, n, n),
            LltRegularization::default(),
            Par::Seq,
            self.scratch.memory(),
            Spec::default(),
        )?;
        Ok(Pivots::of(self.factor.iter().step_by(n + 1).map(|root| root.as_f64() * root.as_f64())))
    }

    fn factor_ldlt(&mut self, a: &Matrix<T>) -> Pivots {
        let n = self.symbolic.unknowns;
        self.factor.copy_from_slice(a.values());
        // faer writes a subdiagonal entry only if there is something to eliminate.
        self.subdiagonal.fill(T::zero());
        lblt::factor::cholesky_in_place(
            MatMut::from_column_major_slice_mut(&mut self.factor, n, n),
            DiagMut::from_slice_mut(&mut self.subdiagonal),
            &mut self.forward,
            &mut self.inverse,
            Par::Seq,
            self.scratch.memory(),
            ldlt_params::<T>(),
        );
        Pivots::from_blocks(n, |position| self.factor[position * (n + 1)], &self.subdiagonal)
    }

    fn factor_lu(&mut self, a: &Matrix<T>) -> Pivots {
        let n = self.symbolic.unknowns;
        let mut factor = MatMut::from_column_major_slice_mut(&mut self.factor, n, n);
        factor.copy_from(MatRef::from_row_major_slice(a.values(), n, n));
        lu::factor::lu_in_place(
            factor,
            &mut self.forward,
            &mut self.inverse,
            Par::Seq,
            self.scratch.memory(),
            Spec::default(),
        );
        Pivots::of(self.factor.iter().step_by(n + 1).map(|pivot| pivot.as_f64()))
    }

    fn factor_checked(&mut self, a: &Matrix<T>) -> Result<FactorReport, Failure> {
        let mut indefinite_at = None;
        if self.symbolic.params.symmetry == Symmetry::Definite {
            match self.factor_cholesky(a) {
                Ok(pivots) => return self.report(a, Factorization::Cholesky, None, &pivots),
                Err(NotPositiveDefinite { position }) => indefinite_at = Some(position),
            }
        }
        if self.symbolic.params.symmetry == Symmetry::None {
            let pivots = self.factor_lu(a);
            return self.report(a, Factorization::Lu, None, &pivots);
        }
        let pivots = self.factor_ldlt(a);
        self.report(a, Factorization::Ldlt, indefinite_at, &pivots)
    }

    fn report(
        &mut self,
        a: &Matrix<T>,
        kind: Factorization,
        indefinite_at: Option<usize>,
        pivots: &Pivots,
    ) -> Result<FactorReport, Failure> {
        let unknown = |position: usize| match kind {
            Factorization::Ldlt => self.forward[position] as usize,
            Factorization::Cholesky | Factorization::Lu | Factorization::Approximate | Factorization::Kept => position,
        };
        let params = self.symbolic.params;
        pivots.check_singular(immediate_singular_limit(&params), unknown)?;
        self.active = Some(kind);
        checked_report::<Dense<T>>(a, pivots.report(kind, indefinite_at), &params, |b, x| {
            crate::las::Solver::<Dense<T>>::solve(self, b, x).map(drop)
        })
        .inspect_err(|_| self.active = None)
    }

    /// See [`crate::las::Solver::factor`].
    fn factor_any(&mut self, a: &Matrix<T>) -> Result<FactorReport, Failure> {
        self.active = None;
        self.check_next(a)?;
        let Some(iterative) = &mut self.iterative else { return self.factor_checked(a) };
        match iterative.factor(a) {
            Err(_) if self.symbolic.params.fallback => self.fall_back(a),
            outcome => outcome.map(|(report, _)| report),
        }
    }

    /// See [`crate::las::Solver::update`]: no preconditioner of this backend is worth keeping.
    fn update_any(&mut self, a: &Matrix<T>) -> Result<FactorReport, Failure> {
        self.factor_any(a)
    }

    /// Factors a matrix whose solution by iterations failed.
    fn fall_back(&mut self, a: &Matrix<T>) -> Result<FactorReport, Failure> {
        let n = self.symbolic.unknowns;
        if self.columns.len() < n {
            *self = Self { iterative: self.iterative.take(), ..Self::direct(&self.symbolic, n) };
        }
        self.factor_checked(a)
    }

    /// See [`crate::las::Solver::factor_definite`].
    fn factor_only_definite(&mut self, a: &Matrix<T>) -> Result<FactorReport, Failure> {
        self.active = None;
        self.check_next(a)?;
        if let Some(iterative) = &mut self.iterative {
            return iterative.factor_definite(a);
        }
        let report = self.factor_checked(a)?;
        definite(Dense::<T>::NAME, report).inspect_err(|_| self.active = None)
    }

    /// See [`crate::las::Solver::solve_many`].
    fn solve_columns(&mut self, b: &[Vector<T>], x: &mut [Vector<T>]) -> Result<SolveReport, Failure> {
        let mut report = SolveReport::DIRECT;
        if let (Some(iterative), None) = (&mut self.iterative, self.active) {
            let outcome = iterative.solve_columns(b, x);
            let (Err(SolveError::NotConverged { iterations, .. }), true) = (&outcome, self.symbolic.params.fallback)
            else {
                return outcome;
            };
            report = SolveReport { iterations: *iterations, residual: 0.0, fallbacks: 1 };
            let a = iterative.matrix().ok_or(SolveError::NotFactored)?;
            self.fall_back(&a)?;
        }
        self.solve_directly(b, x).map(|of| report.merge(of))
    }

    fn solve_directly(&mut self, b: &[Vector<T>], x: &mut [Vector<T>]) -> Result<SolveReport, Failure> {
        let (n, count) = (self.symbolic.unknowns, b.len());
        check_columns(n, b.iter().map(|b| b.values.len()), x.iter().map(|x| x.values.len()))?;
        let active = self.active.ok_or(SolveError::NotFactored)?;
        if n == 0 || count == 0 {
            return Ok(SolveReport::DIRECT);
        }
        if self.columns.len() < n * count {
            self.columns.resize(n * count, T::zero());
            self.scratch.reserve(solve_scratch::<T>(n, count));
        }
        let columns = &mut self.columns[..n * count];
        for (column, b) in columns.chunks_exact_mut(n).zip(b) {
            column.copy_from_slice(&b.values);
        }
        let right = MatMut::from_column_major_slice_mut(columns, n, count);
        let factor = MatRef::from_column_major_slice(&self.factor, n, n);
        let stack = self.scratch.memory();
        match active {
            Factorization::Cholesky => llt::solve::solve_in_place_with_conj(factor, Conj::No, right, Par::Seq, stack),
            Factorization::Ldlt => {
                let exchanged = PermRef::new_checked(&self.forward, &self.inverse, n);
                let (d, e) = (factor.diagonal(), DiagRef::from_slice(&self.subdiagonal));
                lblt::solve::solve_in_place_with_conj(factor, d, e, Conj::No, exchanged, right, Par::Seq, stack);
            }
            // Iterative methods returned above.
            Factorization::Approximate | Factorization::Kept => return Err(SolveError::NotFactored),
            Factorization::Lu => {
                let exchanged = PermRef::new_checked(&self.forward, &self.inverse, n);
                lu::solve::solve_in_place_with_conj(factor, factor, exchanged, Conj::No, right, Par::Seq, stack);
            }
        }
        for (column, x) in self.columns.chunks_exact(n).zip(x) {
            x.values.copy_from_slice(column);
        }
        Ok(SolveReport::DIRECT)
    }
}

/// Returns the working memory for solves with `columns` right-hand sides, for all three factorizations.
fn solve_scratch<T: RealField>(unknowns: usize, columns: usize) -> StackReq {
    StackReq::any_of(&[
        llt::solve::solve_in_place_scratch::<T>(unknowns, columns, Par::Seq),
        lblt::solve::solve_in_place_scratch::<u32, T>(unknowns, columns, Par::Seq),
        lu::solve::solve_in_place_scratch::<u32, T>(unknowns, columns, Par::Seq),
    ])
}

impl_direct_solver!(DenseScalar: Scalar + RealField, Dense);
