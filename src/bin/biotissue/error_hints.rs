//! Converts the errors of a run to messages for the user: the problem, what was expected, and a possible cure.

use std::path::{Path, PathBuf};

use biotissue::app::case::{Case, RegionMaterial, RveParams};
use biotissue::app::checkpoint::CheckpointError;
use biotissue::app::macro_scale::hint_of_constraint;
use biotissue::app::results::ResultsError;
use biotissue::app::run::{ResumeError, SimulationError};
use biotissue::fem::equilibrium::EquilibriumError;
use biotissue::fem::stepping::{SetupError, StepFailure};
use biotissue::las::{Method, NewtonError, SolveError};
use biotissue::tissue::micro_scale::{LibraryError, PieceError, PointFailureKind, TissueFieldError};

use crate::failure::Failure;

pub fn not_written(error: ResultsError) -> Failure {
    match error {
        ResultsError::Write(path, source) => Failure::unwritable(&path, &source),
        ResultsError::Locked { .. } => Failure::environment(
            error.to_string(),
            "a result directory that no other run writes to",
            "wait for that run to end, or end it, or name another directory with --out",
        ),
        ResultsError::UnknownOrigin { .. } => Failure::arguments(
            format!("{error}; nothing was touched"),
            "a directory that is empty, or that holds the results of an earlier run as they were written",
            "name another directory with --out, or move or rename that file",
        ),
        ResultsError::OtherCase(ref dir, _) => Failure::arguments(
            format!("{error}, which this run would replace; nothing was touched"),
            "a result directory of its own for each case in a folder",
            format!("name another `directory` in [output], or replace them by `--out {}`", dir.display()),
        ),
        ResultsError::Read { .. } => Failure::environment(
            error.to_string(),
            "a result directory whose files can be read",
            "check its permissions, or name another directory with --out",
        ),
        ResultsError::Damaged { .. } => Failure::arguments(
            error.to_string(),
            "the results of the interrupted run",
            "leave --resume out to start again: that replaces the results",
        ),
        error => Failure::environment(
            error.to_string(),
            "results that can be written to files",
            "report this as a bug, with the case",
        ),
    }
}

pub fn on_disk(steps: usize, dir: &Path) -> String {
    match steps {
        0 => format!("no load step converged before it; the log is in {}", dir.display()),
        1 => format!("the load step before it is in {}", dir.display()),
        steps => format!("the {steps} load steps before it are in {}", dir.display()),
    }
}

/// Formats the hint on how to reproduce the failure of an RVE.
pub fn replay_hint(failed_rve: Option<&Path>) -> String {
    failed_rve.map_or_else(String::new, |file| format!("; `biotissue rve --replay {}` repeats the RVE", file.display()))
}

/// The cure if the only known fact is that a step was too large.
const TOO_FAR: &str = "from the start: check the supports of the body, and the size and units of its loads; later: look for \
                       elements near collapse in the last fields, or raise `max_cuts` in [steps] and continue with --resume";

/// Returns the suggested cure for a failed load step.
pub fn cure_of_step<F: std::error::Error + 'static>(reason: &StepFailure<TissueFieldError, F>, case: &Case) -> String {
    let cure = match reason {
        NewtonError::Problem(EquilibriumError::OffBranch(_)) => cure_of_branches(case),
        // A body that its supports do not hold was refused before the first step.
        NewtonError::Solve(SolveError::Singular { .. }) if has_networks(case) => {
            "networks may resist no motion in some direction: give their material a `matrix`, or use networks with more fibers \
             per node (`biotissue check` names those with motions that no fiber resists); if the body buckles, use more load \
             steps"
                .into()
        }
        _ => cure_of_reason(reason, &case.micro),
    };
    // Adaptive increments have a limit of their own.
    if case.steps.adaptive.is_some() {
        cure.replace("raise `max_cuts` in [steps]", "lower `smallest` of `adaptive`")
    } else {
        cure
    }
}

fn has_networks(case: &Case) -> bool {
    case.regions.iter().any(|region| matches!(region.material, RegionMaterial::FiberRve(_)))
}

