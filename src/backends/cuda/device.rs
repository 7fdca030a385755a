//! A device: its context, its stream, and the kernels compiled for it.

use std::fmt;
use std::sync::{Arc, OnceLock};

use cudarc::driver::{CudaContext, CudaModule, CudaStream};

use super::algebra::Algebra;
use super::error::check_functions;
use super::{CudaError, CudaErrorKind, compiler};

/// A CUDA device with the stream on which this crate works. Clones share both.
#[derive(Clone)]
pub struct Device {
    stream: Arc<CudaStream>,
    architecture: Architecture,
    /// The kernels and libraries of linear algebra, loaded on first use.
    algebra: Arc<OnceLock<Algebra>>,
}

/// The compute capability of a device, for example 9.0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Architecture {
    major: i32,
    minor: i32,
}

impl fmt::Display for Architecture {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "sm_{}{}", self.major, self.minor)
    }
}

impl fmt::Debug for Device {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Device").field("ordinal", &self.context().ordinal()).finish_non_exhaustive()
    }
}

/// Returns an error if the library of the driver cannot be loaded, or is too old: its first use would panic.
fn find_driver() -> Result<(), CudaError> {
    const LIBRARY: &str = "libcuda.so";
    const PACKAGE: &str = "the NVIDIA driver";
    // SAFETY: loads `libcuda`, whose initialization has no precondition.
    if !unsafe { cudarc::driver::sys::is_culib_present() } {
        return Err(CudaErrorKind::MissingLibrary { library: LIBRARY, package: PACKAGE }.into());
    }
    // SAFETY: as above; the library is there.
    let loaded = unsafe { cudarc::driver::sys::culib() };
    // The newest of the functions that are called.
    check_functions!(loaded, LIBRARY, PACKAGE, ["cuMemAllocAsync", "cuDeviceGetUuid_v2"])
}

impl Device {
    /// Returns how many devices the driver lists.
    ///
    /// # Errors
    /// Returns [`CudaErrorKind::MissingLibrary`] without a driver, and [`CudaErrorKind::Driver`] if it cannot be initialized.
    pub fn count() -> Result<usize, CudaError> {
        find_driver()?;
        let count = CudaContext::device_count().map_err(CudaError::of("count the devices"))?;
        Ok(usize::try_from(count).unwrap_or(0))
    }

    /// Opens the device with this number, counted from 0, with its primary context and a stream of its own.
    ///
    /// # Errors
    /// Returns [`CudaErrorKind::MissingLibrary`] without the driver or the compiler NVRTC, [`CudaErrorKind::NoDevice`] if there
    /// is no device with this number, and [`CudaErrorKind::Driver`] if the driver refuses.
    pub fn open(ordinal: usize) -> Result<Self, CudaError> {
        let count = Self::count()?;
        compiler::find()?;
        if ordinal >= count {
            return Err(CudaErrorKind::NoDevice { ordinal, count }.into());
        }
        let context = CudaContext::new(ordinal).map_err(CudaError::of("open the device"))?;
        let (major, minor) = context.compute_capability().map_err(CudaError::of("read the compute capability"))?;
        // SAFETY: all work of a `Device` is on its one stream, which executes it in order.
        unsafe { context.disable_event_tracking() };
        let stream = context.new_stream().map_err(CudaError::of("create a stream"))?;
        Ok(Self { stream, architecture: Architecture { major, minor }, algebra: Arc::default() })
    }

    /// The name of the device, for example `NVIDIA H200`.
    ///
    /// # Errors
    /// Returns the error of the driver.
    pub fn name(&self) -> Result<String, CudaError> {
        self.context().name().map_err(CudaError::of("read the name of the device"))
    }

    /// The number of the device, counted from 0 in this process.
    pub fn ordinal(&self) -> usize {
        self.context().ordinal()
    }

    /// Bytes that no other device has, on this machine or another one.
    ///
    /// # Errors
    /// Returns the error of the driver.
    pub fn uuid(&self) -> Result<[u8; 16], CudaError> {
        let uuid = self.context().uuid().map_err(CudaError::of("read the id of the device"))?;
        Ok(uuid.bytes.map(|byte| byte as u8))
    }

    /// Bytes of device memory that are free, and those that the device has.
    ///
    /// # Errors
    /// Returns the error of the driver.
    pub fn memory(&self) -> Result<(usize, usize), CudaError> {
        self.context().mem_get_info().map_err(CudaError::of("read the free memory"))
    }

    /// Waits until the device has finished all work of its stream.
    ///
    /// # Errors
    /// Returns the error of the work or of the driver.
    pub fn synchronize(&self) -> Result<(), CudaError> {
        self.stream.synchronize().map_err(CudaError::of("wait for the device"))
    }

    /// Compiles the kernels of linear algebra and loads the libraries, which otherwise happens on first use.
    ///
    /// # Errors
    /// Returns [`CudaErrorKind::Compile`], or the error of the driver or of a library.
    pub fn prepare(&self) -> Result<(), CudaError> {
        self.algebra().map(drop)
    }

    /// Returns true if products of matrices and vectors use cuSPARSE, false if that library is not installed.
    ///
    /// # Errors
    /// Returns the error of loading the kernels and libraries of linear algebra.
    pub fn has_cusparse(&self) -> Result<bool, CudaError> {
        Ok(self.algebra()?.library.is_some())
    }

    pub(crate) fn context(&self) -> &Arc<CudaContext> {
        self.stream.context()
    }

    pub(crate) fn stream(&self) -> &Arc<CudaStream> {
        &self.stream
    }

    /// The kernels and libraries of linear algebra.
    pub(super) fn algebra(&self) -> Result<&Algebra, CudaError> {
        if let Some(algebra) = self.algebra.get() {
            return Ok(algebra);
        }
        let algebra = Algebra::load(self)?;
        Ok(self.algebra.get_or_init(|| algebra))
    }

    /// Returns true if both work on the same stream.
    pub(super) fn is_same(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.stream, &other.stream)
    }

    /// Compiles kernels for this device and loads them.
    pub(crate) fn load(&self, source: &str) -> Result<Arc<CudaModule>, CudaError> {
        let code = compiler::compile(source, &self.architecture.to_string())?;
        self.context().load_module(code).map_err(CudaError::of("load the kernels"))
    }
}
