//! Which process writes the results of a run, alone or in step with others.

use std::path::{Path, PathBuf};

use crate::app::recorder::Recorder;
use crate::app::results::ResultsError;
use crate::fem::stepping::{ConvergedStep, FailedAttempt, StepObserver};
use crate::tissue::micro_scale::TissueMaterial;

/// Processes that take the same steps of a run: one of them writes the results, and all continue only if it succeeded.
pub trait Writers {
    /// Returns true if this process writes.
    fn is_writer(&self) -> bool;

    /// Returns the same outcome on all processes.
    ///
    /// # Errors
    /// Returns this process's own error, or else that of the first process that has one.
    fn agree(&self, outcome: Result<(), ResultsError>) -> Result<(), ResultsError>;

    /// Checks that all processes pass the same number.
    ///
    /// # Errors
    /// Returns [`ResultsError`] on all processes if the numbers differ.
    fn agree_on(&self, number: usize) -> Result<(), ResultsError>;
}

/// A single process.
impl Writers for () {
    fn is_writer(&self) -> bool {
        true
    }

    fn agree(&self, outcome: Result<(), ResultsError>) -> Result<(), ResultsError> {
        outcome
    }

    fn agree_on(&self, _: usize) -> Result<(), ResultsError> {
        Ok(())
    }
}

/// Records a run if this process writes, and agrees with the other processes on the outcome of each write.
pub(super) struct AgreedRecorder<'w, 'r> {
    pub(super) recorder: Option<Recorder<'r>>,
    pub(super) writers: &'w dyn Writers,
}

impl<'r> AgreedRecorder<'_, 'r> {
    pub(super) fn write(
        &mut self,
        write: impl FnOnce(&mut Recorder<'r>) -> Result<(), ResultsError>,
    ) -> Result<(), ResultsError> {
        let outcome = self.recorder.as_mut().map_or(Ok(()), write);
        self.writers.agree(outcome)
    }

    pub(super) fn lost(&self) -> Option<PathBuf> {
        self.recorder.as_ref().and_then(Recorder::lost).map(Path::to_owned)
    }
}

impl<M: TissueMaterial, F: std::error::Error> StepObserver<M, F> for AgreedRecorder<'_, '_> {
    type Error = ResultsError;

    fn converged(&mut self, step: &ConvergedStep<'_, M>) -> Result<(), ResultsError> {
        self.write(|recorder| recorder.converged(step))
    }

    fn failed(&mut self, attempt: &FailedAttempt<'_, M, F>) -> Result<(), ResultsError> {
        self.write(|recorder| recorder.failed(attempt))
    }
}
