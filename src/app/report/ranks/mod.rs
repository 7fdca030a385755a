//! How the ranks of a run spent their time: their status over wall time, their loads, and a table.

mod columns;
pub mod history;
pub(super) mod status;
pub mod timeline;
