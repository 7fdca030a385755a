//! `biotissue run` and `biotissue check`: a simulation, or only its plan.

use std::io::IsTerminal;
use std::path::{Path, PathBuf};

use biotissue::las::{Backend, Scalar};
use biotissue::tissue::Progress;
use biotissue::tissue::case::Case;
use biotissue::tissue::checkpoint::CheckpointError;
use biotissue::tissue::macro_scale::MacroScaleError;
use biotissue::tissue::micro_scale::LibraryError;
use biotissue::tissue::results::ResultsError;
use biotissue::tissue::results::log::{Cut, Step};
use biotissue::tissue::run::{Plan, ResumeError, RunError, RunSummary, Simulation, SimulationError};
use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;

use crate::dispatch::{Job, dispatch};
use crate::failure::Failure;

/// The simulation of a case.
#[derive(Args)]
pub struct RunCommand {
    /// The case file.
    case: PathBuf,
    /// Result directory, in place of the one the case names.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Go on after the last converged step in the result directory; start from the beginning where there is none.
    #[arg(long)]
    resume: bool,
    #[command(flatten)]
    common: Common,
    /// Print the summary as one JSON object.
    #[arg(long)]
    json: bool,
}

/// Reads and checks everything, prints the plan, solves nothing.
#[derive(Args)]
pub struct CheckCommand {
    /// The case file.
    case: PathBuf,
    #[command(flatten)]
    common: Common,
    /// Print the plan as one JSON object.
    #[arg(long)]
    json: bool,
}

#[derive(Args)]
struct Common {
    /// Threads that solve RVEs; all cores without it.
    #[arg(long, value_name = "N")]
    threads: Option<usize>,
    /// Linear-algebra backend of both scales.
    #[arg(long, value_name = "NAME")]
    backend: Option<String>,
}

pub fn run(command: RunCommand) -> Result<(), Failure> {
    let case = read(&command.case)?;
    let dir = command.out.unwrap_or_else(|| case.output.directory.clone());
    threads(command.common.threads)?;
    let summary = dispatch(command.common.backend.as_deref(), RunJob { case, dir: &dir, resume: command.resume })?;
    let Summary { steps, iterations, seconds, .. } = &summary;
    if command.json {
        println!("{}", json(&summary)?);
    } else {
        println!("{steps} load steps, {iterations} Newton iterations, {seconds:.1} s; results in {}", dir.display());
    }
    Ok(())
}

pub fn check(command: CheckCommand) -> Result<(), Failure> {
    let case = read(&command.case)?;
    threads(command.common.threads)?;
    let plan = dispatch(command.common.backend.as_deref(), CheckJob { case })?;
    if command.json {
        println!("{}", json(&plan)?);
    } else {
        print!("{}", plan.text());
    }
    Ok(())
}

fn read(path: &Path) -> Result<Case, Failure> {
    let read = Case::read(path)?;
    for warning in &read.warnings {
        eprintln!("warning: {warning}");
    }
    Ok(read.case)
}

/// Sets the number of threads that solve RVEs.
fn threads(count: Option<usize>) -> Result<(), Failure> {
    let Some(count) = count else { return Ok(()) };
    if count == 0 || count > 4096 {
        return Err(Failure::Arguments {
            what: format!("--threads {count}"),
            expected: "a number of threads between 1 and 4096".into(),
            cure: "leave --threads out to use all cores".into(),
        });
    }
    rayon::ThreadPoolBuilder::new().num_threads(count).build_global().map_err(|error| Failure::Environment {
        what: format!("{count} threads cannot be started: {error}"),
        cure: "ask for fewer".into(),
    })
}

pub fn json(value: &impl Serialize) -> Result<String, Failure> {
    serde_json::to_string(value).map_err(|error| Failure::Environment {
        what: format!("the answer cannot be written as JSON: {error}"),
        cure: "report this as a bug, with the command".into(),
    })
}

struct RunJob<'a> {
    case: Case,
    dir: &'a Path,
    resume: bool,
}

#[derive(Serialize)]
struct Summary {
    converged: bool,
    steps: usize,
    iterations: usize,
    seconds: f64,
    directory: PathBuf,
}

