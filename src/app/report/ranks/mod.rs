//! How the ranks of a run spent their time: their status over wall time, their loads, and a table.

pub(super) mod columns;
pub(super) mod deviation;
pub mod history;
pub(super) mod status;
pub mod timeline;
