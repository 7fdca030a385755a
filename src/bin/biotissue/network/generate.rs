//! `biotissue network generate`.

use std::path::PathBuf;

use biotissue::fiber::network::Cube;
use biotissue::fiber::network::check::examine;
use biotissue::fiber::network::file::sidecar::{Generated, Sidecar};
use biotissue::fiber::network::generate::{
    Alignment, GenerateError, GeneratedNetwork, GeneratorParams, Kind, MAX_STRENGTH,
};
use clap::Args;
use serde_json::json;

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
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    #[command(flatten)]
    law: LawArguments,
    /// Instead of --law: the law of a fraction of the fibers, drawn at random by the seed; repeat until the fractions
    /// sum to 1: "fraction=0.7,law=exponential,youngs-modulus=1e8,radius=5e-8,nonlinearity=1.2". Keys: fraction (of
    /// the fibers, by number); law, its parameters, radius, table, compression and buckling-strain as the options of
    /// these names; density (of the fiber material, kg/m^3)
    #[arg(long = "fiber", value_name = "KEY=VALUE,...", conflicts_with = "law")]
    fibers: Vec<FiberTypeArgument>,
    /// Print one JSON object
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
    let made = match size {
        Size::Points(points) => params.of_points(points),
        Size::Nodes(nodes) => params.of_nodes(nodes),
        Size::Density(density) => params.of_density(density),
    };
    let mut made = made.map_err(|error| not_generated(&error))?;
    if let Some(material) = material {
        made.network = made.network.of_one_material(material);
    } else if !types.is_empty() {
        made.network = made.network.with_random_types(types, arguments.seed).map_err(|error| {
            let cure = "give every --fiber a fraction above 0, all together 1";
            Failure::arguments(error.to_string(), "fractions that sum to 1", cure)
        })?;
    }
    let generated = Generated::by(&params, made.points);
    let length_unit = Some("edge of the cube".into());
    let sidecar = Sidecar { generated: Some(generated.clone()), length_unit, ..laws_of(&made.network) };
    write(&arguments.output, &made.network, &sidecar)?;
    print_summary(arguments, &params, &made, &generated)
}

/// Prints a summary of the generated network.
fn print_summary(
    arguments: &GenerateArguments,
    params: &GeneratorParams,
    made: &GeneratedNetwork,
    generated: &Generated,
) -> Result<(), Failure> {
    let report = examine(&made.network);
    let axis = params.alignment.map(|alignment| alignment.axis());
    if arguments.json {
        let mut object = json_of_network(&report, &made.network);
        object["file"] = json!(arguments.output);
        object["generated"] = json!(generated);
        object["removed"] = json!(made.removed);
        object["order_of_alignment"] = json!(axis.map(|axis| report.order_about(axis)[0]));
        return output::print_json(&object);
    }
    let mut text = format!(
        "{}: {}, {} points, seed {}\n",
        arguments.output.display(),
        params.kind.name(),
        made.points,
        params.seed
    );
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
    Alignment::new(direction, strength).map(Some).map_err(|error| not_generated(&error))
}

fn not_generated(error: &GenerateError) -> Failure {
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
    Failure::arguments(format!("no network can be generated: {error}"), expected, cure)
}
