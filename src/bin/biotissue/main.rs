//! The program `biotissue`: parses the arguments, runs the command and reports failures.
#![cfg_attr(
    not(any(feature = "sparse", feature = "dense")),
    allow(dead_code, unused_variables, reason = "without a backend, every command that solves returns an error")
)]
// Every error that a user, a file or a library can cause gives a message and an exit code.
#![cfg_attr(
    not(test),
    deny(
        clippy::unwrap_used,
        clippy::expect_used,
        clippy::panic,
        clippy::todo,
        clippy::unimplemented,
        clippy::unreachable
    )
)]

mod check;
mod conditions;
mod dispatch;
mod divide;
mod error_hints;
mod failure;
mod fiber_type;
mod heartbeat;
mod increments;
mod info;
mod interrupt;
mod law;
mod mesh;
mod network;
mod number;
mod output;
mod progress;
mod ranks;
mod report;
mod run;
mod rve;

use std::process::ExitCode;

use biotissue::input::printable;
use clap::{Parser, Subcommand};

use failure::Failure;

#[derive(Parser)]
#[command(name = "biotissue", version, about = "Multiscale simulation of soft tissue", max_term_width = 100)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    Run(run::RunCommand),
    Check(check::CheckCommand),
    Divide(divide::DivideCommand),
    Rve(rve::RveCommand),
    /// Make, examine and clean fiber networks
    #[command(subcommand)]
    Network(network::NetworkCommand),
    /// Write the built-in meshes, or summarize a mesh file
    #[command(subcommand)]
    Mesh(mesh::MeshCommand),
    Report(report::ReportCommand),
    Info(info::InfoCommand),
}

fn main() -> ExitCode {
    let arguments = match Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(error) => return print_argument_error(&error),
    };
    let outcome: Result<(), Failure> = match arguments.command {
        Command::Run(command) => run::run(command),
        Command::Check(command) => check::check(&command),
        Command::Divide(command) => divide::run(command),
        Command::Rve(command) => rve::run(command),
        Command::Network(command) => network::run(command),
        Command::Mesh(command) => mesh::run(command),
        Command::Report(command) => report::run(&command),
        Command::Info(command) => info::run(&command),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            output::message(&failure.to_string());
            failure.exit_code()
        }
    }
}

/// Prints the help, the version, or an argument error with non-printable characters escaped, and returns the exit code.
fn print_argument_error(error: &clap::Error) -> ExitCode {
    let text = error.render().to_string();
    let shown = printable(&text);
    if shown == text {
        error.exit();
    }
    output::message(shown.trim_end());
    u8::try_from(error.exit_code()).map_or(ExitCode::FAILURE, ExitCode::from)
}
