//! What the hot verbs do.

use super::Matrix;
use crate::las::Value;

impl<T: Value> Matrix<T> {
    /// Calls `visit(entry, value of the block)` for every pair of a block that is in the pattern.
    #[inline(always)]
    pub(in crate::backends) fn scatter(
        &mut self,
        rows: &[i32],
        cols: &[i32],
        block: &[T],
        mut visit: impl FnMut(&mut T, T),
    ) {
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

    /// Zeroes whole rows.
    #[inline(always)]
    pub(in crate::backends) fn zero_whole_rows(&mut self, rows: &[i32]) {
        for &row in rows {
            let range = Self::row_range(&self.pattern, row);
            self.values[range].fill(T::zero());
        }
    }

    /// Reads a block.
    #[inline(always)]
    pub(in crate::backends) fn get_block(&self, rows: &[i32], cols: &[i32], block: &mut [T]) {
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
    }

    /// Appends the positions of a block; what is dropped goes behind the last one.
    #[inline(always)]
    pub(in crate::backends) fn positions(&self, rows: &[i32], cols: &[i32], slots: &mut Vec<u32>) {
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
    }

    /// Adds at positions.
    #[inline(always)]
    pub(in crate::backends) fn add_at_positions(&mut self, slots: &[u32], block: &[T]) {
        debug_assert_eq!(slots.len(), block.len(), "one value a slot");
        for (&slot, &value) in slots.iter().zip(block) {
            match self.values.get_mut(slot as usize) {
                Some(entry) => *entry += value,
                None => debug_assert!(false, "slot {slot} is not of this pattern"),
            }
        }
    }
}

/// Searches one row for the columns of a block.
///
/// The unknowns of a node follow each other, in the block as in the row, so that the place after the last one found is
/// tried before the row is searched.
pub(in crate::backends) struct RowSearch<'a> {
    columns: &'a [u32],
    next: usize,
}

impl<'a> RowSearch<'a> {
    #[inline(always)]
    pub(in crate::backends) fn new(columns: &'a [u32]) -> Self {
        Self { columns, next: 0 }
    }

    /// The position of a column in the row. A negative one is larger than any column as a `u32`, and so not found.
    #[inline(always)]
    pub(in crate::backends) fn find(&mut self, column: i32) -> Option<usize> {
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
