//! The errors and the result of a run, and of resuming it.

use std::path::PathBuf;

use thiserror::Error;

use crate::app::checkpoint::CheckpointError;
use crate::app::results::ResultsError;
use crate::app::results::log::ScalesLog;
use crate::fem::equilibrium::LargestResidual;
use crate::fem::stepping::{RestoreError, StepFailure};
use crate::tissue::micro_scale::{FieldRestoreError, TissueFieldError};

/// The reason why a run ended early. The results of all converged steps are on disk.
#[derive(Debug, Error)]
pub enum RunError<F: std::error::Error + 'static> {
    /// A load step did not converge.
    #[error("load step {step} of {count} does not converge: {reason}")]
    NotConverged {
        /// The step, from 1.
        step: usize,
        /// Number of steps of the case.
        count: usize,
        /// The last converged pseudo-time.
        reached: f64,
        /// Number of times that the step was halved.
        halvings: u32,
        /// The reason why the last attempt failed.
        reason: Box<StepFailure<TissueFieldError, F>>,
        /// The file that reproduces the failure of an RVE, if that was the reason.
        failed_rve: Option<PathBuf>,
        /// Where the residual of the body was largest in the last attempt, if Newton's method ended without a small one.
        largest_residual: Option<Box<LargestResidual>>,
    },
    /// The observer of the run has ended it after this load step, which has a checkpoint.
    #[error("interrupted after load step {0}")]
    Interrupted(usize),
    /// A result file could not be written.
    #[error(transparent)]
    Results(#[from] ResultsError),
}

/// The reason why a run cannot resume from where an earlier one stopped.
#[derive(Debug, Error)]
pub enum ResumeError<F: std::error::Error + 'static> {
    /// No checkpoint can be used.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
    /// There are results but no checkpoint: a result file and its content.
    #[error("{0}: holds {1}, but there is no checkpoint to resume from")]
    NoCheckpoint(PathBuf, String),
    /// The results differ from those written before the checkpoint, or the directory cannot be used.
    #[error(transparent)]
    Results(#[from] ResultsError),
    /// Another process failed to read its checkpoint or found that of another step.
    #[error(transparent)]
    OtherRank(ResultsError),
    /// A checkpoint of this run does not match it. The simulation has to be set up again.
    #[error("{0}: {1}")]
    State(PathBuf, Box<RestoreError<FieldRestoreError, TissueFieldError, F>>),
}

/// The result of [`Simulation::resume`](super::Simulation::resume).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Resumed {
    /// The converged step from which the run continues; 0 if there was no checkpoint and it starts from the beginning.
    pub step: usize,
    /// Warnings for the user.
    pub warnings: Vec<String>,
}

/// The result of a run that took all load steps.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RunSummary {
    /// Load steps of the case.
    pub steps: usize,
    /// Newton iterations of the macro scale in converged increments.
    pub iterations: usize,
    /// Number of increments that failed and were repeated in shorter ones.
    pub cuts: usize,
    /// Newton iterations of the macro scale in failed increments.
    pub wasted_iterations: usize,
    /// Wall time, s.
    pub seconds: f64,
    /// How the ranks shared the work since the start or the resumption of the run; only on the process that writes, in runs
    /// on several ranks.
    pub scales: Option<ScalesLog>,
}
