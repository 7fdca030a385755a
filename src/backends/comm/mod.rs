//! Implementations of ranks: threads of one process, or MPI processes (feature `mpi`). Both behave alike behind
//! [`Comm`](crate::las::Comm), except for how a rank that fails ends the others.

#[cfg(feature = "mpi")]
pub mod mpi;
pub mod thread;

/// Returns the message of a panic.
fn words_of(panic: &(dyn std::any::Any + Send)) -> String {
    let words = panic.downcast_ref::<&str>().map(|words| (*words).to_owned());
    let words = words.or_else(|| panic.downcast_ref::<String>().cloned());
    format!("panicked: {}", words.unwrap_or_else(|| "no reason given".into()))
}
