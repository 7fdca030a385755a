//! Full matrices, stored by rows.

use std::ops::Range;

use super::slices;

/// A matrix. `values` has one element more than the matrix has entries; that element receives dropped entries.
pub struct Full {
    pub rows: usize,
    pub cols: usize,
    pub values: Vec<f64>,
}

impl Full {
    #[inline(always)]
    fn range(&self, row: i32) -> Range<usize> {
        let row = row as usize;
        if row < self.rows { row * self.cols..(row + 1) * self.cols } else { 0..0 }
    }

    #[inline(always)]
    pub fn zero(&mut self) {
        self.values.fill(0.0);
    }

    #[inline(always)]
    pub fn zero_rows(&mut self, rows: &[i32]) {
        for &row in rows {
            let range = self.range(row);
            self.values[range].fill(0.0);
        }
    }

    #[inline(always)]
    pub fn add(&mut self, rows: &[i32], cols: &[i32], block: &[f64]) {
        for (&row, values) in rows.iter().zip(block.chunks_exact(cols.len().max(1))) {
            let range = self.range(row);
            slices::add(&mut self.values[range], cols, values);
        }
    }

    #[inline(always)]
    pub fn set(&mut self, rows: &[i32], cols: &[i32], block: &[f64]) {
        for (&row, values) in rows.iter().zip(block.chunks_exact(cols.len().max(1))) {
            let range = self.range(row);
            slices::set(&mut self.values[range], cols, values);
        }
    }

    #[inline(always)]
    pub fn get(&self, rows: &[i32], cols: &[i32], block: &mut [f64]) {
        for (&row, values) in rows.iter().zip(block.chunks_exact_mut(cols.len().max(1))) {
            if row >= 0 {
                slices::get(&self.values[self.range(row)], cols, values);
            }
        }
    }

    #[inline(always)]
    pub fn add_at(&mut self, slots: &[usize], block: &[f64]) {
        for (&slot, &value) in slots.iter().zip(block) {
            if let Some(entry) = self.values.get_mut(slot) {
                *entry += value;
            }
        }
    }
}
