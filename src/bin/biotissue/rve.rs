//! `biotissue rve`: one RVE brought to equilibrium.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use biotissue::fiber::equilibrium::{EquilibriumParams, EquilibriumReport, RveError, equilibrate};
use biotissue::fiber::homogenise;
use biotissue::fiber::law::{FiberMaterial, Law};
use biotissue::fiber::network::{Network, file};
use biotissue::fiber::orientation::{Weighting, tensor};
use biotissue::fiber::rve::{Rve, RveModel, RveModelError, StressScale};
use biotissue::fiber::workspace::Workspace;
use biotissue::las::{Backend, NewtonReport, Scalar};
use clap::{Args, ValueEnum};
use nalgebra::Matrix3;
use serde::Serialize;

use crate::dispatch::{Job, dispatch};
use crate::failure::Failure;

/// One RVE to equilibrium: stress, tangent, energy, orientation.
#[derive(Args)]
pub struct RveCommand {
    /// The network file.
    network: PathBuf,
    /// Deformation gradient, row by row: "f11 f12 f13 f21 f22 f23 f31 f32 f33".
    #[arg(long = "F", value_name = "NINE NUMBERS", allow_hyphen_values = true)]
    gradient: String,
    /// Fiber law of all fibers; without it the network's own files count.
    #[arg(long, value_enum)]
    law: Option<LawName>,
    /// Young's modulus of the fibers, Pa.
    #[arg(long, value_name = "E", allow_hyphen_values = true, requires = "law")]
    youngs_modulus: Option<f64>,
    /// Fiber radius, m.
    #[arg(long, value_name = "R", allow_hyphen_values = true, requires = "law")]
    radius: Option<f64>,
    /// Nonlinearity B of the exponential laws.
    #[arg(long, value_name = "B", allow_hyphen_values = true, requires = "law")]
    nonlinearity: Option<f64>,
    /// Stretch at which exponential-stretch goes on as a straight line.
    #[arg(long, value_name = "LAMBDA", allow_hyphen_values = true, requires = "law")]
    transition: Option<f64>,
    /// "raw" (kappa = 1), or the fiber volume fraction.
    #[arg(long, value_name = "raw|PHI", default_value = "raw", allow_hyphen_values = true)]
    scale: String,
    /// Increments from the undeformed state to F.
    #[arg(long, value_name = "N", default_value_t = 1)]
    steps: usize,
    /// Residual relative to all nodal forces.
    #[arg(long, value_name = "T", default_value_t = 1e-10, allow_hyphen_values = true)]
    tolerance: f64,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
    /// Linear-algebra backend.
    #[arg(long, value_name = "NAME")]
    backend: Option<String>,
}

#[derive(Clone, Copy, ValueEnum)]
enum LawName {
    Linear,
    Exponential,
    ExponentialStretch,
}

/// The checked arguments.
struct RveJob {
    path: PathBuf,
    network: Arc<Network>,
    gradient: Matrix3<f64>,
    material: Option<FiberMaterial>,
    scale: StressScale,
    steps: usize,
    tolerance: f64,
}

/// The object that `--json` prints.
#[derive(Serialize)]
struct Answer {
    converged: bool,
    iterations: usize,
    /// Norm of the residual, and that over the norm of all nodal forces.
    residuals: Vec<[f64; 2]>,
    #[serde(rename = "J")]
    j: f64,
    network: NetworkFacts,
    scale: f64,
    #[serde(flatten)]
    state: Option<State>,
    ladder: Ladder,
    seconds: Seconds,
}

#[derive(Serialize)]
struct NetworkFacts {
    nodes: usize,
    fibers: usize,
    boundary_nodes: usize,
    free_dofs: usize,
    total_length: f64,
}

/// What is known of an RVE that converged.
#[derive(Serialize)]
struct State {
    pk1: [[f64; 3]; 3],
    cauchy: [[f64; 3]; 3],
    tangent: Vec<[f64; 9]>,
    energy: f64,
    stretch: Stretch,
    orientation: Orientation,
}

#[derive(Serialize)]
struct Stretch {
    min: f64,
    max: f64,
}

#[derive(Serialize)]
struct Orientation {
    reference: [[f64; 3]; 3],
    current: [[f64; 3]; 3],
}