/// Returns the cure if RVEs leave their branches of equilibria.
fn cure_of_branches(case: &Case) -> String {
    let cure = "raise `max_cuts` in [steps] and continue with --resume, or use more load steps (`count` in [steps]) and start again";
    if has_networks(case) {
        return format!(
            "networks that are compressed, or that have motions which no fiber resists (`biotissue check` names those), are a \
             likely cause: give the material a `matrix`, or a stiffer one, or use networks with more fibers per node; otherwise \
             check the size and units of the loads, {cure}"
        );
    }
    cure.into()
}

/// Returns true if a library or a device failed in a load step, whatever the load is.
pub fn is_failure_of_backend<F: std::error::Error + 'static>(reason: &StepFailure<TissueFieldError, F>) -> bool {
    match reason {
        NewtonError::Solve(SolveError::Backend(_)) | NewtonError::Problem(EquilibriumError::Backend(_)) => true,
        NewtonError::Problem(EquilibriumError::PointField(TissueFieldError::Point(point))) => {
            matches!(point.kind, PointFailureKind::Device)
        }
        _ => false,
    }
}

/// Returns what was expected of a failed load step.
pub fn expected_of_step<F: std::error::Error + 'static>(reason: &StepFailure<TissueFieldError, F>) -> &'static str {
    match reason {
        NewtonError::Problem(EquilibriumError::UnbalancedLoads { .. }) => "loads that balance on the deformed body",
        NewtonError::Problem(EquilibriumError::OffBranch(_)) => {
            "equilibria of all networks that change continuously with the load"
        }
        reason if is_failure_of_backend(reason) => "a linear-algebra library or device that works",
        _ => "equilibrium with det F > 0 everywhere",
    }
}

/// Says how a load step failed: a failure of the backend has nothing to do with the increment.
pub fn manner_of_failure<F: std::error::Error + 'static>(
    reason: &StepFailure<TissueFieldError, F>,
    case: &Case,
    halvings: u32,
) -> String {
    match (case.steps.adaptive, halvings) {
        _ if is_failure_of_backend(reason) => "fails".into(),
        (Some(adaptive), _) => format!("does not converge, in increments down to {} of a step", adaptive.smallest),
        (None, 1) => "does not converge, halved once".into(),
        (None, _) => format!("does not converge, halved {halvings} times"),
    }
}

/// Names the constraint of a singular system, whose error has only its number.
pub fn constraint_of<F: std::error::Error + 'static>(case: &Case, reason: &StepFailure<TissueFieldError, F>) -> String {
    let NewtonError::Solve(SolveError::SingularBorder { constraint, .. }) = reason else { return String::new() };
    let constraint = case.constraints.get(*constraint);
    constraint.map_or_else(String::new, |of| format!("; that constraint is `{}`", of.constraint.name))
}

fn cure_of_reason<F: std::error::Error + 'static>(
    reason: &StepFailure<TissueFieldError, F>,
    micro: &RveParams,
) -> String {
    match reason {
        NewtonError::Solve(SolveError::Singular { .. }) => {
            "prescribe displacements that prevent every rigid-body motion; if the body buckles, use more load steps"
                .into()
        }
        NewtonError::Solve(SolveError::SingularBorder { .. }) => {
            "the free displacements cannot satisfy the constraints: remove one of two [[constraint]]s on the same volume, or \
             leave more of the surface of the volume free"
                .into()
        }
        NewtonError::Problem(EquilibriumError::UnbalancedLoads { .. }) => {
            "correct the loads if they do not balance at rest either (`biotissue check` warns of it); loads that balance at \
             rest may not balance on the deformed body: hold it by [[boundary]] or [[point]] instead of `free = \"rigid\"`, or let the \
             loads follow it (`pressure`)"
                .into()
        }
        NewtonError::Problem(EquilibriumError::VolumeNotReached { .. }) => {
            "use method = \"multiplier\", or raise `penalty` of that [[constraint]]".into()
        }
        NewtonError::Problem(EquilibriumError::PointField(error)) => cure_of_point(error, micro),
        reason if is_failure_of_backend(reason) => {
            "correct the cause and continue with --resume, or start again with another --backend".into()
        }
        _ => TOO_FAR.into(),
    }
}

