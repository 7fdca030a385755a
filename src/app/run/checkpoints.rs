//! Resuming from a checkpoint, and writing one.

use std::path::Path;

use super::writers::AgreedRecorder;
use super::{ResumeError, Resumed, Simulation, WriterGroup, other_rank};
use crate::app::checkpoint::body_pieces::{self, BodyState, BodyStatePiece};
use crate::app::checkpoint::{self, Checkpoint};
use crate::app::results::{self, CHECKPOINT_FOLDER, ResultsError, ResultsRecord, RunProgress};
use crate::fem::equilibrium;
use crate::fem::mesh::Mesh;
use crate::fem::stepping::SavedState;
use crate::las::RealBackend;
use crate::tissue::micro_scale::{Piece, PieceError, TissueMaterial};
use crate::tissue::two_scale::{pack, unpack};

impl<B: RealBackend, M: TissueMaterial> Simulation<B, M> {
    /// Restores the newest checkpoint, if there is one.
    pub(super) fn restore(&mut self, writers: &dyn WriterGroup, dir: &Path) -> Result<Resumed, ResumeError<B::Error>> {
        // A directory that does not exist cannot be locked.
        let mut warnings = match dir.exists() {
            true => self.take_directory(writers, dir)?,
            false => writers.agree(Ok(())).map(|()| Vec::new())?,
        };
        let Some((checkpoint, body)) = self.find_checkpoint(writers, dir, &mut warnings)? else {
            self.check_empty(writers, dir)?;
            warnings.push(format!("{}: no checkpoint: starting from the beginning", dir.display()));
            return Ok(Resumed { step: 0, warnings });
        };
        let folder = checkpoint.folder().to_owned();
        let Checkpoint { path, state, pieces, written, .. } = checkpoint;
        let progress = RunProgress { steps: state.completed_steps, of: self.stepper.count() };
        warnings.extend(writers.on_writer(|| written.check(dir, progress))?);
        let restored = self
            .stepper
            .restore(&state, &body.displacements, |field| field.restore_units(&body.sites, &folder, &pieces));
        restored.map_err(|reason| ResumeError::State(path, Box::new(reason)))?;
        self.written = written;
        // The cost of restoring is not part of the next step.
        let field = self.stepper.field();
        let _ = (field.take_stats(), field.take_times(), field.take_costs(), field.take_balance());
        Ok(Resumed { step: state.completed_steps, warnings })
    }

    /// Returns the newest checkpoint that is not damaged, the same on all processes, and the state of the part of this
    /// process; `None` if there are no checkpoints.
    fn find_checkpoint(
        &self,
        writers: &dyn WriterGroup,
        dir: &Path,
        warnings: &mut Vec<String>,
    ) -> Result<Option<(Checkpoint, BodyState)>, ResumeError<B::Error>> {
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
            match self.read_body(writers, &checkpoint).map_err(ResumeError::OtherRank)? {
                Ok(body) => match self.stepper.field().verify_pieces(checkpoint.folder(), &checkpoint.pieces) {
                    Ok(()) => {
                        warnings.extend(remarks);
                        return Ok(Some((checkpoint, body)));
                    }
                    Err(PieceError::Ranks(reason)) => return Err(ResumeError::OtherRank(other_rank(reason))),
                    Err(error) => damaged = Some(ResumeError::Checkpoint(error.into())),
                },
                Err(error) => damaged = Some(error),
            }
            warnings.extend(damaged.as_ref().map(|error| checkpoint::trying_another(error)));
            before = step;
        }
    }

    /// Reads the state of the part of this process. If another process cannot read its own, the inner error says so.
    ///
    /// # Errors
    /// Returns [`ResultsError`] if the processes cannot communicate.
    fn read_body(
        &self,
        writers: &dyn WriterGroup,
        checkpoint: &Checkpoint,
    ) -> Result<Result<BodyState, ResumeError<B::Error>>, ResultsError> {
        let read = body_pieces::read(checkpoint, self.stepper.mesh());
        // A process that takes this checkpoint would wait for one that takes another.
        if !writers.any(read.is_err())? {
            return Ok(read.map_err(ResumeError::from));
        }
        let others = writers.agree(read.as_ref().map(drop).map_err(other_rank));
        Ok(read.map_err(ResumeError::from).and_then(|body| others.map(|()| body).map_err(ResumeError::OtherRank)))
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
}

impl AgreedRecorder<'_, '_> {
    /// Writes a checkpoint of a state at the end of a step. The main file is written last, so that it never refers to results
    /// or pieces that do not exist.
    pub(super) fn write_checkpoint<M: TissueMaterial>(
        &mut self,
        saved: SavedState,
        mesh: &Mesh,
        state: &equilibrium::BodyState,
        field: &M,
    ) -> Result<(), ResultsError> {
        let (dir, step) = (self.dir, saved.completed_steps);
        let mut written = ResultsRecord::default();
        self.write(|recorder| {
            written = recorder.flush()?;
            checkpoint::create_folder(dir).map(drop)
        })?;
        let (body, pieces) = self.write_pieces_of(&checkpoint::stem(step), mesh, &state.displacements, field)?;
        let identity = self.identity.clone();
        self.write(|recorder| {
            checkpoint::write(dir, &identity, saved, written, body, pieces)?;
            recorder.saved(step);
            Ok(())
        })?;
        self.saved = step;
        Ok(())
    }

    /// Writes the pieces of all ranks of both scales, which are on the disk then. Returns them on the process that writes
    /// the main file; the others return only some.
    fn write_pieces_of<M: TissueMaterial>(
        &self,
        stem: &str,
        mesh: &Mesh,
        displacements: &[[f64; 3]],
        field: &M,
    ) -> Result<(Vec<BodyStatePiece>, Vec<Piece>), ResultsError> {
        let (writers, folder) = (self.writers, self.dir.join(CHECKPOINT_FOLDER));
        // Every process of a body that is not divided holds the same.
        let writes = mesh.part().is_some() || writers.is_writer();
        let written = field.save_units(&folder, stem).and_then(|pieces| {
            let own = writes.then(|| body_pieces::write(&folder, stem, mesh, displacements, field.sites().saved()));
            Ok((own.transpose()?, pieces))
        });
        let (own, pieces) = writers.agree_with(written.map_err(ResultsError::from))?;
        // The others wait for this rank even if it cannot encode its piece; the one that writes reports an empty message.
        let all = writers.gather(pack(&own).unwrap_or_default()).and_then(|all| {
            let listed = all.unwrap_or_default().into_iter().map(|own| unpack(&own).map_err(other_rank));
            listed.collect::<Result<Vec<Option<BodyStatePiece>>, _>>()
        });
        Ok((writers.agree_with(all)?.into_iter().flatten().collect(), pieces))
    }
}
