//! The numeric factorization `L L^T`, and `L D L^T` for matrices that are not positive definite.

use faer::dyn_stack::{MemStack, StackReq};
use faer::linalg::cholesky::llt::factor::LltRegularization;
use faer::perm::PermRef;
use faer::sparse::SparseColMatRef;
use faer::sparse::linalg::cholesky::supernodal;
use faer::traits::RealField;
use faer::{Conj, MatMut, Par, Spec};

use super::analysis::{CholeskyAnalysis, PARALLEL_CHOLESKY_FROM, parallelism};
use crate::backends::direct::{NotPositiveDefinite, Pivots, ldlt_params};
use crate::las::Scalar;

/// Returns the working memory for solves with `columns` right-hand sides, for both factorizations.
pub(super) fn solve_scratch<T: RealField>(analysis: &CholeskyAnalysis, columns: usize) -> StackReq {
    analysis.supernodes.solve_in_place_scratch::<T>(columns, Par::Seq)
}

/// The values of `L`.
pub(super) struct Cholesky<T> {
    values: Vec<T>,
}

impl<T: Scalar + RealField> Cholesky<T> {
    pub(super) fn new(analysis: &CholeskyAnalysis) -> Self {
        Self { values: vec![T::zero(); analysis.supernodes.len_val()] }
    }

    pub(super) fn scratch(analysis: &CholeskyAnalysis) -> StackReq {
        supernodal::factorize_supernodal_numeric_llt_scratch::<u32, T>(&analysis.supernodes, Par::Seq, Spec::default())
    }

    /// Factors the permuted lower triangle.
    pub(super) fn factor(
        &mut self,
        analysis: &CholeskyAnalysis,
        lower: &[T],
        stack: &mut MemStack,
    ) -> Result<Pivots, NotPositiveDefinite> {
        let par = parallelism(self.values.len() >= PARALLEL_CHOLESKY_FROM);
        supernodal::factorize_supernodal_numeric_llt(
            &mut self.values,
            SparseColMatRef::new(analysis.lower.as_ref(), lower),
            LltRegularization::default(),
            &analysis.supernodes,
            par,
            stack,
            Spec::default(),
        )?;
        let roots = analysis.diagonal.iter().map(|&at| self.values[at as usize].as_f64());
        Ok(Pivots::of(roots.map(|root| root * root)))
    }

    /// Solves in place for right-hand sides whose rows are in elimination order.
    pub(super) fn solve(&self, analysis: &CholeskyAnalysis, columns: MatMut<'_, T>, stack: &mut MemStack) {
        let factor = supernodal::SupernodalLltRef::new(&analysis.supernodes, &self.values);
        factor.solve_in_place_with_conj(Conj::No, columns, Par::Seq, stack);
    }
}

/// The values of `L` and of the blocks of `D`, and the permutation of the unknowns within the supernodes.
pub(super) struct Ldlt<T> {
    values: Vec<T>,
    subdiagonal: Vec<T>,
    forward: Vec<u32>,
    inverse: Vec<u32>,
    /// The unknown eliminated at each position.
    pub(super) order: Vec<u32>,
}

impl<T: Scalar + RealField> Ldlt<T> {
    pub(super) fn new(analysis: &CholeskyAnalysis) -> Self {
        let n = analysis.order.len();
        Self {
            values: vec![T::zero(); analysis.supernodes.len_val()],
            subdiagonal: vec![T::zero(); n],
            forward: vec![0; n],
            inverse: vec![0; n],
            order: vec![0; n],
        }
    }

    pub(super) fn scratch(analysis: &CholeskyAnalysis) -> StackReq {
        supernodal::factorize_supernodal_numeric_intranode_lblt_scratch::<u32, T>(
            &analysis.supernodes,
            Par::Seq,
            ldlt_params::<T>(),
        )
    }

    /// Factors the permuted lower triangle.
    pub(super) fn factor(&mut self, analysis: &CholeskyAnalysis, lower: &[T], stack: &mut MemStack) -> Pivots {
        // faer writes a subdiagonal entry only if there is something to eliminate.
        self.subdiagonal.fill(T::zero());
        supernodal::factorize_supernodal_numeric_intranode_lblt(
            &mut self.values,
            &mut self.subdiagonal,
            &mut self.forward,
            &mut self.inverse,
            SparseColMatRef::new(analysis.lower.as_ref(), lower),
            &analysis.supernodes,
            Par::Seq,
            stack,
            ldlt_params::<T>(),
        );
        for (unknown, &position) in self.order.iter_mut().zip(&self.forward) {
            *unknown = analysis.order[position as usize];
        }
        let diagonal = |position: usize| self.values[analysis.diagonal[position] as usize];
        Pivots::from_blocks(self.order.len(), diagonal, &self.subdiagonal)
    }

    /// Solves in place for right-hand sides whose rows are in the elimination order [`Ldlt::order`].
    pub(super) fn solve(&self, analysis: &CholeskyAnalysis, columns: MatMut<'_, T>, stack: &mut MemStack) {
        let exchanged = PermRef::new_checked(&self.forward, &self.inverse, self.forward.len());
        supernodal::SupernodalIntranodeLbltRef::new(&analysis.supernodes, &self.values, &self.subdiagonal, exchanged)
            .solve_in_place_no_numeric_permute_with_conj(Conj::No, columns, Par::Seq, stack);
    }
}
