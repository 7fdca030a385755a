//! Objects of PETSc, each with the session that it lives in.

use std::fmt;

use mpi::environment::is_finalized;

use super::error::PetscError;
use super::ffi;
use super::session::{Session, call, lock};

/// A kind of object.
pub(super) trait Object: Sized {
    /// Destroys one.
    ///
    /// # Safety
    /// The object is live and nobody else uses it.
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

object!(ffi::_p_Vec: VecDestroy, ffi::_p_Mat: MatDestroy, ffi::_p_KSP: KSPDestroy);

/// An object that is destroyed with this handle, and the session that must not end before it.
pub(super) struct Handle<T: Object> {
    raw: *mut T,
    _session: Session,
}

// SAFETY: an object belongs to no thread. All calls of PETSc wait for one another (`session::call`), since each may touch what
// all objects share, such as the log; entries are read and written without any call, through the memory of an object that no
// other thread can reach, since a handle is not `Sync`.
unsafe impl<T: Object> Send for Handle<T> {}

impl<T: Object> Handle<T> {
    /// What `create` makes; it writes the object to the place that it is given.
    pub(super) fn new(session: &Session, create: impl FnOnce(*mut *mut T) -> ffi::Code) -> Result<Self, PetscError> {
        let mut raw = std::ptr::null_mut();
        call(|| create(&raw mut raw))?;
        Ok(Self { raw, _session: session.clone() })
    }

    /// The object, live as long as the handle.
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
        // Where the program has finalized MPI before, the object is left to the end of the process.
        if !self.raw.is_null() && !is_finalized() {
            let _alone = lock();
            // SAFETY: live, and this handle was the only one. There is nobody to report an error to.
            unsafe { T::destroy(&raw mut self.raw) };
        }
    }
}
