//! `biotissue network generate`.

use std::path::{Path, PathBuf};

use biotissue::fiber::law::FiberMaterial;
use biotissue::fiber::network::check::examine;
use biotissue::fiber::network::file::sidecar::{Generated, Sidecar};
use biotissue::fiber::network::generate::{
    Alignment, GenerateError, GeneratedNetwork, GeneratorParams, Kind, MAX_STRENGTH,
};
use biotissue::fiber::network::{Cube, FiberTypesError};
use clap::Args;
use serde_json::json;

use super::library::{self, Member};
use super::{check_length, json_of_network, laws_of, text, write};
use crate::failure::Failure;
use crate::fiber_type::FiberTypeArgument;
use crate::law::LawArguments;
use crate::number::{count, real, seed};
use crate::output;

#[derive(Args)]
pub struct GenerateArguments {
    /// Kind of network: delaunay (rigid, about 15 fibers per node) or voronoi (floppy, 4 fibers per node)
    #[arg(long, default_value = "delaunay")]
    kind: String,
    /// Size: random points in the cube; each becomes an interior node (delaunay) or a cell (voronoi)
    #[arg(long, value_name = "N", value_parser = count, allow_hyphen_values = true)]
    points: Option<usize>,
    /// Size: number of nodes, boundary included; the closest possible number is taken
    #[arg(long, value_name = "N", value_parser = count, allow_hyphen_values = true)]
    nodes: Option<usize>,
    /// Size: total length of the fibers in the unit cube; the closest possible length is taken
    #[arg(long, value_name = "L", value_parser = real, allow_hyphen_values = true)]
    density: Option<f64>,
    /// Preferred direction of the fibers: "x y z"; with --strength
    #[arg(long, value_name = "X Y Z", allow_hyphen_values = true)]
    align: Option<String>,
    /// Strength of the alignment: the order parameter P2, from 0 (isotropic) to 0.95
    #[arg(long, value_name = "S", value_parser = real, allow_hyphen_values = true)]
    strength: Option<f64>,
    /// Merge nodes joined by a fiber shorter than this fraction of the mean spacing of the points [default: 0.05 for
    /// voronoi, 0 for delaunay]
    #[arg(long, value_name = "M", value_parser = real, allow_hyphen_values = true)]
    merge: Option<f64>,
    /// Remove fibers shorter than this fraction of the cube's edge, and fibers that dangle or lose contact with the
    /// boundary as a result
    #[arg(long, value_name = "L", value_parser = real, allow_hyphen_values = true)]
    shorter_than: Option<f64>,
    /// Seed of the random numbers
    #[arg(long, value_name = "S", value_parser = seed, default_value_t = 1, allow_hyphen_values = true)]
    seed: u64,
    /// The network file to write; a .toml file is written beside it, and a .params file if that format can hold the law
    #[arg(short, long, value_name = "FILE", required_unless_present = "count")]
    output: Option<PathBuf>,
    /// Instead of --output: write a library of N networks with the seeds S, S+1, ... (--seed S) to --directory, as
    /// network-0001.txt and so on, numbered by the seed, each with the files beside it; existing files are not replaced,
    /// and seeds without a network are passed over
    #[arg(long, value_name = "N", value_parser = count, allow_hyphen_values = true, requires = "directory")]
    #[arg(conflicts_with = "output")]
    count: Option<usize>,
    /// The directory of the library; it is made if there is none
    #[arg(long, value_name = "D", requires = "count")]
    directory: Option<PathBuf>,
    #[command(flatten)]
    law: LawArguments,
    /// Instead of --law: the law of a fraction of the fibers, drawn at random by the seed; repeat until the fractions
    /// sum to 1: "fraction=0.7,law=exponential,youngs-modulus=1e8,radius=5e-8,nonlinearity=1.2". Keys: fraction (of
    /// the fibers, by number); law, its parameters, radius, table, compression and buckling-strain as the options of
    /// these names; density (of the fiber material, kg/m^3)
    #[arg(long = "fiber", value_name = "KEY=VALUE,...", conflicts_with = "law")]
    fibers: Vec<FiberTypeArgument>,
    /// Print one JSON object; of a library one per network, each on its own line
    #[arg(long)]
    json: bool,
}

/// The requested size of the network.
#[derive(Clone, Copy)]
enum Size {
    Points(usize),
    Nodes(usize),
    Density(f64),
}

pub fn run(arguments: &GenerateArguments) -> Result<(), Failure> {
    let params = generator_params(arguments)?;
    let size = size(arguments)?;
    let material = arguments.law.material()?;
    let types: Vec<_> = arguments.fibers.iter().map(FiberTypeArgument::material).collect::<Result<_, _>>()?;
    let request = Request { size, material, types };
    match (&arguments.output, &arguments.directory, arguments.count) {
        (Some(output), ..) if output.extension().is_some_and(|ending| ending == "toml") => Err(Failure::arguments(
            format!("invalid --output {}", output.display()),
            "the name of a network file, such as network.txt; .toml is the ending of cases",
            "change the ending",
        )),
        (Some(output), ..) => {
            let (made, generated) = request.write(&params, output).map_err(|error| not_written(error, ""))?;
            print_summary(arguments, output, &params, &made, &generated)
        }
        (None, Some(directory), Some(count)) => write_library(arguments, &params, &request, directory, count),
        _ => Err(Failure::arguments(
            "no option names the file of the network",
            "--output FILE, or --count N and --directory D",
            "add --output FILE",
        )),
    }
}

