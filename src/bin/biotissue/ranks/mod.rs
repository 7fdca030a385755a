//! `biotissue run` on several ranks: threads of this process, or the processes that `mpirun` started.

#[cfg(any(feature = "sparse", feature = "dense"))]
mod mains;

use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use biotissue::app::case::{Case, ScalesCase};
use biotissue::backends::comm::thread;
use biotissue::coupling::{Config, Plan, PlanError, ScaleError, Scales, Share};
use biotissue::las::{Comm, Disagreement};
use biotissue::tissue::two_scale::{MACRO, MICRO};

use crate::failure::Failure;
use crate::run::{StepOptions, Summary};

/// A communicator whose ranks a backend can distribute a linear system over.
pub trait Ranks: Comm {
    /// Returns the PETSc context of these ranks.
    #[cfg(feature = "petsc")]
    fn petsc(&self) -> Result<biotissue::backends::petsc::Context, Failure>;
}

impl Ranks for thread::ThreadComm {
    #[cfg(feature = "petsc")]
    fn petsc(&self) -> Result<biotissue::backends::petsc::Context, Failure> {
        Err(Failure::arguments(
            "--backend petsc on ranks that are threads: PETSc is for processes",
            "ranks that mpirun starts, or a run in one process",
            "start the program with mpirun, or leave --ranks and [scales] out",
        ))
    }
}

#[cfg(feature = "mpi")]
impl Ranks for biotissue::backends::comm::mpi::MpiComm {
    #[cfg(feature = "petsc")]
    fn petsc(&self) -> Result<biotissue::backends::petsc::Context, Failure> {
        use biotissue::backends::petsc::{Context, Session};

        let session = match Session::current() {
            Some(session) => session,
            None => Session::new().map_err(Failure::library)?,
        };
        Ok(Context::new(&session, self.communicator()))
    }
}

/// The common outcome of the ranks of the body.
type Outcome = Result<Summary, Failure>;

/// The data of a run that all its ranks share.
pub struct RunContext<'a> {
    pub case: Case,
    pub steps: StepOptions<'a>,
    pub backend: Option<&'a str>,
    /// The assignment of ranks to scales from a configuration file, and that file.
    pub plan: Option<(Plan, PathBuf)>,
    /// Maximum time that ranks wait for each other.
    pub time_out: Option<Duration>,
    /// The folder of a divided body.
    pub divided: Option<&'a Path>,
}

/// The error of a run that cannot use a divided body.
pub fn not_divided() -> Failure {
    Failure::arguments(
        "--divided for a body that this run does not divide",
        "a run on petsc with several ranks of the body",
        "add --backend petsc, start it by mpirun with `macro` of [scales] above 1, or leave --divided out",
    )
}

