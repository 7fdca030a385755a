//! The dense matrix.

use crate::las::{Scalar, Sparsity};

/// A dense matrix, stored by rows.
#[derive(Debug)]
pub struct Matrix<T = f64> {
    pub(super) rows: usize,
    pub(super) cols: usize,
    /// `rows * cols` values, followed by one that is never read: [`add_at`](crate::las::MatrixOps::add_at) adds dropped
    /// contributions to it without a branch.
    pub(super) values: Vec<T>,
}

/// `clone_from` does not allocate if both matrices have the same shape.
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
    /// Creates a zero matrix with the shape of a pattern; it contains every entry, whether the pattern does or not.
    pub fn zeros(pattern: &Sparsity) -> Self {
        let (rows, cols) = (pattern.rows(), pattern.cols());
        Self { rows, cols, values: vec![T::zero(); rows * cols + 1] }
    }

    /// Returns the values by rows.
    #[inline(always)]
    pub fn values(&self) -> &[T] {
        &self.values[..self.rows * self.cols]
    }

    /// Returns the values by rows, mutably.
    #[inline(always)]
    pub fn values_mut(&mut self) -> &mut [T] {
        &mut self.values[..self.rows * self.cols]
    }

    /// Returns the index range of the values of a row; empty for a constrained row and for a row out of range.
    #[inline(always)]
    pub(super) fn row_range(&self, row: i32) -> std::ops::Range<usize> {
        let row = row as usize;
        if row < self.rows { row * self.cols..(row + 1) * self.cols } else { 0..0 }
    }
}
