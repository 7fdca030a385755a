//! Compressed rows in memory, shared by the backends `sparse` and `batched`.
//!
//! Matrix and vector are generic over the type of an entry. A backend implements the traits of [`las`](crate::las) for
//! its entry type with the macro [`impl_backend_ops`], which forwards every method to a function of this module.

mod blocks;
mod forward;
mod matrix;
mod ops;
mod products;

pub(in crate::backends) use forward::impl_backend_ops;
pub use matrix::Matrix;

crate::backends::local::contiguous_vector!();