/// Returns the number of processes that `mpirun` started; `None` if it did not start this one.
pub fn started_by_mpirun() -> Option<usize> {
    let of = |name: &str| std::env::var(name).ok()?.parse().ok();
    // The last variable is set by `srun`, for any process management interface.
    ["OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "MV2_COMM_WORLD_SIZE", "SLURM_STEP_NUM_TASKS"].into_iter().find_map(of)
}

/// Returns the number of ranks of a run in this process: `requested`, or else the smallest number for the plan or the
/// case; `None` for a run without ranks.
pub fn of_threads(requested: Option<usize>, scales: ScalesCase, plan: Option<&Plan>) -> Option<usize> {
    let planned = plan.map_or(scales.least(), Plan::min_ranks);
    // If the case names more ranks than `requested`, `Scales` reports the error.
    (planned > 1 || requested.is_some_and(|requested| requested > 1)).then_some(requested.unwrap_or(planned))
}

/// Checks the number of ranks that the user asks for.
pub fn check_requested(ranks: Option<usize>) -> Result<(), Failure> {
    if ranks == Some(0) {
        return Err(Failure::arguments(
            "invalid --ranks 0",
            "at least one rank",
            "leave --ranks out, or give a number above 0",
        ));
    }
    Ok(())
}

/// Returns the numbers of macro and micro ranks of a run of this case on `requested` ranks, or else on the smallest number
/// that it can run on; 1 and 0 for a run without ranks.
pub fn split(case: &Case, requested: Option<usize>) -> Result<[usize; 2], Failure> {
    let Some(ranks) = of_threads(requested, case.scales, None) else { return Ok([1, 0]) };
    let assigned = plan(case.scales, ranks).assign(ranks);
    let assigned = assigned.map_err(|error| plan_failure(&error.into(), "[scales]", &case.file))?;
    let count = |scale: usize| assigned.get(scale).map_or(0, Vec::len);
    Ok([count(0), count(1)])
}

/// Checks the scales of a configuration file, which may name any scales and relations: a body has exactly two scales,
/// with relations in both directions or none.
pub fn check_scales(config: &Config, file: &Path) -> Result<(), Failure> {
    let mut names: Vec<&str> = config.plan.scales.iter().map(|(name, _)| name.as_str()).collect();
    names.sort_unstable();
    if names != [MACRO, MICRO] {
        return Err(Failure::arguments(
            format!("{}: the scales are {}", file.display(), names.join(", ")),
            format!("the two scales of a body, {MACRO} and {MICRO}"),
            "name these two in @scales",
        ));
    }
    let given = |producer: &str| config.relations.iter().any(|relation| relation.producer == producer);
    match config.relations.is_empty() || given(MACRO) && given(MICRO) {
        true => Ok(()),
        false => Err(Failure::arguments(
            format!("{}: the relations go in one direction only", file.display()),
            format!("both directions: `{MACRO} {MICRO}` for strains and `{MICRO} {MACRO}` for stresses"),
            "give both in @relations, or none",
        )),
    }
}

/// Returns the number of ranks of each scale: as given in the case, or by default one for the macro scale and all
/// others for the RVEs.
fn plan(scales: ScalesCase, ranks: usize) -> Plan {
    let (macro_ranks, micro_ranks) = match scales.micro_ranks {
        0 => (scales.macro_ranks, ranks.saturating_sub(scales.macro_ranks).max(1)),
        micro => (scales.macro_ranks, micro),
    };
    Plan::default().with(MACRO, Share::Count(macro_ranks)).with(MICRO, Share::Count(micro_ranks))
}

/// Places ranks near each other if the case requests it and the plan is valid for this number of ranks.
#[cfg(feature = "hwloc")]
fn near<C: Comm>(world: &C, plan: Plan, scales: ScalesCase) -> Result<Result<Plan, Failure>, Failure> {
    use biotissue::coupling::topology;

    if !scales.near || plan.assign(world.size()).is_err() {
        return Ok(Ok(plan));
    }
    let here = topology::current_location().map_err(|what| {
        Failure::environment(what, "hwloc to know where each rank runs, for `near` in [scales]", "leave `near` out")
    });
    let here = match agreed(world, here)? {
        Ok(here) => here,
        Err(failure) => return Ok(Err(failure)),
    };
    let places = topology::gather(world, &here).map_err(|error| ranks_failed(&error))?;
    Ok(topology::plan([MACRO, MICRO], &places, scales.macro_ranks).map_err(|error| ranks_failed(&error)))
}

#[cfg(not(feature = "hwloc"))]
fn near<C: Comm>(_: &C, plan: Plan, scales: ScalesCase) -> Result<Result<Plan, Failure>, Failure> {
    Ok(check_near(scales).map(|()| plan))
}

/// Returns an error if the case requests `near` but this build has no `hwloc`.
pub fn check_near(scales: ScalesCase) -> Result<(), Failure> {
    if cfg!(feature = "hwloc") || !scales.near {
        return Ok(());
    }
    Err(Failure::arguments(
        "`near` in [scales], in a build that cannot determine the topology of machines",
        "a build with the cargo feature `hwloc`",
        "build it with --features mpi,hwloc, or leave `near` out",
    ))
}

/// Runs on `ranks` threads of this process.
pub fn on_threads(ranks: usize, run: &RunContext<'_>) -> Result<Summary, Failure> {
    // The first failure ends the other ranks, so it is the one to report.
    let first = Mutex::new(None);
    let outcome = thread::run(ranks, |world| {
        rank(&world, run).map_err(|failure| {
            let text = failure.to_string();
            first.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(failure);
            text
        })
    });
    match outcome {
        Ok(all) => all.into_iter().flatten().next().unwrap_or_else(|| Err(no_outcome())),
        Err(failed) if failed.has_panicked => Err(Failure::Panicked(failed.to_string())),
        Err(failed) => {
            Err(first.into_inner().unwrap_or_else(PoisonError::into_inner).unwrap_or_else(|| ranks_failed(&failed)))
        }
    }
}

/// Runs on the processes that `mpirun` started; only one of them returns the outcome.
#[cfg(feature = "mpi")]
pub fn on_processes(
    world: &biotissue::backends::comm::mpi::MpiComm,
    run: &RunContext<'_>,
) -> Result<Option<Outcome>, Failure> {
    rank(world, run)
}

fn no_outcome() -> Failure {
    ranks_failed(&"no rank reported how the run ended")
}

fn ranks_failed(error: &impl std::fmt::Display) -> Failure {
    Failure::environment(
        error.to_string(),
        "ranks that all complete the run",
        "see the error of that rank; the converged steps are on disk",
    )
}

/// Runs the main function of the scale of this rank. The root of the macro scale returns the outcome of the run, which
/// may be a failure that all ranks know of; an outer error is one that the other ranks do not know of.
fn rank<C: Ranks>(world: &C, run: &RunContext<'_>) -> Result<Option<Outcome>, Failure> {
    let plan = match &run.plan {
        Some((plan, _)) => plan.clone(),
        None => match near(world, plan(run.case.scales, world.size()), run.case.scales)? {
            Ok(plan) => plan,
            Err(failure) => return Ok((world.rank() == 0).then_some(Err(failure))),
        },
    };
    let scales = match Scales::with_time_out(world, &plan, run.time_out) {
        Ok(scales) => scales,
        // Only this rank knows of this error.
        Err(error @ ScaleError::Plan(PlanError::Mismatch { .. })) => return Err(ranks_failed(&error)),
        Err(error @ ScaleError::Plan(_)) => return scales_failure(world.rank(), run, &error),
        Err(error) => return Err(ranks_failed(&error)),
    };
    // Initializing and finalizing PETSc is collective over all processes, including those that do not use it.
    #[cfg(feature = "petsc")]
    let session = match run.backend {
        Some(name) if name == biotissue::backends::BackendName::Petsc.as_str() => Some(world.petsc()?),
        _ => None,
    };
    #[cfg(any(feature = "sparse", feature = "dense"))]
    let outcome = mains::on_scale(world, &scales, run);
    #[cfg(not(any(feature = "sparse", feature = "dense")))]
    let outcome = Err(Failure::arguments(
        "ranks, in a build without a backend for RVEs on their own",
        "a build with the cargo feature `sparse` or `dense`",
        "build it with one of them, or leave ranks out",
    ));
    #[cfg(feature = "petsc")]
    if outcome.is_err() {
        // Finalizing would wait for ranks that are lost.
        std::mem::forget(session);
    }
    outcome
}

/// Reports an error that all ranks find; only the root returns it.
fn scales_failure(rank: usize, run: &RunContext<'_>, error: &ScaleError) -> Result<Option<Outcome>, Failure> {
    if rank > 0 {
        return Ok(None);
    }
    let (scales, file) = match &run.plan {
        Some((_, file)) => ("@scales", file),
        None => ("[scales]", &run.case.file),
    };
    Ok(Some(Err(plan_failure(error, scales, file))))
}

/// Describes an assignment of ranks that is impossible, with the section `scales` of `file` that causes it.
fn plan_failure(error: &ScaleError, scales: &str, file: &Path) -> Failure {
    let cure = match error {
        ScaleError::Plan(PlanError::Sum { planned, .. }) => format!("start {planned} ranks, or change"),
        ScaleError::Plan(PlanError::Empty(_)) => "start more ranks, or change".to_owned(),
        _ => "change".to_owned(),
    };
    let cure = format!("{cure} {scales} in {}", file.display());
    Failure::arguments(error.to_string(), "at least a rank for each scale, and each rank in one of them", cure)
}

/// Makes all ranks fail if one of them failed: a failed rank returns its own failure, the others that of the first
/// failed rank. Collective.
pub fn agreed<C: Comm, T>(world: &C, outcome: Result<T, Failure>) -> Result<Result<T, Failure>, Failure> {
    match world.agree(outcome.map_err(Told)) {
        Ok(found) => Ok(Ok(found)),
        Err(Disagreement::Own(Told(failure))) => Ok(Err(failure)),
        Err(Disagreement::Failed { rank, reason }) => Ok(Err(Told::failure(rank, &reason))),
        Err(Disagreement::Comm(error)) => Err(ranks_failed(&error)),
    }
}

/// A failure as other ranks are told of it: its exit code and its text.
struct Told(Failure);

impl fmt::Display for Told {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}", self.0.code(), self.0)
    }
}

impl Told {
    /// Returns the failure that a rank told.
    fn failure(rank: usize, told: &str) -> Failure {
        let (code, text) = told.split_once(' ').unwrap_or_default();
        let (text, is_error) = text.strip_prefix("error: ").map_or((text, false), |text| (text, true));
        let text = if is_error { format!("error: rank {rank}: {text}") } else { text.to_owned() };
        code.parse().map_or_else(|_| ranks_failed(&told), |code| Failure::OfRank { code, text })
    }
}
