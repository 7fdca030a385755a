//! The result directory of a run: the files written during the run, and their readers.
//!
//! | file | module | written |
//! |---|---|---|
//! | `fields.pvd` and the `.vtu` files it names | [`collection`], [`fields`] | at every output step |
//! | for a divided body: `.pvtu` files and the `.vtu` pieces they name | [`pieces`] | at every output step |
//! | `points.pvd` and the `.vtu` (or `.pvtu`) files it names | [`collection`], [`points`] | with the fields, if requested |
//! | `loads.csv` | [`loads`] | one row per converged step |
//! | `costs.csv` | [`costs`] | one row per RVE and sweep, if requested |
//! | `log.jsonl` | [`log`] | one line per event |
//! | `rve/element-NNNNN.pvd` and the `.vtp` files it names | [`collection`], [`networks`] | with the fields, if requested |
//! | `checkpoint/step-NNNNN.bin` and its pieces, the last two | [`super::checkpoint`] | at every converged step, or as often as the case says |
//! | `case.toml` | [`super::case`] | at the beginning: the case as run, defaults filled in |
//!
//! A run that fails within a step also writes the last state it reached there, under the name of the last full step
//! with `-partial`.
//!
//! Every file is readable at any time during the run, and after the run was killed: fields, networks, their collections
//! and checkpoints are replaced atomically, and readers ignore an unfinished last line. A run that starts from the
//! beginning removes all of these files of an earlier run ([`clear`]), and the `report.html` drawn from them. A run
//! does not replace or remove a file with one of these names that no run has written, or a symbolic link; it refuses to
//! start instead ([`check_origin`]). Two runs cannot write to one directory: each holds a lock on `.biotissue.lock`
//! ([`DirectoryLock`]) and removes the file at its end.

mod clear;
pub mod collection;
pub mod costs;
mod error;
pub mod fields;
mod fields_read;
pub mod loads;
mod lock;
pub mod log;
mod names;
pub mod networks;
mod origin;
pub mod pieces;
pub mod points;
mod record;
mod replace;
mod scales_log;
mod vtk;
mod vtk_cells;
mod vtk_write;

pub use clear::{clear, clear_after, clear_unfinished};
pub(in crate::app) use clear::{failed_rve_file, remove_as};
pub use collection::Collection;
pub use costs::{CostRow, CostsWriter, read_costs};
pub use error::ResultsError;
pub use fields::{FieldSet, Fields, read_fields, read_vtu, write_vtu};
pub use loads::{LoadNames, LoadRow, Loads, LoadsWriter, RigidRow, SurfaceRow};
pub use lock::DirectoryLock;
pub use log::{Event, LogWriter};
pub use networks::{NetworkSet, Networks, read_vtp, write_vtp};
pub use origin::check_origin;
pub(in crate::app) use origin::{case_copy, check_case, is_report, results_without_checkpoint};
pub use pieces::{part_file, piece_index, write_piece, write_pieces};
pub use points::{PointCloud, PointValues, point_piece_index, read_points, write_point_pieces, write_points};
pub use record::{FieldFile, NetworkSeries, ResultsRecord, RunProgress, network_series, unlisted_points};
pub(in crate::app) use replace::{names_in, replace};
pub(in crate::app) use vtk::attribute;
pub(in crate::app) use vtk_cells::{place as vtk_place, volume_type};

/// Name of the collection of field files in a result directory.
pub const FIELDS_FILE: &str = "fields.pvd";
/// Name of the collection of files of integration points in a result directory.
pub const POINTS_FILE: &str = "points.pvd";
/// Name of the table of loads in a result directory.
pub const LOADS_FILE: &str = "loads.csv";
/// Name of the table of costs in a result directory.
pub const COSTS_FILE: &str = "costs.csv";
/// Name of the log in a result directory.
pub const LOG_FILE: &str = "log.jsonl";
/// Name of the folder of deformed networks in a result directory.
pub const NETWORKS_FOLDER: &str = "rve";
/// Name of the folder, in a result directory, of RVEs that found no equilibrium.
pub const FAILED_RVE_FOLDER: &str = "lost-rve";
/// Name of the folder of checkpoints in a result directory.
pub const CHECKPOINT_FOLDER: &str = "checkpoint";
/// Name of the page of figures in a result directory.
pub const REPORT_FILE: &str = "report.html";
/// Name of the file in a result directory that a run keeps locked while it writes there.
pub const LOCK_FILE: &str = ".biotissue.lock";
/// Name of the case as run in a result directory.
pub const CASE_FILE: &str = "case.toml";
