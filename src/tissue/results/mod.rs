//! The result directory of a run: what is written while it goes on, and how it is read back.
//!
//! | file | module | written |
//! |---|---|---|
//! | `fields.pvd` and the `.vtu` files it names | [`collection`], [`fields`] | whenever fields are due |
//! | instead, of a body in several parts: `.pvtu` files and the `.vtu` pieces they name | [`pieces`] | whenever fields are due |
//! | `loads.csv` | [`loads`] | a row a converged step |
//! | `log.jsonl` | [`log`] | a line an event |
//! | `rve/element-NNNNN.pvd` and the `.vtp` files it names | [`collection`], [`networks`] | with the fields, for the elements asked for |
//! | `checkpoint/step-NNNNN.bin`, the last two | [`super::checkpoint`] | at every converged step |
//! | `case.toml` | [`super::case`] | at the beginning: the case as run, defaults filled in |
//!
//! A run that fails within a step also writes the state it had reached there, under the name of the last full step with
//! `-partial`.
//!
//! Every file is readable at any time while the run goes on, and after the run was killed: fields, networks, their
//! collections and checkpoints replace their predecessors atomically, and readers leave out a last line that was not
//! finished. A run that starts from the beginning removes all of these that an earlier one has left ([`clear`]), and the
//! `report.html` drawn from them. A file of one of these names that no run has written, or a symbolic link, is neither
//! replaced nor removed: the run is refused ([`check_origin`]). Two runs cannot write into one directory: each holds
//! `.biotissue.lock` locked ([`DirectoryLock`]) and removes it at its end.

mod clear;
pub mod collection;
mod error;
pub mod fields;
mod fields_read;
pub mod loads;
mod lock;
pub mod log;
pub mod networks;
mod origin;
pub mod pieces;
mod replace;
mod written;

pub use clear::{clear, clear_unfinished};
pub use collection::Collection;
pub use error::ResultsError;
pub use fields::{FieldSet, Fields, read_fields, read_vtu, write_vtu};
pub use loads::{Loads, LoadsWriter, SurfaceRow};
pub use lock::DirectoryLock;
pub use log::{Event, LogWriter};
pub use networks::{NetworkSet, Networks, read_vtp, write_vtp};
pub use origin::check_origin;
pub(in crate::tissue) use origin::{case_copy, is_report, results_without_checkpoint};
pub use pieces::Pieces;
pub(in crate::tissue) use replace::{replace, replace_by};
pub use written::{Done, FieldFile, NetworkSeries, Written, network_series};

/// Name of the collection of field files in a result directory.
pub const FIELDS_FILE: &str = "fields.pvd";
/// Name of the table of loads in a result directory.
pub const LOADS_FILE: &str = "loads.csv";
/// Name of the log in a result directory.
pub const LOG_FILE: &str = "log.jsonl";
/// Name of the folder of deformed networks in a result directory.
pub const NETWORKS_FOLDER: &str = "rve";
/// Name of the folder of checkpoints in a result directory.
pub const CHECKPOINT_FOLDER: &str = "checkpoint";
/// Name of the page of figures in a result directory.
pub const REPORT_FILE: &str = "report.html";
/// Name of the file in a result directory that a run holds locked while it writes there.
pub const LOCK_FILE: &str = ".biotissue.lock";
/// Name of the case as run in a result directory.
pub const CASE_FILE: &str = "case.toml";