/// Writes networks with consecutive seeds, without those whose network has no fiber through a face of the cube or another
/// defect that a seed may have; those before a failure are left in the directory.
fn write_library(
    arguments: &GenerateArguments,
    params: &GeneratorParams,
    request: &Request,
    directory: &Path,
    count: usize,
) -> Result<(), Failure> {
    let members = library::members(directory, params.seed, count)?;
    let [mut nodes, mut fibers, mut skipped] = [0; 3];
    let mut written: Vec<PathBuf> = Vec::new();
    for member in members {
        let Member { seed, path } = &member;
        let params = GeneratorParams { seed: *seed, ..*params };
        let number = written.len();
        let plural = if number == 1 { "" } else { "s" };
        let place = format!(" with seed {seed}, after {number} network{plural}");
        if number + skipped >= count {
            library::refuse_existing(std::slice::from_ref(&member))?;
        }
        let (made, generated) = match request.write(&params, path) {
            Ok(made) => made,
            Err(NotWritten::Generator(error))
                if depends_on_seed(&error) && skipped < library::MOST_SKIPPED * (number + 1) =>
            {
                output::warn(&[format!("no network with seed {seed}: {error}; the next seed takes its place")]);
                skipped += 1;
                continue;
            }
            Err(error) => return Err(not_written(error, &place)),
        };
        if arguments.json {
            print_summary(arguments, path, &params, &made, &generated)?;
        }
        nodes += made.network.nodes().len();
        fibers += made.network.fibers().len();
        written.push(path.clone());
        if written.len() == count {
            break;
        }
    }
    if written.len() < count {
        let what = format!("no seeds are left after {} networks and {skipped} seeds without one", written.len());
        return Err(Failure::arguments(what, "seeds with a network", "lower --seed"));
    }
    if arguments.json {
        return Ok(());
    }
    let mean = |sum: usize| sum as f64 / count as f64;
    let name = |path: Option<&PathBuf>| path.map_or_else(String::new, |path| path.display().to_string());
    let without = match skipped {
        0 => String::new(),
        1 => "; 1 seed without a network was passed over".into(),
        _ => format!("; {skipped} seeds without a network were passed over"),
    };
    output::print(&format!(
        "{} to {}: {count} {} networks, {:.1} nodes and {:.1} fibers on average{without}\n",
        name(written.first()),
        name(written.last()),
        params.kind.name(),
        mean(nodes),
        mean(fibers)
    ))
}

/// Returns true if another seed may have a network where this one has none.
fn depends_on_seed(error: &GenerateError) -> bool {
    matches!(error, GenerateError::OpenFace { .. } | GenerateError::NoRoom { .. } | GenerateError::Network(_))
}

/// What all networks of one call have in common besides the parameters of the generator.
struct Request {
    size: Size,
    material: Option<FiberMaterial>,
    types: Vec<(f64, FiberMaterial)>,
}

/// The reason why a network is not written.
enum NotWritten {
    Generator(GenerateError),
    Types(FiberTypesError),
    Files(Failure),
}

impl Request {
    /// Generates a network and writes it to `path`, with the files beside it.
    fn write(&self, params: &GeneratorParams, path: &Path) -> Result<(GeneratedNetwork, Generated), NotWritten> {
        let made = match self.size {
            Size::Points(points) => params.of_points(points),
            Size::Nodes(nodes) => params.of_nodes(nodes),
            Size::Density(density) => params.of_density(density),
        };
        let mut made = made.map_err(NotWritten::Generator)?;
        if let Some(material) = &self.material {
            made.network = made.network.of_one_material(material.clone());
        } else if !self.types.is_empty() {
            let typed = made.network.with_random_types(self.types.clone(), params.seed);
            made.network = typed.map_err(NotWritten::Types)?;
        }
        let generated = Generated::by(params, made.points);
        let length_unit = Some("edge of the cube".into());
        let sidecar = Sidecar { generated: Some(generated.clone()), length_unit, ..laws_of(&made.network) };
        write(path, &made.network, &sidecar).map_err(NotWritten::Files)?;
        Ok((made, generated))
    }
}

/// Prints a summary of the generated network.
fn print_summary(
    arguments: &GenerateArguments,
    file: &Path,
    params: &GeneratorParams,
    made: &GeneratedNetwork,
    generated: &Generated,
) -> Result<(), Failure> {
    let report = examine(&made.network);
    let axis = params.alignment.map(|alignment| alignment.axis());
    if arguments.json {
        let mut object = json_of_network(&report, &made.network);
        object["file"] = json!(file);
        object["generated"] = json!(generated);
        object["removed"] = json!(made.removed);
        object["order_of_alignment"] = json!(axis.map(|axis| report.order_about(axis)[0]));
        return output::print_json(&object);
    }
    let mut text =
        format!("{}: {}, {} points, seed {}\n", file.display(), params.kind.name(), made.points, params.seed);
    text.push_str(&text::figures(&report, &made.network, &Cube::UNIT, axis));
    if !made.removed.is_nothing() {
        text.push_str(&format!("  removed          {}\n", text::removed(&made.removed)));
    }
    output::print(&text)
}

