//! What a network is like, and what in it carries no load.

mod clean;
mod components;
mod report;

pub use clean::{Cleaned, Removed, clean};
pub use components::Component;
pub use report::{NetworkReport, Spread, examine};
