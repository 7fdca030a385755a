//! A case: everything a simulation needs, read from one TOML file and checked.

mod curve;
mod data;
mod elastic;
mod load;
mod material;
mod names;
mod networks;
mod problems;
mod range;
mod read;
mod section;
mod table;
#[cfg(test)]
mod tests;
mod value;
mod write;

pub use data::*;
pub use read::CaseFile;
