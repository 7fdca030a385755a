//! From `PetscInitialize` to `PetscFinalize`.

use std::ffi::CStr;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};

use mpi::environment::{Threading, Universe, initialize_with_threading, is_finalized};
use thiserror::Error;

use super::error::{PetscError, check, keep};
use super::ffi;

/// PETSc, initialized: MPI too, if nobody had.
///
/// Everything of this backend holds the session that it was made in. PETSc is finalized when the session and all that was
/// made in it are dropped, in whatever order, and MPI after it, if the session had initialized it. MPI starts only once in a
/// process: whoever wants several sessions, one after the other, initializes MPI himself.
///
/// PETSc's signal handlers stay out, and it prints no errors: they come back as [`PetscError`].
///
/// # Threads
/// PETSc is not made for threads: its log, its options and its communicators are one for all of them. All calls of PETSc (making,
/// finishing, destroying, multiplying, solving) wait for one another, whatever threads they come from, so that any thread may
/// use what it owns; the hot verbs call nothing and wait for nothing. On several
/// ranks all ranks must make these calls in the same order, which only one thread a rank can promise. Whoever initializes
/// MPI himself and lets several threads use PETSc asks MPI for [`Threading::Serialized`] at least.
#[derive(Clone, Debug)]
pub struct Session(#[allow(dead_code, reason = "held until the last is dropped")] Arc<Running>);

/// Why there is no session.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum SessionError {
    /// There is one already.
    #[error("a PETSc session is running in this process: share it, or drop it and all that was made in it")]
    Running,
    /// Somebody else called `PetscInitialize`.
    #[error("PETSc was initialized by another part of this program")]
    Foreign,
    /// MPI has ended, and cannot start again.
    #[error("MPI was finalized in this process, and starts only once: keep the session, or initialize MPI yourself")]
    Ended,
    /// PETSc did not start, or refuses the communicator.
    #[error("{0}")]
    Petsc(#[from] PetscError),
}

#[derive(Debug)]
struct Running {
    /// Dropped after PETSc was finalized.
    _universe: Option<Mpi>,
}

struct Mpi(#[allow(dead_code, reason = "held to be dropped")] Universe);

impl std::fmt::Debug for Mpi {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Mpi")
    }
}

/// One call of PETSc or MPI at a time.
static CALLS: Mutex<()> = Mutex::new(());

/// Whether a session runs; held while one starts or ends.
static RUNS: Mutex<bool> = Mutex::new(false);

/// The session that runs.
static CURRENT: Mutex<Weak<Running>> = Mutex::new(Weak::new());

/// Waits for all other calls; what was left by a panic is no more broken than without it.
pub(super) fn lock() -> MutexGuard<'static, ()> {
    CALLS.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A call of PETSc, alone. Such calls do not nest.
pub(super) fn call(function: impl FnOnce() -> ffi::Code) -> Result<(), PetscError> {
    let _alone = lock();
    check(function())
}

impl Session {
    /// Initializes MPI, if nobody has, and PETSc.
    ///
    /// PETSc reads its options from the environment variable `PETSC_OPTIONS` and from `.petscrc`, not from the arguments of
    /// the program.
    ///
    /// # Errors
    /// [`SessionError`].
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

    /// The session that runs in this process, if there is one: for code that does not know who began it.
    #[must_use]
    pub fn current() -> Option<Self> {
        CURRENT.lock().unwrap_or_else(PoisonError::into_inner).upgrade().map(Self)
    }

    /// The version of PETSc that the crate was built with.
    #[must_use]
    pub fn version() -> &'static str {
        env!("BIOTISSUE_PETSC_VERSION")
    }

    /// The packages that this PETSc was built with, as far as solvers depend on them.
    #[must_use]
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
                0 => ffi::PetscPushErrorHandler(Some(keep), std::ptr::null_mut()),
                code => code,
            }
        }
    })
}

impl Drop for Running {
    fn drop(&mut self) {
        let mut runs = RUNS.lock().unwrap_or_else(PoisonError::into_inner);
        // Where the program has finalized MPI before, PETSc cannot be finalized any more.
        if !is_finalized() {
            let _alone = lock();
            // SAFETY: initialized by `Session::new`; every object of the session held it, so that none is left. There is
            // nobody to report an error to.
            unsafe {
                ffi::PetscPopErrorHandler();
                ffi::PetscFinalize();
            }
        }
        *runs = false;
    }
}
