//! A sparsity pattern on the device, shared by all matrices that have it.

use std::sync::{Arc, OnceLock};

use cudarc::driver::CudaSlice;

use super::algebra::sent;
use super::{CudaError, Device};
use crate::las::Sparsity;

/// The copy of a pattern on a device.
pub(super) struct DevicePattern {
    pub offsets: CudaSlice<u32>,
    pub columns: CudaSlice<u32>,
    pattern: Arc<Sparsity>,
    transpose: OnceLock<Transpose>,
}

/// The transpose of a pattern.
pub(super) struct Transpose {
    pub offsets: CudaSlice<u32>,
    pub columns: CudaSlice<u32>,
    /// The position of each entry in the pattern.
    pub sources: CudaSlice<u32>,
}

impl DevicePattern {
    pub fn new(device: &Device, pattern: &Arc<Sparsity>) -> Result<Self, CudaError> {
        Ok(Self {
            offsets: sent(device, pattern.row_offsets())?,
            columns: sent(device, pattern.col_indices())?,
            pattern: Arc::clone(pattern),
            transpose: OnceLock::new(),
        })
    }

    /// Returns the transpose, made on first use.
    pub fn transpose(&self, device: &Device) -> Result<&Transpose, CudaError> {
        if let Some(transpose) = self.transpose.get() {
            return Ok(transpose);
        }
        let transpose = self.pattern.transpose();
        let mut next = transpose.row_offsets().to_vec();
        let mut sources = vec![0; transpose.nnz()];
        for (position, &column) in (0..).zip(self.pattern.col_indices()) {
            let to = &mut next[column as usize];
            sources[*to as usize] = position;
            *to += 1;
        }
        let sent = Transpose {
            offsets: sent(device, transpose.row_offsets())?,
            columns: sent(device, transpose.col_indices())?,
            sources: sent(device, &sources)?,
        };
        Ok(self.transpose.get_or_init(|| sent))
    }
}
