//! The program `biotissue`: reads arguments, picks types, prints results.

mod failure;
mod network;

use std::process::ExitCode;

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
    /// Make, examine and clean fiber networks
    #[command(subcommand)]
    Network(network::NetworkCommand),
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let outcome: Result<(), Failure> = match arguments.command {
        Command::Network(command) => network::run(command),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("{failure}");
            failure.exit_code()
        }
    }
}
