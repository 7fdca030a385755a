//! `biotissue network`: make, examine, clean, convert and draw fiber networks.

mod check;
mod convert;
mod draw;
mod generate;
mod info;
mod library;
mod text;

use std::path::Path;

use biotissue::app::mesh_files::ENDINGS;
use biotissue::fiber::network::check::RigidityError;
use biotissue::fiber::network::file::file_set::{FileSetError, write_file_set};
use biotissue::fiber::network::file::sidecar::{FiberTypes, NamedLaw, Sidecar};
use biotissue::fiber::network::file::{self, NetworkFile};
use biotissue::fiber::network::{Network, check::NetworkReport};
use clap::Subcommand;
use serde_json::json;

use crate::failure::Failure;
use crate::output;

/// What to do with networks.
#[derive(Subcommand)]
pub enum NetworkCommand {
    /// Make a network from random points, or a library of them; the same seed gives the same network everywhere
    Generate(generate::GenerateArguments),
    /// Find parts that carry no load and motions without resistance (exit code 0 in any case); clean on request
    Check(check::CheckArguments),
    /// Write a network of any format that can be read in the current format, with its laws
    Convert(convert::ConvertArguments),
    /// Print the properties of a network
    Info(info::InfoArguments),
    /// Draw a network, at rest or deformed
    Draw(draw::DrawArguments),
}

/// Runs a command; results go to stdout, warnings to stderr.
pub fn run(command: NetworkCommand) -> Result<(), Failure> {
    match command {
        NetworkCommand::Generate(arguments) => generate::run(&arguments),
        NetworkCommand::Check(arguments) => check::run(&arguments),
        NetworkCommand::Convert(arguments) => convert::run(&arguments),
        NetworkCommand::Info(arguments) => info::run(&arguments),
        NetworkCommand::Draw(arguments) => draw::run(&arguments),
    }
}

/// Returns the sidecar data for the laws of a network.
fn laws_of(network: &Network) -> Sidecar {
    let one_law = match network.materials() {
        [material] => Some(material.clone()),
        _ => None,
    };
    Sidecar { material: one_law, fiber_types: FiberTypes::of(network), ..Sidecar::default() }
}

/// Writes a network and the files beside it with its materials and its origin.
fn write(path: &Path, network: &Network, sidecar: &Sidecar) -> Result<(), Failure> {
    output::make_folder_of(path)?;
    if biotissue::output::is_stream(path) {
        let what = format!("{}: not a regular file: the network is written without its materials", path.display());
        output::warn(&[what]);
    }
    write_file_set(path, network, sidecar).map_err(|error| match &error {
        FileSetError::Write { path, source } => Failure::unwritable(path, source),
        FileSetError::UnknownOrigin { .. } => Failure::arguments(
            format!("{error}; nothing is written"),
            "no such file, or one that `biotissue network` wrote with a network and that is unchanged since",
            "move or rename that file, or give the network another name",
        ),
    })
}

fn read(path: &Path) -> Result<NetworkFile, Failure> {
    let is_mesh = path.extension().is_some_and(|ending| ENDINGS.iter().any(|mesh| ending == *mesh));
    let read = file::read(path).map_err(|mut errors| {
        if is_mesh {
            let cure = "if it is a mesh, `biotissue mesh info` reads it";
            errors.0.iter_mut().filter(|error| error.line.is_some()).for_each(|error| error.cure = cure.into());
        }
        errors
    })?;
    output::warn(&read.warnings);
    Ok(read)
}

/// Rejects a length that is not a fraction of the edge of the cube.
fn check_length(shorter_than: Option<f64>) -> Result<(), Failure> {
    match shorter_than {
        Some(length) if !(length > 0.0 && length < 1.0) => Err(Failure::arguments(
            format!("--shorter-than is {length}"),
            "a part of the cube's edge, above 0 and below 1",
            "lengths are in units of the cube's edge, whatever the units of the file",
        )),
        _ => Ok(()),
    }
}

/// Returns the JSON properties of a network that all subcommands print.
fn json_of_network(report: &NetworkReport, network: &Network) -> serde_json::Value {
    let mut object = json!(report);
    object["density"] = json!(report.total_length);
    object["unsupported_components"] = json!(report.unsupported().count());
    object["laws"] = network.materials().iter().map(|material| json!(NamedLaw::from(material))).collect();
    object
}

/// Returns the properties of [`json_of_network`] and those of the file.
fn json_of_file(report: &NetworkReport, read: &NetworkFile) -> serde_json::Value {
    let mut object = json_of_network(report, &read.network);
    object["cube"] = json!({ "lower": read.cube.lower, "edges": read.cube.edges });
    object["periodic_pairs"] = json!(read.periodic.len());
    object["warnings"] = json!(read.warnings);
    object
}

/// Returns the failure for zero modes that could not be counted.
fn not_counted<F: std::error::Error>(name: &str, error: &RigidityError<F>) -> Failure {
    Failure::library(format!("{name}: {error}"))
}
