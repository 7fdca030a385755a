//! `biotissue network check`.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use biotissue::backends;
use biotissue::fiber::network::check::{Cleaned, NetworkReport, Removed, Rigidity, clean, examine, rigidity};
use biotissue::fiber::network::file::NetworkFile;
use biotissue::fiber::network::file::sidecar::Sidecar;
use biotissue::fiber::network::{Cube, Network, NetworkError};
use biotissue::input::{InputError, InputErrors};

use clap::Args;
use serde_json::json;

use super::{check_length, json_of_file, json_of_network, laws_of, not_counted, read, text, write};
use crate::dispatch::{Job, ProgramBackend, dispatch};
use crate::failure::Failure;
use crate::number::real;
use crate::output;

#[derive(Args)]
pub struct CheckArguments {
    /// The network files
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Remove fibers that dangle and parts that are not connected to the boundary; merge fibers of the same law that
    /// join the same two nodes into one with the sum of their cross-sectional areas, which responds as they do together
    /// (fibers of different laws, and those of a network without laws, are kept and counted)
    #[arg(long)]
    clean: bool,
    /// Where to write the cleaned network, with its materials
    #[arg(short, long, value_name = "FILE", requires = "clean", conflicts_with = "directory")]
    output: Option<PathBuf>,
    /// Where to write cleaned networks of any number, under their names; it is made if there is none
    #[arg(long, value_name = "D", requires = "clean")]
    directory: Option<PathBuf>,
    /// Count fibers shorter than this fraction of the cube's edge, and remove them with --clean
    #[arg(long, value_name = "L", value_parser = real, allow_hyphen_values = true)]
    shorter_than: Option<f64>,
    /// Linear-algebra backend that counts the zero modes
    #[arg(long, value_name = "NAME")]
    backend: Option<String>,
    /// Print one JSON object per file, each on its own line
    #[arg(long)]
    json: bool,
}

/// Checks one file after another. Errors in the files are reported together at the end.
pub fn run(arguments: &CheckArguments) -> Result<(), Failure> {
    check_length(arguments.shorter_than)?;
    if arguments.files.len() > 1 && arguments.output.is_some() {
        return Err(Failure::arguments(
            format!("--clean with {} network files, but one --output", arguments.files.len()),
            "one network to clean, or --directory D",
            "give --directory D instead of --output: the networks keep their names there",
        ));
    }
    if arguments.clean && arguments.output.is_none() && arguments.directory.is_none() {
        let expected = "--output FILE for one network, --directory D for any number";
        return Err(Failure::arguments("--clean without a place to write to", expected, "add one of them"));
    }
    let outputs = outputs(arguments)?;
    let mut errors = Vec::new();
    for (file, output) in arguments.files.iter().zip(outputs) {
        match check(file, output.as_deref(), arguments) {
            Err(Failure::Input(InputErrors(found))) => errors.extend(found),
            outcome => outcome?,
        }
    }
    if errors.is_empty() { Ok(()) } else { Err(Failure::Input(InputErrors(errors))) }
}

/// Returns where each cleaned network is written.
fn outputs(arguments: &CheckArguments) -> Result<Vec<Option<PathBuf>>, Failure> {
    let Some(directory) = &arguments.directory else {
        return Ok(vec![arguments.output.clone(); arguments.files.len()]);
    };
    let mut outputs: Vec<Option<PathBuf>> = Vec::new();
    for file in &arguments.files {
        let output = directory.join(file.file_name().unwrap_or(file.as_os_str()));
        if outputs.contains(&Some(output.clone())) {
            let what = format!("two of the networks would be written to {}", output.display());
            return Err(Failure::arguments(
                what,
                "networks of different names",
                "clean them into different directories",
            ));
        }
        outputs.push(Some(output));
    }
    Ok(outputs)
}

