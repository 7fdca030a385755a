//! The device that solves the RVEs of a run.

#[cfg(feature = "cuda")]
use crate::backends::cuda::{CudaError, Device};
use crate::fiber::batch::BatchSolver;
use crate::fiber::rve::RveModel;
use crate::las::{Comm, CommError, Message, RealBackend};
#[cfg(feature = "cuda")]
use crate::rve_batch::DeviceBatch;
use crate::tissue::materials::RveDevice;
use crate::tissue::micro_scale::LibraryError;

/// Share of the free memory of a device for RVEs. The rest is for the body, if it is on the same device, and for what the
/// driver takes for kernels and for each process.
#[cfg(feature = "cuda")]
const SHARE_OF_MEMORY: f64 = 0.7;

/// An open device.
pub enum OpenDevice {
    /// A CUDA device.
    #[cfg(feature = "cuda")]
    Cuda(Device),
}

/// The solvers of the batches of each model; `None` for a model whose laws the device cannot evaluate, or whose network does not
/// fit into its memory.
pub type BatchSolvers = Vec<Option<Box<dyn BatchSolver>>>;

/// Opens the device of a rank, if RVEs are to be solved on one. Rank `r` takes device `r` modulo the number of devices.
///
/// # Errors
/// Returns [`LibraryError::Device`] if the device cannot be used.
pub fn open(device: Option<RveDevice>, rank: usize) -> Result<Option<OpenDevice>, LibraryError> {
    match device {
        None => Ok(None),
        #[cfg(feature = "cuda")]
        Some(RveDevice::Cuda) => {
            let open = || Device::open(rank % Device::count()?.max(1));
            open().map(|device| Some(OpenDevice::Cuda(device))).map_err(|error| of_device(&error))
        }
        #[cfg(not(feature = "cuda"))]
        Some(device) => {
            let _ = rank;
            Err(LibraryError::Device(format!("this build has no support for `{}`: add the feature", device.name())))
        }
    }
}

/// Returns how many of the ranks have opened the same device as this one, which may be on another machine with the same
/// number. Collective over `ranks`.
///
/// # Errors
/// Returns [`CommError`] if the communication fails.
pub fn ranks_of_device<C: Comm>(ranks: &C, own: Option<&OpenDevice>) -> Result<usize, CommError> {
    let own = own.map_or_else(Vec::new, OpenDevice::id);
    let all = ranks.gather_all(Message::of(&own))?;
    Ok(all.iter().filter(|id| id.values() == Some(&own[..])).count().max(1))
}

impl OpenDevice {
    /// Bytes that tell devices apart, also those of other machines.
    fn id(&self) -> Vec<u8> {
        match *self {
            // Ranks whose devices have no known id divide the memory as if they had the same.
            #[cfg(feature = "cuda")]
            Self::Cuda(ref device) => device.uuid().map_or_else(|_| Vec::new(), Vec::from),
        }
    }

    /// Returns the solvers of the batches of models. They divide the memory of the device among the models, and among so
    /// many `ranks`.
    ///
    /// # Errors
    /// Returns [`LibraryError::Device`] if the device cannot be used.
    pub fn batch_solvers<B: RealBackend>(
        &self,
        ranks: usize,
        models: &[RveModel<B>],
        predicts: bool,
    ) -> Result<BatchSolvers, LibraryError> {
        #[cfg(not(feature = "cuda"))]
        let (_, _, _) = (ranks, models, predicts);
        match *self {
            #[cfg(feature = "cuda")]
            Self::Cuda(ref device) => {
                let (free, _) = device.memory().map_err(|error| of_device(&error))?;
                // Each model has a stream of its own, so that batches run side by side.
                let open = || Device::open(device.ordinal());
                let batch = |model| match open().and_then(|device| DeviceBatch::new(&device, model, predicts)) {
                    // Where not even the network fits, the processor solves its RVEs, as where no RVE fits.
                    Err(error) if error.is_out_of_memory() => Ok(None),
                    outcome => outcome,
                };
                let batches: Result<Vec<_>, CudaError> = models.iter().map(batch).collect();
                let mut batches = batches.map_err(|error| of_device(&error))?;
                let bytes = (SHARE_OF_MEMORY * free as f64) as usize / ranks.max(1);
                DeviceBatch::share_memory(batches.iter_mut().flatten(), bytes);
                let boxed = |batch| Box::new(batch) as Box<dyn BatchSolver>;
                Ok(batches.into_iter().map(|batch| batch.map(boxed)).collect())
            }
        }
    }
}

#[cfg(feature = "cuda")]
fn of_device(error: &CudaError) -> LibraryError {
    LibraryError::Device(error.to_string())
}
