//! The result directory of a run: what is written while it goes on, and how it is read back.
//!
//! | file | module | written |
//! |---|---|---|
//! | `fields.pvd` and the `.vtu` files it names | [`collection`], [`fields`] | whenever fields are due |
//! | `loads.csv` | [`loads`] | a row a converged step |
//! | `log.jsonl` | [`log`] | a line an event |
//!
//! Every file is readable at any time while the run goes on, and after the run was killed: fields and their collection
//! replace their predecessors atomically, and readers leave out a last line that was not finished.

pub mod collection;
mod error;
pub mod fields;
mod fields_read;
pub mod loads;
pub mod log;
mod replace;

pub use collection::Collection;
pub use error::ResultsError;
pub use fields::{FieldSet, Fields, read_vtu, write_vtu};
pub use loads::{Loads, LoadsWriter, SurfaceRow};
pub use log::{Event, LogWriter};

/// Name of the collection of field files in a result directory.
pub const FIELDS_FILE: &str = "fields.pvd";
/// Name of the table of loads in a result directory.
pub const LOADS_FILE: &str = "loads.csv";
/// Name of the log in a result directory.
pub const LOG_FILE: &str = "log.jsonl";
