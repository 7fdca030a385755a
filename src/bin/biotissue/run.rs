//! `biotissue run`: runs the simulation of a case.

use std::path::{Path, PathBuf};
use std::time::Duration;

use biotissue::app::Examination;
use biotissue::app::case::{Case, ScalesCase};
use biotissue::app::results::LOADS_FILE;
use biotissue::app::results::log::ScalesLog;
use biotissue::app::run::{RunError, RunSummary, Setup, Simulation, WriterGroup};
use biotissue::coupling::{Config, Plan};

use biotissue::tissue::micro_scale::{TissueField, TissueMaterial};
use clap::Args;
use serde::Serialize;

use crate::dispatch::{Job, ProgramBackend, dispatch};
use crate::error_hints::{
    CaseHints, constraint_of, cure_of_step, expected_of_step, is_failure_of_backend, manner_of_failure, not_resumed,
    not_set_up, not_written, on_disk, replay_hint,
};
use crate::failure::Failure;
use crate::interrupt::{self, how_to_continue};
use crate::number::count;
use crate::output;
use crate::progress::{self, Reporter};
use crate::ranks::{self, RunContext};

/// Maximum number of threads, above the number of cores of any supported machine.
const MAX_THREADS: usize = 4096;

/// Run the simulation of a case
#[derive(Args)]
pub struct RunCommand {
    /// The case file
    case: PathBuf,
    /// Result directory, instead of the one that the case names
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Continue after the last converged step in the result directory; without results, start from the beginning
    #[arg(long)]
    resume: bool,
    /// Folder with the body divided by `biotissue divide` among as many ranks as it has here: none holds the whole mesh
    #[arg(long, value_name = "DIR")]
    divided: Option<PathBuf>,
    /// Configuration file of the original AMSI: which ranks each scale gets, and where results go
    #[arg(short = 'a', long = "amsi", value_name = "FILE")]
    amsi: Option<PathBuf>,
    /// Seconds that ranks wait for each other before the run ends with an error that names the rank that did not
    /// respond [default: forever]
    #[arg(long, value_name = "SECONDS", allow_hyphen_values = true)]
    time_out: Option<f64>,
    #[command(flatten)]
    common: Common,
    /// Ranks that share the work, as threads of this process: one for the body, the others for RVEs, unless [scales] of
    /// the case says otherwise; not under mpirun, which starts them itself [default: those of [scales], else 1]
    #[arg(long, value_name = "N", value_parser = count, allow_hyphen_values = true)]
    ranks: Option<usize>,
    /// Without a terminal: the most seconds between two lines about a load step in progress
    #[arg(long, value_name = "SECONDS", default_value_t = 30.0, allow_hyphen_values = true)]
    progress: f64,
    /// Print the summary as one JSON object
    #[arg(long)]
    json: bool,
}

/// What `run` and `check` have in common.
#[derive(Args)]
pub struct Common {
    /// Threads that solve the body and its RVEs; results do not depend on it [default: all cores]
    #[arg(long, value_name = "N", value_parser = count, allow_hyphen_values = true)]
    threads: Option<usize>,
    /// Linear-algebra backend of both scales [default: the first that `biotissue info` names]
    #[arg(long, value_name = "NAME")]
    backend: Option<String>,
}

/// Runs the command; progress goes to stderr.
pub fn run(command: RunCommand) -> Result<(), Failure> {
    if let Some(processes) = ranks::started_by_mpirun().filter(|&processes| processes > 1) {
        return run_on_processes(processes, command);
    }
    ranks::check_requested(command.ranks)?;
    interrupt::watch_preparation();
    let config = command.config()?;
    let time_out = command.time_out()?;
    let report_every = command.report_every()?;
    let case = read(&command.case)?;
    output::warn(&config.warnings_for(&case));
    let (dir, is_named) = (command.dir(&case, &config), command.names_dir(&config));
    command.common.start_threads()?;
    let (backend, plan) = (command.common.backend(), config.plan);
    let steps = StepOptions { dir: &dir, is_named, resume: command.resume, report_every };
    // A single process started by mpirun is one rank.
    let requested = command.ranks.or_else(ranks::started_by_mpirun);
    let divided = command.divided.as_deref();
    let summary = match ranks::of_threads(requested, case.scales, plan.as_ref().map(|(plan, _)| plan)) {
        None if divided.is_some() => return Err(ranks::not_divided()),
        None => dispatch(backend, RunJob { case, steps })?,
        Some(count) if count > MAX_THREADS => return Err(too_many_ranks(count)),
        Some(count) => ranks::on_threads(count, &RunContext { case, steps, backend, plan, time_out, divided })?,
    };
    print_summary(&summary, &dir, command.json)
}

