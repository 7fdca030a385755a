//! What linear algebra needs of a device: its kernels, its libraries, and buffers of reductions.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};

use cudarc::driver::{CudaFunction, CudaModule, CudaSlice, DeviceRepr, LaunchConfig};

use super::cusparse::Library;
use super::pattern::DevicePattern;
use super::{CudaError, Device};
use crate::las::Sparsity;

/// The source of the kernels for vectors.
pub(super) const VECTORS: &str = include_str!("kernels/vectors.cu");

/// The source of the kernels for matrices.
pub(super) const MATRICES: &str = include_str!("kernels/matrices.cu");

/// Threads of a block, in all kernels of linear algebra.
const THREADS: u32 = 256;

/// Rows that a block of threads multiplies: one per warp.
const ROWS_PER_BLOCK: usize = 8;

/// Entries of a vector that a thread reduces, unless the vector has more than [`MOST_BLOCKS`] blocks of them.
const ENTRIES_PER_THREAD: usize = 8;

/// The greatest number of blocks of a reduction.
const MOST_BLOCKS: usize = 1024;

/// Kernels, libraries and buffers of linear algebra.
pub(super) struct Algebra {
    pub axpy: CudaFunction,
    pub axpby: CudaFunction,
    pub multiply: CudaFunction,
    pub dot: CudaFunction,
    pub largest: CudaFunction,
    pub product: CudaFunction,
    pub transposed: CudaFunction,
    matrices: Arc<CudaModule>,
    reduction: Mutex<Reduction>,
    /// cuSPARSE, if it can be loaded.
    pub library: Option<Library>,
    /// The patterns on the device, each with the one on the host that it copies.
    patterns: Mutex<Vec<(Weak<Sparsity>, Weak<DevicePattern>)>>,
}

/// The buffers of a reduction.
pub(super) struct Reduction {
    /// The results of the blocks.
    pub partial: CudaSlice<f64>,
    /// The number of blocks that have ended.
    pub ticket: CudaSlice<u32>,
    pub result: CudaSlice<f64>,
}

impl Algebra {
    /// Compiles the kernels and loads the libraries.
    pub fn load(device: &Device) -> Result<Self, CudaError> {
        let (vectors, matrices) = (device.load(VECTORS)?, device.load(MATRICES)?);
        let vector_kernel = |name| find(&vectors, name);
        Ok(Self {
            axpy: vector_kernel("axpy")?,
            axpby: vector_kernel("axpby")?,
            multiply: vector_kernel("multiply")?,
            dot: vector_kernel("dot")?,
            largest: vector_kernel("largest")?,
            product: find(&matrices, "product_double_11")?,
            transposed: find(&matrices, "transposed")?,
            matrices,
            reduction: Mutex::new(Reduction {
                partial: zeros(device, MOST_BLOCKS)?,
                ticket: zeros(device, 1)?,
                result: zeros(device, 1)?,
            }),
            library: Library::load(device)?,
            patterns: Mutex::default(),
        })
    }

    /// Returns a kernel of matrices by its name.
    pub fn matrix_kernel(&self, name: &str) -> Result<CudaFunction, CudaError> {
        find(&self.matrices, name)
    }

    /// Returns the buffers of a reduction, for one thread at a time.
    pub fn reduction(&self) -> MutexGuard<'_, Reduction> {
        self.reduction.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns the copy of a pattern on the device, made on first use.
    pub fn pattern(&self, device: &Device, pattern: &Arc<Sparsity>) -> Result<Arc<DevicePattern>, CudaError> {
        let mut patterns = self.patterns.lock().unwrap_or_else(PoisonError::into_inner);
        let is_this = |known: &Weak<Sparsity>| std::ptr::eq(known.as_ptr(), Arc::as_ptr(pattern));
        if let Some(found) = patterns.iter().find(|(known, _)| is_this(known)).and_then(|(_, copy)| copy.upgrade()) {
            return Ok(found);
        }
        patterns.retain(|(_, copy)| copy.strong_count() > 0);
        let copy = Arc::new(DevicePattern::new(device, pattern)?);
        patterns.push((Arc::downgrade(pattern), Arc::downgrade(&copy)));
        Ok(copy)
    }
}

