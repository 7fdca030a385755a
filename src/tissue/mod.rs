//! The soft-tissue application: the macro scale and the fiber RVEs put together, cases, results.

pub mod case;
pub mod report;
pub mod results;
