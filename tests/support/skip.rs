//! A list of the tests that cannot run on this machine. The test harness of Rust counts them as passed and hides their
//! output; this module lists them below its summary.

use std::ffi::c_int;
use std::io::Write;
use std::sync::{Mutex, PoisonError};

/// The skipped tests, each with the reason.
static SKIPPED: Mutex<Vec<(String, String)>> = Mutex::new(Vec::new());

#[allow(unsafe_code, reason = "the standard library runs no code at the end of a program")]
// SAFETY: the declaration of the C standard, which requires nothing of the caller.
unsafe extern "C" {
    safe fn atexit(function: extern "C" fn()) -> c_int;
}

/// Records that the running test skips all or a part of its checks.
pub fn skip(reason: &str) {
    let mut skipped = SKIPPED.lock().unwrap_or_else(PoisonError::into_inner);
    if skipped.is_empty() {
        atexit(print_skipped);
    }
    // The harness names the thread of a test after the test; with `--test-threads=1`, there is only the main thread.
    let test = std::thread::current().name().unwrap_or("main").to_owned();
    skipped.push((test, reason.to_owned()));
}

/// Prints the list to stderr; the harness captures only the output of `eprint`.
extern "C" fn print_skipped() {
    let mut skipped = SKIPPED.lock().unwrap_or_else(PoisonError::into_inner);
    skipped.sort();
    skipped.dedup();
    let mut text = format!("SKIPPED, completely or in part, although counted as passed ({}):\n", skipped.len());
    for (test, reason) in skipped.iter() {
        text += &format!("    {test}: {reason}\n");
    }
    let _ = writeln!(std::io::stderr(), "{text}");
}