impl RunCommand {
    /// Reads the configuration file, if there is one.
    fn config(&self) -> Result<Configuration, Failure> {
        Ok(match &self.amsi {
            None => Configuration::default(),
            Some(file) => {
                let config = Config::read(file)?;
                // A file without scales may set the result directory alone.
                let has_scales = !config.plan.scales.is_empty();
                if has_scales {
                    ranks::check_scales(&config, file)?;
                }
                let Config { plan, results, warnings, .. } = config;
                let plan = has_scales.then_some((plan, file.clone()));
                Configuration { plan, results, warnings }
            }
        })
    }

    fn time_out(&self) -> Result<Option<Duration>, Failure> {
        let Some(seconds) = self.time_out else { return Ok(None) };
        match Duration::try_from_secs_f64(seconds) {
            Ok(time_out) if !time_out.is_zero() => Ok(Some(time_out)),
            _ => Err(Failure::arguments(
                format!("invalid --time-out {seconds}"),
                "seconds above 0",
                "leave --time-out out to wait indefinitely",
            )),
        }
    }

    fn report_every(&self) -> Result<Duration, Failure> {
        match Duration::try_from_secs_f64(self.progress) {
            Ok(every) if every >= Duration::from_millis(10) => Ok(every),
            _ => Err(Failure::arguments(
                format!("invalid --progress {}", self.progress),
                "at least 0.01 seconds",
                "leave --progress out for a line every 30 seconds",
            )),
        }
    }

    /// Returns the result directory from the option, else from the configuration file, else from the case.
    fn dir(&self, case: &Case, config: &Configuration) -> PathBuf {
        let of_config = || config.results.clone();
        self.out.clone().or_else(of_config).unwrap_or_else(|| case.output.directory.clone())
    }

    /// Returns true if the user has named the result directory outside the case.
    fn names_dir(&self, config: &Configuration) -> bool {
        self.out.is_some() || config.results.is_some()
    }
}

/// The contents of a configuration file.
#[derive(Default)]
struct Configuration {
    /// The assignment of ranks to scales, and the file itself.
    plan: Option<(Plan, PathBuf)>,
    results: Option<PathBuf>,
    warnings: Vec<String>,
}

impl Configuration {
    /// Returns the warnings of the file, and a warning if it overrides the ranks of the case.
    fn warnings_for(&self, case: &Case) -> Vec<String> {
        let default = ScalesCase { balance: case.scales.balance, ..ScalesCase::default() };
        let overridden = self.plan.iter().filter(|_| case.scales != default).map(|(_, file)| {
            format!(
                "{}: [scales] has no effect: {} assigns the ranks to the scales",
                case.file.display(),
                file.display()
            )
        });
        self.warnings.iter().cloned().chain(overridden).collect()
    }
}

fn print_summary(summary: &Summary, dir: &Path, json: bool) -> Result<(), Failure> {
    let Summary { steps, resumed_from, iterations, cuts, wasted_iterations, seconds, .. } = summary;
    if json {
        return output::print_json(summary);
    }
    let failed = match cuts {
        0 => String::new(),
        1 => format!(", and {wasted_iterations} in a failed increment"),
        _ => format!(", and {wasted_iterations} in {cuts} failed increments"),
    };
    let of_this_run = match (resumed_from, steps - resumed_from) {
        (0, _) => String::new(),
        (_, 0) => " (none of them in this run)".to_owned(),
        (_, taken) => format!(" ({taken} of them in this run)"),
    };
    let scales = summary.scales.iter().map(|scales| format!("{}\n", balance_line(scales)));
    output::print(&format!(
        "{}{steps} load step{}{of_this_run}, {iterations} Newton iteration{}{failed}, {seconds:.1} s; results in {}",
        scales.collect::<String>(),
        if *steps == 1 { "" } else { "s" },
        if *iterations == 1 { "" } else { "s" },
        dir.display()
    ))
}

/// Says how evenly the micro ranks shared the work.
fn balance_line(ScalesLog { micro_scale, migrations, moved, .. }: &ScalesLog) -> String {
    let idle = 100.0 * micro_scale.idle_mean;
    let moves = match (migrations, moved) {
        (0, _) => "no RVE moved".to_owned(),
        (1, 1) => "1 RVE moved in 1 migration".to_owned(),
        (1, moved) => format!("{moved} RVEs moved in 1 migration"),
        (migrations, moved) => format!("{moved} RVEs moved in {migrations} migrations"),
    };
    format!("micro ranks idle for {idle:.1} % of the evaluations on average; {moves}")
}

/// Reads a case; warnings go to stderr.
pub fn read(path: &Path) -> Result<Case, Failure> {
    let read = Case::read(path)?;
    output::warn(&read.warnings);
    Ok(read.case)
}