/// What beyond full Newton steps it took.
#[derive(Default, Serialize)]
struct Ladder {
    cuts: u32,
    line_search_cuts: usize,
    indefinite: usize,
}

#[derive(Default, Serialize)]
struct Seconds {
    analyze: f64,
    solve: f64,
    tangent: f64,
}

pub fn run(command: RveCommand) -> Result<(), Failure> {
    let json = command.json;
    let backend = command.backend.clone();
    let job = check(command)?;
    let (answer, failure) = dispatch(backend.as_deref(), job)?;
    if json {
        let text = serde_json::to_string(&answer).map_err(|error| Failure::Environment {
            what: format!("the answer cannot be written as JSON: {error}"),
            cure: "report this as a bug, with the command".into(),
        })?;
        println!("{text}");
    } else if failure.is_none() {
        print!("{}", text(&answer));
    }
    failure.map_or(Ok(()), Err)
}

fn check(command: RveCommand) -> Result<RveJob, Failure> {
    let gradient = parse_gradient(&command.gradient)?;
    let material = material(&command)?;
    let scale = parse_scale(&command.scale)?;
    if command.steps == 0 {
        return Err(argument("--steps 0", "at least one increment", "leave --steps out for one"));
    }
    if !(command.tolerance > 0.0 && command.tolerance < 1.0) {
        let what = format!("--tolerance {}", command.tolerance);
        return Err(argument(what, "a number between 0 and 1", "1e-10 is the default"));
    }
    let read = file::read(&command.network)?;
    for warning in &read.warnings {
        eprintln!("warning: {warning}");
    }
    let network = Arc::new(read.network);
    let (path, steps, tolerance) = (command.network, command.steps, command.tolerance);
    Ok(RveJob { path, network, gradient, material, scale, steps, tolerance })
}

fn argument(what: impl Into<String>, expected: impl Into<String>, cure: impl Into<String>) -> Failure {
    Failure::Arguments { what: what.into(), expected: expected.into(), cure: cure.into() }
}

fn parse_gradient(text: &str) -> Result<Matrix3<f64>, Failure> {
    let numbers: Result<Vec<f64>, _> =
        text.split(|c: char| c.is_whitespace() || c == ',').filter(|t| !t.is_empty()).map(str::parse).collect();
    let expected = "nine finite numbers, row by row: \"f11 f12 f13 f21 f22 f23 f31 f32 f33\"";
    match numbers {
        Ok(n) if n.len() == 9 && n.iter().all(|x| x.is_finite()) => {
            let f = Matrix3::from_row_slice(&n);
            let determinant = f.determinant();
            if determinant > 0.0 {
                return Ok(f);
            }
            let what = format!("--F has determinant {determinant:e}");
            Err(argument(what, "a positive determinant", "a deformation cannot turn the material inside out"))
        }
        _ => Err(argument(format!("--F \"{text}\""), expected, "the undeformed state is \"1 0 0 0 1 0 0 0 1\"")),
    }
}

fn parse_scale(text: &str) -> Result<StressScale, Failure> {
    if text == "raw" {
        return Ok(StressScale::Raw);
    }
    match text.parse::<f64>() {
        Ok(phi) if phi > 0.0 && phi < 1.0 => Ok(StressScale::FiberVolumeFraction(phi)),
        _ => {
            let expected = "\"raw\", or a fiber volume fraction between 0 and 1";
            Err(argument(format!("--scale {text}"), expected, "collagen gels have some 0.003"))
        }
    }
}

fn material(command: &RveCommand) -> Result<Option<FiberMaterial>, Failure> {
    let Some(name) = command.law else { return Ok(None) };
    let needed = |flag: &str, value: Option<f64>| {
        value.ok_or_else(|| {
            argument(format!("--law without {flag}"), format!("{flag} with its value"), format!("add {flag}"))
        })
    };
    let superfluous = |flag: &str, value: Option<f64>| match value {
        Some(_) => Err(argument(
            format!("{flag} with a law that has none"),
            "only parameters of the law",
            format!("leave {flag} out"),
        )),
        None => Ok(()),
    };
    let youngs_modulus = needed("--youngs-modulus", command.youngs_modulus)?;
    let radius = needed("--radius", command.radius)?;
    let nonlinearity = || needed("--nonlinearity", command.nonlinearity);
    let law = match name {
        LawName::Linear => {
            superfluous("--nonlinearity", command.nonlinearity)?;
            superfluous("--transition", command.transition)?;
            Law::Linear { youngs_modulus }
        }
        LawName::Exponential => {
            superfluous("--transition", command.transition)?;
            Law::Exponential { youngs_modulus, nonlinearity: nonlinearity()? }
        }
        LawName::ExponentialStretch => {
            let transition = needed("--transition", command.transition)?;
            Law::ExponentialStretch { youngs_modulus, nonlinearity: nonlinearity()?, transition }
        }
    };
    let material = FiberMaterial { law, radius, density: None };
    material.check().map_err(|error| argument(error.to_string(), error.expected, "check the parameters of the law"))?;
    Ok(Some(material))
}