impl Job for RunJob<'_> {
    type Output = Summary;

    fn run<B>(self) -> Result<Summary, Failure>
    where
        B: Backend<Scalar = f64, Context = ()>,
        B::Reduced: Scalar,
    {
        let mut simulation = simulation::<B>(self.case)?;
        if self.resume {
            let resumed = simulation.resume(self.dir).map_err(not_resumed)?;
            for warning in &resumed.warnings {
                eprintln!("warning: {warning}");
            }
            if resumed.step > 0 {
                eprintln!("going on after step {} of {}", resumed.step, simulation.case().steps.count);
            }
        }
        let mut progress = Reporter::new(&simulation.plan());
        let outcome = simulation.run(self.dir, &mut progress);
        progress.finish();
        match outcome {
            Ok(RunSummary { steps, iterations, seconds }) => {
                Ok(Summary { converged: true, steps, iterations, seconds, directory: self.dir.to_owned() })
            }
            Err(RunError::NotConverged { step, count, reached, halvings, reason }) => Err(Failure::NotConverged {
                what: format!("load step {step} of {count} does not converge, halved {halvings} times: {reason}"),
                place: format!("t = {reached}; everything up to there is in {}", self.dir.display()),
                cure: "take more load steps, or look at the last fields for elements near collapse".into(),
            }),
            Err(RunError::Results(error @ ResultsError::Damaged { .. })) => Err(Failure::Arguments {
                what: error.to_string(),
                expected: "the results of the interrupted run".into(),
                cure: "leave --resume out to start again: that replaces the results".into(),
            }),
            Err(RunError::Results(error)) => Err(Failure::Environment {
                what: error.to_string(),
                cure: "check that the folder exists, may be written and has space left".into(),
            }),
        }
    }
}

struct CheckJob {
    case: Case,
}

/// What `biotissue check` prints.
#[derive(Serialize)]
struct PlanText {
    title: String,
    backend: &'static str,
    elements: usize,
    nodes: usize,
    unknowns: usize,
    rves: usize,
    rve_bytes: usize,
    networks: Vec<NetworkText>,
    surfaces: Vec<String>,
    regions: Vec<String>,
    steps: usize,
    threads: usize,
    ranks: usize,
    directory: PathBuf,
}

#[derive(Serialize)]
struct NetworkText {
    name: String,
    unknowns: usize,
    rves: usize,
}

impl Job for CheckJob {
    type Output = PlanText;

    fn run<B>(self) -> Result<PlanText, Failure>
    where
        B: Backend<Scalar = f64, Context = ()>,
        B::Reduced: Scalar,
    {
        let simulation = simulation::<B>(self.case)?;
        let Plan { elements, nodes, unknowns, rves, networks, rve_bytes, steps, threads } = simulation.plan();
        let networks = networks.into_iter().map(|n| NetworkText { name: n.name, unknowns: n.unknowns, rves: n.rves });
        Ok(PlanText {
            title: simulation.case().title.clone(),
            backend: B::NAME,
            elements,
            nodes,
            unknowns,
            rves,
            rve_bytes,
            networks: networks.collect(),
            surfaces: simulation.mesh().surface_names().map(str::to_owned).collect(),
            regions: simulation.mesh().regions().to_vec(),
            steps,
            threads,
            ranks: 1,
            directory: simulation.case().output.directory.clone(),
        })
    }
}

impl PlanText {
    fn text(&self) -> String {
        let mut lines = vec![
            format!("title      {}", self.title),
            format!("mesh       {} elements, {} nodes", self.elements, self.nodes),
            format!("regions    {}", self.regions.join(", ")),
            format!("surfaces   {}", self.surfaces.join(", ")),
            format!("unknowns   {} free, backend {}", self.unknowns, self.backend),
            format!("RVEs       {}, {:.1} MB of states", self.rves, self.rve_bytes as f64 * 1e-6),
        ];
        for network in &self.networks {
            lines.push(format!("  {:<24} {:>6} unknowns, {:>6} RVEs", network.name, network.unknowns, network.rves));
        }
        lines.push(format!("steps      {}", self.steps));
        lines.push(format!("threads    {}, one process", self.threads));
        lines.push(format!("results    {}", self.directory.display()));
        lines.join("\n") + "\n"
    }
}

