//! The application: cases, coupled scales, results, and commands of the program.
#![cfg(feature = "app")]

#[cfg(all(feature = "sparse", feature = "dense"))]
#[allow(dead_code, reason = "only tests/body uses all items")]
#[path = "../bar_of_24/mod.rs"]
mod bar_of_24;
#[cfg(feature = "sparse")]
#[path = "../support/counting.rs"]
mod counting;
#[path = "../fabricated/mod.rs"]
mod fabricated;
#[cfg(feature = "sparse")]
#[path = "../support/networks.rs"]
mod networks;
#[path = "../support/skip.rs"]
mod skip;

#[cfg(unix)]
mod browser;
#[cfg(feature = "sparse")]
mod dogbone;
mod fiber_types;
mod mesh_command;
mod network_command;
mod report;
mod results_read_back;
#[cfg(feature = "sparse")]
mod resume;
#[cfg(feature = "sparse")]
mod rve_memory;
#[cfg(feature = "sparse")]
mod sweep;
#[cfg(all(feature = "sparse", feature = "dense"))]
mod two_scale;

#[cfg(feature = "sparse")]
#[global_allocator]
static ALLOCATOR: counting::Counting = counting::Counting;
