//! The last converged states of a run, from which it can go on: `checkpoint/` in the result directory.
//!
//! After every converged load step `checkpoint/step-NNNNN.bin` is written, whole or not at all, and all but the last two
//! are removed. A run that goes on from there gives bit for bit what it would have given without the interruption.
//!
//! | module | holds |
//! |---|---|
//! | this one | writing, keeping, finding |
//! | `file` | the frame: version and hash |
//! | `record` | the content: displacements, halvings, what of the results was written, the memory of all RVEs |
//! | `identity` | the case, mesh and networks that the content belongs to |

mod file;
mod identity;
mod raw;
mod record;
#[cfg(all(test, feature = "sparse"))]
mod tests;

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use thiserror::Error;

pub use identity::{Identity, Mismatch};
pub(in crate::tissue) use record::UnitRecord;

use super::micro_scale::{Life, TissueMaterial, UnitState};
use super::results::{CHECKPOINT_FOLDER, ResultsError, Written};
use crate::fem::stepping::SavedState;
use crate::output::{self, final_name};
use record::{Record, RecordRef};

/// How many are kept: the last one, and the one before in case the last is damaged.
const KEPT: usize = 2;

/// A state that a run can go on from.
#[derive(Clone, Debug, PartialEq)]
pub struct Checkpoint {
    /// The file.
    pub path: PathBuf,
    /// Where the run stood.
    pub state: SavedState,
    /// Where the RVE of every element was in its life.
    pub lives: Vec<Life>,
    /// What those RVEs remembered that there were.
    pub units: Vec<UnitState>,
    /// What the run had written until then.
    pub written: Written,
}

/// Why a run cannot go on from the checkpoints that are there.
#[derive(Debug, Error)]
pub enum CheckpointError {
    /// The operating system refused to read.
    #[error("{}: cannot be read: {source}", path.display())]
    Unreadable {
        /// The file or folder.
        path: PathBuf,
        /// Its answer.
        source: io::Error,
    },
    /// The file is not as it was written.
    #[error("{}: damaged: {what}", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// In what way.
        what: String,
    },
    /// Another version of the program has written it.
    #[error("{}: has version {found} of the format; this program reads version {expected}", path.display())]
    Version {
        /// The file.
        path: PathBuf,
        /// Its version.
        found: u32,
        /// Ours.
        expected: u32,
    },
    /// It belongs to another run.
    #[error("{}: belongs to another run: {reason}", path.display())]
    OtherRun {
        /// The file.
        path: PathBuf,
        /// What differs.
        reason: Mismatch,
    },
}

impl CheckpointError {
    /// The file or folder concerned.
    #[must_use]
    pub fn path(&self) -> &Path {
        match self {
            Self::Unreadable { path, .. }
            | Self::Damaged { path, .. }
            | Self::Version { path, .. }
            | Self::OtherRun { path, .. } => path,
        }
    }

    /// What the user can do.
    #[must_use]
    pub fn cure(&self) -> &'static str {
        match self {
            Self::Unreadable { .. } => "check the permissions, or start again without resuming",
            Self::Damaged { .. } => "start again without resuming: that replaces the results",
            Self::Version { .. } => {
                "go on with the version of biotissue that wrote it, or start again without resuming"
            }
            Self::OtherRun { .. } => {
                "take the case, mesh and networks of the interrupted run, or another result directory, or start again \
                 without resuming: that replaces the results"
            }
        }
    }
}

/// Writes the state of a run after a full step into the result directory `dir`, with what was `written` there before and is
/// on the disk, and removes checkpoints that are no longer among the last.
///
/// # Errors
/// [`ResultsError::Write`].
pub fn write(
    dir: &Path,
    identity: &Identity,
    state: &SavedState,
    written: &Written,
    field: &impl TissueMaterial,
) -> Result<(), ResultsError> {
    let folder = dir.join(CHECKPOINT_FOLDER);
    fs::create_dir_all(&folder).map_err(ResultsError::write(&folder))?;
    file::write(&folder.join(file_name(state.completed_steps)), &RecordRef { identity, state, written, field })?;
    output::sync_folder(&folder).map_err(ResultsError::write(&folder))?;
    keep_last(dir, state.completed_steps)
}

