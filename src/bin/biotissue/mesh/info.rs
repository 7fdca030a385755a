//! `biotissue mesh info`.

use std::path::PathBuf;

use biotissue::app::{LARGEST_SAMPLE, mesh_files};
use clap::Args;

use super::summary;
use crate::failure::Failure;
use crate::number::real;
use crate::output;

#[derive(Args)]
pub struct InfoArguments {
    /// The mesh file: .msh, .vtu, .inp, .mesh or .feb
    file: PathBuf,
    /// Length of a mesh unit, in meters, as `scale` in [mesh] of a case: 0.001 for a mesh in mm [default: 1]
    #[arg(long, value_name = "M", value_parser = real, allow_hyphen_values = true)]
    scale: Option<f64>,
    /// Print the summary as JSON
    #[arg(long)]
    json: bool,
}

/// Reads the mesh and prints its summary; warnings of the reader go to stderr.
pub fn run(InfoArguments { file, scale, json }: &InfoArguments) -> Result<(), Failure> {
    let read = mesh_files::read(file).map_err(Failure::from)?;
    output::warn(&read.warnings);
    let factor = scale.unwrap_or(1.0);
    let mesh = read.mesh.scaled(factor).map_err(|error| {
        let expected = "a positive, finite length in meters";
        Failure::arguments(format!("--scale {factor}: {error}"), expected, "give 0.001 for a mesh in mm")
    })?;
    let [low, high] = mesh.bounding_box();
    let edge = (0..3).map(|axis| high[axis] - low[axis]).fold(0.0, f64::max);
    if scale.is_none() && edge > LARGEST_SAMPLE {
        output::warn(&[format!(
            "{}: the body is {edge:.3} m long: if the mesh is in mm, give --scale 0.001",
            file.display()
        )]);
    }
    summary::print(file, &mesh, *json)
}
