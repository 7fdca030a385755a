//! The factorization `L U` of unsymmetric matrices, with partial pivoting.
//!
//! faer has two variants. The simplicial (column-by-column) variant gives access to its pivots; the supernodal variant
//! is many times faster on large systems but does not. After a supernodal factorization, an estimate of the reciprocal
//! condition number replaces the ratio of the pivots. If that estimate is too small, the matrix is factored again
//! column by column, so that the error for a singular matrix always refers to a pivot.

use faer::dyn_stack::{MemStack, StackReq};
use faer::perm::PermRef;
use faer::sparse::linalg::lu::{LuRef, LuSymbolicParams, NumericLu, SymbolicLu, factorize_symbolic_lu, simplicial};
use faer::sparse::linalg::{LuError, SupernodalThreshold};
use faer::sparse::{FaerError, SparseColMatRef, SymbolicSparseColMat};
use faer::traits::RealField;
use faer::{Conj, MatMut, Par, Spec};

use super::analysis::{PARALLEL_LU_FROM, by_columns, parallelism};
use crate::backends::direct::Pivots;
use crate::las::{Scalar, Sparsity};

/// The number of unknowns from which the supernodal variant is faster.
const SUPERNODES_FROM: usize = 400;

/// The sparsity pattern by columns, and the order in which the columns are eliminated.
pub(super) struct LuAnalysis {
    columns: SymbolicSparseColMat<u32>,
    /// For each entry by columns, the index of its value in the matrix, which is stored by rows.
    source: Vec<u32>,
    /// The simplicial analysis (column by column).
    columnwise: SymbolicLu<u32>,
    /// The supernodal analysis, if the system is large enough.
    supernodal: Option<SymbolicLu<u32>>,
}

impl LuAnalysis {
    pub(super) fn new(pattern: &Sparsity) -> Result<Self, FaerError> {
        let n = pattern.rows();
        let mut entries = Vec::with_capacity(pattern.nnz());
        for row in 0..n {
            let start = pattern.row_offsets()[row];
            entries.extend((start..).zip(pattern.row(row)).map(|(k, &column)| (column, row as u32, k)));
        }
        let (columns, source) = by_columns(n, entries);
        let analyze = |threshold| {
            let params = LuSymbolicParams { supernodal_flop_ratio_threshold: threshold, ..LuSymbolicParams::default() };
            factorize_symbolic_lu(columns.as_ref(), params)
        };
        let columnwise = analyze(SupernodalThreshold::FORCE_SIMPLICIAL)?;
        let supernodal = if n < SUPERNODES_FROM { None } else { Some(analyze(SupernodalThreshold::FORCE_SUPERNODAL)?) };
        Ok(Self { columns, source, columnwise, supernodal })
    }

    /// Returns the unknown that is eliminated at a position.
    pub(super) fn unknown(&self, position: usize) -> usize {
        self.columnwise.col_perm().arrays().0[position] as usize
    }

    /// Returns the working memory for the factorization and for solves with `columns` right-hand sides.
    pub(super) fn scratch<T: RealField>(&self, columns: usize) -> StackReq {
        let n = self.columns.nrows();
        let request = simplicial::factorize_simplicial_numeric_lu_scratch::<u32, T>(n, n)
            .or(simplicial::solve_in_place_scratch::<u32, T>(n, columns, Par::Seq));
        match &self.supernodal {
            None => request,
            Some(symbolic) => StackReq::any_of(&[
                request,
                symbolic.factorize_numeric_lu_scratch::<T>(Par::Seq, Spec::default()),
                symbolic.solve_in_place_scratch::<T>(columns, Par::Seq),
                symbolic.solve_transpose_in_place_scratch::<T>(1, Par::Seq),
            ]),
        }
    }
}

/// The values of `L` and `U` and the row permutation.
pub(super) struct Lu<T> {
    values: Vec<T>,
    columnwise: simplicial::SimplicialLu<u32, T>,
    forward: Vec<u32>,
    inverse: Vec<u32>,
    supernodal: NumericLu<u32, T>,
    /// True if `supernodal` holds the current factors, false if `columnwise` does.
    by_supernodes: bool,
}

impl<T: Scalar + RealField> Lu<T> {
    pub(super) fn new(analysis: &LuAnalysis) -> Self {
        let n = analysis.columns.nrows();
        Self {
            values: vec![T::zero(); analysis.source.len()],
            columnwise: simplicial::SimplicialLu::new(),
            forward: vec![0; n],
            inverse: vec![0; n],
            supernodal: NumericLu::new(),
            by_supernodes: false,
        }
    }

    /// Factors a matrix given by its values row by row. If the ratio of the pivots is below `limit`, the position of
    /// the smallest pivot refers to the order of [`LuAnalysis::unknown`].
    pub(super) fn factor(
        &mut self,
        analysis: &LuAnalysis,
        values: &[T],
        limit: f64,
        stack: &mut MemStack,
    ) -> Result<Pivots, LuError> {
        for (value, &source) in self.values.iter_mut().zip(&analysis.source) {
            *value = values[source as usize];
        }
        if let Some(symbolic) = &analysis.supernodal {
            let ratio = self.factor_supernodes(analysis, symbolic, stack)?;
            if ratio >= limit {
                self.by_supernodes = true;
                return Ok(Pivots::from_ratio(ratio));
            }
        }
        self.by_supernodes = false;
        self.factor_columns(analysis, stack)
    }

