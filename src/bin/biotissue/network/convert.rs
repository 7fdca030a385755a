//! `biotissue network convert`.

use std::path::PathBuf;

use biotissue::fiber::network::check::examine;
use biotissue::fiber::network::file::sidecar::Sidecar;
use clap::Args;
use serde_json::json;

use super::{json_of_file, laws_of, read, write};
use crate::failure::Failure;
use crate::output;

#[derive(Args)]
pub struct ConvertArguments {
    /// The network file, in the current or the older format (`NODES DOFS FIBERS`, then `id n1 n2 x y z x y z`)
    input: PathBuf,
    /// The network file to write, in units of the cube's edge; its laws are written to files beside it: .toml, and
    /// .params if that format can hold them
    output: PathBuf,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

pub fn run(arguments: &ConvertArguments) -> Result<(), Failure> {
    let read = read(&arguments.input)?;
    let generated = read.sidecar.as_ref().and_then(|sidecar| sidecar.generated.clone());
    let sidecar = Sidecar { generated, length_unit: Some("edge of the cube".into()), ..laws_of(&read.network) };
    write(&arguments.output, &read.network, &sidecar)?;
    if arguments.json {
        let mut object = json_of_file(&examine(&read.network), &read);
        object["written"] = json!(arguments.output);
        return output::print_json(&object);
    }
    let (nodes, fibers) = (read.network.nodes().len(), read.network.fibers().len());
    let laws = match read.network.materials().len() {
        0 => "no law".to_owned(),
        1 => "1 law".to_owned(),
        laws => format!("{laws} laws"),
    };
    output::print(&format!(
        "{}: {nodes} nodes, {fibers} fibers, {laws}; lengths in units of the cube's edge, which is {} in {}\n",
        arguments.output.display(),
        read.cube.edges[0],
        arguments.input.display()
    ))
}
