//! The matrix: compressed rows over a shared pattern.

use std::sync::Arc;

use crate::las::{Scalar, Sparsity};

/// Compressed rows whose pattern is shared with every matrix like it.
#[derive(Debug)]
pub struct Matrix<T = f64> {
    pub(super) pattern: Arc<Sparsity>,
    /// One value an entry of the pattern, and one more behind them: what [`add_at`](crate::las::MatrixOps::add_at) drops
    /// lands there, so that it need not ask. Nothing reads it.
    pub(super) values: Vec<T>,
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

impl<T: Scalar> Matrix<T> {
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
    pub(super) fn row_range(pattern: &Sparsity, row: i32) -> std::ops::Range<usize> {
        match pattern.row_start().get(row as usize..).and_then(|starts| starts.first_chunk()) {
            Some(&[start, end]) => start as usize..end as usize,
            None => {
                debug_assert!(row < 0, "row {row} of a matrix of {}", pattern.rows());
                0..0
            }
        }
    }
}

/// Searches one row for the columns of a block.
///
/// The unknowns of a node follow each other, in the block as in the row, so that the place after the last one found is
/// tried before the row is searched.
pub(super) struct RowSearch<'a> {
    columns: &'a [u32],
    next: usize,
}

impl<'a> RowSearch<'a> {
    #[inline(always)]
    pub(super) fn new(columns: &'a [u32]) -> Self {
        Self { columns, next: 0 }
    }

    /// The position of a column in the row. A negative one is larger than any column as a `u32`, and so not found.
    #[inline(always)]
    pub(super) fn find(&mut self, column: i32) -> Option<usize> {
        let column = column as u32;
        let position = if self.columns.get(self.next) == Some(&column) {
            self.next
        } else {
            self.columns.binary_search(&column).ok()?
        };
        self.next = position + 1;
        Some(position)
    }
}
