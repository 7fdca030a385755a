//! `biotissue run` on several ranks: threads of this process, or the processes that `mpirun` started.

use std::path::{Path, PathBuf};
use std::sync::{Mutex, OnceLock, PoisonError};
use std::time::Duration;

use biotissue::backends::comm::thread;
use biotissue::coupling::{Plan, PlanError, ScaleError, Scales, Share};
use biotissue::las::{Backend, Comm, Disagreement, Scalar};
use biotissue::tissue::case::{Case, ScalesCase};
use biotissue::tissue::macro_scale;
use biotissue::tissue::micro_scale::Library;
use biotissue::tissue::run::{Setup, Writers};
use biotissue::tissue::two_scale::{self, First, Lead, MACRO, MICRO, ScaleField, TwoScaleError};

use crate::cures::not_set_up;
use crate::dispatch::{Job, dispatch};
use crate::failure::Failure;
use crate::output;
use crate::run::{Summary, take_steps};

/// Ranks that a backend may spread a linear system over.
pub trait Ranks: Comm {
    /// What PETSc needs of these ranks.
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

/// The backend of RVEs that have a rank of their own, where that of the body is none for one rank.
#[cfg(feature = "sparse")]
type Micro = biotissue::backends::sparse::Sparse;
#[cfg(all(feature = "dense", not(feature = "sparse")))]
type Micro = biotissue::backends::dense::Dense;

/// The backend that is asked for by this name.
#[cfg(feature = "dense")]
fn is_dense(name: Option<&str>) -> bool {
    name == Some(biotissue::backends::BackendName::Dense.as_str())
}

/// A run that several ranks share.
pub struct Shared<'a> {
    pub case: Case,
    pub dir: &'a Path,
    pub resume: bool,
    pub backend: Option<&'a str>,
    /// Which ranks each scale gets, where a configuration file says so, and that file.
    pub plan: Option<(Plan, PathBuf)>,
    /// How long ranks wait for each other.
    pub time_out: Option<Duration>,
}

