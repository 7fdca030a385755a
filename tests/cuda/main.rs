//! Checks and measurements on a CUDA device.
//!
//! ```sh
//! cargo test --features cuda --test cuda   # all checks; without a device, fewer cases on an emulated one
//! bash scripts/gpu.sh                      # all checks; without a device, the reason why they are skipped
//! bash scripts/gpu.sh las_                 # those whose names contain the word
//! bash scripts/gpu.sh bench                # the measurements
//! ```
//!
//! With `BIOTISSUE_REQUIRE_GPU=1` a missing device is a failure, with `BIOTISSUE_REQUIRE_GPU=0` the checks are skipped then. A
//! check that fails does not stop the others.

mod bench_las;
mod bench_networks;
mod body;
mod elasticity;
mod emulation;
mod las;
mod networks;
mod program;

use std::panic::{AssertUnwindSafe, PanicHookInfo, catch_unwind};
use std::process::ExitCode;
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use biotissue::backends::cuda::Device;

/// A named check; it panics if it fails.
type Check = (&'static str, fn(&Device));

/// All checks, in this order.
const CHECKS: &[&[Check]] = &[networks::CHECKS, las::CHECKS, program::CHECKS];

/// The beginnings of the names of checks that take equally long, about.
const GROUPS: [&str; 3] = ["las_", "networks_", "program_"];

/// The measurements, which run only if an argument starts with `bench`.
const BENCHES: &[Check] = &[("bench-networks", bench_networks::run), ("bench-las", bench_las::run)];

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

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).filter(|word| !word.starts_with("--")).collect();
    let device = match Device::open(0) {
        Ok(device) => device,
        Err(error) => {
            println!("skipped: {error}");
            let required = std::env::var("BIOTISSUE_REQUIRE_GPU").ok();
            return match required.as_deref() {
                None if !emulation::is_emulated() => emulation::run(&words, &GROUPS),
                Some("0") => ExitCode::SUCCESS,
                _ => ExitCode::FAILURE,
            };
        }
    };
    println!("device: {}", device.name().unwrap_or_else(|error| error.to_string()));
    std::panic::set_hook(Box::new(record_panic));
    let is_bench = words.iter().any(|word| word.starts_with("bench"));
    let checks = if is_bench { BENCHES.to_vec() } else { CHECKS.concat() };
    // `bench` alone asks for all of them; numbers are arguments of a measurement.
    let words: Vec<&String> = words.iter().filter(|word| word.parse::<f64>().is_err()).collect();
    let chosen = checks.iter().filter(|(name, _)| words.is_empty() || words.iter().any(|word| name.contains(&***word)));
    let (mut count, mut failures) = (0, Vec::new());
    for &(name, check) in chosen {
        count += 1;
        failures.extend(run(name, check, &device));
    }
    for failure in &failures {
        println!("\n{failure}");
    }
    println!("\n{} of {count} checks passed", count - failures.len());
    if failures.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
