//! The last converged states of a run, from which it can resume: `checkpoint/` in the result directory.
//!
//! After every converged load step, the run writes `checkpoint/step-NNNNN.bin` atomically and removes all but the last
//! two checkpoints. The results of a resumed run are bit for bit those of an uninterrupted one.
//!
//! | module | holds |
//! |---|---|
//! | this one | writing, removing and finding checkpoints |
//! | `file` | the frame of the file: version and hash |
//! | `record` | the content: displacements, halvings, description of the results so far, states of all RVEs |
//! | `identity` | the case, mesh and networks that the content belongs to |

mod file;
mod identity;
mod record;
#[cfg(all(test, feature = "sparse"))]
mod tests;

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use thiserror::Error;

pub use identity::{Identity, Mismatch};

use super::results::{CHECKPOINT_FOLDER, ResultsError, ResultsRecord, names_in, remove_as};
use crate::fem::stepping::SavedState;
use crate::output;
use crate::tissue::micro_scale::{RveStatus, SerializeIter, TissueMaterial, UnitState};
use record::Record;

/// Number of checkpoints kept: the last one, and the one before in case the last is damaged.
const CHECKPOINTS_KEPT: usize = 2;

/// A state from which a run can resume.
#[derive(Clone, Debug, PartialEq)]
pub struct Checkpoint {
    /// The file.
    pub path: PathBuf,
    /// The state of the body and of load stepping.
    pub state: SavedState,
    /// The status of the RVE of every element.
    pub statuses: Vec<RveStatus>,
    /// The states of the RVEs that exist.
    pub units: Vec<UnitState>,
    /// The results that the run had written until then.
    pub written: ResultsRecord,
}

/// The reason why a run cannot resume from the checkpoints in its directory.
#[derive(Debug, Error)]
pub enum CheckpointError {
    /// The file or folder cannot be read.
    #[error("{0}: cannot be read: {1}")]
    Unreadable(PathBuf, #[source] io::Error),
    /// The content of the file is not as it was written: the defect.
    #[error("{0}: damaged: {1}")]
    Damaged(PathBuf, String),
    /// The file has another version of the format.
    #[error("{}: has version {found} of the format; this program reads version {expected}", path.display())]
    Version {
        /// The file.
        path: PathBuf,
        /// Its version.
        found: u32,
        /// The version that this program reads.
        expected: u32,
    },
    /// The checkpoint belongs to another run: the difference.
    #[error("{0}: belongs to another run: {1}")]
    OtherRun(PathBuf, Mismatch),
}

impl CheckpointError {
    /// Returns advice for the user.
    pub fn cure(&self) -> &'static str {
        match self {
            Self::Unreadable { .. } => "check the permissions, or start again without resuming",
            Self::Damaged { .. } => "start again without resuming: that replaces the results",
            Self::Version { .. } => {
                "continue with the version of biotissue that wrote it, or start again without resuming"
            }
            Self::OtherRun { .. } => {
                "take the case, mesh and networks of the interrupted run, or another result directory, or start again \
                 without resuming: that replaces the results"
            }
        }
    }
}

/// Writes the state of a run after a full step into the result directory `dir`, with the description of the results
/// `written` before, which must be on disk, and removes all but the last checkpoints.
///
/// # Errors
/// Returns [`ResultsError::Write`] if a file cannot be written or removed.
pub fn write(
    dir: &Path,
    identity: &Identity,
    state: SavedState,
    written: ResultsRecord,
    field: &impl TissueMaterial,
) -> Result<(), ResultsError> {
    let folder = dir.join(CHECKPOINT_FOLDER);
    fs::create_dir_all(&folder).map_err(ResultsError::write(&folder))?;
    let completed_steps = state.completed_steps;
    let (statuses, units) = (field.sites().statuses(), SerializeIter(|| field.unit_states()));
    let record = Record { identity: identity.clone(), state, written, statuses, units };
    file::write(&folder.join(file_name(completed_steps)), &record)?;
    output::sync_folder(&folder).map_err(ResultsError::write(&folder))?;
    keep_last(dir, completed_steps)
}

/// Removes all checkpoints of a result directory except the last ones up to step `completed_steps`, and all unfinished
/// files.
///
/// # Errors
/// Returns [`ResultsError::Write`] if the folder cannot be read or a file cannot be removed.
pub fn keep_last(dir: &Path, completed_steps: usize) -> Result<(), ResultsError> {
    let folder = dir.join(CHECKPOINT_FOLDER);
    let steps = steps_in(&folder).map_err(ResultsError::write(&folder))?;
    let oldest_kept =
        steps.iter().copied().filter(|&step| step <= completed_steps).nth(CHECKPOINTS_KEPT - 1).unwrap_or(0);
    remove(&folder, |step| step < oldest_kept || step > completed_steps)
}

/// Removes all checkpoints of a result directory.
///
/// # Errors
/// Returns [`ResultsError::Write`] if the folder cannot be read or a file cannot be removed.
pub fn clear(dir: &Path) -> Result<(), ResultsError> {
    remove(&dir.join(CHECKPOINT_FOLDER), |_| true)
}

/// Returns the newest checkpoint of a result directory that is not damaged, `None` if there are no checkpoints, and
/// warnings.
///
/// # Errors
/// Returns [`CheckpointError`] if all checkpoints are damaged or unreadable, or if the newest undamaged one belongs to
/// another run or version.
pub fn latest(dir: &Path, now: &Identity) -> Result<(Option<Checkpoint>, Vec<String>), CheckpointError> {
    let folder = dir.join(CHECKPOINT_FOLDER);
    let steps = steps_in(&folder).map_err(|source| CheckpointError::Unreadable(folder.clone(), source))?;
    let mut warnings = Vec::new();
    let mut last = None;
    for step in steps {
        let path = folder.join(file_name(step));
        match read(&path, now) {
            Ok((checkpoint, remarks)) => {
                let changed = "continuing with settings that differ from those of the run so far";
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
    let Record { identity, state, written, statuses, units }: Record = file::read(path)?;
    let remarks = identity.check(now).map_err(|reason| CheckpointError::OtherRun(path.into(), reason))?;
    Ok((Checkpoint { path: path.into(), state, statuses, units, written }, remarks))
}

fn file_name(step: usize) -> String {
    format!("step-{step:05}.bin")
}

fn step_of(name: &str) -> Option<usize> {
    let step = name.strip_prefix("step-")?.strip_suffix(".bin")?.parse().ok()?;
    (file_name(step) == name).then_some(step)
}

/// Returns true if `name` is the file name of a checkpoint.
pub(in crate::app) fn is_file_name(name: &str) -> bool {
    step_of(name).is_some()
}

/// Returns true if a file, which may be truncated, begins like a checkpoint.
pub(in crate::app) fn is_begin(bytes: &[u8]) -> bool {
    file::is_begin(bytes)
}

/// Returns the steps that have a checkpoint, newest first; empty if the folder does not exist.
fn steps_in(folder: &Path) -> io::Result<Vec<usize>> {
    let mut steps: Vec<usize> = names_in(folder)?.iter().filter_map(|name| step_of(name)).collect();
    steps.sort_unstable_by(|a, b| b.cmp(a));
    Ok(steps)
}

/// Removes the checkpoints of the steps for which `unwanted` returns true, and all unfinished files.
fn remove(folder: &Path, unwanted: impl Fn(usize) -> bool) -> Result<(), ResultsError> {
    remove_as(folder, |name, unfinished| step_of(name).is_some_and(|step| unfinished || unwanted(step)))
}