/// Removes the checkpoints of a result directory but for the last ones up to step `done`, and all that were never finished.
///
/// # Errors
/// [`ResultsError::Write`].
pub fn keep_last(dir: &Path, done: usize) -> Result<(), ResultsError> {
    let folder = dir.join(CHECKPOINT_FOLDER);
    let steps = steps_in(&folder).map_err(ResultsError::write(&folder))?;
    let oldest_kept = steps.iter().copied().filter(|&step| step <= done).nth(KEPT - 1).unwrap_or(0);
    remove(&folder, |step| step < oldest_kept || step > done)
}

/// Removes all checkpoints of a result directory.
///
/// # Errors
/// [`ResultsError::Write`].
pub fn clear(dir: &Path) -> Result<(), ResultsError> {
    remove(&dir.join(CHECKPOINT_FOLDER), |_| true)
}

/// The newest checkpoint of a result directory that is not damaged, if there is one at all, and what is to be said
/// about it.
///
/// # Errors
/// [`CheckpointError`]: all are damaged, or the newest that is not belongs to another run or version.
pub fn latest(dir: &Path, now: &Identity) -> Result<(Option<Checkpoint>, Vec<String>), CheckpointError> {
    let folder = dir.join(CHECKPOINT_FOLDER);
    let steps = steps_in(&folder).map_err(|source| CheckpointError::Unreadable { path: folder.clone(), source })?;
    let mut warnings = Vec::new();
    let mut last = None;
    for step in steps {
        let path = folder.join(file_name(step));
        match read(&path, now) {
            Ok((checkpoint, remarks)) => {
                let changed = "going on with other settings than the run has had so far";
                warnings.extend(remarks.into_iter().map(|remark| format!("{changed}: {remark}")));
                return Ok((Some(checkpoint), warnings));
            }
            Err(error @ (CheckpointError::Damaged { .. } | CheckpointError::Unreadable { .. })) => {
                warnings.push(format!("{error}; trying the one before"));
                last = Some(error);
            }
            Err(error) => return Err(error),
        }
    }
    last.map_or(Ok((None, warnings)), Err)
}

fn read(path: &Path, now: &Identity) -> Result<(Checkpoint, Vec<String>), CheckpointError> {
    let record: Record = file::read(path)?;
    let remarks = record.identity.check(now);
    let remarks = remarks.map_err(|reason| CheckpointError::OtherRun { path: path.into(), reason })?;
    let written = record.written.clone();
    let (state, lives, units) = record.into_states().ok_or_else(|| CheckpointError::Damaged {
        path: path.into(),
        what: "it counts more steps than this machine can".into(),
    })?;
    Ok((Checkpoint { path: path.into(), state, lives, units, written }, remarks))
}

fn file_name(step: usize) -> String {
    format!("step-{step:05}.bin")
}

fn step_of(name: &str) -> Option<usize> {
    let step = name.strip_prefix("step-")?.strip_suffix(".bin")?.parse().ok()?;
    (file_name(step) == name).then_some(step)
}

/// Whether a file of this name in the folder of checkpoints is one.
pub(in crate::tissue) fn is_file_name(name: &str) -> bool {
    step_of(name).is_some()
}

/// Whether a file begins as a checkpoint does; it may have been cut short.
pub(in crate::tissue) fn is_begin(bytes: &[u8]) -> bool {
    file::is_begin(bytes)
}

/// The steps of which there are checkpoints, newest first; none where there is no folder.
fn steps_in(folder: &Path) -> io::Result<Vec<usize>> {
    let mut steps: Vec<usize> = names_in(folder)?.iter().filter_map(|name| step_of(name)).collect();
    steps.sort_unstable_by(|a, b| b.cmp(a));
    Ok(steps)
}

fn names_in(folder: &Path) -> io::Result<Vec<String>> {
    match fs::read_dir(folder) {
        Ok(entries) => {
            entries.map(|entry| Ok(entry?.file_name().into_string().ok())).filter_map(Result::transpose).collect()
        }
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(Vec::new()),
        Err(error) => Err(error),
    }
}

/// Removes the checkpoints of these steps, and all that were never finished.
fn remove(folder: &Path, unwanted: impl Fn(usize) -> bool) -> Result<(), ResultsError> {
    for name in names_in(folder).map_err(ResultsError::write(folder))? {
        let unfinished = final_name(&name) != name;
        if step_of(final_name(&name)).is_some_and(|step| unfinished || unwanted(step)) {
            let path = folder.join(&name);
            fs::remove_file(&path).map_err(ResultsError::write(&path))?;
        }
    }
    Ok(())
}
