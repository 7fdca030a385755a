//! Converts the errors of a run to messages for the user: the problem, what was expected, and a possible cure.

use std::path::Path;

use biotissue::app::case::MicroCase;
use biotissue::app::checkpoint::CheckpointError;
use biotissue::app::results::ResultsError;
use biotissue::app::run::{ResumeError, SimulationError};
use biotissue::fem::equilibrium::EquilibriumError;
use biotissue::fem::stepping::{SetupError, StepFailure};
use biotissue::input::InputError;
use biotissue::las::{NewtonError, SolveError};
use biotissue::tissue::macro_scale::MacroScaleError;
use biotissue::tissue::micro_scale::{LibraryError, PointFailureKind, TissueFieldError};

use crate::failure::Failure;

pub fn not_written(error: ResultsError) -> Failure {
    match error {
        ResultsError::Write { path, source } => Failure::unwritable(&path, &source),
        ResultsError::Locked { .. } => Failure::Environment {
            what: error.to_string(),
            expected: "a result directory that no other run writes to".into(),
            cure: "wait for that run to end, or end it, or name another directory with --out".into(),
        },
        ResultsError::UnknownOrigin { .. } => Failure::Arguments {
            what: format!("{error}; nothing was touched"),
            expected: "a directory that is empty, or that holds the results of an earlier run as they were written"
                .into(),
            cure: "name another directory with --out, or move or rename that file".into(),
        },
        ResultsError::Read { .. } => Failure::Environment {
            what: error.to_string(),
            expected: "a result directory whose files can be read".into(),
            cure: "check its permissions, or name another directory with --out".into(),
        },
        ResultsError::Damaged { .. } => Failure::Arguments {
            what: error.to_string(),
            expected: "the results of the interrupted run".into(),
            cure: "leave --resume out to start again: that replaces the results".into(),
        },
        error => Failure::Environment {
            what: error.to_string(),
            expected: "results that can be put into files".into(),
            cure: "report this as a bug, with the case".into(),
        },
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
pub fn repeated_by(lost: Option<&Path>) -> String {
    lost.map_or_else(String::new, |file| format!("; `biotissue rve --replay {}` repeats the RVE", file.display()))
}

/// The cure if the only known fact is that a step was too large.
const TOO_FAR: &str = "from the start: check that the body is held, and the size and units of its loads; later: look at the \
                       last fields for elements near collapse, or raise `max_cuts` and go on with --resume";

/// Returns the suggested cure for a failed load step.
pub fn cure_of_step<F: std::error::Error + 'static>(
    reason: &StepFailure<TissueFieldError, F>,
    micro: &MicroCase,
) -> String {
    match reason {
        NewtonError::Solve(SolveError::Singular { .. }) => {
            "hold the body so that it can neither move nor turn as a whole; if it buckles, take more load steps".into()
        }
        NewtonError::Problem(EquilibriumError::PointField(error)) => cure_of_point(error, micro),
        _ => TOO_FAR.into(),
    }
}

fn cure_of_point(error: &TissueFieldError, micro: &MicroCase) -> String {
    let TissueFieldError::Point(point) = error else { return "see what that rank says".into() };
    let default = MicroCase::default();
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
        PointFailureKind::LinearSystem => {
            "`biotissue network check` tells whether that network is floppy or hangs loose: clean it, or take another"
        }
        _ => TOO_FAR,
    };
    freed + cure
}

