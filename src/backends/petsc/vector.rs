//! The vector: whole on every rank, or a part on each.

use std::sync::Arc;

use mpi::ffi::MPI_Comm;

use super::context::Context;
use super::error::PetscError;
use super::ffi;
use super::handle::Handle;
use super::rows::Parts;
use super::session::call;

/// A vector in memory of PETSc.
///
/// With [`Distribution::Copies`](super::Distribution::Copies), every rank stores the whole vector and writes all
/// entries, so that reading, norms and dot products need no communication and are bitwise identical on all ranks.
///
/// With [`Distribution::Parts`](super::Distribution::Parts), every rank stores its own entries and copies of those of
/// its ghost rows ([`RankRows`](crate::las::RankRows)). Norms and dot products are collective and bitwise identical on
/// all ranks. The slices contain the own entries.
#[derive(Debug)]
pub struct Vector {
    pub(super) handle: Handle<ffi::_p_Vec>,
    pub(super) values: *mut f64,
    /// The number of own entries, which come first.
    pub(super) len: usize,
    /// The number of own entries and of ghosts.
    pub(super) held: usize,
    /// The number of entries if this rank holds all of them, else 0.
    pub(super) whole: usize,
    /// `whole` if this rank holds all entries. Else a number that is `whole` of no vector, and equal for vectors with
    /// the same numbers of own entries and ghosts.
    pub(super) extent: u64,
    /// `None` if this rank holds all entries.
    pub(super) parts: Option<Arc<Parts>>,
}

// SAFETY: `values` is memory of the vector that `handle` owns, reached in no other way.
unsafe impl Send for Vector {}

impl Vector {
    pub(super) fn zeros(context: &Context, len: usize) -> Result<Self, PetscError> {
        if let Some(parts) = context.parts() {
            return Self::zeros_of_part(context, parts, len);
        }
        // SAFETY: a constant of MPI, `MPI_COMM_SELF`, which exists for the whole session.
        let alone = unsafe { mpi::ffi::RSMPI_COMM_SELF };
        // Vectors and matrices in one operation must share a communicator.
        Self::whole_of(context, if context.is_single_rank() { context.comm() } else { alone }, len)
    }

    /// Creates a vector of zeros that this rank holds alone, on a communicator of one rank.
    pub(super) fn whole_of(context: &Context, comm: MPI_Comm, len: usize) -> Result<Self, PetscError> {
        let count = count(len)?;
        // SAFETY: PETSc is initialized; the communicator is live and of one rank.
        let handle = Handle::new(context.session(), |out| unsafe { ffi::VecCreateSeq(comm, count, out) })?;
        let values = std::ptr::null_mut();
        let mut vector = Self { handle, values, len, held: len, whole: len, extent: len as u64, parts: None };
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

    /// Returns the first `len` entries.
    ///
    /// # Safety
    /// The vector holds that many.
    #[inline(always)]
    pub(super) unsafe fn first(&self, len: usize) -> &[f64] {
        if len == 0 {
            return &[];
        }
        // SAFETY: `len` numbers that the vector owns, written only through `&mut self`.
        unsafe { std::slice::from_raw_parts(self.values, len) }
    }

    /// Returns the first `len` entries, mutably.
    ///
    /// # Safety
    /// The vector holds that many.
    #[inline(always)]
    unsafe fn first_mut(&mut self, len: usize) -> &mut [f64] {
        if len == 0 {
            return &mut [];
        }
        // SAFETY: `len` numbers that the vector owns, and `self` is borrowed exclusively.
        unsafe { std::slice::from_raw_parts_mut(self.values, len) }
    }

    /// Returns the entries (of this rank).
    #[inline(always)]
    pub fn as_slice(&self) -> &[f64] {
        // SAFETY: `len` is at most `held`.
        unsafe { self.first(self.len) }
    }

    /// Returns the entries (of this rank), mutably.
    #[inline(always)]
    pub fn as_mut_slice(&mut self) -> &mut [f64] {
        // SAFETY: `len` is at most `held`.
        unsafe { self.first_mut(self.len) }
    }

    /// Returns the entries if this rank holds all of them, else nothing.
    #[inline(always)]
    pub(super) fn whole(&self) -> &[f64] {
        // SAFETY: `whole` is at most `held`.
        unsafe { self.first(self.whole) }
    }

    /// Returns the own entries and those of the ghosts.
    #[inline(always)]
    pub(super) fn held(&self) -> &[f64] {
        // SAFETY: the array has `held` entries.
        unsafe { self.first(self.held) }
    }

    /// Returns the own entries and those of the ghosts, mutably.
    #[inline(always)]
    pub(super) fn held_mut(&mut self) -> &mut [f64] {
        // SAFETY: the array has `held` entries.
        unsafe { self.first_mut(self.held) }
    }
}

/// Converts a size for PETSc. Returns an error if it exceeds 32-bit indices.
pub(super) fn count(len: usize) -> Result<i32, PetscError> {
    i32::try_from(len)
        .map_err(|_| PetscError::found(ffi::ERR_ARG_OUTOFRANGE, "", format!("{len} exceeds 32-bit indices")))
}
