//! Ranks: threads of one process, or processes of MPI (feature `mpi`). Behind [`Comm`](crate::las::Comm)
//! both do the same; what differs is how one that fails ends the others.

#[cfg(feature = "mpi")]
pub mod mpi;
pub mod thread;

/// What somebody panicked with.
fn words_of(panic: &(dyn std::any::Any + Send)) -> String {
    let words = panic.downcast_ref::<&str>().map(|words| (*words).to_owned());
    let words = words.or_else(|| panic.downcast_ref::<String>().cloned());
    format!("panicked: {}", words.unwrap_or_else(|| "no reason given".into()))
}
