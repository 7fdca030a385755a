//! Pictures and the report page, made from a result directory alone: of a finished run, or of one that goes on.
//!
//! [`picture::draw`] draws the deformed body with its fiber directions, [`page::write()`](fn@page::write) one
//! self-contained HTML page with that picture, charts and a table. What a directory does not hold is left out.

pub mod charts;
pub mod directory;
mod error;
pub mod extension;
pub mod page;
pub mod picture;
mod units;

pub use error::ReportError;
