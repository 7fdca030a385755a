//! The matrix: compressed rows over a shared pattern.

use std::sync::Arc;

use crate::las::{Sparsity, Value};
use crate::parallel;

/// A matrix of compressed rows that shares its sparsity pattern with other matrices.
#[derive(Debug)]
pub struct Matrix<T = f64> {
    pub(in crate::backends) pattern: Arc<Sparsity>,
    /// One value per entry of the pattern, followed by one that is never read:
    /// [`add_at`](crate::las::MatrixOps::add_at) adds dropped contributions to it without a branch.
    pub(in crate::backends) values: Vec<T>,
}

/// `clone_from` copies only the values, without allocating, if both matrices have the same pattern.
impl<T: Clone> Clone for Matrix<T> {
    fn clone(&self) -> Self {
        Self { pattern: Arc::clone(&self.pattern), values: self.values.clone() }
    }

    fn clone_from(&mut self, from: &Self) {
        self.pattern.clone_from(&from.pattern);
        self.values.clone_from(&from.values);
    }
}

impl<T: Value> Matrix<T> {
    /// Creates a zero matrix.
    pub fn zeros(pattern: &Arc<Sparsity>) -> Self {
        Self { pattern: Arc::clone(pattern), values: parallel::filled(T::zero(), pattern.nnz() + 1) }
    }

    /// Returns the sparsity pattern.
    #[inline(always)]
    pub fn pattern(&self) -> &Arc<Sparsity> {
        &self.pattern
    }

    /// Returns the value of every entry of the pattern, by rows.
    #[inline(always)]
    pub fn values(&self) -> &[T] {
        &self.values[..self.pattern.nnz()]
    }

    /// Returns the value of every entry of the pattern, by rows, mutably.
    #[inline(always)]
    pub fn values_mut(&mut self) -> &mut [T] {
        &mut self.values[..self.pattern.nnz()]
    }

    /// Returns the index range of the values of a row; empty for a constrained row and for a row out of range.
    #[inline(always)]
    pub(in crate::backends) fn row_range(pattern: &Sparsity, row: i32) -> std::ops::Range<usize> {
        let ends = pattern.row_offsets().get(row as usize..).and_then(|starts| starts.first_chunk::<2>());
        ends.map_or(0..0, |&[start, end]| start as usize..end as usize)
    }
}
