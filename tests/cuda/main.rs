//! Checks and measurements on a CUDA device.
//!
//! ```sh
//! cargo test --features cuda --test cuda   # all checks; without a device, on an emulated one, with fewer and smaller cases
//! bash scripts/gpu.sh                      # all checks; without a device, the reason why they are skipped
//! bash scripts/gpu.sh las_                 # those whose names contain the word
//! bash scripts/gpu.sh bench                # the measurements
//! ```
//!
//! With `BIOTISSUE_REQUIRE_GPU=1` a missing device is a failure, with `BIOTISSUE_REQUIRE_GPU=0` the checks are skipped then. A
//! check that fails does not stop the others.

mod bench_cudss;
mod bench_las;
mod bench_networks;
mod body;
mod elasticity;
mod emulation;
mod las;
#[path = "../support/launcher.rs"]
mod launcher;
mod networks;
mod program;

use std::panic::{AssertUnwindSafe, PanicHookInfo, catch_unwind};
use std::process::ExitCode;
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use biotissue::backends::cuda::{CudaError, Device};

/// A named check; it panics if it fails.
type Check = (&'static str, fn(&Device));

/// All checks, in this order.
const CHECKS: &[&[Check]] = &[networks::CHECKS, las::CHECKS, program::CHECKS];

/// The beginnings of the names of checks that take equally long, about.
const GROUPS: [&str; 3] = ["las_", "networks_", "program_"];

/// The measurements, which run only if an argument starts with `bench`.
const BENCHES: &[Check] =
    &[("bench-networks", bench_networks::run), ("bench-las", bench_las::run), ("bench-cudss", bench_cudss::run)];

/// The message of the last panic, with its position.
static LAST_PANIC: Mutex<String> = Mutex::new(String::new());

fn record_panic(panic: &PanicHookInfo<'_>) {
    let payload = panic.payload();
    let text = payload.downcast_ref::<&str>().map(|text| (*text).to_owned());
    let text = text.or_else(|| payload.downcast_ref::<String>().cloned()).unwrap_or_default();
    let place = panic.location().map(ToString::to_string).unwrap_or_default();
    *LAST_PANIC.lock().unwrap_or_else(PoisonError::into_inner) = format!("{place}: {text}");
}

/// Runs a check; returns the message of its failure.
fn run(name: &str, check: fn(&Device), device: &Device) -> Option<String> {
    let start = Instant::now();
    let outcome = catch_unwind(AssertUnwindSafe(|| {
        check(device);
        device.synchronize().unwrap();
    }));
    let seconds = start.elapsed().as_secs_f64();
    let failure = outcome.err().map(|_| LAST_PANIC.lock().unwrap_or_else(PoisonError::into_inner).clone());
    println!("{} {name} ({seconds:.2} s)", if failure.is_some() { "FAILED" } else { "ok    " });
    failure.map(|message| format!("{name}: {message}"))
}

/// Runs the checks on an emulated device, unless a device is required, or an emulated one is not wanted or of no use.
fn without_device(error: &CudaError, is_bench: bool, words: &[String]) -> ExitCode {
    match std::env::var("BIOTISSUE_REQUIRE_GPU").as_deref() {
        Err(_) if !is_bench && !emulation::is_emulated() => {
            println!("there is no device ({error}): the checks run on an emulated one");
            let is_in_group = |name: &str| GROUPS.iter().any(|group| name.starts_with(group));
            assert!(CHECKS.concat().iter().all(|(name, _)| is_in_group(name)), "a check of no group");
            emulation::run(words, &GROUPS)
        }
        Err(_) if !emulation::is_emulated() => skipped(error),
        Ok("0") => skipped(error),
        _ => {
            println!("{error}");
            ExitCode::FAILURE
        }
    }
}

fn skipped(error: &CudaError) -> ExitCode {
    println!("skipped: {error}");
    ExitCode::SUCCESS
}

/// Returns the checks whose names contain one of the words, or all without any.
fn chosen(checks: Vec<Check>, words: &[String]) -> Vec<Check> {
    // Numbers are arguments of a measurement.
    let words: Vec<&String> = words.iter().filter(|word| word.parse::<f64>().is_err()).collect();
    let is_chosen = |name: &str| words.is_empty() || words.iter().any(|word| name.contains(&***word));
    checks.into_iter().filter(|(name, _)| is_chosen(name)).collect()
}

fn main() -> ExitCode {
    let (options, words): (Vec<String>, Vec<String>) =
        std::env::args().skip(1).partition(|word| word.starts_with("--"));
    let is_bench = words.iter().any(|word| word.starts_with("bench"));
    let checks = chosen(if is_bench { BENCHES.to_vec() } else { CHECKS.concat() }, &words);
    // Options of the usual harness; and words that name tests of other programs.
    if checks.is_empty() || options.iter().any(|option| ["--list", "--ignored"].contains(&&**option)) {
        println!("0 of 0 checks passed");
        return ExitCode::SUCCESS;
    }
    let device = match Device::open(0) {
        Ok(device) => device,
        Err(error) => return without_device(&error, is_bench, &words),
    };
    println!("device: {}", device.name().unwrap_or_else(|error| error.to_string()));
    std::panic::set_hook(Box::new(record_panic));
    let (mut count, mut failures) = (0, Vec::new());
    for (name, check) in checks {
        count += 1;
        failures.extend(run(name, check, &device));
    }
    for failure in &failures {
        println!("\n{failure}");
    }
    println!("\n{} of {count} checks passed", count - failures.len());
    if failures.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
