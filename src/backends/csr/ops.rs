//! The functions behind the vector and matrix operations of assembly.

use super::Matrix;
use crate::backends::local::{self, NOT_FOUND, find};
use crate::las::Value;
use crate::parallel;

impl<T: Value> Matrix<T> {
    /// Calls `visit(entry, value of the block)` for every entry of a block whose position is in the
    /// pattern.
    #[inline(always)]
    pub(in crate::backends) fn scatter(
        &mut self,
        rows: &[i32],
        cols: &[i32],
        block: &[T],
        mut visit: impl FnMut(&mut T, T),
    ) {
        debug_assert_eq!(rows.len() * cols.len(), block.len(), "one value per pair of row and column");
        for (&row, values) in rows.iter().zip(block.chunks_exact(cols.len().max(1))) {
            let range = Self::row_range(&self.pattern, row);
            let (columns, mut next) = (&self.pattern.col_indices()[range.clone()], 0);
            let entries = &mut self.values[range];
            for (&column, &value) in cols.iter().zip(values) {
                match entries.get_mut(find(columns, &mut next, column)) {
                    Some(entry) => visit(entry, value),
                    None => debug_assert!(row < 0 || column < 0, "({row}, {column}) is not in the pattern"),
                }
            }
        }
    }

    /// Sets all entries to zero.
    #[inline(always)]
    pub(in crate::backends) fn zero_all(&mut self) {
        local::zero(&mut self.values);
    }

    /// Sets all entries to zero, on all threads if there are many.
    pub(in crate::backends) fn zero_before_assembly(&mut self) {
        /// The number of entries that a task sets to zero.
        const ENTRIES: usize = 1 << 17;
        if self.values.len() > ENTRIES {
            parallel::map(self.values.chunks_mut(ENTRIES), local::zero);
        } else {
            self.zero_all();
        }
    }

    /// Sets whole rows to zero.
    #[inline(always)]
    pub(in crate::backends) fn zero_whole_rows(&mut self, rows: &[i32]) {
        for &row in rows {
            debug_assert!(row < self.pattern.rows() as i32, "row {row} of a matrix of {}", self.pattern.rows());
            let range = Self::row_range(&self.pattern, row);
            local::zero(&mut self.values[range]);
        }
    }

    /// Reads a block.
    #[inline(always)]
    pub(in crate::backends) fn get_block(&self, rows: &[i32], cols: &[i32], block: &mut [T]) {
        debug_assert_eq!(rows.len() * cols.len(), block.len(), "one value per pair of row and column");
        for (&row, values) in rows.iter().zip(block.chunks_exact_mut(cols.len().max(1))) {
            if row < 0 {
                continue;
            }
            let range = Self::row_range(&self.pattern, row);
            let (columns, mut next) = (&self.pattern.col_indices()[range.clone()], 0);
            let entries = &self.values[range];
            for (&column, value) in cols.iter().zip(values) {
                if column >= 0 {
                    *value = entries.get(find(columns, &mut next, column)).copied().unwrap_or_else(T::zero);
                }
            }
        }
    }

    /// Appends the positions of a block; dropped entries get the position after the last one.
    #[inline(always)]
    pub(in crate::backends) fn positions(&self, rows: &[i32], cols: &[i32], slots: &mut Vec<u32>) {
        let dropped = self.pattern.nnz() as u32;
        slots.reserve(rows.len() * cols.len());
        for &row in rows {
            let range = Self::row_range(&self.pattern, row);
            let (columns, mut next) = (&self.pattern.col_indices()[range.clone()], 0);
            slots.extend(cols.iter().map(|&column| match find(columns, &mut next, column) {
                NOT_FOUND => {
                    debug_assert!(row < 0 || column < 0, "({row}, {column}) is not in the pattern");
                    dropped
                }
                position => (range.start + position) as u32,
            }));
        }
    }

    /// Adds the values of a block at these positions.
    #[inline(always)]
    pub(in crate::backends) fn add_at_positions(&mut self, slots: &[u32], block: &[T]) {
        debug_assert_eq!(slots.len(), block.len(), "one value per slot");
        for (&slot, &value) in slots.iter().zip(block) {
            match self.values.get_mut(slot as usize) {
                Some(entry) => *entry += value,
                None => debug_assert!(false, "slot {slot} is not of this pattern"),
            }
        }
    }
}