fn find(module: &Arc<CudaModule>, name: &str) -> Result<CudaFunction, CudaError> {
    module.load_function(name).map_err(CudaError::of("find a kernel"))
}

/// Allocates zeros; at least one, because the driver allocates no empty memory.
pub(super) fn zeros<T: DeviceRepr + cudarc::driver::ValidAsZeroBits>(
    device: &Device,
    len: usize,
) -> Result<CudaSlice<T>, CudaError> {
    device.stream().alloc_zeros(len.max(1)).map_err(CudaError::of("allocate memory of the device"))
}

/// Copies values to new memory of the device.
pub(super) fn sent<T: DeviceRepr + cudarc::driver::ValidAsZeroBits>(
    device: &Device,
    values: &[T],
) -> Result<CudaSlice<T>, CudaError> {
    let mut copy = zeros(device, values.len())?;
    send(device, values, &mut copy)?;
    Ok(copy)
}

/// Copies values to memory of the device that was allocated for as many, and waits until they can change: on some
/// machines, the device reads them from the memory of the host.
pub(super) fn send<T: DeviceRepr>(device: &Device, values: &[T], to: &mut CudaSlice<T>) -> Result<(), CudaError> {
    if values.is_empty() {
        return Ok(());
    }
    let stream = device.stream();
    stream.memcpy_htod(values, to).map_err(CudaError::of("send to the device"))?;
    stream.synchronize().map_err(CudaError::of("send to the device"))
}

/// Copies values from the device, and waits for them.
pub(super) fn fetch<T: DeviceRepr>(device: &Device, from: &CudaSlice<T>, to: &mut [T]) -> Result<(), CudaError> {
    if to.is_empty() {
        return Ok(());
    }
    let stream = device.stream();
    stream.memcpy_dtoh(&from.slice(..to.len()), to).map_err(CudaError::of("fetch from the device"))?;
    stream.synchronize().map_err(CudaError::of("fetch from the device"))
}

/// Returns a launch of one thread per entry.
pub(super) fn per_entry(count: usize) -> LaunchConfig {
    blocks(count.div_ceil(THREADS as usize))
}

/// Returns a launch of one warp per row.
pub(super) fn per_row(rows: usize) -> LaunchConfig {
    blocks(rows.div_ceil(ROWS_PER_BLOCK))
}

/// Returns the launch of a reduction of this many entries.
pub(super) fn of_reduction(count: usize) -> LaunchConfig {
    blocks(count.div_ceil(THREADS as usize * ENTRIES_PER_THREAD).min(MOST_BLOCKS))
}

fn blocks(count: usize) -> LaunchConfig {
    LaunchConfig { grid_dim: (count.max(1) as u32, 1, 1), block_dim: (THREADS, 1, 1), shared_mem_bytes: 0 }
}

/// Launches a kernel on the stream of a device: `launch!(device, kernel, config, arguments)`.
///
/// The arguments must be those of the kernel, and the memory they refer to at least as large as the kernel uses.
macro_rules! launch {
    ($device:expr, $kernel:expr, $config:expr, $($argument:expr),+ $(,)?) => {{
        use cudarc::driver::PushKernelArg;
        let mut builder = $device.stream().launch_builder($kernel);
        $(builder.arg($argument);)+
        // SAFETY: the callers pass the arguments that the kernel declares, in its order; all memory belongs to the one
        // stream of the device.
        let launched = unsafe { builder.launch($config) };
        launched.map(drop).map_err($crate::backends::cuda::CudaError::of("launch a kernel"))
    }};
}

pub(super) use launch;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backends::cuda::compiler::{compile, is_missing};

    #[test]
    fn the_kernels_of_vectors_and_matrices_compile() {
        if !is_missing() {
            [VECTORS, MATRICES].iter().for_each(|source| drop(compile(source, "sm_90").unwrap()));
        }
    }
}
