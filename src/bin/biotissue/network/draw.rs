//! `biotissue network draw`.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use biotissue::app::report::picture::{FiberColor, NetworkPicture, draw_network};
use biotissue::app::results::{NetworkSet, ResultsError, write_vtp};
use biotissue::fiber::equilibrium::EquilibriumParams;
use biotissue::fiber::law::FiberMaterial;
use biotissue::fiber::network::Network;
use biotissue::fiber::rve::{Rve, RveModel, StressScale};
use biotissue::fiber::workspace::Workspace;

use clap::{Args, ValueEnum};
use nalgebra::Matrix3;

use super::read;
use super::text::unsigned_zero;
use crate::dispatch::{Job, ProgramBackend, dispatch};
use crate::failure::Failure;
use crate::increments::{Increments, check_steps, unusable};
use crate::law::LawArguments;
use crate::number::count;
use crate::output;
use crate::report::Axis;
use crate::rve::parse_gradient;

#[derive(Args)]
pub struct DrawArguments {
    /// The network file
    file: PathBuf,
    /// The picture to write: .svg, or .vtp for a viewer of VTK files
    #[arg(short, long, value_name = "FILE.svg|FILE.vtp")]
    output: PathBuf,
    /// Bring the network to equilibrium at this deformation gradient first: "f11 f12 f13 f21 f22 f23 f31 f32 f33"
    #[arg(long = "F", value_name = "\"NINE NUMBERS\"", allow_hyphen_values = true)]
    gradient: Option<String>,
    #[command(flatten)]
    law: LawArguments,
    /// Increments from the undeformed state to F [default: 1]
    #[arg(long, value_name = "N", value_parser = count, requires = "gradient", allow_hyphen_values = true)]
    steps: Option<usize>,
    /// Linear-algebra backend
    #[arg(long, value_name = "NAME")]
    backend: Option<String>,
    /// Quantity that the color of a fiber shows [default: stretch with --F, otherwise direction]
    #[arg(long, value_enum)]
    color: Option<Color>,
    /// Oblique view along this axis, from slightly above and from the side [default: z]
    #[arg(long, value_enum)]
    axis: Option<Axis>,
    /// Title above the picture [default: the name of the network]
    #[arg(long, value_name = "TEXT")]
    title: Option<String>,
    /// Width of the picture in pixels
    #[arg(long, value_name = "N", value_parser = count, default_value_t = 900, allow_hyphen_values = true)]
    width: usize,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Color {
    Stretch,
    Force,
    Direction,
    Length,
    Plain,
}

/// The file format, determined by the extension of the file name.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Format {
    Svg,
    Vtp,
}

pub fn run(arguments: &DrawArguments) -> Result<(), Failure> {
    let format = format(&arguments.output)?;
    check(arguments)?;
    let gradient = arguments.gradient.as_deref().map(parse_gradient).transpose()?;
    let material = arguments.law.material()?;
    let read = read(&arguments.file)?;
    let network = Arc::new(read.network);
    let state = match gradient {
        None => State::at_rest(&network),
        Some(gradient) => {
            let steps = arguments.steps.unwrap_or(1);
            let job = DeformJob { path: &arguments.file, network: &network, gradient, material, steps };
            dispatch(arguments.backend.as_deref(), job)?
        }
    };
    output::make_folder_of(&arguments.output)?;
    match format {
        Format::Svg => {
            let svg = picture(arguments, &network, &state, gradient);
            biotissue::output::write(&arguments.output, svg.as_bytes())
                .map_err(|error| Failure::unwritable(&arguments.output, &error))?;
        }
        Format::Vtp => vtp(&arguments.output, &network, &state)?,
    }
    output::print(&arguments.output.display().to_string())
}

fn format(output: &Path) -> Result<Format, Failure> {
    match output.extension().and_then(|extension| extension.to_str()) {
        Some("svg") => Ok(Format::Svg),
        Some("vtp") => Ok(Format::Vtp),
        _ => Err(Failure::arguments(
            format!("invalid --output {}", output.display()),
            "a name that ends in .svg (a picture) or .vtp (for a viewer of VTK files)",
            "give the file one of these endings",
        )),
    }
}

/// Rejects options that contradict each other and numbers out of range.
fn check(arguments: &DrawArguments) -> Result<(), Failure> {
    let deforms = arguments.gradient.is_some();
    if arguments.law.is_given() && !deforms {
        let what = "--law of a network at rest, where no fiber carries a force";
        let cure = "add --F, or leave out --law and its parameters";
        return Err(Failure::arguments(what, "--F with a deformation gradient", cure));
    }
    let of_state = match arguments.color {
        Some(Color::Stretch) => Some("--color stretch"),
        Some(Color::Force) => Some("--color force"),
        _ => None,
    };
    if let Some(option) = of_state.filter(|_| !deforms) {
        let what = format!("{option} of a network at rest, where all fibers are alike");
        return Err(Failure::arguments(what, "--F with a deformation gradient", "add --F, or choose another --color"));
    }
    check_steps(arguments.steps.unwrap_or(1))?;
    if !(480..=20_000).contains(&arguments.width) {
        let what = format!("invalid --width {}", arguments.width);
        return Err(Failure::arguments(what, "between 480 and 20000 pixels", "leave --width out for 900"));
    }
    Ok(())
}

