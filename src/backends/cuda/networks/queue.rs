//! Where the kernels run: a device, or in tests the processor.

use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use cudarc::driver::{
    CudaFunction, CudaSlice, DevicePtr, DeviceRepr, LaunchConfig, PinnedHostSlice, PushKernelArg, ValidAsZeroBits,
};

use super::layout::{BLOCK_THREADS, KERNELS, Uniform, Variant, source};
use crate::backends::cuda::{CudaError, CudaErrorKind, Device};

/// The kernels, by their place in [`KERNELS`].
type Functions = Arc<[CudaFunction; KERNELS.len()]>;

/// Compiles the kernels for a device.
fn compile(device: &Device, variant: Variant) -> Result<Functions, CudaError> {
    let module = device.load(&source(variant))?;
    let mut functions = Vec::new();
    for name in KERNELS {
        functions.push(module.load_function(name).map_err(CudaError::of("find a kernel"))?);
    }
    let functions: Result<[CudaFunction; KERNELS.len()], _> = functions.try_into();
    let missing =
        |_| CudaError::from(CudaErrorKind::Compile { architecture: String::new(), log: "a kernel is missing".into() });
    functions.map(Arc::new).map_err(missing)
}

/// The kernels, and where they run.
#[derive(Clone)]
pub(super) enum Queue {
    Device {
        device: Device,
        functions: Arc<[CudaFunction; KERNELS.len()]>,
    },
    #[cfg(test)]
    Emulated(Arc<super::emulation::Emulation>),
}

/// Memory that the kernels access.
pub(super) enum Memory<T> {
    Device(CudaSlice<T>),
    #[cfg(test)]
    Host(Vec<T>, #[expect(dead_code, reason = "dropped with the numbers")] super::emulation::Allocation),
}

/// Page-locked memory of the host, which the device reads and writes without a copy in between.
pub(super) enum Staging<T> {
    Pinned(PinnedHostSlice<T>),
    #[cfg(test)]
    Plain(Vec<T>),
}

impl<T: DeviceRepr + ValidAsZeroBits> Staging<T> {
    /// Returns the numbers. The caller has waited ([`Queue::wait`]) for all transfers of them.
    pub fn values(&mut self) -> Result<&mut [T], CudaError> {
        match self {
            Self::Pinned(memory) => memory.as_mut_slice().map_err(CudaError::of("access page-locked memory")),
            #[cfg(test)]
            Self::Plain(values) => Ok(values),
        }
    }
}

/// A kernel, by its place in [`KERNELS`].
#[derive(Clone, Copy, Debug)]
pub(super) enum Kernel {
    Equilibrate,
    Condense,
    TakeTargets,
    TakeStates,
    GiveStates,
    GiveResults,
}

impl Queue {
    /// Returns the kernels of a variant on a device, which are compiled once for all batches.
    pub fn on(device: &Device, variant: Variant) -> Result<Self, CudaError> {
        type Compiled = Mutex<HashMap<(usize, Variant), Functions>>;
        static COMPILED: OnceLock<Compiled> = OnceLock::new();
        let key = (device.context().ordinal(), variant);
        // A thread that panicked has left a map of whole entries.
        let mut compiled = COMPILED.get_or_init(Mutex::default).lock().unwrap_or_else(PoisonError::into_inner);
        let functions = match compiled.entry(key) {
            Entry::Occupied(known) => Arc::clone(known.get()),
            Entry::Vacant(place) => Arc::clone(place.insert(compile(device, variant)?)),
        };
        Ok(Self::Device { device: device.clone(), functions })
    }

    /// Waits until all kernels and transfers have finished.
    pub fn wait(&self) -> Result<(), CudaError> {
        match self {
            Self::Device { device, .. } => device.synchronize(),
            #[cfg(test)]
            Self::Emulated(_) => Ok(()),
        }
    }

    /// Allocates memory for `len` numbers, all zero.
    pub fn zeros<T: DeviceRepr + ValidAsZeroBits + Clone + Default>(&self, len: usize) -> Result<Memory<T>, CudaError> {
        match self {
            // An allocation of no bytes is an error.
            Self::Device { device, .. } => {
                device.stream().alloc_zeros(len.max(1)).map(Memory::Device).map_err(CudaError::of("allocate memory"))
            }
            #[cfg(test)]
            Self::Emulated(emulation) => {
                let allocation = emulation.device().allocate(size_of::<T>() * len)?;
                Ok(Memory::Host(vec![T::default(); len], allocation))
            }
        }
    }

    /// Allocates page-locked memory of the host for `len` numbers, all zero.
    pub fn staging<T: DeviceRepr + ValidAsZeroBits + Clone + Default>(
        &self,
        len: usize,
    ) -> Result<Staging<T>, CudaError> {
        let mut staging = match self {
            // SAFETY: all numbers are set below, before they are read.
            Self::Device { device, .. } => unsafe { device.context().alloc_pinned_with_flags(len.max(1), 0) }
                .map(Staging::Pinned)
                .map_err(CudaError::of("allocate page-locked memory of the host"))?,
            #[cfg(test)]
            Self::Emulated(_) => Staging::Plain(vec![T::default(); len]),
        };
        staging.values()?.fill(T::default());
        Ok(staging)
    }