fn simulation<B>(case: Case) -> Result<Simulation<B>, Failure>
where
    B: Backend<Scalar = f64, Context = ()>,
    B::Reduced: Scalar,
{
    let file = case.file.clone();
    let simulation = Simulation::<B>::new((), case).map_err(|error| not_set_up(&file, error))?;
    for warning in simulation.warnings() {
        eprintln!("warning: {warning}");
    }
    Ok(simulation)
}

fn not_resumed<F: std::error::Error + 'static>(error: ResumeError<F>) -> Failure {
    let cure = match &error {
        ResumeError::Checkpoint(error @ CheckpointError::Unreadable { .. }) => {
            return Failure::Environment { what: error.to_string(), cure: error.cure().into() };
        }
        ResumeError::Checkpoint(error) => error.cure(),
        ResumeError::State { .. } => "start again without resuming: that replaces the results",
    };
    Failure::Arguments {
        what: error.to_string(),
        expected: "a checkpoint of the run that this case describes".into(),
        cure: format!("{cure} (leave --resume out)"),
    }
}

fn not_set_up<F: std::error::Error + 'static>(file: &Path, error: SimulationError<F>) -> Failure {
    let (what, cure) = match error {
        SimulationError::MacroScale(MacroScaleError::Input(errors))
        | SimulationError::Library(LibraryError::Network(errors))
        | SimulationError::Output(errors) => return errors.into(),
        SimulationError::Library(error @ LibraryError::Model { .. }) => {
            (error.to_string(), "give the region a `law`, or put a .params file beside the network")
        }
        error => (error.to_string(), "change the case, or the mesh it names"),
    };
    Failure::Arguments {
        what: format!("{}: {what}", file.display()),
        expected: "a case that can be set up".into(),
        cure: cure.into(),
    }
}

/// A bar on a terminal, a line a step otherwise.
struct Reporter {
    bar: Option<ProgressBar>,
    count: usize,
}

impl Reporter {
    fn new(plan: &Plan) -> Self {
        eprintln!(
            "{} elements, {} unknowns, {} RVEs of {} networks, {} threads",
            plan.elements,
            plan.unknowns,
            plan.rves,
            plan.networks.len(),
            plan.threads
        );
        let bar = std::io::stderr().is_terminal().then(|| {
            let bar = ProgressBar::new(plan.steps as u64);
            if let Ok(style) = ProgressStyle::with_template("{bar:32} step {pos}/{len} {elapsed} (left {eta}) {msg}") {
                bar.set_style(style);
            }
            bar.enable_steady_tick(std::time::Duration::from_millis(200));
            bar
        });
        Self { bar, count: plan.steps }
    }

    fn say(&self, line: &str) {
        match &self.bar {
            Some(bar) => bar.println(line),
            None => eprintln!("{line}"),
        }
    }

    fn finish(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

impl Progress for Reporter {
    fn converged(&mut self, step: &Step) {
        let newton = &step.newton;
        let residual = newton.relative.last().copied().unwrap_or(0.0);
        let rves = step.rve.as_ref().map_or(String::new(), |rve| {
            format!(", RVEs {:.1} iterations on average, {} at most", rve.iterations_mean, rve.iterations_max)
        });
        let line = format!(
            "step {}/{} t = {:.4}: {} iterations, residual {residual:.1e}{rves}, {:.1} s",
            step.step, self.count, step.t, newton.iterations, newton.seconds.total
        );
        match &self.bar {
            Some(bar) => {
                bar.set_position(step.step as u64);
                bar.set_message(format!("{} iterations", newton.iterations));
            }
            None => eprintln!("{line}"),
        }
    }

    fn failed(&mut self, cut: &Cut) {
        self.say(&format!("step {}/{} to t = {:.4} failed: {}", cut.step, self.count, cut.t, cut.reason));
    }
}
