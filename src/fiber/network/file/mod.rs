//! Network files, as published networks come: see [`read`] for the format.

mod write;

pub use write::{write, write_params, write_parts};