    /// Copies numbers to the device.
    pub fn copy_of<T: DeviceRepr + ValidAsZeroBits + Clone + Default>(
        &self,
        values: &[T],
    ) -> Result<Memory<T>, CudaError> {
        let mut memory = self.zeros(values.len())?;
        self.write(values, &mut memory)?;
        // On some machines, the device reads the numbers from the memory of the host, which the caller may free.
        self.wait()?;
        Ok(memory)
    }

    /// Copies numbers to the first places of a memory. Numbers in page-locked memory must not change before the next
    /// [`Queue::read`].
    ///
    /// # Panics
    /// Panics if the memory is shorter.
    pub fn write<T: DeviceRepr + Clone>(&self, values: &[T], memory: &mut Memory<T>) -> Result<(), CudaError> {
        match (self, memory) {
            _ if values.is_empty() => Ok(()),
            (Self::Device { device, .. }, Memory::Device(memory)) => {
                let mut part = memory.slice_mut(..values.len());
                device.stream().memcpy_htod(values, &mut part).map_err(CudaError::of("copy to the device"))
            }
            #[cfg(test)]
            (Self::Emulated(_), Memory::Host(memory, _)) => {
                memory[..values.len()].clone_from_slice(values);
                Ok(())
            }
            #[cfg(test)]
            _ => unreachable!("memory of another queue"),
        }
    }

    /// Copies the first numbers of a memory, after all kernels have finished.
    ///
    /// # Panics
    /// Panics if the memory is shorter.
    pub fn read<T: DeviceRepr + Clone>(&self, memory: &Memory<T>, values: &mut [T]) -> Result<(), CudaError> {
        match (self, memory) {
            _ if values.is_empty() => Ok(()),
            (Self::Device { device, .. }, Memory::Device(memory)) => {
                let part = memory.slice(..values.len());
                device.stream().memcpy_dtoh(&part, values).map_err(CudaError::of("copy from the device"))?;
                device.synchronize()
            }
            #[cfg(test)]
            (Self::Emulated(_), Memory::Host(memory, _)) => {
                values.clone_from_slice(&memory[..values.len()]);
                Ok(())
            }
            #[cfg(test)]
            _ => unreachable!("memory of another queue"),
        }
    }

    /// Returns the address that the kernels use.
    pub fn address<T>(&self, memory: &Memory<T>) -> u64 {
        match (self, memory) {
            (Self::Device { device, .. }, Memory::Device(memory)) => memory.device_ptr(device.stream()).0,
            #[cfg(test)]
            (_, Memory::Host(memory, _)) => memory.as_ptr() as u64,
            #[cfg(test)]
            _ => unreachable!("memory of another queue"),
        }
    }

    /// Starts a kernel with at least this number of threads.
    ///
    /// # Safety
    /// The addresses in `uniform` must be those of memory of this queue of the lengths that the kernel expects, which must
    /// live until the kernel has finished.
    pub unsafe fn launch(&self, kernel: Kernel, uniform: &Uniform, threads: usize) -> Result<(), CudaError> {
        match self {
            Self::Device { device, functions } => {
                let blocks = threads.div_ceil(BLOCK_THREADS) as u32;
                let block_dim = (BLOCK_THREADS as u32, 1, 1);
                let shape = LaunchConfig { grid_dim: (blocks, 1, 1), block_dim, shared_mem_bytes: 0 };
                let mut launch = device.stream().launch_builder(&functions[kernel as usize]);
                launch.arg(uniform);
                // SAFETY: the caller guarantees it.
                unsafe { launch.launch(shape) }.map(drop).map_err(CudaError::of("start a kernel"))
            }
            #[cfg(test)]
            Self::Emulated(emulation) => {
                // SAFETY: the caller guarantees it.
                unsafe { emulation.run(kernel, uniform, threads) }
            }
        }
    }

    /// Returns how many threads of a kernel the device executes at the same time.
    pub fn resident_threads(&self, kernel: Kernel) -> Result<usize, CudaError> {
        match self {
            Self::Device { device, functions } => {
                device.context().bind_to_thread().map_err(CudaError::of("bind the device to the thread"))?;
                let blocks = functions[kernel as usize]
                    .occupancy_max_active_blocks_per_multiprocessor(BLOCK_THREADS as u32, 0, None)
                    .map_err(CudaError::of("read the occupancy"))?;
                let count = cudarc::driver::sys::CUdevice_attribute::CU_DEVICE_ATTRIBUTE_MULTIPROCESSOR_COUNT;
                let multiprocessors =
                    device.context().attribute(count).map_err(CudaError::of("read the number of multiprocessors"))?;
                Ok(blocks as usize * multiprocessors as usize * BLOCK_THREADS)
            }
            #[cfg(test)]
            Self::Emulated(emulation) => Ok(emulation.device().threads),
        }
    }

    /// Returns the bytes of free memory.
    pub fn free_bytes(&self) -> Result<usize, CudaError> {
        match self {
            Self::Device { device, .. } => Ok(device.memory()?.0),
            #[cfg(test)]
            Self::Emulated(emulation) => Ok(emulation.device().free()),
        }
    }
}
