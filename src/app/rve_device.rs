//! The device that solves the RVEs of a run.

#[cfg(feature = "cuda")]
use crate::backends::cuda::Device;
use crate::fiber::batch::BatchSolver;
use crate::fiber::rve::RveModel;
use crate::las::RealBackend;
#[cfg(feature = "cuda")]
use crate::rve_batch::DeviceBatch;
use crate::tissue::materials::RveDevice;
use crate::tissue::micro_scale::LibraryError;

/// Returns the solver for batches of RVEs of a model on a device; `None` without a device, and for a model whose laws the
/// device cannot evaluate. Rank `r` takes device `r` modulo the number of devices.
///
/// # Errors
/// Returns [`LibraryError::Device`] if the device cannot be used.
pub fn batch_solver<B: RealBackend>(
    device: Option<RveDevice>,
    rank: usize,
    model: &RveModel<B>,
    predicts: bool,
) -> Result<Option<Box<dyn BatchSolver>>, LibraryError> {
    match device {
        None => Ok(None),
        #[cfg(feature = "cuda")]
        Some(RveDevice::Cuda) => {
            let open = || {
                let count = Device::count()?;
                DeviceBatch::new(&Device::open(rank % count.max(1))?, model, predicts)
            };
            let batch = open().map_err(|error| LibraryError::Device(error.to_string()))?;
            Ok(batch.map(|batch| Box::new(batch) as Box<dyn BatchSolver>))
        }
        #[cfg(not(feature = "cuda"))]
        Some(device) => {
            let (_, _, _) = (rank, model, predicts);
            Err(LibraryError::Device(format!("this build has no support for `{}`: add the feature", device.name())))
        }
    }
}
