//! Compressed rows in memory: what the backends `sparse` and `batched` have in common.
//!
//! Matrix and vector are generic over what an entry is. A backend implements the traits of [`las`](crate::las) for its own
//! entries with the macro [`hot_verbs`], which forward every verb to the function here that does it, and [`amortized`].

mod forward;
mod matrix;
mod ops;
mod products;
mod vector;

pub(in crate::backends) use forward::{amortized, hot_verbs};
pub use matrix::Matrix;
pub use vector::Vector;
