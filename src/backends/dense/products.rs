//! Products, sums, diagonals and the traversal of all entries.

use std::convert::Infallible;
use std::sync::Arc;

use faer::linalg::matmul::matmul;
use faer::{Accum, MatMut, MatRef, Par};

use super::{Dense, DenseScalar, Failure, Matrix, Vector};
use crate::backends::checks::check_size;
use crate::backends::local;
use crate::las::{Entries, MatMat, MatVec, Scalar, Sparsity};

impl<T: DenseScalar> MatVec<Dense<T>> for Matrix<T> {
    fn mul(&self, x: &Vector<T>, y: &mut Vector<T>) -> Result<(), Failure> {
        check_size("the vector to multiply", x.values.len(), self.cols)?;
        check_size("the product", y.values.len(), self.rows)?;
        for (row, y) in y.values.iter_mut().enumerate() {
            *y = local::dot(self.row(row), &x.values);
        }
        Ok(())
    }

    fn mul_transpose(&self, x: &Vector<T>, y: &mut Vector<T>) -> Result<(), Failure> {
        check_size("the vector to multiply", x.values.len(), self.rows)?;
        check_size("the product", y.values.len(), self.cols)?;
        y.values.fill(T::zero());
        for (row, &x) in x.values.iter().enumerate() {
            local::axpy(x, self.row(row), &mut y.values);
        }
        Ok(())
    }

    fn diagonal(&self, d: &mut Vector<T>) -> Result<(), Failure> {
        check_size("the diagonal", d.values.len(), self.rows.min(self.cols))?;
        for (d, &entry) in d.values.iter_mut().zip(self.values.iter().step_by(self.cols + 1)) {
            *d = entry;
        }
        Ok(())
    }
}

impl<T: DenseScalar> MatMat<Dense<T>> for Matrix<T> {
    fn scale(&mut self, factor: T) -> Result<(), Infallible> {
        self.values.iter_mut().for_each(|value| *value *= factor);
        Ok(())
    }

    fn sum(&self, a: T, other: &Self, b: T) -> Result<Self, Failure> {
        check_size("the other matrix (rows)", other.rows, self.rows)?;
        check_size("the other matrix (columns)", other.cols, self.cols)?;
        let values = self.values.iter().zip(&other.values).map(|(&x, &y)| a * x + b * y).collect();
        Ok(Self { rows: self.rows, cols: self.cols, values })
    }

    fn product(&self, other: &Self) -> Result<Self, Failure> {
        check_size("the other matrix (rows)", other.rows, self.cols)?;
        let (rows, cols) = (self.rows, other.cols);
        let mut product = Self { rows, cols, values: vec![T::zero(); rows * cols + 1] };
        if rows * cols * self.cols > 0 {
            let left = MatRef::from_row_major_slice(self.values(), rows, self.cols);
            let right = MatRef::from_row_major_slice(other.values(), self.cols, cols);
            let out = MatMut::from_row_major_slice_mut(product.values_mut(), rows, cols);
            matmul(out, Accum::Replace, left, right, T::one(), Par::Seq);
        }
        Ok(product)
    }

    fn transpose(&self) -> Result<Self, Failure> {
        let (rows, cols) = (self.cols, self.rows);
        let mut values = Vec::with_capacity(rows * cols + 1);
        for column in 0..rows {
            values.extend((0..cols).map(|row| self.values[row * rows + column]));
        }
        values.push(T::zero());
        Ok(Self { rows, cols, values })
    }
}

impl<T: DenseScalar> Entries<Dense<T>> for Matrix<T> {
    /// Returns the full pattern.
    fn pattern(&self) -> Result<Arc<Sparsity>, Infallible> {
        Ok(Arc::new(Sparsity::full(self.rows, self.cols)))
    }

    fn for_each(&self, mut visit: impl FnMut(usize, usize, T)) -> Result<(), Infallible> {
        for row in 0..self.rows {
            for (column, &value) in self.row(row).iter().enumerate() {
                visit(row, column, value);
            }
        }
        Ok(())
    }
}

impl<T: Scalar> Matrix<T> {
    /// Returns the values of a row.
    fn row(&self, row: usize) -> &[T] {
        &self.values[row * self.cols..(row + 1) * self.cols]
    }
}
