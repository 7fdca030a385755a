//! Which process writes the results of a run, alone or in step with others.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::is_final;
use crate::app::checkpoint::Identity;
use crate::app::field_files::{FieldFiles, FieldState, PieceIndex};
use crate::app::recorder::Recorder;
use crate::app::results::ResultsError;
use crate::fem::stepping::{ConvergedStep, FailedAttempt, Iterating, StepObserver};
use crate::las::Message;
use crate::tissue::micro_scale::TissueMaterial;

/// Processes that take the same steps of a run: one of them writes the results, and all continue only if it succeeded.
pub trait WriterGroup {
    /// Returns true if this process writes.
    fn is_writer(&self) -> bool;

    /// Returns the same outcome on all processes.
    ///
    /// # Errors
    /// Returns this process's own error, or else that of the first process that has one.
    fn agree(&self, outcome: Result<(), ResultsError>) -> Result<(), ResultsError>;

    /// Returns true on all processes if one of them passes true.
    ///
    /// # Errors
    /// Returns [`ResultsError`] if the processes cannot communicate.
    fn any(&self, condition: bool) -> Result<bool, ResultsError>;

    /// Gathers the messages of all processes on the one that writes, in the order of their ranks; `None` on the others.
    ///
    /// # Errors
    /// Returns [`ResultsError`] if the processes cannot communicate.
    fn gather(&self, own: Message) -> Result<Option<Vec<Message>>, ResultsError>;

    /// Checks that all processes pass the same number.
    ///
    /// # Errors
    /// Returns [`ResultsError`] on all processes if the numbers differ.
    fn agree_on(&self, number: usize) -> Result<(), ResultsError>;
}

impl dyn WriterGroup + '_ {
    /// Calls `write` on the process that writes; the others return a default value if it succeeds.
    ///
    /// # Errors
    /// Returns the error of `write` on all processes.
    pub(super) fn on_writer<T: Default>(
        &self,
        write: impl FnOnce() -> Result<T, ResultsError>,
    ) -> Result<T, ResultsError> {
        let outcome = if self.is_writer() { write() } else { Ok(T::default()) };
        self.agree_with(outcome)
    }

    /// Returns the value of this process if all processes have one.
    ///
    /// # Errors
    /// Returns this process's own error, or else that of the first process that has one.
    pub(super) fn agree_with<T: Default>(&self, outcome: Result<T, ResultsError>) -> Result<T, ResultsError> {
        let (value, outcome) = outcome.map_or_else(|error| (T::default(), Err(error)), |value| (value, Ok(())));
        self.agree(outcome)?;
        Ok(value)
    }
}

/// A single process.
impl WriterGroup for () {
    fn is_writer(&self) -> bool {
        true
    }

    fn agree(&self, outcome: Result<(), ResultsError>) -> Result<(), ResultsError> {
        outcome
    }

    fn any(&self, condition: bool) -> Result<bool, ResultsError> {
        Ok(condition)
    }

    fn gather(&self, own: Message) -> Result<Option<Vec<Message>>, ResultsError> {
        Ok(Some(vec![own]))
    }

    fn agree_on(&self, _: usize) -> Result<(), ResultsError> {
        Ok(())
    }
}

/// Records a run if this process writes, and agrees with the other processes on the outcome of each write.
pub(super) struct AgreedRecorder<'w, 'r> {
    /// The directory of the run, and what its checkpoints belong to.
    pub(super) dir: &'w Path,
    pub(super) identity: Identity,
    /// The step of the last checkpoint; 0 without one.
    pub(super) saved: usize,
    pub(super) recorder: Option<Recorder<'r>>,
    /// The files of the part of this process, if the body is divided.
    pub(super) pieces: Option<Arc<FieldFiles>>,
    pub(super) writers: &'w dyn WriterGroup,
}

impl<'r> AgreedRecorder<'_, 'r> {
    pub(super) fn write(
        &mut self,
        write: impl FnOnce(&mut Recorder<'r>) -> Result<(), ResultsError>,
    ) -> Result<(), ResultsError> {
        let outcome = self.recorder.as_mut().map_or(Ok(()), write);
        self.writers.agree(outcome)
    }

    /// In a divided body, writes the piece of every process, and returns what names them once all are written.
    fn write_pieces<M: TissueMaterial>(&self, of: &FieldState<'_, M>) -> Result<Option<PieceIndex>, ResultsError> {
        let Some(pieces) = &self.pieces else { return Ok(None) };
        self.writers.agree_with(pieces.write_piece(of).map(Some))
    }

    /// Writes the fields of the last converged state if they are not written yet.
    pub(super) fn write_last<M: TissueMaterial>(&mut self, of: &FieldState<'_, M>) -> Result<(), ResultsError> {
        let lacks_fields = self.recorder.as_ref().is_some_and(|recorder| recorder.lacks_fields(of.state.t));
        if !self.writers.any(lacks_fields)? {
            return Ok(());
        }
        let index = self.write_pieces(of)?;
        self.write(|recorder| recorder.write_fields(of, index.as_ref()))
    }

    /// Returns true on all processes if the observer of the run wants it to end before its next load step.
    pub(super) fn is_interrupted(&self) -> Result<bool, ResultsError> {
        let is_interrupted = self.recorder.as_ref().is_some_and(Recorder::is_interrupted);
        self.writers.any(is_interrupted)
    }

    pub(super) fn failed_rve(&self) -> Option<PathBuf> {
        self.recorder.as_ref().and_then(Recorder::failed_rve).map(Path::to_owned)
    }
}

impl<M: TissueMaterial, F: std::error::Error> StepObserver<M, F> for AgreedRecorder<'_, '_> {
    type Error = ResultsError;

    fn converged(&mut self, step: &ConvergedStep<'_, M>) -> Result<(), ResultsError> {
        let is_due = self.pieces.as_ref().is_some_and(|pieces| pieces.is_due(step.step, step.count));
        let index = if is_due { self.write_pieces(&FieldState::of(step))? } else { None };
        self.write(|recorder| recorder.converged(step, index.as_ref()))
    }

    fn iterating(&mut self, iteration: &Iterating<'_>) {
        if let Some(recorder) = &mut self.recorder {
            recorder.iterating(iteration);
        }
    }

    fn failed(&mut self, attempt: &FailedAttempt<'_, M, F>) -> Result<(), ResultsError> {
        // If this run does not recover, another can continue with other settings.
        let FailedAttempt { saved, mesh, state, field, reason, .. } = attempt;
        if let Some(saved) = saved.as_ref().filter(|saved| saved.completed_steps > self.saved && !is_final(reason)) {
            self.write_checkpoint(saved.clone(), mesh, state, *field)?;
        }
        self.write(|recorder| recorder.failed(attempt))
    }
}