impl Common {
    /// Returns the requested backend.
    pub fn backend(&self) -> Option<&str> {
        self.backend.as_deref()
    }

    /// Sets the number of threads of both scales.
    pub fn start_threads(&self) -> Result<(), Failure> {
        let Some(count) = self.threads else { return Ok(()) };
        if !(1..=MAX_THREADS).contains(&count) {
            let expected = format!("a number of threads between 1 and {MAX_THREADS}");
            let cure = "leave --threads out to use all cores";
            return Err(Failure::arguments(format!("invalid --threads {count}"), expected, cure));
        }
        rayon::ThreadPoolBuilder::new().num_threads(count).build_global().map_err(|error| {
            Failure::environment(
                format!("{count} threads cannot be started: {error}"),
                "a system that allows that many threads",
                "ask for fewer --threads, or leave it out to use all cores",
            )
        })
    }
}

fn too_many_ranks(count: usize) -> Failure {
    let expected = format!("between 1 and {MAX_THREADS} ranks in one process");
    Failure::arguments(format!("{count} ranks"), expected, "start them with mpirun, in a build with the feature `mpi`")
}

/// Runs on every process; the root reports input errors, and the one that knows the outcome reports it.
#[cfg(feature = "mpi")]
fn run_on_processes(processes: usize, command: RunCommand) -> Result<(), Failure> {
    use biotissue::backends::comm::mpi;
    use biotissue::las::Comm as _;

    let started = || match command.ranks {
        Some(ranks) if ranks != processes => Err(Failure::arguments(
            format!("--ranks {ranks} under mpirun, which has started {processes}"),
            "as many ranks as processes",
            "leave --ranks out, and give the number to mpirun",
        )),
        _ => Ok(()),
    };
    let on_rank = |world: mpi::MpiComm| {
        let is_root = world.rank() == 0;
        let read = || {
            started()?;
            // Processes share the cores of a machine: one thread each by default.
            Common { threads: command.common.threads.or(Some(1)), backend: None }.start_threads()?;
            Ok((command.config()?, (command.time_out()?, command.report_every()?), Case::read(&command.case)?))
        };
        let (config, (time_out, report_every), case) = match ranks::agreed(&world, read())? {
            Ok((config, times, read)) => {
                if is_root {
                    output::warn(&read.warnings);
                    output::warn(&config.warnings_for(&read.case));
                }
                (config, times, read.case)
            }
            Err(failure) => return Ok(if is_root { Err(failure) } else { Ok(()) }),
        };
        let (dir, is_named) = (command.dir(&case, &config), command.names_dir(&config));
        let (backend, plan) = (command.common.backend(), config.plan);
        let steps = StepOptions { dir: &dir, is_named, resume: command.resume, report_every };
        let run = RunContext { case, steps, backend, plan, time_out, divided: command.divided.as_deref() };
        Ok(match ranks::on_processes(&world, &run)? {
            Some(outcome) => outcome.and_then(|summary| print_summary(&summary, &dir, command.json)),
            None => Ok(()),
        })
    };
    mpi::run(on_rank, |failure: &Failure| failure.code().into())
}

/// Returns an error: without MPI every process would run the whole case and write the same files.
#[cfg(not(feature = "mpi"))]
fn run_on_processes(processes: usize, _: RunCommand) -> Result<(), Failure> {
    Err(Failure::arguments(
        format!("started as {processes} processes, each of which would run the whole case: this build has no MPI"),
        "one process, or a build with MPI",
        "build with --features mpi, or leave mpirun out and give --ranks",
    ))
}

/// How the steps of a run are taken.
#[derive(Clone, Copy)]
pub struct StepOptions<'a> {
    /// The result directory.
    pub dir: &'a Path,
    /// Whether the user has named it, so that other results there may be replaced.
    pub is_named: bool,
    /// Whether to continue after the last converged step in that directory.
    pub resume: bool,
    /// The longest time between two lines of progress without a terminal.
    pub report_every: Duration,
}

struct RunJob<'a> {
    case: Case,
    steps: StepOptions<'a>,
}

#[derive(Serialize)]
pub struct Summary {
    converged: bool,
    /// Load steps of the case.
    steps: usize,
    /// The step after which this run continued, which the following numbers leave out with those before.
    #[serde(skip_serializing_if = "is_start")]
    resumed_from: usize,
    iterations: usize,
    /// Number of increments that failed and were repeated in shorter ones.
    cuts: usize,
    wasted_iterations: usize,
    seconds: f64,
    /// How the ranks shared the work, if there are several.
    #[serde(skip_serializing_if = "Option::is_none")]
    scales: Option<ScalesLog>,
    directory: PathBuf,
}

