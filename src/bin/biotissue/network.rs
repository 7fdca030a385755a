//! `biotissue network`: make, examine and clean fiber networks.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use biotissue::fiber::law::Law;
use biotissue::fiber::network::check::{Cleaned, NetworkReport, Removed, clean, examine};
use biotissue::fiber::network::file::sidecar::{Generated, NamedLaw, Sidecar};
use biotissue::fiber::network::file::{self, NetworkFile};
use biotissue::fiber::network::generate::{GenerateError, Kind, Recipe};
use biotissue::fiber::network::{Network, NetworkError};
use clap::{Args, Subcommand};
use serde_json::json;

use crate::failure::Failure;
use crate::law::LawArguments;
use crate::number::{count, real, seed};
use crate::output;

/// What to do with networks.
#[derive(Subcommand)]
pub enum NetworkCommand {
    /// Make a network from random points; the same seed gives the same network everywhere
    Generate(GenerateArguments),
    /// Look for what carries no load (exit code 0 whatever is found) and take it out on request
    Check(CheckArguments),
    /// Print what a network is like
    Info(InfoArguments),
}

#[derive(Args)]
pub struct GenerateArguments {
    /// What kind of network: delaunay
    #[arg(long, default_value = "delaunay")]
    kind: String,
    /// Random points in the cube, which become the interior nodes
    #[arg(long, value_name = "N", value_parser = count, allow_hyphen_values = true)]
    #[arg(required_unless_present = "nodes", conflicts_with = "nodes")]
    points: Option<usize>,
    /// Instead of points: nodes in all, boundary included, to come as close to as can be
    #[arg(long, value_name = "N", value_parser = count, allow_hyphen_values = true)]
    nodes: Option<usize>,
    /// Seed of the random numbers
    #[arg(long, value_name = "S", value_parser = seed, default_value_t = 1, allow_hyphen_values = true)]
    seed: u64,
    /// The network file to write; its .toml goes beside it, and a .params if the law has a place there
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    #[command(flatten)]
    law: LawArguments,
}

