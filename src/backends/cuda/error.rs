//! The errors of the device, its driver and its libraries.

use cudarc::driver::DriverError;
use cudarc::driver::sys::CUresult;
use thiserror::Error;

/// Error of a device, of its driver or of a CUDA library. It is a pointer, so that a `Result` without a value fits into a
/// register, and verbs that can fail cost no more than others.
#[derive(Clone, Debug, Error)]
#[error(transparent)]
pub struct CudaError(Box<CudaErrorKind>);

/// What failed.
#[derive(Clone, Debug, Error)]
#[non_exhaustive]
pub enum CudaErrorKind {
    /// A shared library is not installed or not found by the loader.
    #[error("{library} was not found: install {package}, and add the directory of the library to LD_LIBRARY_PATH")]
    MissingLibrary {
        /// The name of the shared library.
        library: &'static str,
        /// What contains the library.
        package: &'static str,
    },
    /// A shared library lacks a function.
    #[error("{library} is too old, it has no {function}: install a newer version of {package}")]
    OldLibrary {
        /// The name of the shared library.
        library: &'static str,
        /// The function.
        function: &'static str,
        /// What contains the library.
        package: &'static str,
    },
    /// The machine has no such device.
    #[error("there is no CUDA device number {ordinal}; the driver lists {count} devices, numbered from 0")]
    NoDevice {
        /// The requested number.
        ordinal: usize,
        /// How many devices the driver lists.
        count: usize,
    },
    /// The driver reports an error.
    #[error("the CUDA driver failed ({action}): {error}")]
    Driver {
        /// What was asked of the driver.
        action: &'static str,
        /// The error of the driver.
        error: DriverError,
    },
    /// A kernel does not compile; this is a defect of this crate or a compiler that is too old.
    #[error("NVRTC cannot compile a kernel for {architecture}: {log}")]
    Compile {
        /// The architecture of the device.
        architecture: String,
        /// The messages of the compiler.
        log: String,
    },
    /// A CUDA library reports an error.
    #[error("{library} failed ({action}): {status}")]
    Library {
        /// The name of the library.
        library: &'static str,
        /// What was asked of it.
        action: &'static str,
        /// The status that it returned.
        status: String,
    },
}

/// Returns an error if a library, which `cudarc` has loaded, lacks one of these functions: a call of it would panic.
macro_rules! check_functions {
    ($loaded:expr, $library:expr, $package:expr, $functions:expr) => {{
        use $crate::backends::cuda::{CudaError, CudaErrorKind};
        // SAFETY: only the presence of the functions is tested.
        let is_missing = |name: &&str| unsafe { $loaded.get::<unsafe extern "C" fn()>(name.as_bytes()) }.is_err();
        let missing = $functions.into_iter().find(is_missing);
        let error = |function| CudaErrorKind::OldLibrary { library: $library, function, package: $package };
        missing.map_or(Ok(()), |function| Err(CudaError::from(error(function))))
    }};
}

pub(super) use check_functions;

impl From<CudaErrorKind> for CudaError {
    fn from(kind: CudaErrorKind) -> Self {
        Self(Box::new(kind))
    }
}

impl CudaError {
    /// Returns what failed.
    pub fn kind(&self) -> &CudaErrorKind {
        &self.0
    }

    /// Returns true if the memory of the device does not suffice.
    pub fn is_out_of_memory(&self) -> bool {
        matches!(*self.0, CudaErrorKind::Driver { error: DriverError(CUresult::CUDA_ERROR_OUT_OF_MEMORY), .. })
    }

    /// The error of a device whose memory does not suffice.
    #[cfg(test)]
    pub(crate) fn out_of_memory() -> Self {
        Self::of("allocate memory")(DriverError(CUresult::CUDA_ERROR_OUT_OF_MEMORY))
    }

    /// Adds to an error of the driver what was asked of it.
    pub(crate) fn of(action: &'static str) -> impl FnOnce(DriverError) -> Self {
        move |error| CudaErrorKind::Driver { action, error }.into()
    }
}
