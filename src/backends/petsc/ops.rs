//! The hot verbs.
//!
//! Those of vectors work on the memory of the vector: `VecSetValues` does not look whether an index is in range, and would
//! write anywhere. `add` and `set` of matrices are `MatSetValues`, checked; `add_at` writes to the arrays of the matrix,
//! where `locate` has found the places.

use super::context::Context;
use super::error::{PetscError, check};
use super::{Matrix, Petsc, Vector, ffi};
use crate::backends::local;
use crate::las::{MatrixOps, VectorOps};

/// A slot of what is dropped.
const DROPPED: u32 = u32::MAX;

impl VectorOps<Petsc> for Vector {
    #[inline(always)]
    fn len(&self) -> usize {
        self.size()
    }

    #[inline(always)]
    fn zero(&mut self) -> Result<(), PetscError> {
        local::zero(self.as_mut_slice());
        Ok(())
    }

    #[inline(always)]
    fn add(&mut self, rows: &[i32], values: &[f64]) -> Result<(), PetscError> {
        local::add(self.as_mut_slice(), rows, values);
        Ok(())
    }

    #[inline(always)]
    fn set(&mut self, rows: &[i32], values: &[f64]) -> Result<(), PetscError> {
        local::set(self.as_mut_slice(), rows, values);
        Ok(())
    }

    #[inline(always)]
    fn get(&self, rows: &[i32], values: &mut [f64]) -> Result<(), PetscError> {
        local::get(self.as_slice(), rows, values);
        Ok(())
    }

    #[inline(always)]
    fn norm(&self) -> Result<f64, PetscError> {
        Ok(local::norm(self.as_slice()))
    }

    #[inline(always)]
    fn dot(&self, y: &Self) -> Result<f64, PetscError> {
        if self.size() != y.size() {
            return self.dot_by_petsc(y);
        }
        Ok(local::dot(self.as_slice(), y.as_slice()))
    }

    #[inline(always)]
    fn axpy(&mut self, a: f64, x: &Self) -> Result<(), PetscError> {
        if self.size() != x.size() {
            return self.axpy_by_petsc(a, x);
        }
        local::axpy(a, x.as_slice(), self.as_mut_slice());
        Ok(())
    }

    #[inline(always)]
    fn with_local<R>(&self, read: impl FnOnce(&[f64]) -> R) -> Result<R, PetscError> {
        Ok(read(self.as_slice()))
    }

    #[inline(always)]
    fn with_local_mut<R>(&mut self, write: impl FnOnce(&mut [f64]) -> R) -> Result<R, PetscError> {
        Ok(write(self.as_mut_slice()))
    }

    #[inline(always)]
    fn finish(&mut self) -> Result<(), PetscError> {
        Ok(())
    }
}

impl Matrix {
    /// `MatSetValues`.
    #[inline(always)]
    fn write(&mut self, rows: &[i32], cols: &[i32], block: &[f64], mode: i32) -> Result<(), PetscError> {
        let (m, n) = self.shape();
        let inside = |indices: &[i32], end: usize| indices.iter().fold(true, |all, &i| all & (i < end as i32));
        if rows.len() * cols.len() != block.len() || !inside(rows, m) || !inside(cols, n) {
            return self.write_what_fits(rows, cols, block, mode);
        }
        if cfg!(debug_assertions) {
            self.check_pattern(rows, cols)?;
        }
        self.turn_to(mode)?;
        let (raw, rows_len, cols_len) = (self.handle.raw(), rows.len() as i32, cols.len() as i32);
        // SAFETY: a live matrix that is borrowed alone; indices in range or negative, which PETSc drops; a value for each
        // pair. PETSc touches this matrix only.
        check(unsafe { ffi::MatSetValues(raw, rows_len, rows.as_ptr(), cols_len, cols.as_ptr(), block.as_ptr(), mode) })
    }

