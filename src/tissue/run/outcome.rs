//! How a run ends, and how it is taken up again.

use std::path::PathBuf;

use thiserror::Error;

use crate::fem::stepping::{RestoreError, StepFailure};
use crate::tissue::checkpoint::CheckpointError;
use crate::tissue::micro_scale::{FieldRestoreError, TissueFieldError};
use crate::tissue::results::ResultsError;

/// Why a run ended early. Everything that converged is on disk.
#[derive(Debug, Error)]
pub enum RunError<F: std::error::Error + 'static> {
    /// A load step did not converge.
    #[error("load step {step} of {count} does not converge: {reason}")]
    NotConverged {
        /// The step, from 1.
        step: usize,
        /// How many there are.
        count: usize,
        /// The last converged pseudo-time.
        reached: f64,
        /// How often the step was halved.
        halvings: u32,
        /// What stopped the last attempt.
        reason: Box<StepFailure<TissueFieldError, F>>,
        /// The file that repeats the failure of an RVE, where that was the reason.
        lost: Option<PathBuf>,
    },
    /// A result file could not be written.
    #[error("{0}")]
    Results(#[from] ResultsError),
}

/// Why a run cannot go on from where an earlier one stopped.
#[derive(Debug, Error)]
pub enum ResumeError<F: std::error::Error + 'static> {
    /// No checkpoint can be used.
    #[error("{0}")]
    Checkpoint(#[from] CheckpointError),
    /// There are results, but no checkpoint.
    #[error("{}: holds {what}, but there is no checkpoint to go on from", path.display())]
    NoCheckpoint {
        /// A file of results.
        path: PathBuf,
        /// What is in it.
        what: String,
    },
    /// The results are not as they were written before the checkpoint, or cannot be touched.
    #[error("{0}")]
    Results(#[from] ResultsError),
    /// Another process could not read its checkpoint.
    #[error("{0}")]
    Elsewhere(ResultsError),
    /// A checkpoint of this very run does not fit it. The simulation must then be set up anew.
    #[error("{}: {reason}", path.display())]
    State {
        /// The checkpoint.
        path: PathBuf,
        /// Why.
        reason: Box<RestoreError<FieldRestoreError, TissueFieldError, F>>,
    },
}

/// What [`Simulation::resume`](super::Simulation::resume) has found.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Resumed {
    /// The converged step that the run goes on from; 0 where there was no checkpoint and it starts from the beginning.
    pub step: usize,
    /// What the user should know.
    pub warnings: Vec<String>,
}

/// A run that reached its end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RunSummary {
    /// Load steps.
    pub steps: usize,
    /// Newton iterations of the macro scale in all.
    pub iterations: usize,
    /// Wall time, s.
    pub seconds: f64,
}