const FLOPPY_NETWORK: &str = "`biotissue network check` shows whether that network is floppy or not connected to the boundary: clean \
                              it, or use another";

const ITERATIVE_RVES: &str = "leave `solver` of [micro] out, which means \"direct\", or raise its `tolerance` or its \
                              `max_iterations`";

fn cure_of_point(error: &TissueFieldError, micro: &RveParams) -> String {
    let TissueFieldError::Point(point) = error else { return "see the error of that rank".into() };
    let default = RveParams::default();
    let restricted = [
        ("`stages`", micro.stages != default.stages),
        ("`max_iterations`", micro.max_iterations < default.max_iterations),
        ("`max_cuts`", micro.max_cuts < default.max_cuts),
    ];
    let restricted: Vec<&str> = restricted.iter().filter(|(_, is)| *is).map(|(name, _)| *name).collect();
    let is_network = matches!(point.kind, PointFailureKind::Network | PointFailureKind::LinearSystem);
    let freed = match (is_network, restricted.is_empty()) {
        (true, false) => format!("leave {} of [micro] at the default; then: ", restricted.join(" and ")),
        _ => String::new(),
    };
    let cure = match point.kind {
        PointFailureKind::LinearSystem if micro.solver != Method::Direct => ITERATIVE_RVES,
        PointFailureKind::LinearSystem => FLOPPY_NETWORK,
        PointFailureKind::Device => {
            "continue with --resume, where `device = \"none\"` in [micro] does without the device"
        }
        _ => TOO_FAR,
    };
    freed + cure
}

pub fn not_resumed<F: std::error::Error + 'static>(error: ResumeError<F>) -> Failure {
    let what = error.to_string();
    match error {
        ResumeError::Results(ResultsError::Damaged { .. }) => Failure::arguments(
            what,
            "the results of the interrupted run, as they were written",
            "put that file back as it was, or start again without --resume: that replaces the results",
        ),
        ResumeError::Results(error) => not_written(error),
        ResumeError::NoCheckpoint { .. } => Failure::arguments(
            what,
            "the checkpoint of the last converged step, in the folder `checkpoint`",
            "put the checkpoint back, or start again without --resume: that replaces the results; or name another \
             directory with --out",
        ),
        ResumeError::OtherRank(_) => Failure::environment(
            what,
            "checkpoints that every rank of the body can read",
            "put the result directory where all machines see it",
        ),
        ResumeError::Checkpoint(
            error @ (CheckpointError::Unreadable { .. } | CheckpointError::Piece(PieceError::Unreadable { .. })),
        ) => Failure::environment(what, "checkpoints that can be read", error.cure()),
        ResumeError::Checkpoint(error) => other_checkpoint(what, error.cure()),
        ResumeError::State { .. } => other_checkpoint(what, "start again without resuming: that replaces the results"),
    }
}

fn other_checkpoint(what: String, cure: &str) -> Failure {
    let expected = "a checkpoint of the run that this case describes";
    Failure::arguments(what, expected, format!("{cure} (leave --resume out)"))
}

/// What the errors of the setup of a case need of the case, which the setup consumes.
pub struct CaseHints {
    file: PathBuf,
    micro: RveParams,
    hold_free_modes: bool,
}

impl CaseHints {
    pub fn of(case: &Case) -> Self {
        Self { file: case.file.clone(), micro: case.micro, hold_free_modes: case.hold_free_modes }
    }
}

