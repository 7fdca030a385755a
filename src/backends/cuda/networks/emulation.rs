//! The kernels compiled for the processor, so that tests execute them without a device.

use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use super::layout::{KERNELS, Uniform, Variant, source};
use super::queue::Kernel;
use crate::backends::cuda::CudaError;

/// The library of the kernels.
pub(super) struct Emulation {
    library: libloading::Library,
    device: EmulatedDevice,
}

/// A device that is not there; clones share its memory.
#[derive(Clone, Debug)]
pub(crate) struct EmulatedDevice {
    /// Bytes of memory, and those in use.
    pub bytes: usize,
    pub used: Arc<AtomicUsize>,
    /// Bytes that the device takes while a kernel runs.
    pub of_kernels: usize,
    /// Threads that it executes at the same time.
    pub threads: usize,
}

/// Bytes that are in use until it is dropped.
pub(super) struct Allocation {
    used: Arc<AtomicUsize>,
    bytes: usize,
}

impl EmulatedDevice {
    /// Bytes that are not in use.
    pub(crate) fn free(&self) -> usize {
        self.bytes - self.used.load(Ordering::Relaxed)
    }

    /// Takes this number of bytes, if there are that many.
    pub(super) fn allocate(&self, bytes: usize) -> Result<Allocation, CudaError> {
        let allocation = Allocation { used: Arc::clone(&self.used), bytes };
        let used = self.used.fetch_add(bytes, Ordering::Relaxed);
        if used + bytes > self.bytes { Err(CudaError::out_of_memory()) } else { Ok(allocation) }
    }
}

impl Default for EmulatedDevice {
    fn default() -> Self {
        Self { bytes: 1 << 30, used: Arc::default(), of_kernels: 0, threads: 64 }
    }
}

impl Drop for Allocation {
    fn drop(&mut self) {
        self.used.fetch_sub(self.bytes, Ordering::Relaxed);
    }
}

impl Emulation {
    /// Compiles the kernels by the C++ compiler of the machine; `None` if there is none.
    pub(super) fn new(variant: Variant, device: EmulatedDevice) -> Option<Self> {
        let folder = tempfile::tempdir().unwrap();
        let (path, library) = (folder.path().join("kernel.cpp"), folder.path().join("kernel.so"));
        std::fs::write(&path, source(variant)).unwrap();
        let options = [
            "-std=c++17",
            "-O1",
            "-march=native",
            "-ffp-contract=off",
            "-DEMULATE",
            "-shared",
            "-fPIC",
            "-Wno-unknown-pragmas",
            "-o",
        ];
        let compiler = std::env::var("CXX").unwrap_or_else(|_| "c++".into());
        let output = Command::new(compiler).args(options).args([&library, &path]).output().ok()?;
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        // SAFETY: the library has no initialization.
        Some(Self { library: unsafe { libloading::Library::new(&library) }.unwrap(), device })
    }

    pub(super) fn device(&self) -> &EmulatedDevice {
        &self.device
    }

    /// Executes all threads of a kernel in turn.
    ///
    /// # Safety
    /// As for `Queue::launch`.
    pub(super) unsafe fn run(&self, kernel: Kernel, uniform: &Uniform, threads: usize) -> Result<(), CudaError> {
        let _of_kernel = self.device.allocate(self.device.of_kernels)?;
        type Entry = unsafe extern "C" fn(*const Uniform, u64);
        // SAFETY: the kernels have this signature; the caller guarantees the rest.
        unsafe {
            let entry: libloading::Symbol<'_, Entry> = self.library.get(KERNELS[kernel as usize].as_bytes()).unwrap();
            entry(uniform, threads as u64);
        }
        Ok(())
    }
}
