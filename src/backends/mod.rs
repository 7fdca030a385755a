//! The backends: one folder each, the same file names in every folder.

#[cfg(feature = "sparse")]
mod direct;
#[cfg(feature = "sparse")]
mod local;
#[cfg(feature = "sparse")]
pub mod sparse;
