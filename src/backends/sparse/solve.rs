//! The solver: it selects the factorization and owns its storage.

use std::sync::Arc;

use faer::MatMut;
use faer::dyn_stack::StackReq;

use super::analysis::{CholeskyAnalysis, failed};
use super::block::{BlockCholesky, BlockScalar};
use super::cholesky::{Cholesky, Ldlt, solve_scratch};
use super::lu::Lu;
use super::preconditioner::preconditioner;
use super::{Failure, Matrix, Sparse, Symbolic, Vector};
use crate::backends::checks::{
    check_columns, check_finite, check_pattern, definite, immediate_singular_limit, singular_limit,
};
use crate::backends::direct::{NotPositiveDefinite, Pivots, Scratch, impl_direct_solver};
use crate::backends::iterative::IterativeSolver;
use crate::backends::null_vector::{check_near_singular, checked_report};
use crate::backends::sparse::long;
use crate::las::{Backend, FactorReport, Factorization, Method, SolveError, SolveReport, Symmetry};

/// The solver for matrices with one sparsity pattern.
///
/// With [`Method::Iterative`], the solver runs a Krylov method preconditioned by an incomplete factorization or by the
/// diagonal. Otherwise, it factors a matrix declared [`Symmetry::Definite`] by Cholesky: by 3x3 blocks (some of which
/// may be smaller) if the pattern consists of them and the factorization is not too large, else by faer. Of each
/// pair of entries `(i, j)` and `(j, i)`, it reads only one. If a pivot is not positive, LDL^T replaces Cholesky; its
/// analysis and storage are made at that point and kept. LDL^T exchanges unknowns only within a supernode. If one of
/// its pivots is (nearly) zero although the matrix may be regular, LU with partial pivoting either factors the matrix
/// or finds it singular. LU allocates in every factorization, the others only in their first.
pub struct Solver<T: SparseScalar = f64> {
    symbolic: Arc<Symbolic>,
    limit: f64,
    /// The factorization used by solves; `None` if there is no valid one.
    active: Option<Factorization>,
    blocks: Option<BlockCholesky<T>>,
    /// Values of the permuted lower triangle, for the factorizations of faer.
    lower: Vec<T>,
    cholesky: Option<Cholesky<T>>,
    ldlt: Option<Ldlt<T>>,
    lu: Option<Lu<T>>,
    scratch: Scratch,
    /// Right-hand sides in elimination order.
    columns: Vec<T>,
    /// The iterative solver, if one was requested; the fields above are then unused unless a direct method replaces it.
    iterative: Option<Box<IterativeSolver<Sparse<T>>>>,
}

impl<T: SparseScalar> Solver<T> {
    fn new(symbolic: &Arc<Symbolic>) -> Result<Self, Failure> {
        let mut solver = Self {
            limit: singular_limit::<T>(&symbolic.params),
            active: None,
            blocks: symbolic.blocks.as_ref().map(BlockCholesky::new),
            lower: Vec::new(),
            cholesky: None,
            ldlt: None,
            lu: None,
            scratch: Scratch::new(StackReq::EMPTY),
            columns: Vec::new(),
            iterative: None,
            symbolic: Arc::clone(symbolic),
        };
        if let Method::Iterative(method) = symbolic.params.method {
            let inverse = preconditioner::<T>(symbolic, method.preconditioner)?;
            let iterative = IterativeSolver::<Sparse<T>>::new(&(), symbolic.unknowns(), method, inverse)?;
            solver.iterative = Some(Box::new(iterative));
        } else {
            solver.make_direct()?;
        }
        Ok(solver)
    }

    /// Allocates the storage of the factorization by faer that the declared symmetry asks for first.
    fn make_direct(&mut self) -> Result<(), Failure> {
        let symbolic = Arc::clone(&self.symbolic);
        if symbolic.params.symmetry == Symmetry::None || self.blocks.is_some() {
            return Ok(());
        }
        let analysis = symbolic.cholesky()?;
        if symbolic.params.symmetry == Symmetry::Definite {
            self.scratch.reserve(Cholesky::<T>::scratch(analysis));
            self.cholesky = Some(Cholesky::new(analysis));
        } else {
            self.make_ldlt(analysis);
        }
        self.lower = vec![T::zero(); analysis.source.len()];
        self.reserve_columns(1);
        Ok(())
    }

    /// Allocates the storage of LDL^T on first use.
    fn make_ldlt(&mut self, analysis: &CholeskyAnalysis) {
        if self.ldlt.is_none() {
            self.scratch.reserve(Ldlt::<T>::scratch(analysis));
            self.ldlt = Some(Ldlt::new(analysis));
        }
    }