    fn factor_columns(&mut self, analysis: &LuAnalysis, stack: &mut MemStack) -> Result<Pivots, LuError> {
        let factored = simplicial::factorize_simplicial_numeric_lu(
            &mut self.forward,
            &mut self.inverse,
            &mut self.columnwise,
            SparseColMatRef::new(analysis.columns.as_ref(), &self.values),
            analysis.columnwise.col_perm(),
            stack,
        );
        match factored {
            Ok(()) => {}
            Err(LuError::SymbolicSingular { index }) => {
                // A structurally singular column counts as a zero pivot.
                let mut pivots = Pivots::empty();
                pivots.record(0.0, index);
                return Ok(pivots);
            }
            Err(error) => return Err(error),
        }
        // The diagonal of `U` is the last entry of each of its columns.
        let upper = self.columnwise.u_factor_unsorted();
        Ok(Pivots::of(upper.col_ptr()[1..].iter().map(|&end| {
            let pivot = end.checked_sub(1).and_then(|last| upper.val().get(last as usize));
            pivot.map_or(0.0, |pivot| pivot.as_f64())
        })))
    }

    /// Returns an estimate of the reciprocal condition number; 0 if the matrix is structurally singular.
    fn factor_supernodes(
        &mut self,
        analysis: &LuAnalysis,
        symbolic: &SymbolicLu<u32>,
        stack: &mut MemStack,
    ) -> Result<f64, LuError> {
        let matrix = SparseColMatRef::new(analysis.columns.as_ref(), &self.values);
        let par = parallelism(analysis.columns.nrows() >= PARALLEL_LU_FROM);
        match symbolic.factorize_numeric_lu(&mut self.supernodal, matrix, par, stack, Spec::default()) {
            Ok(_) => {}
            Err(LuError::SymbolicSingular { .. }) => return Ok(0.0),
            Err(error) => return Err(error),
        }
        let ends = analysis.columns.col_ptr().windows(2);
        let sums =
            ends.map(|ends| self.values[ends[0] as usize..ends[1] as usize].iter().map(|v| v.as_f64().abs()).sum());
        let norm = sums.fold(0.0, f64::max);
        let inverse_norm = inverse_norm(LuRef::new_unchecked(symbolic, &self.supernodal), stack);
        let reciprocal = 1.0 / (norm * inverse_norm);
        Ok(if reciprocal.is_finite() { reciprocal.min(1.0) } else { 0.0 })
    }

    /// Solves in place for all columns.
    pub(super) fn solve(&self, analysis: &LuAnalysis, columns: MatMut<'_, T>, stack: &mut MemStack) {
        match &analysis.supernodal {
            Some(symbolic) if self.by_supernodes => LuRef::new_unchecked(symbolic, &self.supernodal)
                .solve_in_place_with_conj(Conj::No, columns, Par::Seq, stack),
            _ => {
                let rows = PermRef::new_checked(&self.forward, &self.inverse, self.forward.len());
                let order = analysis.columnwise.col_perm();
                self.columnwise.solve_in_place_with_conj(rows, order, Conj::No, columns, Par::Seq, stack);
            }
        }
    }
}

/// Estimates the 1-norm of the inverse from below, usually within a factor of three; NaN if the inverse does not exist.
///
/// Reference: N. J. Higham, *FORTRAN codes for estimating the one-norm of a real or complex matrix*, ACM Transactions
/// on Mathematical Software 14 (1988), 381-396, after W. W. Hager.
fn inverse_norm<T: Scalar + RealField>(factors: LuRef<'_, u32, T>, stack: &mut MemStack) -> f64 {
    let n = factors.symbolic().nrows();
    let mut x = vec![T::one() / T::of(n as f64); n];
    let mut largest = 0.0;
    for _ in 0..4 {
        let start = x.clone();
        let column = MatMut::from_column_major_slice_mut(&mut x, n, 1);
        factors.solve_in_place_with_conj(Conj::No, column, Par::Seq, stack);
        let norm: f64 = x.iter().map(|v| v.as_f64().abs()).sum();
        if !norm.is_finite() {
            return f64::NAN;
        }
        if norm <= largest {
            break;
        }
        largest = norm;
        x.iter_mut().for_each(|v| *v = if *v < T::zero() { -T::one() } else { T::one() });
        let column = MatMut::from_column_major_slice_mut(&mut x, n, 1);
        factors.solve_transpose_in_place_with_conj(Conj::No, column, Par::Seq, stack);
        let along: f64 = x.iter().zip(&start).map(|(z, x)| z.as_f64() * x.as_f64()).sum();
        let (at, steepest) = x
            .iter()
            .map(|z| z.as_f64().abs())
            .enumerate()
            .fold((0, 0.0), |best, (i, z)| if z > best.1 { (i, z) } else { best });
        if steepest <= along {
            break;
        }
        x.fill(T::zero());
        x[at] = T::one();
    }
    largest
}
