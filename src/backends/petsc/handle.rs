//! Owned PETSc objects, each with the session that it belongs to.

use std::fmt;

use mpi::environment::is_finalized;

use super::error::PetscError;
use super::ffi;
use super::session::{Session, call, lock};

/// A type of PETSc objects.
pub(super) trait Object: Sized {
    /// Destroys an object.
    ///
    /// # Safety
    /// The object is live and has no other user.
    unsafe fn destroy(raw: *mut *mut Self) -> ffi::Code;
}

macro_rules! object {
    ($($kind:ty: $destroy:ident),*) => {$(
        impl Object for $kind {
            unsafe fn destroy(raw: *mut *mut Self) -> ffi::Code {
                // SAFETY: the caller's promise.
                unsafe { ffi::$destroy(raw) }
            }
        }
    )*};
}

object!(
    ffi::_p_Vec: VecDestroy, ffi::_p_Mat: MatDestroy, ffi::_p_KSP: KSPDestroy,
    ffi::_p_MatNullSpace: MatNullSpaceDestroy
);

/// An object that is destroyed with this handle, and the session that must outlive it.
pub(super) struct Handle<T: Object> {
    raw: *mut T,
    _session: Session,
}

// SAFETY: an object is not bound to a thread. A lock serializes all calls of PETSc (`session::call`), since each may
// use state shared by all objects, such as the log; entries are read and written without any call, through the memory
// of an object that no other thread can reach, since a handle is not `Sync`.
unsafe impl<T: Object> Send for Handle<T> {}

impl<T: Object> Handle<T> {
    /// Owns the object that `create` makes; `create` writes the object to the pointer that it receives.
    pub(super) fn new(session: &Session, create: impl FnOnce(*mut *mut T) -> ffi::Code) -> Result<Self, PetscError> {
        let mut raw = std::ptr::null_mut();
        call(|| create(&raw mut raw))?;
        Ok(Self { raw, _session: session.clone() })
    }

    /// Returns the object, which lives as long as the handle.
    #[inline(always)]
    pub(super) fn raw(&self) -> *mut T {
        self.raw
    }
}

impl<T: Object> fmt::Debug for Handle<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:?}", self.raw)
    }
}

impl<T: Object> Drop for Handle<T> {
    fn drop(&mut self) {
        // If the program has already finalized MPI, the object is leaked.
        if !self.raw.is_null() && !is_finalized() {
            let _alone = lock();
            // SAFETY: live, and this handle was the only one. An error cannot be reported here.
            unsafe { T::destroy(&raw mut self.raw) };
        }
    }
}
