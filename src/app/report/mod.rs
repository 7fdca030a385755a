//! Pictures and the report page, made only from a result directory, during or after the run.
//!
//! [`picture::draw`] draws the deformed body with its fiber directions, [`page::write()`](fn@page::write) writes one
//! self-contained HTML page with the body in three dimensions, charts and tables. Parts without data are omitted.

pub mod charts;
pub mod directory;
mod error;
pub mod extension;
mod nodal;
pub mod page;
pub mod picture;
mod quantity;
pub mod ranks;
mod skin;
mod svg;
mod units;
mod viewer;

pub use error::ReportError;