fn generator_params(arguments: &GenerateArguments) -> Result<GeneratorParams, Failure> {
    let kinds = || Kind::ALL.map(Kind::name).join(" or ");
    let Some(kind) = Kind::ALL.into_iter().find(|kind| kind.name() == arguments.kind) else {
        return Err(Failure::arguments(
            format!("there is no kind of network called `{}`", arguments.kind),
            format!("--kind {}", kinds()),
            "use one of these, or a network file from another source",
        ));
    };
    check_length(arguments.shorter_than)?;
    let plain = GeneratorParams::new(kind, arguments.seed);
    Ok(GeneratorParams {
        merge_length: arguments.merge.unwrap_or(plain.merge_length),
        alignment: alignment(arguments)?,
        min_length: arguments.shorter_than,
        ..plain
    })
}

fn size(arguments: &GenerateArguments) -> Result<Size, Failure> {
    let sizes =
        [arguments.points.map(Size::Points), arguments.nodes.map(Size::Nodes), arguments.density.map(Size::Density)];
    let given: Vec<Size> = sizes.into_iter().flatten().collect();
    let what = match given[..] {
        [size] => return Ok(size),
        [] => "no option gives the size of the network",
        _ => "more than one option gives the size of the network",
    };
    Err(Failure::arguments(
        what,
        "one of --points N, --nodes N and --density L",
        "--points 60 gives a network of a suitable size for an RVE",
    ))
}

fn alignment(arguments: &GenerateArguments) -> Result<Option<Alignment>, Failure> {
    let (text, strength) = match (&arguments.align, arguments.strength) {
        (None, None) => return Ok(None),
        (Some(text), Some(strength)) => (text, strength),
        (align, _) => {
            let (there, missing) =
                if align.is_some() { ("--align", "--strength S") } else { ("--strength", "--align \"x y z\"") };
            let (what, expected) = (format!("{there} without {missing}"), "a direction and a strength, or neither");
            return Err(Failure::arguments(what, expected, format!("add {missing}, or leave out {there}")));
        }
    };
    let words = text.split(|c: char| c.is_whitespace() || c == ',').filter(|word| !word.is_empty());
    let numbers: Result<Vec<f64>, _> = words.map(str::parse).collect();
    let direction = numbers.ok().and_then(|numbers| <[f64; 3]>::try_from(numbers).ok()).ok_or_else(|| {
        let (what, expected) = (format!("invalid --align \"{text}\""), "three numbers: \"x y z\"");
        Failure::arguments(what, expected, "fibers along x: --align \"1 0 0\"; the quotes are required")
    })?;
    Alignment::new(direction, strength).map(Some).map_err(|error| not_generated(&error, ""))
}

/// Returns the failure for a network that is not written; `place` names the member of a library.
fn not_written(error: NotWritten, place: &str) -> Failure {
    match error {
        NotWritten::Generator(error) => not_generated(&error, place),
        NotWritten::Types(error) => {
            let cure = "give every --fiber a fraction above 0, all together 1";
            Failure::arguments(error.to_string(), "fractions that sum to 1", cure)
        }
        NotWritten::Files(failure) => failure,
    }
}

fn not_generated(error: &GenerateError, place: &str) -> Failure {
    let (expected, cure) = match error {
        GenerateError::Points { .. } => ("--points in that range", "change --points".to_owned()),
        GenerateError::Nodes { .. } => ("--nodes in that range", "change --nodes, or give --points".into()),
        GenerateError::Density { nearest, .. } => (
            "a --density that some number of points can give",
            format!("ask for one nearer to {nearest:.3}, or try another --kind, --merge or --seed"),
        ),
        GenerateError::Direction(_) => {
            ("a direction that is not zero: --align \"1 0 0\"", "correct --align".into())
        }
        GenerateError::Strength { .. } => {
            ("--strength in that range", format!("0.3 is noticeable, {MAX_STRENGTH} nearly parallel"))
        }
        GenerateError::Merge(_) => {
            ("--merge in that range", "leave --merge out for a value that suits the kind".into())
        }
        GenerateError::OpenFace { .. } => (
            "fibers through every face of the cube",
            "lower the strength of an alignment (--strength), ask for a larger network, trim or merge it less, or change \
             --seed"
                .into(),
        ),
        GenerateError::NoRoom { .. } | GenerateError::Network(_) => (
            "fibers through every face of the cube",
            "ask for a larger network, trim, merge or align it less, or change --seed".into(),
        ),
    };
    Failure::arguments(format!("no network can be generated{place}: {error}"), expected, cure)
}