#[derive(Args)]
pub struct CheckArguments {
    /// The network file
    file: PathBuf,
    /// Take out fibers that dangle and parts that are not tied to the boundary
    #[arg(long, requires = "output")]
    clean: bool,
    /// Where to write the cleaned network, with its materials
    #[arg(short, long, value_name = "FILE", requires = "clean")]
    output: Option<PathBuf>,
    /// Count fibers shorter than this part of the cube's edge, and take them out with --clean
    #[arg(long, value_name = "L", value_parser = real, allow_hyphen_values = true)]
    shorter_than: Option<f64>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

#[derive(Args)]
pub struct InfoArguments {
    /// The network file
    file: PathBuf,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// Runs a command; results go to stdout, warnings to stderr.
pub fn run(command: NetworkCommand) -> Result<(), Failure> {
    match command {
        NetworkCommand::Generate(arguments) => generate(&arguments),
        NetworkCommand::Check(arguments) => check(&arguments),
        NetworkCommand::Info(arguments) => info(&arguments),
    }
}

fn generate(arguments: &GenerateArguments) -> Result<(), Failure> {
    if arguments.kind != "delaunay" {
        return Err(Failure::Arguments {
            what: format!("there is no kind of network called `{}`", arguments.kind),
            expected: "--kind delaunay".into(),
            cure: "take delaunay, or bring a network file of your own".into(),
        });
    }
    let material = arguments.law.material()?;
    let (wanted, network) = match (arguments.points, arguments.nodes) {
        (_, Some(nodes)) => ("--nodes", Recipe::new(Kind::Delaunay, arguments.seed).of_nodes(nodes)),
        (points, None) => ("--points", Recipe::new(Kind::Delaunay, arguments.seed).of_points(points.unwrap_or(0))),
    };
    let mut network = network.map_err(|error| not_generated(wanted, &error))?.network;
    if let Some(material) = material {
        network = network.of_one_material(material);
    }
    let sidecar = Sidecar {
        generated: Some(Generated {
            kind: arguments.kind.clone(),
            points: network.interior().len(),
            seed: arguments.seed,
            program: concat!("biotissue ", env!("CARGO_PKG_VERSION")).into(),
        }),
        length_unit: Some("edge of the cube".into()),
        material,
    };
    write(&arguments.output, &network, &sidecar)?;
    output::print(&summary(&arguments.output, &network))
}

fn not_generated(wanted: &str, error: &GenerateError) -> Failure {
    let (expected, cure) = (format!("{wanted} in that range"), format!("change {wanted} or --seed"));
    Failure::arguments(format!("no network can be generated: {error}"), expected, cure)
}

/// Writes a network with what goes beside it: first the network, then its materials, then where it comes from.
fn write(path: &Path, network: &Network, sidecar: &Sidecar) -> Result<(), Failure> {
    let unwritable = |error: std::io::Error| Failure::unwritable(path, &error);
    file::write(path, network).map_err(unwritable)?;
    let in_params = !network.materials().is_empty()
        && !network.materials().iter().any(|material| matches!(material.law, Law::Exponential { .. }));
    if in_params {
        file::write_params(path, network).map_err(unwritable)?;
    } else {
        file::remove_params(path).map_err(unwritable)?;
    }
    sidecar.write_beside(path).map_err(unwritable)
}

fn read(path: &Path) -> Result<NetworkFile, Failure> {
    let read = file::read(path)?;
    output::warn(&read.warnings);
    Ok(read)
}

fn info(arguments: &InfoArguments) -> Result<(), Failure> {
    let read = read(&arguments.file)?;
    let report = examine(&read.network);
    if arguments.json { output::print_json(&json(&report, &read)) } else { output::print(&in_words(&report, &read)) }
}

fn check(arguments: &CheckArguments) -> Result<(), Failure> {
    if let Some(length) = arguments.shorter_than
        && !(length > 0.0 && length < 1.0)
    {
        return Err(Failure::Arguments {
            what: format!("--shorter-than is {length}"),
            expected: "a part of the cube's edge, above 0 and below 1".into(),
            cure: "lengths are in units of the cube's edge, whatever the units of the file".into(),
        });
    }
    let read = read(&arguments.file)?;
    let report = examine(&read.network);
    let cleaned = clean(&read.network, arguments.shorter_than);
    if let Some(file) = &arguments.output {
        let cleaned = cleaned.as_ref().map_err(|error| nothing_left(&arguments.file, error))?;
        write_cleaned(file, &read, cleaned)?;
    }
    // A network of which nothing would be left is examined all the same.
    let removable = cleaned.ok().map(|cleaned| cleaned.removed);
    if arguments.json {
        let mut object = json(&report, &read);
        object["removable"] = json!(removable);
        object["written"] = json!(arguments.output);
        return output::print_json(&object);
    }
    output::print(&(in_words(&report, &read) + &findings(&report, removable, arguments)))
}

fn write_cleaned(output: &Path, read: &NetworkFile, cleaned: &Cleaned) -> Result<(), Failure> {
    let one_law = match cleaned.network.materials() {
        [material] => Some(*material),
        _ => None,
    };
    // A cleaned network is no longer what its generator made, so that part of the sidecar does not go with it.
    let generated = read.sidecar.as_ref().and_then(|sidecar| sidecar.generated.clone());
    let generated = generated.filter(|_| cleaned.removed.is_nothing());
    let sidecar = Sidecar { generated, length_unit: Some("edge of the cube".into()), material: one_law };
    write(output, &cleaned.network, &sidecar)
}

fn nothing_left(path: &Path, error: &NetworkError) -> Failure {
    Failure::Input(
        biotissue::input::InputError::in_file(
            path,
            format!("nothing is left after cleaning: {error}"),
            "fibers that tie the faces of the cube together",
            "is --shorter-than too long, or the network not tied to its boundary?",
        )
        .into(),
    )
}

/// The one line that says what was made.
fn summary(path: &Path, network: &Network) -> String {
    format!(
        "{}: {} nodes ({} on the boundary), {} fibers, {} free unknowns",
        path.display(),
        network.nodes().len(),
        network.boundary().len(),
        network.fibers().len(),
        3 * network.interior().len(),
    )
}

fn json(report: &NetworkReport, read: &NetworkFile) -> serde_json::Value {
    let mut object = json!(report);
    object["untied_components"] = json!(report.untied().count());
    object["cube"] = json!({ "lower": read.cube.lower, "edges": read.cube.edges });
    object["periodic_pairs"] = json!(read.periodic.len());
    object["laws"] = read.network.materials().iter().map(|material| json!(NamedLaw::from(material))).collect();
    object["warnings"] = json!(read.warnings);
    object
}

/// The report for people. Writing to a string cannot fail.
fn in_words(report: &NetworkReport, read: &NetworkFile) -> String {
    let mut text = String::new();
    let edge = read.cube.edges[0];
    let _ = writeln!(text, "{}", report.name);
    let _ = writeln!(
        text,
        "  nodes            {} ({} on the boundary, {} interior: {} free unknowns)",
        report.nodes, report.boundary_nodes, report.interior_nodes, report.free_dofs
    );
    let _ = writeln!(
        text,
        "  fibers           {} ({} from boundary to boundary; Maxwell's count {:+})",
        report.fibers, report.boundary_fibers, report.maxwell_count
    );
    let _ = writeln!(text, "  cube             edge {edge} in the file; lengths below are parts of it");
    let length = report.length;
    let _ = writeln!(
        text,
        "  fiber length     {:.6} to {:.6}, mean {:.6}, total {:.6}",
        length.min, length.max, length.mean, report.total_length
    );
    if let Some(fibers) = report.coordination {
        let _ = writeln!(text, "  coordination     {} to {} fibers, mean {:.3}", fibers.min, fibers.max, fibers.mean);
    }
    for (name, tensor) in [("orientation", report.orientation), ("  by length", report.orientation_by_length)] {
        let [[xx, xy, xz], [_, yy, yz], [_, _, zz]] = tensor;
        let _ =
            writeln!(text, "  {name:<16} xx {xx:.4}  yy {yy:.4}  zz {zz:.4}  yz {yz:+.4}  xz {xz:+.4}  xy {xy:+.4}");
    }
    for material in read.network.materials() {
        let law = NamedLaw::from(material);
        let _ =
            write!(text, "  law              {}, E {:e} Pa, radius {:e} m", law.name, law.youngs_modulus, law.radius);
        let _ = law.nonlinearity.map_or(Ok(()), |b| write!(text, ", B {b}"));
        let _ = law.transition.map_or(Ok(()), |stretch| write!(text, ", transition {stretch}"));
        text.push('\n');
    }
    let _ = writeln!(
        text,
        "  parts            {}, {} not tied to the boundary",
        report.components.len(),
        report.untied().count()
    );
    text
}

/// What is wrong with the network, and what was or could be done about it.
fn findings(report: &NetworkReport, removed: Option<Removed>, arguments: &CheckArguments) -> String {
    let mut text = String::new();
    if report.maxwell_count < 0 {
        text.push_str(
            "  floppy: fewer fibers than free unknowns; the unstretched network does not resist every motion\n",
        );
    }
    match removed {
        None => text.push_str("  cleaning would leave nothing\n"),
        Some(removed) if removed.is_nothing() => text.push_str("  nothing to take out\n"),
        Some(removed) => {
            let _ = writeln!(
                text,
                "  {}: {} short, {} dangling and {} untied fibers, {} nodes",
                if arguments.clean { "taken out" } else { "to take out (--clean -o FILE)" },
                removed.short_fibers,
                removed.dangling_fibers,
                removed.untied_fibers,
                removed.nodes
            );
        }
    }
    if let Some(output) = &arguments.output {
        let _ = writeln!(text, "  written to {}", output.display());
    }
    text
}
