//! The unsymmetric factorisation, `L U` with partial pivoting.

use faer::dyn_stack::{MemStack, StackReq};
use faer::perm::PermRef;
use faer::sparse::linalg::lu::{LuSymbolicParams, SymbolicLu, factorize_symbolic_lu, simplicial};
use faer::sparse::linalg::{LuError, SupernodalThreshold};
use faer::sparse::{FaerError, SparseColMatRef, SymbolicSparseColMat};
use faer::traits::RealField;
use faer::{Conj, MatMut, Par};

use crate::backends::direct::Pivots;
use crate::las::{Scalar, Sparsity};

/// The matrix by columns, and the order in which they are eliminated.
pub(super) struct LuAnalysis {
    columns: SymbolicSparseColMat<u32>,
    /// Where the value of each entry by columns stands among those of the matrix, which go by rows.
    source: Vec<u32>,
    symbolic: SymbolicLu<u32>,
}

impl LuAnalysis {
    pub(super) fn new(pattern: &Sparsity) -> Result<Self, FaerError> {
        let n = pattern.rows();
        let mut entries = Vec::with_capacity(pattern.entries());
        for row in 0..n {
            let start = pattern.row_start()[row];
            entries.extend((start..).zip(pattern.row(row)).map(|(k, &column)| (column, row as u32, k)));
        }
        entries.sort_unstable();
        let mut column_start = vec![0_u32; n + 1];
        for &(column, ..) in &entries {
            column_start[column as usize + 1] += 1;
        }
        for column in 0..n {
            column_start[column + 1] += column_start[column];
        }
        let rows = entries.iter().map(|&(_, row, _)| row).collect();
        let source = entries.iter().map(|&(.., k)| k).collect();
        let columns = SymbolicSparseColMat::new_checked(n, n, column_start, None, rows);
        // Of the library's two variants only the one by single columns shows its pivots.
        let params = LuSymbolicParams {
            supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SIMPLICIAL,
            ..LuSymbolicParams::default()
        };
        let symbolic = factorize_symbolic_lu(columns.as_ref(), params)?;
        Ok(Self { columns, source, symbolic })
    }

    /// The unknown that is eliminated at a position.
    pub(super) fn unknown(&self, position: usize) -> usize {
        self.symbolic.col_perm().arrays().0[position] as usize
    }

    /// Working memory for factoring, and for solving with so many right-hand sides.
    pub(super) fn scratch<T: RealField>(&self, columns: usize) -> StackReq {
        let n = self.columns.nrows();
        simplicial::factorize_simplicial_numeric_lu_scratch::<u32, T>(n, n)
            .or(simplicial::solve_in_place_scratch::<u32, T>(n, columns, Par::Seq))
    }
}

/// Values of `L` and `U`, and how the rows were exchanged.
pub(super) struct Lu<T> {
    values: Vec<T>,
    factors: simplicial::SimplicialLu<u32, T>,
    forward: Vec<u32>,
    inverse: Vec<u32>,
}

impl<T: Scalar + RealField> Lu<T> {
    pub(super) fn new(analysis: &LuAnalysis) -> Self {
        let n = analysis.columns.nrows();
        Self {
            values: vec![T::zero(); analysis.source.len()],
            factors: simplicial::SimplicialLu::new(),
            forward: vec![0; n],
            inverse: vec![0; n],
        }
    }

    /// Factors a matrix given by the values of its rows.
    pub(super) fn factor(
        &mut self,
        analysis: &LuAnalysis,
        values: &[T],
        stack: &mut MemStack,
    ) -> Result<Pivots, LuError> {
        for (value, &source) in self.values.iter_mut().zip(&analysis.source) {
            *value = values[source as usize];
        }
        let factored = simplicial::factorize_simplicial_numeric_lu(
            &mut self.forward,
            &mut self.inverse,
            &mut self.factors,
            SparseColMatRef::new(analysis.columns.as_ref(), &self.values),
            analysis.symbolic.col_perm(),
            stack,
        );
        let mut pivots = Pivots::none();
        match factored {
            Ok(()) => self.see_pivots(&mut pivots),
            // A column without any candidate for a pivot: as good as one whose candidates are all zero.
            Err(LuError::SymbolicSingular { index }) => pivots.see(0.0, index),
            Err(error) => return Err(error),
        }
        Ok(pivots)
    }

    /// The diagonal of `U`: the last entry of each of its columns.
    fn see_pivots(&self, pivots: &mut Pivots) {
        let upper = self.factors.u_factor_unsorted();
        for (position, &end) in upper.col_ptr()[1..].iter().enumerate() {
            let pivot = end.checked_sub(1).and_then(|last| upper.val().get(last as usize));
            pivots.see(pivot.map_or(0.0, |pivot| pivot.as_f64()), position);
        }
    }

    /// Solves in place.
    pub(super) fn solve(&self, analysis: &LuAnalysis, columns: MatMut<'_, T>, stack: &mut MemStack) {
        let rows = PermRef::new_checked(&self.forward, &self.inverse, self.forward.len());
        let order = analysis.symbolic.col_perm();
        self.factors.solve_in_place_with_conj(rows, order, Conj::No, columns, Par::Seq, stack);
    }
}