/// The state of the network to be drawn; the fiber arrays have one entry per fiber, in the order of the network.
struct State {
    positions: Vec<[f64; 3]>,
    stretches: Vec<f64>,
    forces: Vec<f64>,
}

impl State {
    fn at_rest(network: &Network) -> Self {
        let fibers = network.fibers().len();
        Self { positions: network.nodes().to_vec(), stretches: vec![1.0; fibers], forces: vec![0.0; fibers] }
    }
}

/// The job that brings the network to equilibrium.
struct DeformJob<'a> {
    path: &'a Path,
    network: &'a Arc<Network>,
    gradient: Matrix3<f64>,
    material: Option<FiberMaterial>,
    steps: usize,
}

impl Job for DeformJob<'_> {
    type Output = State;

    fn run<B: ProgramBackend>(self, context: B::Context) -> Result<State, Failure> {
        let Self { path, network, gradient, material, steps } = self;
        let place = path.display().to_string();
        let model = RveModel::<B>::new(&context, Arc::clone(network), material, StressScale::Raw)
            .map_err(|error| unusable(&place, &error))?;
        let mut workspace = Workspace::new(&context, &model).map_err(Failure::library)?;
        let params = EquilibriumParams::default();
        let increments =
            Increments { target: &gradient, steps, params: &params, place: &place, file: Some(path), replayed: false };
        let mut rve = Rve::at_rest(network);
        let mut last = (rve.clone(), gradient);
        let outcome = increments.apply(&model, &mut rve, &mut workspace, &mut last);
        outcome.map_err(|failed| increments.increment_failure(&failed))?;
        let (truss, states) = (model.truss(), workspace.states());
        let mut state = State { positions: workspace.positions().to_vec(), ..State::at_rest(network) };
        for (fiber, &original) in truss.fiber_numbers().iter().enumerate() {
            state.stretches[original as usize] = states.stretches[fiber];
            state.forces[original as usize] = states.forces[fiber];
        }
        Ok(state)
    }
}

fn picture(arguments: &DrawArguments, network: &Network, state: &State, gradient: Option<Matrix3<f64>>) -> String {
    let of_values = |label, unit, values, rest| FiberColor::Values { label, unit, values, rest };
    let default = if gradient.is_some() { Color::Stretch } else { Color::Direction };
    let color = match arguments.color.unwrap_or(default) {
        Color::Stretch => of_values("fiber stretch", "", &state.stretches[..], Some(1.0)),
        Color::Force => of_values("fiber force", "N", &state.forces[..], Some(0.0)),
        Color::Length => of_values("fiber length at rest, edges of the cube", "", network.lengths(), None),
        Color::Direction => FiberColor::Direction,
        Color::Plain => FiberColor::Plain,
    };
    let (nodes, fibers) = (network.nodes().len(), network.fibers().len());
    let state_in_words = gradient.map_or_else(|| "at rest".to_owned(), |f| format!("F = {}", in_words(&f)));
    draw_network(&NetworkPicture {
        title: arguments.title.as_deref().unwrap_or_else(|| network.name()),
        subtitle: &format!("{nodes} nodes, {fibers} fibers  \u{b7}  {state_in_words}"),
        positions: &state.positions,
        fibers: network.fibers(),
        color,
        gradient: gradient.unwrap_or_else(Matrix3::identity),
        axis: arguments.axis.map(|axis| axis as usize),
        width: arguments.width as u32,
    })
}

/// Formats the rows of a matrix on one line; only the diagonal if all other entries are zero.
fn in_words(f: &Matrix3<f64>) -> String {
    let number = |x: f64| {
        let text = format!("{:.4}", unsigned_zero(x));
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    };
    if *f == Matrix3::from_diagonal(&f.diagonal()) {
        let parts: Vec<String> = f.diagonal().iter().map(|&x| number(x)).collect();
        return format!("diag({})", parts.join(", "));
    }
    let row = |i: usize| [0, 1, 2].map(|j| number(f[(i, j)])).join(" ");
    format!("[{}]", [0, 1, 2].map(row).join("; "))
}

fn vtp(path: &Path, network: &Network, state: &State) -> Result<(), Failure> {
    let kind: Vec<i64> = network.material_of().iter().map(|&reaction| reaction.into()).collect();
    let moved = |(current, node): (&[f64; 3], &[f64; 3])| std::array::from_fn(|k| current[k] - node[k]);
    let displacements: Vec<[f64; 3]> = state.positions.iter().zip(network.nodes()).map(moved).collect();
    let set = NetworkSet {
        points: &state.positions,
        displacements: &displacements,
        fibers: network.fibers(),
        stretch: &state.stretches,
        force: &state.forces,
        kind: &kind,
    };
    write_vtp(path, &set).map_err(|error| match &error {
        ResultsError::Write(path, source) => Failure::unwritable(path, source),
        _ => Failure::library(error),
    })
}
