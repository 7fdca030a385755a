//! The soft-tissue application: couples the macro scale with the fiber RVEs.
//!
//! ```text
//! case file ─► case::Case ─► macro_scale (mesh, loads) ──┐
//!                       └──► micro_scale (networks) ─────┴─► run::Simulation ─► results (directory) ─► report
//! ```
//!
//! [`micro_scale::TissueField`] implements the interface [`crate::fem::point_field`] with a formula or a network in
//! every element, where all threads solve the networks; [`run::Simulation`] takes the load steps and writes the result
//! directory.

pub mod case;
pub mod checkpoint;
pub mod macro_scale;
mod magnitudes;
pub mod micro_scale;
mod recorder;
pub mod replay;
pub mod report;
pub mod results;
pub mod run;
mod rve_files;
mod stress;
pub mod two_scale;

pub use recorder::Progress;