impl Job for RveJob {
    type Output = (Answer, Option<Failure>);

    fn run<B>(self) -> Result<Self::Output, Failure>
    where
        B: Backend<Scalar = f64, Context = ()>,
        B::Reduced: Scalar,
    {
        let start = Instant::now();
        let model = RveModel::<B>::new(&(), Arc::clone(&self.network), self.material, self.scale)
            .map_err(|error| unusable(&self.path, &error))?;
        let mut workspace = Workspace::new(&(), &model).map_err(library)?;
        let mut seconds = Seconds { analyze: start.elapsed().as_secs_f64(), ..Seconds::default() };

        let start = Instant::now();
        let mut rve = Rve::at_rest(&self.network);
        let outcome = self.equilibrate(&model, &mut rve, &mut workspace);
        seconds.solve = start.elapsed().as_secs_f64();

        let start = Instant::now();
        let (report, state, failure) = match outcome {
            Ok(report) => match self.state(&model, &rve, &mut workspace) {
                Ok(state) => (report, Some(state), None),
                Err(error) => (report, None, Some(self.failure(&error))),
            },
            Err(error) => {
                let report = if let RveError::NotConverged { report, .. } = &error {
                    (**report).clone()
                } else {
                    EquilibriumReport::default()
                };
                (report, None, Some(self.failure(&error)))
            }
        };
        seconds.tangent = start.elapsed().as_secs_f64();
        Ok((self.answer(&model, &report, state, seconds), failure))
    }
}

impl RveJob {
    fn equilibrate<B>(
        &self,
        model: &RveModel<B>,
        rve: &mut Rve,
        workspace: &mut Workspace<B>,
    ) -> Result<EquilibriumReport, RveError<B::Fault>>
    where
        B: Backend<Scalar = f64>,
        B::Reduced: Scalar,
    {
        let mut params = EquilibriumParams::default();
        params.newton.tolerance = self.tolerance;
        let mut sum = EquilibriumReport::default();
        for step in 1..=self.steps {
            let part = step as f64 / self.steps as f64;
            let identity = Matrix3::identity();
            let target = if step == self.steps { self.gradient } else { identity + (self.gradient - identity) * part };
            let report = equilibrate(model, rve, &target, &params, workspace)?;
            sum = EquilibriumReport {
                iterations: sum.iterations + report.iterations,
                cuts: sum.cuts + report.cuts,
                line_search_cuts: sum.line_search_cuts + report.line_search_cuts,
                indefinite: sum.indefinite + report.indefinite,
                newton: report.newton,
            };
        }
        Ok(sum)
    }

    fn state<B>(
        &self,
        model: &RveModel<B>,
        rve: &Rve,
        workspace: &mut Workspace<B>,
    ) -> Result<State, RveError<B::Fault>>
    where
        B: Backend<Scalar = f64>,
        B::Reduced: Scalar,
    {
        let pk1 = homogenise::pk1(model, workspace);
        let tangent = homogenise::tangent(model, rve, &pk1, workspace)?;
        let energy = homogenise::energy(model, workspace);
        let states = workspace.states();
        let stretch = states.stretches.iter().fold(Stretch { min: f64::INFINITY, max: 0.0 }, |range, &stretch| {
            Stretch { min: range.min.min(stretch), max: range.max.max(stretch) }
        });
        let lengths = model.truss().lengths();
        let current = rows(&tensor(&states.directions, lengths, Weighting::Number));
        workspace.show(model, &Rve::at_rest(model.network()));
        let reference = rows(&tensor(&workspace.states().directions, lengths, Weighting::Number));
        Ok(State {
            pk1: rows(&pk1),
            cauchy: rows(&homogenise::cauchy(&pk1, rve.gradient())),
            tangent: (0..9).map(|row| std::array::from_fn(|column| tangent[(row, column)])).collect(),
            energy,
            stretch,
            orientation: Orientation { reference, current },
        })
    }

