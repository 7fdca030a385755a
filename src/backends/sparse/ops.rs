//! The hot verbs.

use std::convert::Infallible;

use super::block::BlockScalar;
use super::matrix::RowSearch;
use super::{Matrix, Sparse, Vector};
use crate::backends::local;
use crate::las::{MatrixOps, VectorOps};

impl<T: BlockScalar> VectorOps<Sparse<T>> for Vector<T> {
    #[inline(always)]
    fn len(&self) -> usize {
        self.values.len()
    }

    #[inline(always)]
    fn zero(&mut self) -> Result<(), Infallible> {
        self.values.fill(T::zero());
        Ok(())
    }

    #[inline(always)]
    fn add(&mut self, rows: &[i32], values: &[T]) -> Result<(), Infallible> {
        local::add(&mut self.values, rows, values);
        Ok(())
    }

    #[inline(always)]
    fn set(&mut self, rows: &[i32], values: &[T]) -> Result<(), Infallible> {
        local::set(&mut self.values, rows, values);
        Ok(())
    }

    #[inline(always)]
    fn get(&self, rows: &[i32], values: &mut [T]) -> Result<(), Infallible> {
        local::get(&self.values, rows, values);
        Ok(())
    }

    #[inline(always)]
    fn norm(&self) -> Result<T, Infallible> {
        Ok(local::norm(&self.values))
    }

    #[inline(always)]
    fn dot(&self, y: &Self) -> Result<T, Infallible> {
        Ok(local::dot(&self.values, &y.values))
    }

    #[inline(always)]
    fn axpy(&mut self, a: T, x: &Self) -> Result<(), Infallible> {
        local::axpy(a, &x.values, &mut self.values);
        Ok(())
    }

    #[inline(always)]
    fn with_local<R>(&self, read: impl FnOnce(&[T]) -> R) -> Result<R, Infallible> {
        Ok(read(&self.values))
    }

    #[inline(always)]
    fn with_local_mut<R>(&mut self, write: impl FnOnce(&mut [T]) -> R) -> Result<R, Infallible> {
        Ok(write(&mut self.values))
    }

    #[inline(always)]
    fn finish(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}

impl<T: BlockScalar> Matrix<T> {
    /// Calls `visit(entry, value of the block)` for every pair of a block that is in the pattern.
    #[inline(always)]
    fn scatter(&mut self, rows: &[i32], cols: &[i32], block: &[T], mut visit: impl FnMut(&mut T, T)) {
        debug_assert_eq!(rows.len() * cols.len(), block.len(), "one value a pair of row and column");
        for (&row, values) in rows.iter().zip(block.chunks_exact(cols.len().max(1))) {
            let range = Self::row_range(&self.pattern, row);
            let mut search = RowSearch::new(&self.pattern.columns()[range.clone()]);
            let entries = &mut self.values[range];
            for (&column, &value) in cols.iter().zip(values) {
                match search.find(column).and_then(|position| entries.get_mut(position)) {
                    Some(entry) => visit(entry, value),
                    None => debug_assert!(row < 0 || column < 0, "({row}, {column}) is not in the pattern"),
                }
            }
        }
    }
}

impl<T: BlockScalar> MatrixOps<Sparse<T>> for Matrix<T> {
    #[inline(always)]
    fn shape(&self) -> (usize, usize) {
        (self.pattern.rows(), self.pattern.cols())
    }

    #[inline(always)]
    fn zero(&mut self) -> Result<(), Infallible> {
        self.values.fill(T::zero());
        Ok(())
    }

    #[inline(always)]
    fn zero_rows(&mut self, rows: &[i32]) -> Result<(), Infallible> {
        for &row in rows {
            let range = Self::row_range(&self.pattern, row);
            self.values[range].fill(T::zero());
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
        debug_assert_eq!(rows.len() * cols.len(), block.len(), "one value a pair of row and column");
        for (&row, values) in rows.iter().zip(block.chunks_exact_mut(cols.len().max(1))) {
            if row < 0 {
                continue;
            }
            let starts = self.pattern.row_start();
            let range = match starts.get(row as usize..).and_then(|starts| starts.first_chunk()) {
                Some(&[start, end]) => start as usize..end as usize,
                None => 0..0,
            };
            let mut search = RowSearch::new(&self.pattern.columns()[range.clone()]);
            let entries = &self.values[range];
            for (&column, value) in cols.iter().zip(values) {
                match search.find(column).and_then(|position| entries.get(position)) {
                    Some(&entry) => *value = entry,
                    None if column >= 0 => *value = T::zero(),
                    None => {}
                }
            }
        }
        Ok(())
    }

    #[inline(always)]
    fn locate(&self, rows: &[i32], cols: &[i32], slots: &mut Vec<u32>) -> Result<(), Infallible> {
        let dropped = self.pattern.entries() as u32;
        slots.reserve(rows.len() * cols.len());
        for &row in rows {
            let range = Self::row_range(&self.pattern, row);
            let mut search = RowSearch::new(&self.pattern.columns()[range.clone()]);
            slots.extend(cols.iter().map(|&column| match search.find(column) {
                Some(position) => (range.start + position) as u32,
                None => {
                    debug_assert!(row < 0 || column < 0, "({row}, {column}) is not in the pattern");
                    dropped
                }
            }));
        }
        Ok(())
    }

    #[inline(always)]
    fn add_at(&mut self, slots: &[u32], block: &[T]) -> Result<(), Infallible> {
        debug_assert_eq!(slots.len(), block.len(), "one value a slot");
        for (&slot, &value) in slots.iter().zip(block) {
            match self.values.get_mut(slot as usize) {
                Some(entry) => *entry += value,
                None => debug_assert!(false, "slot {slot} is not of this pattern"),
            }
        }
        Ok(())
    }

    #[inline(always)]
    fn finish(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}