    /// Returns the symbolic analysis of this solver.
    pub fn symbolic(&self) -> &Arc<Symbolic> {
        &self.symbolic
    }

    /// Returns the number of values in the incomplete factorization, if there is one.
    pub fn incomplete_entries(&self) -> Option<usize> {
        self.iterative.as_ref().and_then(|iterative| iterative.entries())
    }

    fn check(&self, a: &Matrix<T>) -> Result<(), Failure> {
        let expected = &self.symbolic.pattern;
        check_pattern(a.pattern(), expected)?;
        check_finite(expected, a.values(), long::all_finite)
    }

    /// Checks the next matrix.
    fn check_next(&mut self, a: &Matrix<T>) -> Result<(), Failure> {
        let checked = self.check(a);
        IterativeSolver::unless_invalid(&mut self.iterative, checked)
    }

    fn factor_checked(&mut self, a: &Matrix<T>) -> Result<FactorReport, Failure> {
        let symbolic = Arc::clone(&self.symbolic);
        if symbolic.params.symmetry == Symmetry::None {
            return self.factor_lu(a, None);
        }
        match self.factor_by_cholesky(a) {
            Err(SolveError::Indefinite { unknown }) => self.factor_ldlt(a, unknown),
            Ok(None) => self.factor_ldlt(a, None),
            Ok(Some(report)) => Ok(report),
            Err(error) => Err(error),
        }
    }

    /// Factors by Cholesky. Returns `None` if the matrix was not declared positive definite, so that there is no
    /// Cholesky.
    fn factor_by_cholesky(&mut self, a: &Matrix<T>) -> Result<Option<FactorReport>, Failure> {
        let symbolic = Arc::clone(&self.symbolic);
        if let (Some(blocks), Some(analysis)) = (&mut self.blocks, &symbolic.blocks) {
            match blocks.factor(analysis, &a.values) {
                Ok(pivots) => {
                    let unknown = |p| analysis.unknown(p);
                    return self.report(a, Factorization::Cholesky, None, &pivots, unknown).map(Some);
                }
                Err(NotPositiveDefinite { position }) => {
                    return Err(SolveError::Indefinite { unknown: Some(analysis.unknown(position)) });
                }
            }
        }
        if self.cholesky.is_none() {
            return Ok(None);
        }
        let analysis = symbolic.cholesky()?;
        self.gather_lower(a, analysis);
        let Some(cholesky) = &mut self.cholesky else { return Ok(None) };
        match cholesky.factor(analysis, &self.lower, self.scratch.memory()) {
            Ok(pivots) => {
                let unknown = |p: usize| analysis.order[p] as usize;
                self.report(a, Factorization::Cholesky, None, &pivots, unknown).map(Some)
            }
            Err(NotPositiveDefinite { position }) => {
                Err(SolveError::Indefinite { unknown: Some(analysis.order[position] as usize) })
            }
        }
    }

    /// Copies the values of the permuted lower triangle of `a` to `lower`.
    fn gather_lower(&mut self, a: &Matrix<T>, analysis: &CholeskyAnalysis) {
        self.lower.resize(analysis.source.len(), T::zero());
        for (value, &source) in self.lower.iter_mut().zip(&analysis.source) {
            *value = a.values[source as usize];
        }
    }

    fn factor_ldlt(&mut self, a: &Matrix<T>, indefinite_at: Option<usize>) -> Result<FactorReport, Failure> {
        let symbolic = Arc::clone(&self.symbolic);
        let analysis = symbolic.cholesky()?;
        self.gather_lower(a, analysis);
        self.make_ldlt(analysis);
        let Some(ldlt) = &mut self.ldlt else { return Err(SolveError::NotFactored) };
        let pivots = ldlt.factor(analysis, &self.lower, self.scratch.memory());
        if pivots.ratio() > 0.0 {
            // A null vector of the matrix itself proves it singular; small pivots and lost digits do not, so LU
            // decides.
            self.active = Some(Factorization::Ldlt);
            let report = pivots.report(Factorization::Ldlt, indefinite_at);
            let lost = check_near_singular::<Sparse<T>>(a, &report, &symbolic.params, |b, x| {
                crate::las::Solver::<Sparse<T>>::solve(self, b, x).map(drop)
            })
            .inspect_err(|_| self.active = None)?;
            if pivots.ratio() >= self.limit && lost.is_none() {
                return Ok(report);
            }
            self.active = None;
        }
        self.factor_lu(a, indefinite_at)
    }