    fn answer<B>(
        &self,
        model: &RveModel<B>,
        report: &EquilibriumReport,
        state: Option<State>,
        seconds: Seconds,
    ) -> Answer
    where
        B: Backend<Scalar = f64>,
    {
        let NewtonReport { residuals, relative, .. } = &report.newton;
        Answer {
            converged: state.is_some(),
            iterations: report.iterations,
            residuals: residuals.iter().zip(relative).map(|(&norm, &relative)| [norm, relative]).collect(),
            j: self.gradient.determinant(),
            network: NetworkFacts {
                nodes: self.network.nodes().len(),
                fibers: self.network.fibers().len(),
                boundary_nodes: self.network.boundary().len(),
                free_dofs: model.unknowns(),
                total_length: self.network.total_length(),
            },
            scale: model.scale(),
            state,
            ladder: Ladder {
                cuts: report.cuts,
                line_search_cuts: report.line_search_cuts,
                indefinite: report.indefinite,
            },
            seconds,
        }
    }

    fn failure<F: std::error::Error + 'static>(&self, error: &RveError<F>) -> Failure {
        Failure::NotConverged {
            what: error.to_string(),
            place: format!("the RVE of {}", self.path.display()),
            cure: "try more --steps; `biotissue network check` tells whether the network hangs together".into(),
        }
    }
}

fn unusable<F: std::error::Error + 'static>(path: &Path, error: &RveModelError<F>) -> Failure {
    let expected = "a network whose fibers have a law, a radius and a modulus";
    let cure = "give --law with its parameters, or put a .params file beside the network";
    argument(format!("{}: {error}", path.display()), expected, cure)
}

fn library(error: impl std::fmt::Display) -> Failure {
    Failure::Environment { what: error.to_string(), cure: "try another --backend".into() }
}

fn rows(m: &Matrix3<f64>) -> [[f64; 3]; 3] {
    [0, 1, 2].map(|i| [0, 1, 2].map(|j| m[(i, j)]))
}

/// What a person reads.
fn text(answer: &Answer) -> String {
    use std::fmt::Write;
    let mut out = String::new();
    let n = &answer.network;
    // Writing to a string cannot fail.
    let _ = writeln!(
        out,
        "network      {} nodes, {} fibers, {} boundary nodes, {} unknowns",
        n.nodes, n.fibers, n.boundary_nodes, n.free_dofs
    );
    let last = answer.residuals.last().copied().unwrap_or_default();
    let _ = writeln!(
        out,
        "converged    {} iterations, |r| = {:.3e} N ({:.1e} of all forces)",
        answer.iterations, last[0], last[1]
    );
    let _ = writeln!(out, "J            {}", answer.j);
    let _ = writeln!(out, "kappa        {:e}", answer.scale);
    let Some(state) = &answer.state else { return out };
    let mut matrix = |name: &str, rows: &[[f64; 3]; 3]| {
        for (i, row) in rows.iter().enumerate() {
            let name = if i == 0 { name } else { "" };
            let _ = writeln!(out, "{name:<13}{:>16.8e} {:>16.8e} {:>16.8e}", row[0], row[1], row[2]);
        }
    };
    matrix("P (Pa)", &state.pk1);
    matrix("sigma (Pa)", &state.cauchy);
    matrix("orientation", &state.orientation.current);
    let _ = writeln!(out, "dP/dF (Pa)   row 3 i + J, column 3 k + L");
    for row in &state.tangent {
        let cells: Vec<String> = row.iter().map(|a| format!("{a:>11.4e}")).collect();
        let _ = writeln!(out, "  {}", cells.join(" "));
    }
    let _ = writeln!(out, "energy       {:.8e} J/m^3", state.energy);
    let _ = writeln!(out, "stretch      {:.6} to {:.6}", state.stretch.min, state.stretch.max);
    let s = &answer.seconds;
    let _ = writeln!(out, "seconds      analyze {:.2e}, solve {:.2e}, tangent {:.2e}", s.analyze, s.solve, s.tangent);
    out
}
