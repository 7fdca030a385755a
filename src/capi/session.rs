//! The PETSc session of a C program, which all its contexts share: it starts with the first context and ends with the
//! last.

use mpi::environment::is_initialized;
use mpi::ffi::RSMPI_Comm_f2c;
use mpi::raw::FromRaw;
use mpi::topology::SimpleCommunicator;

use super::handles::Failure;
use super::{LAS_BACKEND_ERROR, LAS_UNSUPPORTED};
use crate::backends::petsc::{Context, Session};

/// Creates a context on all MPI ranks; initializes MPI if it is not yet initialized.
pub(super) fn world_context() -> Result<Context, Failure> {
    let session = session()?;
    Ok(Context::new(&session, &SimpleCommunicator::world()))
}

/// Creates a context on the ranks of a communicator of the caller.
///
/// # Safety
/// The handle belongs to a communicator, and MPI is initialized and not finalized.
pub(super) unsafe fn context_on(comm: i32) -> Result<Context, Failure> {
    if !is_initialized() {
        return Err(Failure::new(LAS_UNSUPPORTED, "there is no communicator before MPI_Init"));
    }
    let session = session()?;
    // SAFETY: MPI is initialized; the caller ensures that the handle is valid. `ManuallyDrop` prevents the
    // caller's communicator from being freed.
    let comm = std::mem::ManuallyDrop::new(unsafe { SimpleCommunicator::from_raw(RSMPI_Comm_f2c(comm)) });
    Ok(Context::new(&session, &*comm))
}

/// Returns the current session, or starts one.
fn session() -> Result<Session, Failure> {
    match Session::current() {
        Some(session) => Ok(session),
        None => Session::new().map_err(|error| Failure::new(LAS_BACKEND_ERROR, error.to_string())),
    }
}
