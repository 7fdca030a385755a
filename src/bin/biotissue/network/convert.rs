//! `biotissue network convert`.

use std::path::PathBuf;

use biotissue::fiber::network::check::examine;
use biotissue::fiber::network::file::sidecar::Sidecar;
use clap::Args;
use serde_json::json;

use super::{json_of_file, laws_of, read, write};
use crate::failure::Failure;

#[derive(Args)]
pub struct ConvertArguments {
    /// The network file, in the current or the older format (`NODES DOFS FIBERS`, then `id n1 n2 x y z x y z`)
    input: PathBuf,
    /// The network file to write, in units of the cube's edge; its laws are written to files beside it: .toml, and
    /// .params if that format can hold them
    #[arg(value_name = "OUTPUT", required_unless_present = "option")]
    output: Option<PathBuf>,
    /// The same as OUTPUT
    #[arg(short = 'o', long = "output", value_name = "FILE", id = "option", conflicts_with = "output")]
    option: Option<PathBuf>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

pub fn run(arguments: &ConvertArguments) -> Result<(), Failure> {
    let Some(output) = arguments.output.as_ref().or(arguments.option.as_ref()) else {
        return Err(Failure::arguments("no file to write is named", "convert INPUT OUTPUT", "name the file to write"));
    };
    let read = read(&arguments.input)?;
    let generated = read.sidecar.as_ref().and_then(|sidecar| sidecar.generated.clone());
    let sidecar = Sidecar { generated, length_unit: Some("edge of the cube".into()), ..laws_of(&read.network) };
    write(output, &read.network, &sidecar)?;
    if arguments.json {
        let mut object = json_of_file(&examine(&read.network), &read);
        object["written"] = json!(output);
        return crate::output::print_json(&object);
    }
    let (nodes, fibers) = (read.network.nodes().len(), read.network.fibers().len());
    let laws = match read.network.materials().len() {
        0 => "no law".to_owned(),
        1 => "1 law".to_owned(),
        laws => format!("{laws} laws"),
    };
    crate::output::print(&format!(
        "{}: {nodes} nodes, {fibers} fibers, {laws}; lengths in units of the cube's edge, which is {} in {}\n",
        output.display(),
        read.cube.edges[0],
        arguments.input.display()
    ))
}
