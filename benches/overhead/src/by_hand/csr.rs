//! Matrices in compressed rows over a shared pattern.

use std::ops::{AddAssign, Range};
use std::sync::Arc;

/// A sparsity pattern: column indices ascend in each row.
pub struct Pattern {
    pub cols: usize,
    pub row_offsets: Box<[u32]>,
    pub columns: Box<[u32]>,
}

/// A matrix. `values` has one element more than the pattern has entries; that element receives dropped entries.
pub struct Csr<T> {
    pub pattern: Arc<Pattern>,
    pub values: Vec<T>,
}

/// Returns the position of a column in a row: tries the position after the last one found, then bisects. Returns
/// `usize::MAX` if the column is not in the row, as for negative columns.
#[inline(always)]
fn find(columns: &[u32], next: &mut usize, column: i32) -> usize {
    let column = column as u32;
    let mut position = *next;
    if columns.get(position) != Some(&column) {
        match columns.binary_search(&column) {
            Ok(found) => position = found,
            Err(_) => return usize::MAX,
        }
    }
    *next = position + 1;
    position
}

#[inline(always)]
fn range(pattern: &Pattern, row: i32) -> Range<usize> {
    match pattern.row_offsets.get(row as usize..).and_then(|starts| starts.first_chunk()) {
        Some(&[start, end]) => start as usize..end as usize,
        None => 0..0,
    }
}

impl<T: Copy + Default + AddAssign> Csr<T> {
    #[inline(always)]
    pub fn zero(&mut self) {
        self.values.iter_mut().for_each(|value| *value = T::default());
    }

    #[inline(always)]
    pub fn zero_rows(&mut self, rows: &[i32]) {
        for &row in rows {
            let range = range(&self.pattern, row);
            self.values[range].iter_mut().for_each(|value| *value = T::default());
        }
    }

    #[inline(always)]
    pub fn add(&mut self, rows: &[i32], cols: &[i32], block: &[T]) {
        for (&row, values) in rows.iter().zip(block.chunks_exact(cols.len().max(1))) {
            let range = range(&self.pattern, row);
            let (columns, mut next) = (&self.pattern.columns[range.clone()], 0);
            let entries = &mut self.values[range];
            for (&column, &value) in cols.iter().zip(values) {
                if let Some(entry) = entries.get_mut(find(columns, &mut next, column)) {
                    *entry += value;
                }
            }
        }
    }

    #[inline(always)]
    pub fn set(&mut self, rows: &[i32], cols: &[i32], block: &[T]) {
        for (&row, values) in rows.iter().zip(block.chunks_exact(cols.len().max(1))) {
            let range = range(&self.pattern, row);
            let (columns, mut next) = (&self.pattern.columns[range.clone()], 0);
            let entries = &mut self.values[range];
            for (&column, &value) in cols.iter().zip(values) {
                if let Some(entry) = entries.get_mut(find(columns, &mut next, column)) {
                    *entry = value;
                }
            }
        }
    }

    #[inline(always)]
    pub fn get(&self, rows: &[i32], cols: &[i32], block: &mut [T]) {
        for (&row, values) in rows.iter().zip(block.chunks_exact_mut(cols.len().max(1))) {
            if row < 0 {
                continue;
            }
            let range = range(&self.pattern, row);
            let (columns, mut next) = (&self.pattern.columns[range.clone()], 0);
            let entries = &self.values[range];
            for (&column, value) in cols.iter().zip(values) {
                if column >= 0 {
                    *value = entries.get(find(columns, &mut next, column)).copied().unwrap_or_default();
                }
            }
        }
    }

    #[inline(always)]
    pub fn add_at(&mut self, slots: &[u32], block: &[T]) {
        for (&slot, &value) in slots.iter().zip(block) {
            if let Some(entry) = self.values.get_mut(slot as usize) {
                *entry += value;
            }
        }
    }
}
