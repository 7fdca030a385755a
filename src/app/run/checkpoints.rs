//! Resuming from a checkpoint, and writing one.

use std::path::Path;

use super::writers::AgreedRecorder;
use super::{ResumeError, Resumed, Simulation, WriterGroup, other_rank, whole_state};
use crate::app::checkpoint::{self, Checkpoint, CheckpointError, Identity};
use crate::app::results::{self, CHECKPOINT_FOLDER, ResultsError, ResultsRecord, RunProgress};
use crate::fem::stepping::RestoreError;
use crate::las::RealBackend;
use crate::tissue::micro_scale::{FieldRestoreError, PieceError, TissueMaterial};

impl<B: RealBackend, M: TissueMaterial> Simulation<B, M> {
    /// Restores the newest checkpoint, if there is one.
    pub(super) fn restore(&mut self, writers: &dyn WriterGroup, dir: &Path) -> Result<Resumed, ResumeError<B::Error>> {
        // A directory that does not exist cannot be locked.
        let mut warnings = match dir.exists() {
            true => self.take_directory(writers, dir)?,
            false => writers.agree(Ok(())).map(|()| Vec::new())?,
        };
        let Some(checkpoint) = self.find_checkpoint(writers, dir, &mut warnings)? else {
            self.check_empty(writers, dir)?;
            warnings.push(format!("{}: no checkpoint: starting from the beginning", dir.display()));
            return Ok(Resumed { step: 0, warnings });
        };
        let folder = checkpoint.folder().to_owned();
        let Checkpoint { path, state, sites, pieces, written } = checkpoint;
        let progress = RunProgress { steps: state.completed_steps, of: self.stepper.count() };
        warnings.extend(writers.on_writer(|| written.check(dir, progress))?);
        // Of a divided body, only some ranks would find these errors later.
        let (whole, nodes, points) = (self.stepper.mesh().whole(), state.displacements.len(), sites.statuses.len());
        let error = if nodes != whole.nodes {
            Some(RestoreError::Nodes { found: nodes, expected: whole.nodes })
        } else if points != whole.points {
            Some(RestoreError::Field(FieldRestoreError::Points { found: points, expected: whole.points }))
        } else {
            state.node_not_finite().map(RestoreError::NotFinite)
        };
        if let Some(error) = error {
            return Err(ResumeError::State(path, Box::new(error)));
        }
        let (state, sites) = whole_state::of_part(self.stepper.mesh(), state, sites);
        let restored = self.stepper.restore(&state, |field| field.restore_units(&sites, &folder, &pieces));
        restored.map_err(|reason| ResumeError::State(path, Box::new(reason)))?;
        self.written = written;
        // The cost of restoring is not part of the next step.
        let _ = (self.stepper.field().take_stats(), self.stepper.field().take_times());
        Ok(Resumed { step: state.completed_steps, warnings })
    }

    /// Returns the newest checkpoint that is not damaged, the same on all processes; `None` if there are no checkpoints.
    fn find_checkpoint(
        &self,
        writers: &dyn WriterGroup,
        dir: &Path,
        warnings: &mut Vec<String>,
    ) -> Result<Option<Checkpoint>, ResumeError<B::Error>> {
        let identity = self.identity();
        let (mut before, mut damaged) = (usize::MAX, None);
        loop {
            let found = checkpoint::latest(dir, before, &identity);
            // A process that continues would wait for those that do not.
            let agreed = writers.agree(found.as_ref().map(|_| ()).map_err(other_rank));
            let (checkpoint, remarks) = found?;
            let step = checkpoint.as_ref().map_or(0, |checkpoint| checkpoint.state.completed_steps);
            agreed.and_then(|()| writers.agree_on(step)).map_err(ResumeError::OtherRank)?;
            let Some(checkpoint) = checkpoint else { return damaged.map_or(Ok(None), Err) };
            match self.stepper.field().verify_pieces(checkpoint.folder(), &checkpoint.pieces) {
                Ok(()) => {
                    warnings.extend(remarks);
                    return Ok(Some(checkpoint));
                }
                Err(PieceError::Ranks(reason)) => return Err(ResumeError::OtherRank(other_rank(reason))),
                Err(error) => {
                    let error = CheckpointError::from(error);
                    warnings.push(checkpoint::trying_another(&error));
                    (before, damaged) = (step, Some(ResumeError::Checkpoint(error)));
                }
            }
        }
    }

    /// Checks that a directory without a checkpoint holds no results that a start from the beginning would remove.
    fn check_empty(&self, writers: &dyn WriterGroup, dir: &Path) -> Result<(), ResumeError<B::Error>> {
        let found = match writers.is_writer() {
            true => results::results_without_checkpoint(dir, &self.case),
            false => Ok(None),
        };
        let agreed = writers.agree(match &found {
            Ok(None) => Ok(()),
            Ok(Some((path, what))) => Err(other_rank(format!("{}: {what}, but no checkpoint", path.display()))),
            Err(error) => Err(other_rank(error)),
        });
        match found? {
            Some((path, what)) => Err(ResumeError::NoCheckpoint(path, what)),
            None => Ok(agreed?),
        }
    }

    /// Writes a checkpoint of the last full step, unless the state lies within a later step. The main file is written
    /// last, so that it never refers to results or pieces that do not exist.
    pub(super) fn write_checkpoint(
        &self,
        dir: &Path,
        recorder: &mut AgreedRecorder<'_, '_>,
        identity: &Identity,
    ) -> Result<(), ResultsError> {
        let Some(state) = self.stepper.saved() else { return Ok(()) };
        let (mut written, field) = (ResultsRecord::default(), self.stepper.field());
        recorder.write(|recorder| {
            written = recorder.flush()?;
            checkpoint::create_folder(dir).map(drop)
        })?;
        let step = state.completed_steps;
        let pieces = field.save_units(&dir.join(CHECKPOINT_FOLDER), &checkpoint::stem(step));
        let whole = whole_state::gather(recorder.writers, self.stepper.mesh(), state, field.sites().saved());
        let (whole, gathered) = whole.map_or_else(|error| (None, Err(error)), |whole| (whole, Ok(())));
        recorder.writers.agree(gathered)?;
        recorder.write(|recorder| {
            let Some((state, sites)) = whole else { return Ok(()) };
            checkpoint::write(dir, identity, state, written, sites, pieces?)?;
            recorder.saved(step);
            Ok(())
        })
    }
}
