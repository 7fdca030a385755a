//! Products, sums, diagonals, and all entries.

use std::convert::Infallible;
use std::sync::Arc;

use super::block::BlockScalar;
use super::{Matrix, Sparse, Vector};
use crate::backends::checks::check_size;
use crate::backends::local;
use crate::las::{Entries, MatMat, MatVec, SolveError, Sparsity};

impl<T: BlockScalar> MatVec<Sparse<T>> for Matrix<T> {
    fn mul(&self, x: &Vector<T>, y: &mut Vector<T>) -> Result<(), SolveError<Infallible>> {
        check_size("the vector to multiply", x.values.len(), self.pattern.cols())?;
        check_size("the product", y.values.len(), self.pattern.rows())?;
        let mut start = 0;
        for (y, &end) in y.values.iter_mut().zip(&self.pattern.row_start()[1..]) {
            let range = start..end as usize;
            let entries = self.pattern.columns()[range.clone()].iter().zip(&self.values[range]);
            *y = entries.map(|(&column, &value)| value * x.values[column as usize]).sum();
            start = end as usize;
        }
        Ok(())
    }

    fn mul_transpose(&self, x: &Vector<T>, y: &mut Vector<T>) -> Result<(), SolveError<Infallible>> {
        check_size("the vector to multiply", x.values.len(), self.pattern.rows())?;
        check_size("the product", y.values.len(), self.pattern.cols())?;
        y.values.fill(T::zero());
        for (row, &x) in x.values.iter().enumerate() {
            for (column, value) in self.row(row) {
                y.values[column] += value * x;
            }
        }
        Ok(())
    }

    fn diagonal(&self, d: &mut Vector<T>) -> Result<(), SolveError<Infallible>> {
        check_size("the diagonal", d.values.len(), self.pattern.rows().min(self.pattern.cols()))?;
        for (k, d) in d.values.iter_mut().enumerate() {
            *d = self.pattern.find(k, k).map_or(T::zero(), |at| self.values[at]);
        }
        Ok(())
    }

    fn inverse_diagonal(&self, d: &mut Vector<T>) -> Result<(), SolveError<Infallible>> {
        self.diagonal(d)?;
        local::invert(&mut d.values)
    }
}

impl<T: BlockScalar> MatMat<Sparse<T>> for Matrix<T> {
    fn scale(&mut self, factor: T) -> Result<(), Infallible> {
        self.values.iter_mut().for_each(|value| *value *= factor);
        Ok(())
    }

    fn sum(&self, a: T, other: &Self, b: T) -> Result<Self, SolveError<Infallible>> {
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
                let mut at = pattern.row_start()[row] as usize;
                for (column, value) in matrix.row(row) {
                    // Both ascend.
                    while (pattern.columns()[at] as usize) < column {
                        at += 1;
                    }
                    sum.values[at] += factor * value;
                }
            }
        }
        Ok(sum)
    }

    fn product(&self, other: &Self) -> Result<Self, SolveError<Infallible>> {
        check_size("the other matrix (rows)", other.pattern.rows(), self.pattern.cols())?;
        let pattern = Arc::new(self.pattern.product(&other.pattern).map_err(SolveError::TooLarge)?);
        let mut product = Self::zeros(&pattern);
        // One row spread out: where each of its columns is summed.
        let mut row_sums = vec![T::zero(); pattern.cols()];
        for row in 0..pattern.rows() {
            for (k, left) in self.row(row) {
                for (column, right) in other.row(k) {
                    row_sums[column] += left * right;
                }
            }
            let range = pattern.row_start()[row] as usize..pattern.row_start()[row + 1] as usize;
            for at in range {
                product.values[at] = std::mem::take(&mut row_sums[pattern.columns()[at] as usize]);
            }
        }
        Ok(product)
    }

    fn transpose(&self) -> Result<Self, SolveError<Infallible>> {
        let pattern = Arc::new(self.pattern.transpose());
        let mut next = pattern.row_start().to_vec();
        let mut transpose = Self::zeros(&pattern);
        for row in 0..self.pattern.rows() {
            for (column, value) in self.row(row) {
                transpose.values[next[column] as usize] = value;
                next[column] += 1;
            }
        }
        Ok(transpose)
    }
}

impl<T: BlockScalar> Entries<Sparse<T>> for Matrix<T> {
    fn pattern(&self) -> Result<Arc<Sparsity>, Infallible> {
        Ok(Arc::clone(&self.pattern))
    }

    fn for_each(&self, mut visit: impl FnMut(usize, usize, T)) -> Result<(), Infallible> {
        for row in 0..self.pattern.rows() {
            for (column, value) in self.row(row) {
                visit(row, column, value);
            }
        }
        Ok(())
    }
}

impl<T: Copy> Matrix<T> {
    /// Columns and values of a row.
    fn row(&self, row: usize) -> impl Iterator<Item = (usize, T)> {
        let range = self.pattern.row_start()[row] as usize..self.pattern.row_start()[row + 1] as usize;
        let columns = self.pattern.columns()[range.clone()].iter().map(|&column| column as usize);
        columns.zip(self.values[range].iter().copied())
    }
}
