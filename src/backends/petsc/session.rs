//! The session: PETSc from `PetscInitialize` to `PetscFinalize`, and the lock around its calls.

use std::ffi::CStr;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};

use mpi::environment::{Threading, Universe, initialize_with_threading, is_finalized};
use thiserror::Error;

use super::error::{PetscError, check, error_handler};
use super::ffi;

/// An initialized PETSc, with MPI initialized too if the program had not done so.
///
/// Every object of this backend holds the session in which it was made. PETSc is finalized when the session and all
/// objects made in it are dropped, in any order; then MPI is finalized if the session had initialized it. MPI can start
/// only once per process: a program that needs several sessions, one after the other, must initialize MPI itself.
///
/// PETSc installs no signal handlers and prints no errors; they are returned as [`PetscError`].
///
/// # Threads
/// PETSc is not thread-safe: its log, options and communicators are shared by all threads. Therefore a lock serializes
/// the calls of PETSc (creating, finishing, destroying, multiplying, solving) from all threads, so that any thread may
/// use the objects that it owns; the assembly operations neither call PETSc nor wait. On several ranks, all ranks must
/// make these calls in the same order, which requires that only one thread per rank makes them. A program that
/// initializes MPI itself and uses PETSc from several threads must request at least [`Threading::Serialized`].
#[derive(Clone, Debug)]
pub struct Session(#[allow(dead_code, reason = "held until the last is dropped")] Arc<Running>);

/// The reason why a session could not start.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum SessionError {
    /// A session is already running.
    #[error("a PETSc session is running in this process: share it, or drop it and all that was made in it")]
    Running,
    /// Another part of the program called `PetscInitialize`.
    #[error("PETSc was initialized by another part of this program")]
    Foreign,
    /// MPI was finalized and cannot start again.
    #[error("MPI was finalized in this process, and starts only once: keep the session, or initialize MPI yourself")]
    Ended,
    /// PETSc did not start, or rejects the communicator.
    #[error(transparent)]
    Petsc(#[from] PetscError),
}

#[derive(Debug)]
struct Running {
    /// Dropped after PETSc is finalized.
    _universe: Option<Mpi>,
}

struct Mpi(#[allow(dead_code, reason = "held to be dropped")] Universe);

impl std::fmt::Debug for Mpi {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Mpi")
    }
}

/// Serializes the calls of PETSc and MPI.
static CALLS: Mutex<()> = Mutex::new(());

/// True while a session runs; locked while one starts or ends.
static RUNS: Mutex<bool> = Mutex::new(false);

/// The running session.
static CURRENT: Mutex<Weak<Running>> = Mutex::new(Weak::new());

/// Locks out all other calls. A panic under this lock leaves no inconsistent state, so poisoning is ignored.
pub(super) fn lock() -> MutexGuard<'static, ()> {
    CALLS.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Makes one call of PETSc under the lock. Such calls must not nest.
pub(super) fn call(function: impl FnOnce() -> ffi::Code) -> Result<(), PetscError> {
    let _alone = lock();
    check(function())
}

impl Session {
    /// Initializes MPI, if the program has not done so, and PETSc.
    ///
    /// PETSc reads its options from the environment variable `PETSC_OPTIONS` and from `.petscrc`, not from the
    /// arguments of the program.
    ///
    /// # Errors
    /// Returns [`SessionError`] if a session is running, if MPI was finalized, if the program initialized PETSc
    /// elsewhere, or if PETSc fails.
    pub fn new() -> Result<Self, SessionError> {
        let mut runs = RUNS.lock().unwrap_or_else(PoisonError::into_inner);
        if *runs {
            return Err(SessionError::Running);
        }
        if is_finalized() {
            return Err(SessionError::Ended);
        }
        let mut foreign = ffi::FALSE;
        // SAFETY: may be called at any time, and writes one flag.
        call(|| unsafe { ffi::PetscInitialized(&raw mut foreign) })?;
        if foreign != ffi::FALSE {
            return Err(SessionError::Foreign);
        }
        let universe = initialize_with_threading(Threading::Serialized).map(|(universe, _)| Mpi(universe));
        start()?;
        *runs = true;
        let running = Arc::new(Running { _universe: universe });
        *CURRENT.lock().unwrap_or_else(PoisonError::into_inner) = Arc::downgrade(&running);
        Ok(Self(running))
    }

    /// Returns the session that runs in this process, if there is one, for code that did not start it.
    pub fn current() -> Option<Self> {
        CURRENT.lock().unwrap_or_else(PoisonError::into_inner).upgrade().map(Self)
    }

    /// Returns the version of PETSc with which the crate was built.
    pub fn version() -> &'static str {
        env!("BIOTISSUE_PETSC_VERSION")
    }

    /// Returns the solver packages with which PETSc was built.
    pub fn packages() -> Vec<&'static str> {
        let known = [
            ("mumps", cfg!(petsc_has = "mumps")),
            ("superlu_dist", cfg!(petsc_has = "superlu_dist")),
            ("hypre", cfg!(petsc_has = "hypre")),
            ("suitesparse", cfg!(petsc_has = "suitesparse")),
        ];
        known.into_iter().filter_map(|(name, has)| has.then_some(name)).collect()
    }
}

fn start() -> Result<(), PetscError> {
    const NO_SIGNALS: &CStr = c"-no_signal_handler";
    call(|| {
        // SAFETY: MPI is initialized and PETSc is not; options may be set before that. The handler outlives PETSc.
        unsafe {
            match ffi::PetscOptionsSetValue(std::ptr::null_mut(), NO_SIGNALS.as_ptr(), c"true".as_ptr()) {
                0 => {}
                code => return code,
            }
            match ffi::PetscInitializeNoArguments() {
                0 => ffi::PetscPushErrorHandler(Some(error_handler), std::ptr::null_mut()),
                code => code,
            }
        }
    })
}

impl Drop for Running {
    fn drop(&mut self) {
        let mut runs = RUNS.lock().unwrap_or_else(PoisonError::into_inner);
        // If the program has already finalized MPI, PETSc can no longer be finalized.
        if !is_finalized() {
            let _alone = lock();
            // SAFETY: initialized by `Session::new`; every PETSc object holds its session, so no object exists
            // any more. An error cannot be reported here.
            unsafe {
                ffi::PetscPopErrorHandler();
                ffi::PetscFinalize();
            }
        }
        *runs = false;
    }
}
