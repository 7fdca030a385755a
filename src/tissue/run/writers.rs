//! Who writes the results of a run, alone or in step with other processes.

use std::path::{Path, PathBuf};

use crate::fem::stepping::{ConvergedStep, FailedAttempt, StepObserver};
use crate::tissue::micro_scale::TissueMaterial;
use crate::tissue::recorder::Recorder;
use crate::tissue::results::ResultsError;

/// Who writes the results of a run that several processes take in step: one of them, and all go on only if it could.
pub trait Writers {
    /// Whether this process writes.
    fn is_writer(&self) -> bool;

    /// The same outcome on all.
    ///
    /// # Errors
    /// The own one, or that of the first that has one.
    fn agree(&self, outcome: Result<(), ResultsError>) -> Result<(), ResultsError>;

    /// That all have found the same number.
    ///
    /// # Errors
    /// On all, where they have not.
    fn agree_on(&self, number: usize) -> Result<(), ResultsError>;
}

/// One process alone.
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

/// Records a run where this process writes, and agrees with the others that it could be written.
pub(super) struct Witness<'w, 'r> {
    pub(super) recorder: Option<Recorder<'r>>,
    pub(super) writers: &'w dyn Writers,
}

impl<'r> Witness<'_, 'r> {
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

impl<M: TissueMaterial, F: std::error::Error> StepObserver<M, F> for Witness<'_, '_> {
    type Error = ResultsError;

    fn converged(&mut self, step: &ConvergedStep<'_, M>) -> Result<(), ResultsError> {
        self.write(|recorder| recorder.converged(step))
    }

    fn failed(&mut self, attempt: &FailedAttempt<'_, M, F>) -> Result<(), ResultsError> {
        self.write(|recorder| recorder.failed(attempt))
    }
}