pub fn not_resumed<F: std::error::Error + 'static>(error: ResumeError<F>) -> Failure {
    let error = match error {
        ResumeError::Results(error) if !matches!(error, ResultsError::Damaged { .. }) => return not_written(error),
        error => error,
    };
    let cure = match &error {
        ResumeError::Results(ResultsError::Damaged { .. }) => {
            return Failure::Arguments {
                what: error.to_string(),
                expected: "the results of the interrupted run, as they were written".into(),
                cure: "put that file back as it was, or start again without --resume: that replaces the results".into(),
            };
        }
        ResumeError::NoCheckpoint { .. } => {
            return Failure::Arguments {
                what: error.to_string(),
                expected: "the checkpoint of the last converged step, in the folder `checkpoint`".into(),
                cure: "put the checkpoint back, or start again without --resume: that replaces the results; or name another \
                       directory with --out"
                    .into(),
            };
        }
        ResumeError::OtherRank(error) => {
            return Failure::Environment {
                what: error.to_string(),
                expected: "checkpoints that every rank of the body can read".into(),
                cure: "put the result directory where all machines see it".into(),
            };
        }
        ResumeError::Checkpoint(error @ CheckpointError::Unreadable { .. }) => {
            return Failure::Environment {
                what: error.to_string(),
                expected: "checkpoints that can be read".into(),
                cure: error.cure().into(),
            };
        }
        ResumeError::Checkpoint(error) => error.cure(),
        ResumeError::State { .. } | ResumeError::Results(_) => {
            "start again without resuming: that replaces the results"
        }
    };
    Failure::Arguments {
        what: error.to_string(),
        expected: "a checkpoint of the run that this case describes".into(),
        cure: format!("{cure} (leave --resume out)"),
    }
}

pub fn not_set_up<F: std::error::Error + 'static>(
    file: &Path,
    micro: &MicroCase,
    error: SimulationError<F>,
) -> Failure {
    let (expected, cure) = match &error {
        SimulationError::MacroScale(MacroScaleError::Input(errors))
        | SimulationError::Library(LibraryError::Network(errors))
        | SimulationError::Output(errors) => return errors.clone().into(),
        SimulationError::MacroScale(MacroScaleError::Curve { line, reason }) => {
            let (expected, cure) = ("a curve over pseudo-time from 0 to 1", "correct its points");
            return InputError::at_line(file, *line, format!("the load curve: {reason}"), expected, cure).into();
        }
        SimulationError::Setup(setup) if matches!(**setup, SetupError::Undeformed(_)) => {
            return not_at_rest(file, micro, setup);
        }
        SimulationError::Library(LibraryError::Model { .. }) => (
            "a network whose fibers have a law, a radius and a modulus",
            "give the region a `law`, or put NETWORK.toml with a [law] or NETWORK.params beside the network",
        ),
        SimulationError::Library(LibraryError::NoMaterial(_)) => {
            ("a material for every region of the mesh", "add a [[region]] with the name of that region, or \"*\"")
        }
        SimulationError::Setup(setup) => cure_of_setup(setup),
    };
    Failure::arguments(format!("{}: {error}", file.display()), expected, cure)
}

/// Returns what was expected of a body whose setup failed, and the cure.
fn cure_of_setup<F: std::error::Error + 'static>(
    error: &SetupError<TissueFieldError, F>,
) -> (&'static str, &'static str) {
    match error {
        SetupError::Boundary(_) => ("loads that fit the mesh", "correct the boundary or point that is named"),
        SetupError::Underconstrained(_) => (
            "conditions that hold every connected part of the body against moving and turning as a whole",
            "prescribe displacements on more surfaces or components; [[point]] holds single nodes",
        ),
        SetupError::Geometry(_) => ("elements with a volume", "improve the mesh, or correct the `scale` of [mesh]"),
        SetupError::Sparsity(_) => ("a stiffness that 32-bit indices can address", "choose a coarser mesh"),
        SetupError::System(_) => {
            ("a linear solver that can be made for this body", "try another `solver` of [newton], or --backend")
        }
        SetupError::Undeformed(_) => ("an undeformed body that resists every deformation", "try another --backend"),
    }
}

/// Reports an undeformed body without a solvable stiffness: an RVE is singular before any load.
fn not_at_rest<F: std::error::Error + 'static>(
    file: &Path,
    micro: &MicroCase,
    error: &SetupError<TissueFieldError, F>,
) -> Failure {
    let cure = match error {
        SetupError::Undeformed(EquilibriumError::PointField(error)) => cure_of_point(error, micro),
        _ => "try another --backend".into(),
    };
    Failure::NotConverged {
        what: format!("{}: {error}", file.display()),
        place: "t = 0, before the first load step; nothing is written".into(),
        expected: "an undeformed body that resists every deformation".into(),
        cure,
    }
}
