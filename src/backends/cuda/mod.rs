//! `cuda`: graphics processors of NVIDIA.
//!
//! Building needs nothing of CUDA: the driver, the run-time compiler NVRTC and the libraries are loaded when a
//! [`Device`] is opened. What is missing is reported by [`CudaError`].

#![allow(unsafe_code, reason = "calls of the driver and launches of kernels")]

mod device;
mod error;
pub mod networks;

pub use device::Device;
pub use error::CudaError;