/// Returns true for a run from the beginning.
#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde passes a reference")]
fn is_start(resumed_from: &usize) -> bool {
    *resumed_from == 0
}

impl Job for RunJob<'_> {
    type Output = Summary;

    fn run<B: ProgramBackend>(self, context: B::Context) -> Result<Summary, Failure> {
        take_steps(&mut simulation::<B>(context, self.case, self.steps.report_every)?, &(), self.steps)
    }
}

/// Runs the steps of a simulation, from the beginning or from the last step of an earlier run.
pub fn take_steps<B: ProgramBackend, M: TissueMaterial>(
    simulation: &mut Simulation<B, M>,
    writers: &dyn WriterGroup,
    StepOptions { dir, is_named, resume, report_every }: StepOptions<'_>,
) -> Result<Summary, Failure> {
    let mut completed_steps = 0;
    if !resume {
        if !is_named {
            simulation.check_case_of(writers, dir).map_err(not_written)?;
        }
        let warnings = simulation.take_directory(writers, dir).map_err(not_written)?;
        output::warn(if writers.is_writer() { &warnings } else { &[] });
    } else {
        let resumed = simulation.resume_among(writers, dir).map_err(not_resumed)?;
        output::warn(if writers.is_writer() { &resumed.warnings } else { &[] });
        completed_steps = resumed.step;
        if resumed.step > 0 && writers.is_writer() {
            output::message(&format!("continuing after step {} of {}", resumed.step, simulation.case().steps.count));
        }
    }
    if !resume && writers.is_writer() && dir.join(LOADS_FILE).exists() {
        output::message(&format!(
            "replacing the results in {}; --resume continues those of the same case",
            dir.display()
        ));
    }
    // Only the rank that writes reports progress.
    let mut progress = writers.is_writer().then(|| Reporter::new(simulation, dir, completed_steps, report_every));
    let outcome = match &mut progress {
        Some(reporter) => simulation.run_among(writers, dir, reporter),
        None => simulation.run_among(writers, dir, &mut ()),
    };
    if let Some(reporter) = &progress {
        reporter.finish();
    }
    match outcome {
        Ok(RunSummary { steps, iterations, cuts, wasted_iterations, seconds, scales }) => {
            let directory = dir.to_owned();
            let resumed_from = completed_steps;
            Ok(Summary {
                converged: true,
                steps,
                resumed_from,
                iterations,
                cuts,
                wasted_iterations,
                seconds,
                scales,
                directory,
            })
        }
        Err(RunError::NotConverged { step, count, reached, halvings, reason, failed_rve, largest_residual }) => {
            let case = simulation.case();
            let (manner, named) = (manner_of_failure(&reason, case, halvings), constraint_of(case, &reason));
            let what = format!("load step {step} of {count} {manner}: {reason}{named}");
            let residual = largest_residual.map_or_else(String::new, |residual| format!("{residual}; "));
            let hint = replay_hint(failed_rve.as_deref());
            let place = format!("t = {reached}; {residual}{}{hint}", on_disk(step - 1, dir));
            let cure = cure_of_step(&reason, case);
            let failure = Failure::not_converged(what, place, expected_of_step(&reason), cure);
            Err(if is_failure_of_backend(&reason) { failure.of_environment() } else { failure })
        }
        Err(RunError::Interrupted(_)) => Err(Failure::Interrupted(how_to_continue(dir))),
        Err(RunError::Results(error)) => Err(not_written(error)),
    }
}

/// A case whose body and RVEs are solved in this process.
pub type OneProcess<B> = Setup<B, TissueField<<B as ProgramBackend>::Local>>;

/// Reads all files that a case names; the warnings of the mesh and network readers go to stderr.
pub fn setup<B: ProgramBackend>(context: B::Context, case: Case) -> Result<OneProcess<B>, Failure> {
    let hints = CaseHints::of(&case);
    let of_rves = B::local(&context);
    let setup = Setup::with_rves(context, of_rves, case).map_err(|error| not_set_up(&hints, error))?;
    output::warn(setup.warnings());
    Ok(setup)
}

/// Sets up the simulation of a case.
fn simulation<B: ProgramBackend>(
    context: B::Context,
    case: Case,
    report_every: Duration,
) -> Result<Simulation<B, TissueField<B::Local>>, Failure> {
    let hints = CaseHints::of(&case);
    let setup = setup::<B>(context, case)?.with_device().map_err(|error| not_set_up(&hints, error))?;
    output::warn(&setup.floppy_networks(Examination::Quick).warnings);
    let _progress = progress::of_undeformed_body(&setup, report_every);
    setup.simulation().map_err(|error| not_set_up(&hints, error))
}
