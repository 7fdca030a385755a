//! What the linear-algebra abstraction LAS costs over calling a backend by hand, beside the other ways of having an
//! interface: instructions and time.
//!
//! `cargo run --release --package overhead` compares the instructions of this very program; see `docs/overhead.md`.

pub mod assembly;
pub mod by_hand;
pub mod compare;
pub mod executed;
pub mod image;
pub mod page;
pub mod ways;
