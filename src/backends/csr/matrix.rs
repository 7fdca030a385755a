//! The matrix: compressed rows over a shared pattern.

use std::sync::Arc;

use crate::las::{Sparsity, Value};

/// Compressed rows whose pattern is shared with every matrix like it.
#[derive(Debug)]
pub struct Matrix<T = f64> {
    pub(in crate::backends) pattern: Arc<Sparsity>,
    /// One value an entry of the pattern, and one more behind them: what [`add_at`](crate::las::MatrixOps::add_at) drops
    /// lands there, so that it need not ask. Nothing reads it.
    pub(in crate::backends) values: Vec<T>,
}

/// `clone_from` copies the values where both have the same pattern, and allocates nothing then.
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
    /// Zeros.
    #[must_use]
    pub fn zeros(pattern: &Arc<Sparsity>) -> Self {
        Self { pattern: Arc::clone(pattern), values: vec![T::zero(); pattern.entries() + 1] }
    }

    /// Which entries it has.
    #[inline(always)]
    #[must_use]
    pub fn pattern(&self) -> &Arc<Sparsity> {
        &self.pattern
    }

    /// The value of every entry of the pattern, row after row.
    #[inline(always)]
    #[must_use]
    pub fn values(&self) -> &[T] {
        &self.values[..self.pattern.entries()]
    }

    /// The value of every entry of the pattern, row after row, for writing.
    #[inline(always)]
    #[must_use]
    pub fn values_mut(&mut self) -> &mut [T] {
        &mut self.values[..self.pattern.entries()]
    }

    /// Where a row lies among the values; empty for a constrained row and for one out of range.
    #[inline(always)]
    pub(in crate::backends) fn row_range(pattern: &Sparsity, row: i32) -> std::ops::Range<usize> {
        match pattern.row_offsets().get(row as usize..).and_then(|starts| starts.first_chunk()) {
            Some(&[start, end]) => start as usize..end as usize,
            None => {
                debug_assert!(row < 0, "row {row} of a matrix of {}", pattern.rows());
                0..0
            }
        }
    }
}
