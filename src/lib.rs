//! `biotissue`: multiscale simulation of soft tissue.

pub mod backends;
pub mod fem;
pub mod fiber;
pub mod input;
pub mod las;
#[cfg(feature = "app")]
pub mod tissue;
