//! The program `biotissue`: reads arguments, picks types, prints results.

mod failure;
mod mesh;

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
    /// Write a mesh of a built-in shape as a Gmsh file
    #[command(subcommand)]
    Mesh(mesh::MeshCommand),
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let outcome: Result<(), Failure> = match arguments.command {
        Command::Mesh(command) => mesh::run(command),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("{failure}");
            failure.exit_code()
        }
    }
}
