//! The vector and matrix operations of assembly.

use std::convert::Infallible;

use super::{Dense, DenseScalar, Matrix, Vector};
use crate::backends::local;
use crate::las::MatrixOps;

local::impl_vector_ops!(
    [T: DenseScalar] Dense<T>, Vector<T>, T, T, norm: local::norm, dot: local::dot, axpy: local::axpy
);

impl<T: DenseScalar> Matrix<T> {
    /// Calls `visit(entry, value of the block)` for every pair of indices of a block that is inside the matrix.
    #[inline(always)]
    fn scatter(&mut self, rows: &[i32], cols: &[i32], block: &[T], mut visit: impl FnMut(&mut T, T)) {
        debug_assert_eq!(rows.len() * cols.len(), block.len(), "one value per pair of row and column");
        let shape = (self.rows, self.cols);
        for (&row, values) in rows.iter().zip(block.chunks_exact(cols.len().max(1))) {
            let range = self.row_range(row);
            let entries = &mut self.values[range];
            for (&column, &value) in cols.iter().zip(values) {
                match entries.get_mut(column as usize) {
                    Some(entry) => visit(entry, value),
                    None => debug_assert!(row < 0 || column < 0, "({row}, {column}) is not in a matrix of {shape:?}"),
                }
            }
        }
    }
}

impl<T: DenseScalar> MatrixOps<Dense<T>> for Matrix<T> {
    #[inline(always)]
    fn shape(&self) -> (usize, usize) {
        (self.rows, self.cols)
    }

    #[inline(always)]
    fn zero(&mut self) -> Result<(), Infallible> {
        local::zero(&mut self.values);
        Ok(())
    }

    #[inline(always)]
    fn zero_rows(&mut self, rows: &[i32]) -> Result<(), Infallible> {
        for &row in rows {
            debug_assert!(row < self.rows as i32, "row {row} of a matrix of {}", self.rows);
            let range = self.row_range(row);
            local::zero(&mut self.values[range]);
        }
        Ok(())
    }

    #[inline(always)]
    fn add(&mut self, rows: &[i32], cols: &[i32], block: &[T]) -> Result<(), Infallible> {
        self.scatter(rows, cols, block, |entry, value| *entry += value);
        Ok(())
    }

    #[inline(always)]
    fn set(&mut self, rows: &[i32], cols: &[i32], block: &[T]) -> Result<(), Infallible> {
        self.scatter(rows, cols, block, |entry, value| *entry = value);
        Ok(())
    }

    #[inline(always)]
    fn get(&self, rows: &[i32], cols: &[i32], block: &mut [T]) -> Result<(), Infallible> {
        debug_assert_eq!(rows.len() * cols.len(), block.len(), "one value per pair of row and column");
        for (&row, values) in rows.iter().zip(block.chunks_exact_mut(cols.len().max(1))) {
            if row >= 0 {
                local::get(&self.values[self.row_range(row)], cols, values);
            }
        }
        Ok(())
    }

    #[inline(always)]
    fn locate(&self, rows: &[i32], cols: &[i32], slots: &mut Vec<usize>) -> Result<(), Infallible> {
        let dropped = self.rows * self.cols;
        slots.reserve(rows.len() * cols.len());
        for &row in rows {
            let range = self.row_range(row);
            slots.extend(cols.iter().map(|&column| {
                if (column as usize) < range.len() {
                    range.start + column as usize
                } else {
                    debug_assert!(row < 0 || column < 0, "({row}, {column}) is not in the matrix");
                    dropped
                }
            }));
        }
        Ok(())
    }

    #[inline(always)]
    fn add_at(&mut self, slots: &[usize], block: &[T]) -> Result<(), Infallible> {
        debug_assert_eq!(slots.len(), block.len(), "one value per slot");
        for (&slot, &value) in slots.iter().zip(block) {
            match self.values.get_mut(slot) {
                Some(entry) => *entry += value,
                None => debug_assert!(false, "slot {slot} is not of this shape"),
            }
        }
        Ok(())
    }

    #[inline(always)]
    fn finish(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}