/// How many processes `mpirun` started; `None` where it did not start this one.
pub fn started_by_mpirun() -> Option<usize> {
    let of = |name: &str| std::env::var(name).ok()?.parse().ok();
    ["OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "MV2_COMM_WORLD_SIZE"].into_iter().find_map(of)
}

/// The ranks of a run in this process: those asked for, or those that the case names; `None` for a run without any.
pub fn of_threads(asked: Option<usize>, scales: ScalesCase, plan: Option<&Plan>) -> Option<usize> {
    let of_case = match scales {
        ScalesCase { macro_ranks: 1, micro_ranks: 0, .. } => 1,
        ScalesCase { macro_ranks, micro_ranks, .. } => macro_ranks + micro_ranks,
    };
    let planned = plan.map_or(of_case, Plan::least);
    // Where more are named than asked for, the scales say so.
    (planned > 1 || asked.is_some_and(|asked| asked > 1)).then_some(asked.unwrap_or(planned))
}

/// A configuration file is of any scales; those of a body are two.
pub fn check_names(plan: &Plan, file: &Path) -> Result<(), Failure> {
    let mut names: Vec<&str> = plan.scales.iter().map(|(name, _)| name.as_str()).collect();
    names.sort_unstable();
    if names == [MACRO, MICRO] {
        return Ok(());
    }
    Err(Failure::arguments(
        format!("{}: the scales are {}", file.display(), names.join(", ")),
        format!("the two scales of a body, {MACRO} and {MICRO}"),
        "name these two in @scales",
    ))
}

/// Which ranks each scale gets: those that the case names, or one for the engineering scale and all others for the RVEs.
fn plan(scales: ScalesCase, ranks: usize) -> Plan {
    let (above, below) = match scales.micro_ranks {
        0 => (scales.macro_ranks, ranks.saturating_sub(scales.macro_ranks)),
        micro => (scales.macro_ranks, micro),
    };
    Plan::default().with(MACRO, Share::Count(above)).with(MICRO, Share::Count(below))
}

/// The plan with ranks near each other, where the case asks for that and the plan adds up.
#[cfg(feature = "hwloc")]
fn near<C: Comm>(world: &C, plan: Plan, scales: ScalesCase) -> Result<Result<Plan, Failure>, Failure> {
    use biotissue::coupling::topology;

    if !scales.near || plan.assign(world.size()).is_err() {
        return Ok(Ok(plan));
    }
    let here = topology::here().map_err(|what| Failure::Environment {
        what,
        expected: "hwloc to know where each rank runs, for `near` in [scales]".into(),
        cure: "leave `near` out".into(),
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
    Ok(match scales.near {
        false => Ok(plan),
        true => Err(Failure::arguments(
            "`near` in [scales], in a build that does not know the topology of machines",
            "a build with the cargo feature `hwloc`",
            "build it with --features mpi,hwloc, or leave `near` out",
        )),
    })
}

/// Runs on as many threads.
pub fn on_threads(ranks: usize, shared: &Shared<'_>) -> Result<Summary, Failure> {
    // What fails first ends the others: it is what the user must know.
    let first = Mutex::new(None);
    let outcome = thread::run(ranks, |world| {
        rank(&world, shared).map_err(|failure| {
            let words = failure.to_string();
            first.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(failure);
            words
        })
    });
    match outcome {
        Ok(all) => all.into_iter().flatten().next().unwrap_or_else(|| Err(no_answer())),
        Err(failed) => {
            Err(first.into_inner().unwrap_or_else(PoisonError::into_inner).unwrap_or_else(|| ranks_failed(&failed)))
        }
    }
}

/// Runs on the processes that `mpirun` started: one of them knows how it ended.
#[cfg(feature = "mpi")]
pub fn on_processes(
    world: &biotissue::backends::comm::mpi::MpiComm,
    shared: &Shared<'_>,
) -> Result<Option<Result<Summary, Failure>>, Failure> {
    rank(world, shared)
}

fn no_answer() -> Failure {
    ranks_failed(&"no rank says how the run ended")
}

fn ranks_failed(error: &impl std::fmt::Display) -> Failure {
    Failure::Environment {
        what: error.to_string(),
        expected: "ranks that all go on to the end".into(),
        cure: "see what that rank says; what converged before is on disk".into(),
    }
}

/// One rank: the main function of its scale. What the first rank of the engineering scale finds is how the run ended, an
/// orderly failure included; an error is one that the others do not know of.
fn rank<C: Ranks>(world: &C, shared: &Shared<'_>) -> Result<Option<Result<Summary, Failure>>, Failure> {
    let plan = match &shared.plan {
        Some((plan, _)) => plan.clone(),
        None => match near(world, plan(shared.case.scales, world.size()), shared.case.scales)? {
            Ok(plan) => plan,
            Err(failure) => return Ok((world.rank() == 0).then_some(Err(failure))),
        },
    };
    let scales = match Scales::with_time_out(world, &plan, shared.time_out) {
        Ok(scales) => scales,
        // This rank alone knows.
        Err(error @ ScaleError::Plan(PlanError::Differs { .. })) => return Err(ranks_failed(&error)),
        Err(error @ ScaleError::Plan(_)) => return no_scales(world.rank(), shared, &error),
        Err(error) => return Err(ranks_failed(&error)),
    };
    // PETSc starts and ends on all processes together, whoever uses it.
    #[cfg(feature = "petsc")]
    let session = match shared.backend {
        Some(name) if name == biotissue::backends::BackendName::Petsc.as_str() => Some(world.petsc()?),
        _ => None,
    };
    let outcome = on_scale(world, &scales, shared);
    #[cfg(feature = "petsc")]
    if outcome.is_err() {
        // Its end would wait for ranks that are lost.
        std::mem::forget(session);
    }
    outcome
}

/// The main function of the scale that this rank belongs to.
fn on_scale<C: Ranks>(
    world: &C,
    scales: &Scales<C>,
    shared: &Shared<'_>,
) -> Result<Option<Result<Summary, Failure>>, Failure> {
    match scales.name(scales.own()) {
        #[cfg(feature = "dense")]
        MICRO if is_dense(shared.backend) => {
            return micro::<biotissue::backends::dense::Dense, C>(world, scales, shared);
        }
        MICRO => return micro::<Micro, C>(world, scales, shared),
        MACRO => {}
        other => return Err(ranks_failed(&ScaleError::NoMain(other.to_owned()))),
    }
    #[cfg(feature = "petsc")]
    if shared.backend == Some(biotissue::backends::BackendName::Petsc.as_str()) {
        return in_step(world, scales, shared);
    }
    match scales.comm().rank() {
        0 => dispatch(shared.backend, Leader { world, scales, shared, lead: Lead::First }).map(Some),
        _ => follow(world, scales, shared),
    }
}

/// All ranks of the engineering scale solve for the body together, on PETSc; the first says how it ended.
#[cfg(feature = "petsc")]
fn in_step<C: Ranks>(
    world: &C,
    scales: &Scales<C>,
    shared: &Shared<'_>,
) -> Result<Option<Result<Summary, Failure>>, Failure> {
    let context = scales.comm().petsc()?;
    let leader = Leader { world, scales, shared, lead: Lead::All };
    let outcome = leader.run::<biotissue::backends::petsc::Petsc>(context)?;
    Ok((scales.comm().rank() == 0).then_some(outcome))
}

/// All ranks find the same mistake; the first says it.
fn no_scales(
    rank: usize,
    shared: &Shared<'_>,
    error: &ScaleError,
) -> Result<Option<Result<Summary, Failure>>, Failure> {
    if rank > 0 {
        return Ok(None);
    }
    let (scales, file) = match &shared.plan {
        Some((_, file)) => ("@scales", file),
        None => ("[scales]", &shared.case.file),
    };
    let cure = match error {
        ScaleError::Plan(PlanError::Sum { planned, .. }) => format!("start {planned} ranks, or change"),
        ScaleError::Plan(PlanError::Empty(_)) => "start more ranks, or change".to_owned(),
        _ => "change".to_owned(),
    };
    let cure = format!("{cure} {scales} in {}", file.display());
    Ok(Some(Err(Failure::arguments(
        error.to_string(),
        "at least a rank for each scale, and each rank in one of them",
        cure,
    ))))
}

/// The same outcome on all ranks: where one could not read something, the first says so.
pub fn agreed<C: Comm, T>(world: &C, outcome: Result<T, Failure>) -> Result<Result<T, Failure>, Failure> {
    match world.agree(outcome) {
        Ok(found) => Ok(Ok(found)),
        Err(Disagreement::Own(failure)) => Ok(Err(failure)),
        Err(failed @ Disagreement::Failed { .. }) => Ok(Err(ranks_failed(&failed))),
        Err(Disagreement::Comm(error)) => Err(ranks_failed(&error)),
    }
}

#[cfg(any(feature = "sparse", feature = "dense"))]
fn micro<M, C: Ranks>(
    world: &C,
    scales: &Scales<C>,
    shared: &Shared<'_>,
) -> Result<Option<Result<Summary, Failure>>, Failure>
where
    M: Backend<Scalar = f64, Context = ()>,
    M::Reduced: Scalar,
{
    let read = Library::<M>::read((), &shared.case);
    // The engineering scale reads the same files, and says what is wrong with them.
    let read = read.map_err(|error| ranks_failed(&error));
    if let Ok((library, _)) = agreed(world, read)? {
        two_scale::run_micro(scales, &shared.case, library).map_err(|error| ranks_failed(&error))?;
    }
    Ok(None)
}

fn follow<C: Ranks>(
    world: &C,
    scales: &Scales<C>,
    shared: &Shared<'_>,
) -> Result<Option<Result<Summary, Failure>>, Failure> {
    let mesh = macro_scale::mesh(&shared.case).map_err(|error| ranks_failed(&error));
    if let Ok((mesh, _)) = agreed(world, mesh)? {
        two_scale::follow(scales, &mesh).map_err(|error| ranks_failed(&error))?;
    }
    Ok(None)
}

/// A rank that solves for the body.
struct Leader<'a, C: Comm> {
    world: &'a C,
    scales: &'a Scales<C>,
    shared: &'a Shared<'a>,
    lead: Lead,
}

impl<C: Ranks> Job for Leader<'_, C> {
    type Output = Result<Summary, Failure>;

    fn run<B>(self, context: B::Context) -> Result<Self::Output, Failure>
    where
        B: Backend<Scalar = f64, Context: Clone>,
        B::Reduced: Scalar,
    {
        #[cfg(feature = "dense")]
        if is_dense(Some(B::NAME)) {
            return self.run_with::<B, biotissue::backends::dense::Dense>(context);
        }
        self.run_with::<B, Micro>(context)
    }
}

impl<C: Ranks> Leader<'_, C> {
    /// With the body on backend `B` and the RVEs on `M`. An error is one that the others do not know of.
    fn run_with<B, M>(self, context: B::Context) -> Result<Result<Summary, Failure>, Failure>
    where
        B: Backend<Scalar = f64, Context: Clone>,
        B::Reduced: Scalar,
        M: Backend<Scalar = f64, Context = ()>,
        M::Reduced: Scalar,
    {
        let Self { world, scales, shared, lead } = self;
        let case = shared.case.clone();
        let (file, micro) = (case.file.clone(), case.micro);
        let setup = Setup::<B, ScaleField<'_, C, M>>::with_material(context, case, |case, mesh| {
            ScaleField::new((scales, lead), (), case, mesh)
        });
        let setup = setup.map_err(|error| not_set_up(&file, &micro, error));
        let mut setup = match agreed(world, setup)? {
            Ok(setup) => setup,
            Err(failure) => return Ok(Err(failure)),
        };
        let is_first = scales.comm().rank() == 0;
        output::warn(if is_first { setup.warnings() } else { &[] });
        setup.material_mut().couple().map_err(|error: TwoScaleError| ranks_failed(&error))?;
        let broken = setup.material_mut().broken();
        let mut simulation = match setup.simulation() {
            Ok(simulation) => simulation,
            Err(error) => return or_broken(&broken, Err(not_set_up(&file, &micro, error))),
        };
        let first = First { comm: scales.comm(), dir: shared.dir, broken: &broken };
        let writers: &dyn Writers = if lead == Lead::All { &first } else { &() };
        let outcome = or_broken(&broken, take_steps(&mut simulation, writers, shared.dir, shared.resume));
        if outcome.is_err() {
            // What ranks free together, such as a factor of MUMPS, would wait for those that are lost.
            std::mem::forget(simulation);
        }
        outcome
    }
}

/// What the ranks of the body have come to together.
type Outcome = Result<Summary, Failure>;

/// Ranks that have lost each other are ended, whatever they wait for.
fn or_broken(broken: &OnceLock<String>, outcome: Outcome) -> Result<Outcome, Failure> {
    match broken.get() {
        Some(reason) if outcome.is_err() => Err(ranks_failed(reason)),
        _ => Ok(outcome),
    }
}
