//! The functions behind products, sums and diagonals.

use std::sync::Arc;

use super::Matrix;
use crate::backends::checks::check_size;
use crate::las::{SolveError, Value};
use crate::parallel;

/// The number of entries from which a product with a vector uses several threads.
const PARALLEL_FROM: usize = 1 << 17;

/// The number of rows that one thread multiplies at a time.
const ROWS_PER_CHUNK: usize = 1 << 11;

impl<T: Value> Matrix<T> {
    /// Computes `y = A x`.
    pub(in crate::backends) fn times<F>(&self, x: &[T], y: &mut [T]) -> Result<(), SolveError<F>> {
        check_size("the vector to multiply", x.len(), self.pattern.cols())?;
        check_size("the product", y.len(), self.pattern.rows())?;
        if self.pattern.nnz() < PARALLEL_FROM {
            self.rows_times(0, x, y);
        } else {
            let starts = (0..y.len()).step_by(ROWS_PER_CHUNK);
            parallel::map(starts.zip(y.chunks_mut(ROWS_PER_CHUNK)), |(start, y)| self.rows_times(start, x, y));
        }
        Ok(())
    }

    /// Computes the entries of `A x` in the rows from `first`.
    fn rows_times(&self, first: usize, x: &[T], y: &mut [T]) {
        let ends = &self.pattern.row_offsets()[first..];
        let mut start = ends[0] as usize;
        for (y, &end) in y.iter_mut().zip(&ends[1..]) {
            let range = start..end as usize;
            let entries = self.pattern.col_indices()[range.clone()].iter().zip(&self.values[range]);
            *y = entries.fold(T::zero(), |sum, (&column, &value)| sum + value * x[column as usize]);
            start = end as usize;
        }
    }

    /// Computes `y = A^T x`.
    pub(in crate::backends) fn transposed_times<F>(&self, x: &[T], y: &mut [T]) -> Result<(), SolveError<F>> {
        check_size("the vector to multiply", x.len(), self.pattern.rows())?;
        check_size("the product", y.len(), self.pattern.cols())?;
        y.fill(T::zero());
        for (row, &x) in x.iter().enumerate() {
            for (column, value) in self.row(row) {
                y[column] += value * x;
            }
        }
        Ok(())
    }

    /// Copies the diagonal: `d[i] = A[i, i]`.
    pub(in crate::backends) fn diagonal_into<F>(&self, d: &mut [T]) -> Result<(), SolveError<F>> {
        check_size("the diagonal", d.len(), self.pattern.rows().min(self.pattern.cols()))?;
        for (k, d) in d.iter_mut().enumerate() {
            *d = self.pattern.find(k, k).map_or(T::zero(), |at| self.values[at]);
        }
        Ok(())
    }

    /// Returns `a A + b B`.
    pub(in crate::backends) fn sum_with<F>(&self, a: T, other: &Self, b: T) -> Result<Self, SolveError<F>> {
        check_size("the other matrix (rows)", other.pattern.rows(), self.pattern.rows())?;
        check_size("the other matrix (columns)", other.pattern.cols(), self.pattern.cols())?;
        if self.pattern == other.pattern {
            let values = self.values.iter().zip(&other.values).map(|(&x, &y)| a * x + b * y).collect();
            return Ok(Self { pattern: Arc::clone(&self.pattern), values });
        }
        let pattern = Arc::new(self.pattern.union(&other.pattern).map_err(SolveError::TooLarge)?);
        let mut sum = Self::zeros(&pattern);
        for (matrix, factor) in [(self, a), (other, b)] {
            for row in 0..pattern.rows() {
                let mut at = pattern.row_offsets()[row] as usize;
                for (column, value) in matrix.row(row) {
                    // Columns ascend in both patterns.
                    while (pattern.col_indices()[at] as usize) < column {
                        at += 1;
                    }
                    sum.values[at] += factor * value;
                }
            }
        }
        Ok(sum)
    }

    /// Returns `A B`.
    pub(in crate::backends) fn product_with<F>(&self, other: &Self) -> Result<Self, SolveError<F>> {
        check_size("the other matrix (rows)", other.pattern.rows(), self.pattern.cols())?;
        let pattern = Arc::new(self.pattern.product(&other.pattern).map_err(SolveError::TooLarge)?);
        let mut product = Self::zeros(&pattern);
        // One dense row in which the sums of its columns accumulate.
        let mut row_sums = vec![T::zero(); pattern.cols()];
        for row in 0..pattern.rows() {
            for (k, left) in self.row(row) {
                for (column, right) in other.row(k) {
                    row_sums[column] += left * right;
                }
            }
            for at in pattern.range(row) {
                product.values[at] = std::mem::take(&mut row_sums[pattern.col_indices()[at] as usize]);
            }
        }
        Ok(product)
    }

    /// Returns `A^T`.
    pub(in crate::backends) fn transposed(&self) -> Self {
        let pattern = Arc::new(self.pattern.transpose());
        let mut next = pattern.row_offsets().to_vec();
        let mut transpose = Self::zeros(&pattern);
        for row in 0..self.pattern.rows() {
            for (column, value) in self.row(row) {
                transpose.values[next[column] as usize] = value;
                next[column] += 1;
            }
        }
        transpose
    }

    /// Returns the columns and values of a row.
    pub(in crate::backends) fn row(&self, row: usize) -> impl Iterator<Item = (usize, T)> {
        let range = self.pattern.range(row);
        let columns = self.pattern.col_indices()[range.clone()].iter().map(|&column| column as usize);
        columns.zip(self.values[range].iter().copied())
    }
}
