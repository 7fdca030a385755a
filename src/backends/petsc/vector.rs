//! The vector, stored whole on every rank.

use super::context::Context;
use super::error::PetscError;
use super::ffi;
use super::handle::Handle;
use super::session::call;

/// A vector that every rank stores whole, in memory of PETSc.
///
/// Every rank writes all entries, so that reading, norms and dot products need no communication and are bitwise
/// identical on all ranks.
#[derive(Debug)]
pub struct Vector {
    handle: Handle<ffi::_p_Vec>,
    values: *mut f64,
    len: usize,
}

// SAFETY: `values` is memory of the vector that `handle` owns, reached in no other way.
unsafe impl Send for Vector {}

impl Vector {
    pub(super) fn zeros(context: &Context, len: usize) -> Result<Self, PetscError> {
        // SAFETY: a constant of MPI, `MPI_COMM_SELF`, which exists for the whole session.
        let alone = unsafe { mpi::ffi::RSMPI_COMM_SELF };
        // Vectors and matrices in one operation must share a communicator.
        let comm = if context.is_single_rank() { context.comm() } else { alone };
        let count = count(len)?;
        // SAFETY: PETSc is initialized; the communicator is live and of one rank.
        let handle = Handle::new(context.session(), |out| unsafe { ffi::VecCreateSeq(comm, count, out) })?;
        let mut vector = Self { handle, values: std::ptr::null_mut(), len };
        vector.values = vector.borrow()?;
        vector.as_mut_slice().fill(0.0);
        Ok(vector)
    }

    /// Returns the array, which does not move because this crate never replaces it. Borrowing the array informs PETSc
    /// that its values may have changed.
    fn borrow(&self) -> Result<*mut f64, PetscError> {
        let (raw, mut values) = (self.handle.raw(), std::ptr::null_mut());
        // SAFETY: a live vector.
        call(|| unsafe { ffi::VecGetArray(raw, &raw mut values) })?;
        let mut lent = values;
        // SAFETY: borrowed just above.
        call(|| unsafe { ffi::VecRestoreArray(raw, &raw mut lent) })?;
        Ok(values)
    }

    /// Returns the `Vec` and informs PETSc that its values may have changed.
    pub(super) fn raw(&self) -> Result<ffi::Vec, PetscError> {
        self.borrow()?;
        Ok(self.handle.raw())
    }

    /// Calls `VecDot` on vectors of different lengths to obtain PETSc's error.
    #[cold]
    pub(super) fn dot_by_petsc(&self, y: &Self) -> Result<f64, PetscError> {
        let (x, y, mut dot) = (self.raw()?, y.raw()?, 0.0);
        // SAFETY: live vectors.
        call(|| unsafe { ffi::VecDot(x, y, &raw mut dot) })?;
        Ok(dot)
    }

    /// Calls `VecAXPY` for the same reason.
    #[cold]
    pub(super) fn axpy_by_petsc(&mut self, a: f64, x: &Self) -> Result<(), PetscError> {
        let (x, y) = (x.raw()?, self.raw()?);
        // SAFETY: live vectors, two of them.
        call(|| unsafe { ffi::VecAXPY(y, a, x) })
    }

    /// Returns the number of entries, without the branch of [`Vector::as_slice`] that empty vectors need.
    #[inline(always)]
    pub(super) fn size(&self) -> usize {
        self.len
    }

    /// Returns the entries.
    #[inline(always)]
    pub fn as_slice(&self) -> &[f64] {
        if self.len == 0 {
            return &[];
        }
        // SAFETY: `len` numbers that the vector owns, written only through `&mut self`.
        unsafe { std::slice::from_raw_parts(self.values, self.len) }
    }

    /// Returns the entries, mutably.
    #[inline(always)]
    pub fn as_mut_slice(&mut self) -> &mut [f64] {
        if self.len == 0 {
            return &mut [];
        }
        // SAFETY: `len` numbers that the vector owns, and `self` is borrowed exclusively.
        unsafe { std::slice::from_raw_parts_mut(self.values, self.len) }
    }
}

/// Converts a size for PETSc. Returns an error if it exceeds 32-bit indices.
pub(super) fn count(len: usize) -> Result<i32, PetscError> {
    i32::try_from(len)
        .map_err(|_| PetscError::found(ffi::ERR_ARG_OUTOFRANGE, "", format!("{len} exceeds 32-bit indices")))
}
