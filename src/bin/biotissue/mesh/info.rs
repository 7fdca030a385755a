//! `biotissue mesh info`.

use std::path::PathBuf;

use biotissue::app::mesh_files;
use clap::Args;

use super::summary;
use crate::failure::Failure;
use crate::number::real;
use crate::output;

#[derive(Args)]
pub struct InfoArguments {
    /// The mesh file: .msh, .vtu, .inp, .mesh or .feb
    file: PathBuf,
    /// Length of a mesh unit, in meters, as `scale` in [mesh] of a case: 0.001 for a mesh in mm
    #[arg(long, value_name = "M", value_parser = real, default_value = "1", allow_hyphen_values = true)]
    scale: f64,
    /// Print the summary as JSON
    #[arg(long)]
    json: bool,
}

/// Reads the mesh and prints its summary; warnings of the reader go to stderr.
pub fn run(InfoArguments { file, scale, json }: &InfoArguments) -> Result<(), Failure> {
    let read = mesh_files::read(file).map_err(Failure::from)?;
    output::warn(&read.warnings);
    let mesh = read.mesh.scaled(*scale).map_err(|error| {
        let expected = "a positive, finite length in meters";
        Failure::arguments(format!("--scale {scale}: {error}"), expected, "give 0.001 for a mesh in mm")
    })?;
    summary::print(file, &mesh, *json)
}