    /// Refuses what is not in the pattern, on all ranks alike; in debug builds, PETSc drops it in others.
    fn check_pattern(&self, rows: &[i32], cols: &[i32]) -> Result<(), PetscError> {
        let pattern = &self.layout.pattern;
        let mut pairs = rows.iter().flat_map(|&row| cols.iter().map(move |&column| (row, column)));
        let is_outside = |&(row, column): &(i32, i32)| {
            row >= 0 && column >= 0 && pattern.find(row as usize, column as usize).is_none()
        };
        let Some((row, column)) = pairs.find(is_outside) else { return Ok(()) };
        let text = format!("({row}, {column}) is not in the pattern");
        Err(PetscError::found(ffi::ERR_ARG_OUTOFRANGE, "MatSetValues", text))
    }

    /// Adding and setting do not mix: an assembly stands between.
    #[inline(always)]
    fn turn_to(&mut self, mode: i32) -> Result<(), PetscError> {
        if self.pending != mode {
            if self.pending != 0 {
                self.assemble(ffi::MAT_FLUSH_ASSEMBLY)?;
            }
            self.pending = mode;
        }
        Ok(())
    }

    /// Refuses a block of another size; drops indices out of range.
    #[cold]
    fn write_what_fits(&mut self, rows: &[i32], cols: &[i32], block: &[f64], mode: i32) -> Result<(), PetscError> {
        let (pairs, found) = (rows.len() * cols.len(), block.len());
        if pairs != found {
            let text = format!("{found} values for {pairs} pairs of row and column");
            return Err(PetscError::found(ffi::ERR_ARG_SIZ, "MatSetValues", text));
        }
        let (m, n) = self.shape();
        let fitting = |indices: &[i32], end: usize| -> Vec<i32> {
            debug_assert!(indices.iter().all(|&i| i < end as i32), "an index of {indices:?} is not below {end}");
            indices.iter().map(|&i| if (i as usize) < end { i } else { -1 }).collect()
        };
        self.write(&fitting(rows, m), &fitting(cols, n), block, mode)
    }

    /// The entries of this rank; zero for those of others.
    #[inline(always)]
    fn read(&self, rows: &[i32], cols: &[i32], block: &mut [f64]) {
        for (&row, values) in rows.iter().zip(block.chunks_exact_mut(cols.len().max(1))) {
            let own = self.layout.row(row);
            for (&column, value) in cols.iter().zip(values) {
                if row >= 0 && column >= 0 {
                    let at = own.and_then(|own| own.find(column));
                    *value = at.map_or(0.0, |at| self.values.get(at));
                }
            }
        }
    }

    /// The same, of all ranks together.
    fn read_together(&self, context: &Context, rows: &[i32], cols: &[i32], block: &mut [f64]) {
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
            debug_assert!(row < layout.pattern.rows() as i32, "row {row} of a matrix of {}", layout.pattern.rows());
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
        self.write(rows, cols, block, ffi::ADD_VALUES)
    }

    #[inline(always)]
    fn set(&mut self, rows: &[i32], cols: &[i32], block: &[f64]) -> Result<(), PetscError> {
        self.write(rows, cols, block, ffi::INSERT_VALUES)
    }

    #[inline(always)]
    fn get(&self, rows: &[i32], cols: &[i32], block: &mut [f64]) -> Result<(), PetscError> {
        debug_assert_eq!(rows.len() * cols.len(), block.len(), "one value a pair of row and column");
        if self.context.is_alone() {
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
                debug_assert!(
                    row < 0 || column < 0 || self.layout.pattern.find(row as usize, column as usize).is_some(),
                    "({row}, {column}) is not in the pattern"
                );
                own.and_then(|own| own.find(column)).map_or(DROPPED, |at| at as u32)
            }));
        }
        Ok(())
    }

    #[inline(always)]
    fn add_at(&mut self, slots: &[u32], block: &[f64]) -> Result<(), PetscError> {
        debug_assert_eq!(slots.len(), block.len(), "one value a slot");
        for (&slot, &value) in slots.iter().zip(block) {
            match self.values.get_mut(slot as usize) {
                Some(entry) => *entry += value,
                None => debug_assert_eq!(slot, DROPPED, "slot {slot} is not of this pattern"),
            }
        }
        Ok(())
    }

    #[inline(always)]
    fn keeps(&self, rows: &[i32]) -> bool {
        rows.iter().any(|&row| self.layout.row(row).is_some())
    }

    #[inline(always)]
    fn finish(&mut self) -> Result<(), PetscError> {
        self.assemble(ffi::MAT_FINAL_ASSEMBLY)
    }
}