pub fn not_set_up<F: std::error::Error + 'static>(of: &CaseHints, error: SimulationError<F>) -> Failure {
    let (expected, cure) = match &error {
        SimulationError::Input(errors) | SimulationError::Library(LibraryError::Network(errors)) => {
            return errors.clone().into();
        }
        SimulationError::Setup(setup) if matches!(**setup, SetupError::Undeformed(_)) => {
            return not_at_rest(of, setup);
        }
        SimulationError::Library(LibraryError::AtRest(..)) if of.micro.solver != Method::Direct => {
            ("an undeformed network whose stiffness `solver` of [micro] can solve with", ITERATIVE_RVES)
        }
        SimulationError::Library(LibraryError::AtRest(..)) => {
            ("an undeformed network that resists every deformation", FLOPPY_NETWORK)
        }
        SimulationError::Library(LibraryError::Model { .. }) => (
            "a network whose fibers have a law, a radius and a modulus",
            "give the region a `law`, or put NETWORK.toml with a [law] or NETWORK.params beside the network",
        ),
        SimulationError::Library(error @ LibraryError::Device(_)) => return no_device(&of.file, error),
        SimulationError::Library(LibraryError::NoPointMaterial(..)) => {
            ("a formula at every point of the region", "make the formulas for the mesh of the case")
        }
        SimulationError::Library(LibraryError::NoMaterial(_)) => {
            ("a material for every region of the mesh", "add a [[region]] with the name of that region, or \"*\"")
        }
        SimulationError::Setup(setup) => cure_of_setup(of, setup),
        SimulationError::OtherRank(_) => ("ranks that all set up the case", "see the error of that rank"),
    };
    Failure::arguments(format!("{}: {error}", of.file.display()), expected, cure)
}

/// Reports that the device of the RVEs cannot be used.
pub fn no_device(case: &Path, error: &LibraryError) -> Failure {
    Failure::arguments(
        format!("{}: {error}", case.display()),
        "a graphics processor of NVIDIA with its driver and the compiler NVRTC",
        "install what is missing, or set `device = \"none\"` in [micro]",
    )
}

/// Returns what was expected of a body whose setup failed, and the cure.
fn cure_of_setup<F: std::error::Error + 'static>(
    of: &CaseHints,
    error: &SetupError<TissueFieldError, F>,
) -> (&'static str, &'static str) {
    match error {
        SetupError::Boundary(_) => ("loads that fit the mesh", "correct the boundary or point that is named"),
        SetupError::Constraint(error) => hint_of_constraint(error),
        SetupError::Underconstrained(_) => (
            "prescribed displacements that prevent rigid-body motions of every connected part of the body",
            if of.hold_free_modes {
                "`free = \"rigid\"` adds no supports to nodes of rigid surfaces and of inclined planes of symmetry: hold the motion \
                 that is named by a component of `rigid`, a [[boundary]] or a [[point]]"
            } else {
                "prescribe displacements on more surfaces or components ([[point]]: of single nodes); if the loads balance, \
                 `free = \"rigid\"` in [body] adds the supports; parts that touch are connected only if they share nodes (Gmsh: \
                 `BooleanFragments`, or `Coherence`, before meshing)"
            },
        ),
        SetupError::Geometry(_) => {
            ("elements of positive volume", "improve the mesh, or correct the `scale` of [mesh]")
        }
        SetupError::Sparsity(_) => ("a stiffness that 32-bit indices can address", "choose a coarser mesh"),
        SetupError::System(_) => {
            ("a linear solver that can be set up for this body", "try another `solver` of [newton], or --backend")
        }
        SetupError::Undeformed(_) => ("an undeformed body that resists every deformation", "try another --backend"),
    }
}

/// Reports an undeformed body without a solvable stiffness: an RVE is singular before any load.
fn not_at_rest<F: std::error::Error + 'static>(of: &CaseHints, error: &SetupError<TissueFieldError, F>) -> Failure {
    let cure = match error {
        SetupError::Undeformed(EquilibriumError::PointField(error)) => cure_of_point(error, &of.micro),
        _ => "try another --backend".into(),
    };
    let (what, place) =
        (format!("{}: {error}", of.file.display()), "t = 0, before the first load step; nothing is written");
    Failure::not_converged(what, place.into(), "an undeformed body that resists every deformation", cure)
}
