//! Cost of the linear-algebra abstraction LAS relative to calling a backend by hand, compared with other kinds of
//! interface: instructions and time.
//!
//! `cargo run --release --package overhead` compares the instructions of this program itself; see `docs/overhead.md`.

pub mod assembly;
pub mod by_hand;
pub mod compare;
pub mod executed;
pub mod image;
pub mod page;
pub mod ways;
