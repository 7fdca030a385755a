//! Implementations of ranks: threads of one process, or MPI processes (feature `mpi`). Both behave alike behind
//! [`Comm`](crate::las::Comm), except for how a rank that fails ends the others.

#[cfg(feature = "mpi")]
pub mod mpi;
pub mod thread;

/// Returns the message of a panic.
fn panic_message(panic: &(dyn std::any::Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().copied().or_else(|| panic.downcast_ref::<String>().map(String::as_str));
    format!("panicked: {}", text.unwrap_or("no reason given"))
}
