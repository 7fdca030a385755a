//! Vectors of which each rank holds its own entries, followed by copies of the entries of its ghost rows.
//!
//! They are PETSc's vectors with ghosts, so that products and solvers read and write them without copying.

use std::sync::Arc;

use super::context::Context;
use super::error::PetscError;
use super::ffi;
use super::handle::Handle;
use super::rows::Parts;
use super::session::call;
use super::vector::Vector;
use crate::backends::local;

impl Vector {
    /// Creates a vector of zeros in a system of which each rank holds a part.
    pub(super) fn zeros_of_part(context: &Context, parts: &Arc<Parts>, len: usize) -> Result<Self, PetscError> {
        let rows = parts.rows();
        if len != rows.own.len() {
            let text = format!("a vector of {len} entries on a rank with {} own rows", rows.own.len());
            return Err(PetscError::found(ffi::ERR_ARG_SIZ, "", text));
        }
        let Some(template) = parts.template() else { return Self::whole_of(context, context.comm(), len) };
        // SAFETY: a live vector, which the lock of this call protects.
        let handle = Handle::new(context.session(), |out| unsafe { ffi::VecDuplicate(template, out) })?;
        let values = array_with_ghosts(handle.raw())?;
        let held = rows.local();
        // Both numbers are below 2^31.
        let extent = 1 << 62 | (held as u64) << 31 | len as u64;
        let mut vector = Self { handle, values, len, held, whole: 0, extent, parts: Some(Arc::clone(parts)) };
        vector.held_mut().fill(0.0);
        Ok(vector)
    }

    /// Copies the entries of the ghost rows from their owners; collective. Does nothing if this rank holds the whole
    /// vector.
    pub(super) fn update_ghosts(&mut self) -> Result<(), PetscError> {
        if self.parts.is_none() {
            return Ok(());
        }
        let raw = self.handle.raw();
        let (insert, forward) = (ffi::INSERT_VALUES, ffi::SCATTER_FORWARD);
        // SAFETY: a live vector with ghosts.
        call(|| unsafe { ffi::VecGhostUpdateBegin(raw, insert, forward) })?;
        // SAFETY: begun just now.
        call(|| unsafe { ffi::VecGhostUpdateEnd(raw, insert, forward) })
    }

    /// Returns the norm of a vector that is zero, out of the range of squares, or of which each rank holds a part.
    #[cold]
    #[inline(never)]
    pub(super) fn norm_together(&self) -> Result<f64, PetscError> {
        let Some(parts) = &self.parts else { return Ok(local::scaled_norm(self.as_slice())) };
        let mut squares = [local::dot(self.as_slice(), self.as_slice())];
        parts.sum(&mut squares);
        if local::is_in_range(squares[0]) {
            return Ok(squares[0].sqrt());
        }
        let of_ranks = parts.comm().all_gather(&[local::scaled_norm(self.as_slice())]);
        Ok(local::scaled_norm(&of_ranks))
    }

    /// Returns the dot product of vectors of which each rank holds a part, or PETSc's error for vectors of different
    /// lengths.
    #[cold]
    #[inline(never)]
    pub(super) fn dot_together(&self, y: &Self) -> Result<f64, PetscError> {
        match (&self.parts, &y.parts) {
            (None, None) => self.dot_by_petsc(y),
            (Some(parts), Some(_)) => {
                // The second number makes the outcome the same on all ranks if the sizes differ on some.
                let differs = self.len != y.len;
                let dot = if differs { 0.0 } else { local::dot(self.as_slice(), y.as_slice()) };
                let mut sums = [dot, f64::from(u8::from(differs))];
                parts.sum(&mut sums);
                if sums[1] > 0.0 { Err(rows_differ()) } else { Ok(sums[0]) }
            }
            _ => Err(rows_differ()),
        }
    }

    /// Returns the error for vectors of different sizes in `axpy`.
    #[cold]
    #[inline(never)]
    pub(super) fn axpy_together(&mut self, a: f64, x: &Self) -> Result<(), PetscError> {
        if self.parts.is_some() || x.parts.is_some() { Err(rows_differ()) } else { self.axpy_by_petsc(a, x) }
    }
}

/// Returns the error for vectors that hold different rows.
fn rows_differ() -> PetscError {
    PetscError::found(ffi::ERR_ARG_SIZ, "", "incompatible vectors: they hold different rows of this rank".to_owned())
}

/// Returns the array of a vector with ghosts: its own entries, then those of the ghosts. It does not move.
fn array_with_ghosts(vector: ffi::Vec) -> Result<*mut f64, PetscError> {
    let (mut local, mut values) = (std::ptr::null_mut(), std::ptr::null_mut());
    // SAFETY: a live vector with ghosts, as in all that follows.
    call(|| unsafe { ffi::VecGhostGetLocalForm(vector, &raw mut local) })?;
    call(|| unsafe { ffi::VecGetArray(local, &raw mut values) })?;
    let mut lent = values;
    call(|| unsafe { ffi::VecRestoreArray(local, &raw mut lent) })?;
    call(|| unsafe { ffi::VecGhostRestoreLocalForm(vector, &raw mut local) })?;
    Ok(values)
}
