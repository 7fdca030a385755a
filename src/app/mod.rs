//! The application: case files, runs, results, reports and pictures.
//!
//! ```text
//! case file ─► case::Case ─► macro_scale (mesh, loads), material_fields ─► run::Simulation ─► results (directory) ─► report
//! ```
//!
//! [`crate::tissue`] solves the two scales in memory; this module reads what describes the problem and writes the
//! result directory.

pub mod case;
mod cell_fields;
pub mod checkpoint;
mod derived_fields;
pub mod expression;
mod field_files;
mod formula_fibers;
pub mod macro_scale;
pub mod material_fields;
pub mod mesh_files;
mod nodal_fields;
mod plausibility;
mod progress;
mod rank_shares;
mod recorder;
pub mod report;
pub mod results;
pub mod run;
pub mod rve_device;
mod rve_files;
mod stress;
pub mod vtu;

pub use plausibility::{Examination, FloppyNetworks, LARGEST_SAMPLE, LoadOf, LoadSize};
pub use progress::Progress;
