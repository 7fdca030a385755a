//! The matrix: every entry of every row.

use crate::las::{Scalar, Sparsity};

/// A dense matrix, row after row.
#[derive(Debug)]
pub struct Matrix<T = f64> {
    pub(super) rows: usize,
    pub(super) cols: usize,
    /// `rows * cols` values, and one more behind them: what [`add_at`](crate::las::MatrixOps::add_at) drops lands there,
    /// so that it need not ask. Nothing reads it.
    pub(super) values: Vec<T>,
}

/// `clone_from` allocates nothing where both have the same shape.
impl<T: Clone> Clone for Matrix<T> {
    fn clone(&self) -> Self {
        Self { rows: self.rows, cols: self.cols, values: self.values.clone() }
    }

    fn clone_from(&mut self, from: &Self) {
        (self.rows, self.cols) = (from.rows, from.cols);
        self.values.clone_from(&from.values);
    }
}

impl<T: Scalar> Matrix<T> {
    /// Zeros, in the shape of a pattern; every entry is there, whether the pattern has it or not.
    #[must_use]
    pub fn zeros(pattern: &Sparsity) -> Self {
        let (rows, cols) = (pattern.rows(), pattern.cols());
        Self { rows, cols, values: vec![T::zero(); rows * cols + 1] }
    }

    /// Its values, row after row.
    #[inline(always)]
    #[must_use]
    pub fn values(&self) -> &[T] {
        &self.values[..self.rows * self.cols]
    }

    /// Its values, row after row, for writing.
    #[inline(always)]
    #[must_use]
    pub fn values_mut(&mut self) -> &mut [T] {
        &mut self.values[..self.rows * self.cols]
    }

    /// Where a row lies among the values; empty for a constrained row and for one out of range.
    #[inline(always)]
    pub(super) fn row_range(&self, row: i32) -> std::ops::Range<usize> {
        let row = row as usize;
        if row < self.rows { row * self.cols..(row + 1) * self.cols } else { 0..0 }
    }
}