    fn factor_lu(&mut self, a: &Matrix<T>, indefinite_at: Option<usize>) -> Result<FactorReport, Failure> {
        let symbolic = Arc::clone(&self.symbolic);
        let analysis = symbolic.lu()?;
        if self.lu.is_none() {
            self.scratch.reserve(analysis.scratch::<T>(1));
        }
        let lu = self.lu.get_or_insert_with(|| Lu::new(analysis));
        let pivots = lu.factor(analysis, a.values(), self.limit, self.scratch.memory()).map_err(failed)?;
        self.report(a, Factorization::Lu, indefinite_at, &pivots, |position| analysis.unknown(position))
    }

    fn report(
        &mut self,
        a: &Matrix<T>,
        kind: Factorization,
        indefinite_at: Option<usize>,
        pivots: &Pivots,
        unknown: impl FnOnce(usize) -> usize,
    ) -> Result<FactorReport, Failure> {
        let params = self.symbolic.params;
        pivots.check_singular(immediate_singular_limit(&params), unknown)?;
        self.active = Some(kind);
        checked_report::<Sparse<T>>(a, pivots.report(kind, indefinite_at), &params, |b, x| {
            crate::las::Solver::<Sparse<T>>::solve(self, b, x).map(drop)
        })
        .inspect_err(|_| self.active = None)
    }

    /// Allocates room for `count` right-hand sides, for the factorizations of faer.
    fn reserve_columns(&mut self, count: usize) {
        let len = self.symbolic.unknowns() * count;
        if self.columns.len() >= len {
            return;
        }
        self.columns.resize(len, T::zero());
        if let Some(analysis) = self.symbolic.cholesky.get() {
            self.scratch.reserve(solve_scratch::<T>(analysis, count));
        }
    }

