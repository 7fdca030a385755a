//! The soft-tissue application: the macro scale and the fiber RVEs put together, cases, results.

pub mod case;
pub mod checkpoint;
pub mod macro_scale;
pub mod micro_scale;
mod record;
pub mod report;
pub mod results;
pub mod run;
mod rve_files;

pub use record::Progress;
