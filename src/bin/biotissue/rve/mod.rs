//! `biotissue rve`: brings one RVE to equilibrium.

mod result;
mod solve;

use std::path::PathBuf;
use std::sync::Arc;

use biotissue::fiber::equilibrium::{EquilibriumParams, Stage, Stages};
use biotissue::fiber::network::file;
use biotissue::fiber::rve::{Rve, StressScale};
use biotissue::input::excerpt;
use biotissue::tissue::replay::RveDump;
use clap::Args;
use nalgebra::Matrix3;

use crate::dispatch::dispatch;
use crate::failure::Failure;
use crate::increments::check_steps;
use crate::law::LawArguments;
use crate::number::{count, real};
use crate::output;

use solve::RveJob;

/// Bring one RVE to equilibrium: stress, tangent, energy, orientation
#[derive(Args)]
pub struct RveCommand {
    /// The network file; without --law, its own materials apply
    #[arg(required_unless_present = "replay")]
    network: Option<PathBuf>,
    /// Deformation gradient, row by row: "f11 f12 f13 f21 f22 f23 f31 f32 f33"
    #[arg(long = "F", value_name = "\"NINE NUMBERS\"", allow_hyphen_values = true, required_unless_present = "replay")]
    gradient: Option<String>,
    #[command(flatten)]
    law: LawArguments,
    /// "raw" (forces of the unit cube, not scaled), or the fiber volume fraction (stresses in Pa). The network is scaled
    /// to the unit cube, the radius is not: in a cube of edge A, in the unit of the radius (the
    /// result names that of the file), the stress in Pa is the raw one divided by A^2
    #[arg(long, value_name = "raw|PHI", default_value = "raw", allow_hyphen_values = true)]
    scale: String,
    /// Increments from the undeformed state to F
    #[arg(long, value_name = "N", value_parser = count, default_value_t = 1, allow_hyphen_values = true)]
    steps: usize,
    /// Tolerance of the residual, relative to all nodal forces; a residual at the rounding limit is always accepted
    #[arg(long, value_name = "T", value_parser = real, default_value = "1e-10", allow_hyphen_values = true)]
    tolerance: f64,
    /// The stages that may be tried, separated by commas: newton, regularized, cuts, relaxation; tried in this order,
    /// whatever the order given; all of them by default
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    stages: Option<Vec<String>>,
    /// Write the last increment, with everything that it depends on, to a file
    #[arg(long, value_name = "FILE")]
    dump: Option<PathBuf>,
    /// Repeat the increment in such a file exactly; runs write one for every RVE that finds no equilibrium
    #[arg(long, value_name = "FILE", conflicts_with_all = ["network", "gradient", "law", "scale", "steps", "tolerance"])]
    replay: Option<PathBuf>,
    /// Linear-algebra backend
    #[arg(long, value_name = "NAME")]
    backend: Option<String>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// Runs the command. With `--json`, the object is printed even if there is no equilibrium.
pub fn run(command: RveCommand) -> Result<(), Failure> {
    let json = command.json;
    let backend = command.backend.clone();
    let job = check(command)?;
    let (result, failure) = dispatch(backend.as_deref(), job)?;
    if json {
        output::print_json(&result)?;
    } else if failure.is_none() {
        output::print(&result.text())?;
    }
    failure.map_or(Ok(()), Err)
}

fn check(command: RveCommand) -> Result<RveJob, Failure> {
    let stages = command.stages.as_deref().map(parse_stages).transpose()?;
    if let Some(file) = &command.replay {
        return Ok(RveJob::replay(RveDump::read(file)?, stages, command.dump));
    }
    let (Some(path), Some(gradient)) = (command.network, command.gradient) else {
        // The argument parser ensures that both are present.
        return Err(Failure::arguments("no network to solve", "a network and --F", "or --replay FILE"));
    };
    let gradient = parse_gradient(&gradient)?;
    let material = command.law.material()?;
    let scale = parse_scale(&command.scale)?;
    let RveCommand { steps, tolerance, dump, .. } = command;
    check_steps(steps)?;
    if !(tolerance > 0.0 && tolerance < 1.0) {
        let what = format!("invalid --tolerance {tolerance}");
        return Err(Failure::arguments(what, "a number between 0 and 1", "leave --tolerance out for 1e-10"));
    }
    let mut params = EquilibriumParams::default();
    params.newton.tolerance = tolerance;
    let params = params.with_stages(stages.unwrap_or_default());
    let read = file::read(&path)?;
    output::warn(&read.warnings);
    let (network, cube_edge) = (Arc::new(read.network), Some(read.cube.edges[0]));
    let (place, start) = (path.display().to_string(), Rve::at_rest(&network));
    Ok(RveJob { place, file: Some(path), network, cube_edge, start, gradient, material, scale, steps, params, dump })
}

fn parse_stages(names: &[String]) -> Result<Stages, Failure> {
    let stages: Result<Vec<Stage>, Failure> = names
        .iter()
        .map(|name| {
            Stage::named(name.trim()).ok_or_else(|| {
                let known = Stage::ALL.map(Stage::name).join(", ");
                let what = format!("there is no stage `{name}`");
                Failure::arguments(what, format!("one or more of {known}"), "leave --stages out for all of them")
            })
        })
        .collect();
    Ok(Stages::of(&stages?))
}

/// Parses the nine numbers of `--F`, whose determinant must be positive.
pub fn parse_gradient(text: &str) -> Result<Matrix3<f64>, Failure> {
    let words: Vec<&str> = text.split(|c: char| c.is_whitespace() || c == ',').filter(|t| !t.is_empty()).collect();
    let numbers: Result<Vec<f64>, _> = words.iter().map(|word| word.parse()).collect();
    let expected = "nine finite numbers, row by row: \"f11 f12 f13 f21 f22 f23 f31 f32 f33\"";
    match numbers {
        Ok(n) if n.len() == 9 && n.iter().all(|x| x.is_finite()) => {
            let f = Matrix3::from_row_slice(&n);
            let determinant = f.determinant();
            if determinant > 0.0 && determinant.is_finite() {
                return Ok(f);
            }
            let what = format!("--F has determinant {determinant}");
            let cure = "a deformation must have a positive determinant: correct the signs and the rows";
            Err(Failure::arguments(what, "a positive, finite determinant", cure))
        }
        _ => Err(Failure::arguments(
            format!("invalid --F \"{}\"", words.join(" ")),
            expected,
            "the undeformed state is \"1 0 0 0 1 0 0 0 1\"; the quotes are required",
        )),
    }
}

fn parse_scale(text: &str) -> Result<StressScale, Failure> {
    if text == "raw" {
        return Ok(StressScale::Raw);
    }
    match text.trim().parse::<f64>() {
        Ok(phi) if phi > 0.0 && phi <= 1.0 => Ok(StressScale::FiberVolumeFraction(phi)),
        _ => Err(Failure::arguments(
            format!("invalid --scale {}", excerpt(text)),
            "\"raw\", or a fiber volume fraction above 0 and at most 1",
            "a collagen gel has about 0.003; leave --scale out for raw",
        )),
    }
}