    /// Solves for all columns with a factorization of faer, in its elimination order.
    fn solve_by_library(
        &mut self,
        active: Factorization,
        b: &[Vector<T>],
        x: &mut [Vector<T>],
    ) -> Result<SolveReport, Failure> {
        let n = self.symbolic.unknowns();
        let columns = &mut self.columns[..n * b.len()];
        match (active, &self.cholesky, &self.ldlt, &self.lu) {
            (Factorization::Cholesky, Some(cholesky), ..) => {
                let analysis = self.symbolic.cholesky()?;
                gather(columns, b, &analysis.order);
                let right = MatMut::from_column_major_slice_mut(columns, n, b.len());
                cholesky.solve(analysis, right, self.scratch.memory());
                spread(columns, x, &analysis.order);
            }
            (Factorization::Ldlt, _, Some(ldlt), _) => {
                gather(columns, b, &ldlt.order);
                let right = MatMut::from_column_major_slice_mut(columns, n, b.len());
                ldlt.solve(self.symbolic.cholesky()?, right, self.scratch.memory());
                spread(columns, x, &ldlt.order);
            }
            (Factorization::Lu, .., Some(lu)) => {
                let analysis = self.symbolic.lu()?;
                for (column, b) in columns.chunks_exact_mut(n).zip(b) {
                    column.copy_from_slice(&b.values);
                }
                self.scratch.reserve(analysis.scratch::<T>(b.len()));
                let right = MatMut::from_column_major_slice_mut(columns, n, b.len());
                lu.solve(analysis, right, self.scratch.memory());
                for (column, x) in columns.chunks_exact(n).zip(x) {
                    x.values.copy_from_slice(column);
                }
            }
            _ => return Err(SolveError::NotFactored),
        }
        Ok(SolveReport::DIRECT)
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

    /// See [`crate::las::Solver::update`].
    fn update_any(&mut self, a: &Matrix<T>) -> Result<FactorReport, Failure> {
        if self.iterative.is_none() {
            return self.factor_any(a);
        }
        // A direct method replaces the iterative one until the next `factor`.
        let is_direct = self.active.take().is_some();
        self.check_next(a)?;
        if is_direct {
            return self.fall_back(a);
        }
        let Some(iterative) = &mut self.iterative else { return Err(SolveError::NotFactored) };
        match iterative.update(a) {
            Err(_) if self.symbolic.params.fallback => self.fall_back(a),
            outcome => outcome,
        }
    }

    /// Factors a matrix whose solution by iterations failed.
    fn fall_back(&mut self, a: &Matrix<T>) -> Result<FactorReport, Failure> {
        if self.cholesky.is_none() && self.ldlt.is_none() {
            self.make_direct()?;
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
        if self.symbolic.params.symmetry == Symmetry::Definite
            && let Some(report) = self.factor_by_cholesky(a)?
        {
            return Ok(report);
        }
        let report = self.factor_checked(a)?;
        definite(Sparse::<T>::NAME, report).inspect_err(|_| self.active = None)
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
        let n = self.symbolic.unknowns();
        check_columns(n, b.iter().map(|b| b.values.len()), x.iter().map(|x| x.values.len()))?;
        let active = self.active.ok_or(SolveError::NotFactored)?;
        if n == 0 || b.is_empty() {
            return Ok(SolveReport::DIRECT);
        }
        if let (Factorization::Cholesky, Some(analysis), Some(blocks)) =
            (active, &self.symbolic.blocks, &mut self.blocks)
        {
            blocks.reserve(analysis, b.len());
            blocks.solve(analysis, b, x);
            return Ok(SolveReport::DIRECT);
        }
        self.reserve_columns(b.len());
        self.solve_by_library(active, b, x)
    }
}

/// Gathers `columns[k][position] = b[k][order[position]]`.
fn gather<T: Copy>(columns: &mut [T], b: &[Vector<T>], order: &[u32]) {
    for (column, b) in columns.chunks_exact_mut(order.len()).zip(b) {
        for (value, &unknown) in column.iter_mut().zip(order) {
            *value = b.values[unknown as usize];
        }
    }
}

/// Scatters `x[k][order[position]] = columns[k][position]`.
fn spread<T: Copy>(columns: &[T], x: &mut [Vector<T>], order: &[u32]) {
    for (column, x) in columns.chunks_exact(order.len()).zip(x) {
        for (&value, &unknown) in column.iter().zip(order) {
            x.values[unknown as usize] = value;
        }
    }
}

impl_direct_solver!(SparseScalar: BlockScalar, Sparse);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::las::{Backend, MatrixOps, Solver as _, SolverParams, Sparsity};

    fn pattern(rows: &[&[u32]]) -> Arc<Sparsity> {
        let row_offsets = (0..=rows.len()).map(|end| rows[..end].iter().map(|row| row.len() as u32).sum()).collect();
        Arc::new(Sparsity::from_rows(rows.len(), row_offsets, rows.concat()).unwrap())
    }

    #[test]
    fn a_matrix_of_another_pattern_is_refused() {
        let (analyzed, other) = (pattern(&[&[0, 1], &[0, 1], &[2]]), pattern(&[&[0, 2], &[1], &[0, 2]]));
        let symbolic = Sparse::<f64>::analyze(&(), &analyzed, &SolverParams::default()).unwrap();
        let mut solver = Sparse::<f64>::solver(&symbolic).unwrap();
        assert_eq!(solver.factor(&Matrix::zeros(&other)), Err(SolveError::Pattern));
        let mut equal = Matrix::zeros(&pattern(&[&[0, 1], &[0, 1], &[2]]));
        for i in 0..3 {
            MatrixOps::<Sparse>::set(&mut equal, &[i], &[i], &[1.0]).unwrap();
        }
        assert!(solver.factor(&equal).is_ok(), "an equal pattern at another address is accepted");
    }

    /// A matrix `[[0, G], [G^T, 0]]`: exchanges within a supernode cannot avoid all zeros on the diagonal.
    #[test]
    fn lu_replaces_ldlt_if_its_pivots_vanish() {
        let n = 40;
        let entries =
            (0..n).flat_map(|i| [(0, 4.0), (7, 1.0), (11, 1.0), (13, 1.0)].map(|(k, g)| (i, n + (i + k) % n, g)));
        let entries: Vec<(i32, i32, f64)> = entries.collect();
        let pattern = Sparsity::from_elements(2 * n as usize, entries.iter().map(|&(i, j, _)| [i, j])).unwrap();
        let pattern = Arc::new(pattern);
        let mut a = Matrix::<f64>::zeros(&pattern);
        for (i, j, g) in entries {
            MatrixOps::<Sparse>::add(&mut a, &[i, j], &[i, j], &[0.0, g, g, 0.0]).unwrap();
        }
        for symmetry in [Symmetry::Definite, Symmetry::Symmetric] {
            let symbolic = Sparse::<f64>::analyze(&(), &pattern, &SolverParams::new(symmetry)).unwrap();
            let mut solver = Sparse::<f64>::solver(&symbolic).unwrap();
            let report = solver.factor(&a).unwrap();
            assert_eq!(report.kind, Factorization::Lu);
            assert_eq!(report.indefinite_at.is_some(), symmetry == Symmetry::Definite);
            let (b, mut x) = (vec![7.0; 2 * n as usize].into(), vec![0.0; 2 * n as usize].into());
            solver.solve(&b, &mut x).unwrap();
            assert!(x.as_slice().iter().all(|x| (x - 1.0).abs() < 1e-14), "{:?}", x.as_slice());
        }
    }
}
