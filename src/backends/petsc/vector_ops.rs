//! The vector operations of assembly.
//!
//! They work on the array of the vector. On a rank that holds the whole vector, they execute the instructions of loops
//! over that array; the fields `whole` and `extent` lead parts of a vector into branches that such loops have
//! anyway.

use super::error::PetscError;
use super::{Petsc, Vector};
use crate::backends::local;
use crate::las::VectorOps;

impl VectorOps<Petsc> for Vector {
    /// Returns the number of own entries.
    #[inline(always)]
    fn len(&self) -> usize {
        self.len
    }

    #[inline(always)]
    fn zero(&mut self) -> Result<(), PetscError> {
        local::zero(self.held_mut());
        Ok(())
    }

    #[inline(always)]
    fn add(&mut self, rows: &[i32], values: &[f64]) -> Result<(), PetscError> {
        let held = self.held;
        local::add_below(held, self.as_mut_slice(), rows, values);
        Ok(())
    }

    #[inline(always)]
    fn set(&mut self, rows: &[i32], values: &[f64]) -> Result<(), PetscError> {
        let held = self.held;
        local::set_below(held, self.as_mut_slice(), rows, values);
        Ok(())
    }

    #[inline(always)]
    fn get(&self, rows: &[i32], values: &mut [f64]) -> Result<(), PetscError> {
        local::get(self.held(), rows, values);
        Ok(())
    }

    #[inline(always)]
    fn norm(&self) -> Result<f64, PetscError> {
        let squares = local::dot(self.whole(), self.whole());
        if local::is_in_range(squares) { Ok(squares.sqrt()) } else { self.norm_together() }
    }

    #[inline(always)]
    fn dot(&self, y: &Self) -> Result<f64, PetscError> {
        if self.whole as u64 != y.extent {
            return self.dot_together(y);
        }
        // SAFETY: `whole` is not the extent of a part, and thus the number of entries of `y`. The compiler knows by
        // this that both slices have one length.
        Ok(local::dot(self.whole(), unsafe { y.first(self.whole) }))
    }

    #[inline(always)]
    fn axpy(&mut self, a: f64, x: &Self) -> Result<(), PetscError> {
        if x.extent != self.extent {
            return self.axpy_together(a, x);
        }
        // SAFETY: vectors of one extent hold the same number of entries.
        local::axpy(a, unsafe { x.first(self.held) }, self.held_mut());
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
        if self.extent >> 62 == 0 { Ok(()) } else { self.update_ghosts() }
    }
}
