//! The kernels compiled for the processor, so that tests execute them without a device.

use std::process::Command;

use super::layout::{KERNELS, Uniform, Variant, source};
use super::queue::Kernel;

/// The library of the kernels.
pub(super) struct Emulation {
    library: libloading::Library,
}

impl Emulation {
    /// Compiles the kernels by the C++ compiler of the machine; `None` if there is none.
    pub(super) fn new(variant: Variant) -> Option<Self> {
        let folder = tempfile::tempdir().unwrap();
        let (path, library) = (folder.path().join("kernel.cpp"), folder.path().join("kernel.so"));
        std::fs::write(&path, source(variant)).unwrap();
        let options =
            ["-std=c++17", "-O1", "-march=native", "-DEMULATE", "-shared", "-fPIC", "-Wno-unknown-pragmas", "-o"];
        let compiler = std::env::var("CXX").unwrap_or_else(|_| "c++".into());
        let output = Command::new(compiler).args(options).args([&library, &path]).output().ok()?;
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        // SAFETY: the library has no initialization.
        Some(Self { library: unsafe { libloading::Library::new(&library) }.unwrap() })
    }

    /// Executes all threads of a kernel in turn.
    ///
    /// # Safety
    /// As for `Queue::launch`.
    pub(super) unsafe fn run(&self, kernel: Kernel, uniform: &Uniform, threads: usize) {
        type Entry = unsafe extern "C" fn(*const Uniform, u64);
        // SAFETY: the kernels have this signature; the caller guarantees the rest.
        unsafe {
            let entry: libloading::Symbol<'_, Entry> = self.library.get(KERNELS[kernel as usize].as_bytes()).unwrap();
            entry(uniform, threads as u64);
        }
    }
}