fn check(file: &Path, output: Option<&Path>, arguments: &CheckArguments) -> Result<(), Failure> {
    let read = read(file)?;
    let report = examine(&read.network);
    let rigidity = rigidity_of(&read.network, arguments)?;
    let cleaned = clean(&read.network, arguments.shorter_than);
    if let Some(output) = output {
        let cleaned = cleaned.as_ref().map_err(|error| no_network_left(file, error))?;
        write_cleaned(output, &read, cleaned)?;
    }
    // A network that cleaning would remove completely is examined all the same.
    let cleaned = cleaned.ok();
    let removable = cleaned.as_ref().map(|cleaned| cleaned.removed);
    let kept_doubled = cleaned.as_ref().map(|cleaned| cleaned.kept_doubled_fibers);
    let after = cleaned.filter(|_| arguments.clean).map(|cleaned| cleaned.network);
    let after = after.map(|network| -> Result<_, Failure> {
        let rigidity = rigidity_of(&network, arguments)?;
        Ok((examine(&network), rigidity, network))
    });
    let after = after.transpose()?;
    if arguments.json {
        let mut object = json_of_file(&report, &read);
        object["rigidity"] = json!(rigidity);
        object["removable"] = json!(removable);
        object["kept_doubled_fibers"] = json!(kept_doubled);
        object["written"] = json!(output);
        object["cleaned"] = after.as_ref().map_or(json!(null), |(report, rigidity, network)| {
            let mut cleaned = json_of_network(report, network);
            cleaned["rigidity"] = json!(rigidity);
            cleaned
        });
        return output::print_json(&object);
    }
    let mut out = format!("{}\n{}", report.name, text::figures(&report, &read.network, &read.cube, None));
    out.push_str(&rigidity.as_ref().map_or_else(String::new, text::rigidity));
    out.push_str(&findings(&report, removable, arguments));
    out.push_str(&kept_doubled.map_or_else(String::new, |count| text::kept_doubled(count, &read.network)));
    if let Some(output) = output {
        let _ = writeln!(out, "  written to {}", output.display());
    }
    if let Some((report, rigidity, network)) = &after {
        let _ = write!(out, "after cleaning\n{}", text::figures(report, network, &Cube::UNIT, None));
        out.push_str(&rigidity.as_ref().map_or_else(String::new, text::rigidity));
    }
    output::print(&out)
}

/// Returns the rigidity; `None` if no backend is compiled in or named.
fn rigidity_of(network: &Network, arguments: &CheckArguments) -> Result<Option<Rigidity>, Failure> {
    if arguments.backend.is_none() && backends::compiled().is_empty() {
        return Ok(None);
    }
    dispatch(arguments.backend.as_deref(), RigidityJob { network }).map(Some)
}

/// The job that examines the rigidity of a network.
struct RigidityJob<'a> {
    network: &'a Network,
}

impl Job for RigidityJob<'_> {
    type Output = Rigidity;

    fn run<B: ProgramBackend>(self, context: B::Context) -> Result<Rigidity, Failure> {
        rigidity::<B>(&context, self.network).map_err(|error| not_counted(self.network.name(), &error))
    }
}

fn write_cleaned(output: &Path, read: &NetworkFile, cleaned: &Cleaned) -> Result<(), Failure> {
    // A cleaned network differs from the generated one, so the sidecar omits the generator data.
    let generated = read.sidecar.as_ref().and_then(|sidecar| sidecar.generated.clone());
    let generated = generated.filter(|_| cleaned.removed.is_nothing());
    let sidecar = Sidecar { generated, length_unit: Some("edge of the cube".into()), ..laws_of(&cleaned.network) };
    write(output, &cleaned.network, &sidecar)
}

fn no_network_left(path: &Path, error: &NetworkError) -> Failure {
    Failure::Input(
        InputError::in_file(
            path,
            format!("nothing is left after cleaning: {error}"),
            "fibers that connect the faces of the cube",
            "is --shorter-than too large, or the network not connected to its boundary?",
        )
        .into(),
    )
}

/// Describes the defects of the network and what cleaning removed or would remove.
fn findings(report: &NetworkReport, removed: Option<Removed>, arguments: &CheckArguments) -> String {
    let mut text = String::new();
    if report.maxwell_count < 0 {
        text.push_str("  floppy: fewer fibers than free unknowns\n");
    }
    match removed {
        None => text.push_str("  cleaning would leave nothing\n"),
        Some(removed) if removed.is_nothing() => text.push_str("  nothing to remove\n"),
        Some(removed) => {
            let done = if arguments.clean { "removed" } else { "to remove (--clean -o FILE)" };
            let _ = writeln!(text, "  {done}: {}", text::removed(&removed));
        }
    }
    text
}
