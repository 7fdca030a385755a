//! The matrix operations of assembly, which bypass the functions of PETSc.
//!
//! They access the memory of the matrix directly, at positions given by the pattern. `VecSetValues` and
//! `MatSetValues` do not check that an index is in range and would write anywhere; if logging is on, both also write to
//! the log of PETSc, which all threads of the process share. `finish` of a matrix informs PETSc, under the lock,
//! that entries changed.

use super::context::Context;
use super::error::PetscError;
use super::{Matrix, Petsc, ffi};
use crate::backends::local;
use crate::las::MatrixOps;

/// The slot of a dropped contribution.
const DROPPED: u32 = u32::MAX;

impl Matrix {
    /// Calls `visit(entry, value of the block)` for every pair of indices of a block whose entry this rank stores.
    #[inline(always)]
    fn scatter(
        &mut self,
        rows: &[i32],
        cols: &[i32],
        block: &[f64],
        mut visit: impl FnMut(&mut f64, f64),
    ) -> Result<(), PetscError> {
        if rows.len() * cols.len() != block.len() {
            return Err(size_differs(rows.len() * cols.len(), block.len()));
        }
        if cfg!(debug_assertions) {
            self.check_pattern(rows, cols)?;
        }
        let Self { layout, values, .. } = self;
        for (&row, values_of_row) in rows.iter().zip(block.chunks_exact(cols.len().max(1))) {
            let Some(own) = layout.row(row) else { continue };
            let mut next = 0;
            for (&column, &value) in cols.iter().zip(values_of_row) {
                let at = own.find_after(&mut next, column);
                if let Some(entry) = at.and_then(|at| values.get_mut(at)) {
                    visit(entry, value);
                }
            }
        }
        Ok(())
    }

    /// Returns an error, on all ranks alike, if a pair is not in the pattern. Only debug builds call it; release builds
    /// drop such pairs.
    fn check_pattern(&self, rows: &[i32], cols: &[i32]) -> Result<(), PetscError> {
        let (m, n) = (self.layout.row_numbers() as i32, self.layout.pattern.cols() as i32);
        debug_assert!(rows.iter().all(|&row| row < m), "a row of {rows:?} is not below {m}");
        debug_assert!(cols.iter().all(|&column| column < n), "a column of {cols:?} is not below {n}");
        let mut pairs = rows.iter().flat_map(|&row| cols.iter().map(move |&column| (row, column)));
        let Some((row, column)) = pairs.find(|&(row, column)| self.layout.is_outside(row, column)) else {
            return Ok(());
        };
        let text = format!("({row}, {column}) is not in the pattern");
        Err(PetscError::found(ffi::ERR_ARG_OUTOFRANGE, "", text))
    }

    /// Reads the entries of this rank, and zero for those of other ranks.
    #[inline(always)]
    fn read(&self, rows: &[i32], cols: &[i32], block: &mut [f64]) {
        for (&row, values) in rows.iter().zip(block.chunks_exact_mut(cols.len().max(1))) {
            if row < 0 {
                continue;
            }
            let (own, mut next) = (self.layout.row(row), 0);
            for (&column, value) in cols.iter().zip(values) {
                if column >= 0 {
                    let at = own.and_then(|own| own.find_after(&mut next, column));
                    *value = at.map_or(0.0, |at| self.values.get(at));
                }
            }
        }
    }

    /// Reads the entries of all ranks (collective); of this rank alone if each rank holds a part of the system.
    fn read_together(&self, context: &Context, rows: &[i32], cols: &[i32], block: &mut [f64]) {
        if context.parts().is_some() {
            return self.read(rows, cols, block);
        }
        let mut sum = vec![0.0; block.len()];
        self.read(rows, cols, &mut sum);
        context.sum(&mut sum);
        let pairs = rows.iter().flat_map(|&row| cols.iter().map(move |&column| (row, column)));
        for (((row, column), value), &sum) in pairs.zip(block).zip(&sum) {
            if row >= 0 && column >= 0 {
                *value = sum;
            }
        }
    }
}

/// Returns the error for a block whose size does not match its indices.
#[cold]
fn size_differs(pairs: usize, found: usize) -> PetscError {
    PetscError::found(ffi::ERR_ARG_SIZ, "", format!("{found} values for {pairs} pairs of row and column"))
}

impl MatrixOps<Petsc> for Matrix {
    #[inline(always)]
    fn shape(&self) -> (usize, usize) {
        (self.layout.pattern.rows(), self.layout.pattern.cols())
    }

    #[inline(always)]
    fn zero(&mut self) -> Result<(), PetscError> {
        for values in self.values.slices_mut() {
            local::zero(values);
        }
        Ok(())
    }

    #[inline(always)]
    fn zero_rows(&mut self, rows: &[i32]) -> Result<(), PetscError> {
        let Self { layout, values, .. } = self;
        for &row in rows {
            debug_assert!(row < layout.row_numbers() as i32, "row {row} of a matrix of {}", layout.pattern.rows());
            let Some(own) = layout.row(row) else { continue };
            for position in 0..own.columns.len() {
                if let Some(value) = values.get_mut(own.at(position)) {
                    *value = 0.0;
                }
            }
        }
        Ok(())
    }

    #[inline(always)]
    fn add(&mut self, rows: &[i32], cols: &[i32], block: &[f64]) -> Result<(), PetscError> {
        self.scatter(rows, cols, block, |entry, value| *entry += value)
    }

    #[inline(always)]
    fn set(&mut self, rows: &[i32], cols: &[i32], block: &[f64]) -> Result<(), PetscError> {
        self.scatter(rows, cols, block, |entry, value| *entry = value)
    }

    #[inline(always)]
    fn get(&self, rows: &[i32], cols: &[i32], block: &mut [f64]) -> Result<(), PetscError> {
        debug_assert_eq!(rows.len() * cols.len(), block.len(), "one value per pair of row and column");
        if self.context.is_single_rank() {
            self.read(rows, cols, block);
        } else {
            self.read_together(&self.context, rows, cols, block);
        }
        Ok(())
    }

    #[inline(always)]
    fn locate(&self, rows: &[i32], cols: &[i32], slots: &mut Vec<u32>) -> Result<(), PetscError> {
        slots.reserve(rows.len() * cols.len());
        for &row in rows {
            let own = self.layout.row(row);
            slots.extend(cols.iter().map(|&column| {
                debug_assert!(!self.layout.is_outside(row, column), "({row}, {column}) is not in the pattern");
                own.and_then(|own| own.find(column)).map_or(DROPPED, |at| at as u32)
            }));
        }
        Ok(())
    }

    #[inline(always)]
    fn add_at(&mut self, slots: &[u32], block: &[f64]) -> Result<(), PetscError> {
        debug_assert_eq!(slots.len(), block.len(), "one value per slot");
        for (&slot, &value) in slots.iter().zip(block) {
            match self.values.get_mut(slot as usize) {
                Some(entry) => *entry += value,
                None => debug_assert_eq!(slot, DROPPED, "slot {slot} is not of this pattern"),
            }
        }
        Ok(())
    }

    #[inline(always)]
    fn owns_any_row(&self, rows: &[i32]) -> bool {
        rows.iter().any(|&row| self.layout.row(row).is_some())
    }

    #[inline(always)]
    fn finish(&mut self) -> Result<(), PetscError> {
        self.assemble()
    }
}
