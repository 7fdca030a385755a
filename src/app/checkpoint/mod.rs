//! The last converged states of a run, from which it can resume: `checkpoint/` in the result directory.
//!
//! A checkpoint consists of a main file, `checkpoint/step-NNNNN.bin`, and of pieces: each rank that holds a part of the body
//! writes the state of its own nodes and points to a body piece, `checkpoint/step-NNNNN-body-RRRR.bin` (one rank alone if the
//! body is not divided), and each rank that solves RVEs their states to `checkpoint/step-NNNNN-part-RRRR.bin`, so that no rank
//! ever holds the states of all. When every rank has reported that its pieces are on the disk, the first rank of the body
//! writes the main file, which lists the pieces with their hashes. A checkpoint exists from then on; without main file, its
//! pieces are ignored. Only then all but the last two checkpoints are removed. Every file is replaced atomically: a run that is killed at any
//! moment leaves at least one complete checkpoint, except before its first. The next run removes pieces without main file.
//!
//! The results of a resumed run are bit for bit those of an uninterrupted one. It may have other numbers of ranks: each
//! reads the states of its nodes, points and RVEs from the pieces that contain them.
//!
//! | module | holds |
//! |---|---|
//! | this one | writing, removing and finding checkpoints |
//! | `record` | the content of the main file: progress, halvings, pressures, results so far, lists of the pieces |
//! | `body_pieces` | the content of the body pieces: displacements and life cycles |
//! | `identity` | the case, mesh and networks that the content belongs to |
//!
//! [`Piece`] describes the pieces with RVEs; `crate::sealed_file` is the frame of all files: version and hash.

pub(super) mod body_pieces;
mod case_text;
mod division;
mod hashes;
mod identity;
mod record;
#[cfg(all(test, feature = "sparse"))]
mod tests;

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use thiserror::Error;

pub use body_pieces::BodyStatePiece;
pub(in crate::app) use division::division_of;
pub use hashes::{hash_of_fields, hash_of_mesh};
pub(in crate::app) use identity::is_same_run;
pub use identity::{Identity, Mismatch};

use super::results::{CHECKPOINT_FOLDER, ResultsError, ResultsRecord, names_in, remove_as};
use crate::fem::stepping::SavedState;
use crate::output;
use crate::sealed_file::{self, SealError, VERSION};
use crate::tissue::micro_scale::{Piece, PieceError, piece_stem};
use record::Record;

/// Number of checkpoints kept: the last one, and the one before in case the last is damaged.
const CHECKPOINTS_KEPT: usize = 2;

/// A state from which a run can resume.
#[derive(Clone, Debug, PartialEq)]
pub struct Checkpoint {
    /// The main file.
    pub path: PathBuf,
    /// The state of load stepping, and of the body as a whole.
    pub state: SavedState,
    /// The files with the states of nodes and points.
    pub body: Vec<BodyStatePiece>,
    /// The files with the states of the RVEs that exist.
    pub pieces: Vec<Piece>,
    /// The results that the run had written until then.
    pub written: ResultsRecord,
}

impl Checkpoint {
    /// Returns the folder of the pieces.
    pub fn folder(&self) -> &Path {
        self.path.parent().unwrap_or(Path::new(""))
    }
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
    /// A piece cannot be used.
    #[error(transparent)]
    Piece(#[from] PieceError),
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
            Self::Unreadable { .. } | Self::Piece(PieceError::Unreadable { .. }) => {
                "check the permissions, or start again without resuming"
            }
            Self::Piece(PieceError::Missing(_)) => {
                "put that file back, or start again without resuming: that replaces the results"
            }
            Self::Piece(PieceError::Ranks(_)) => "see the error of that rank",
            Self::Damaged { .. } | Self::Piece(_) => "start again without resuming: that replaces the results",
            Self::Version { .. } => {
                "continue with the version of biotissue that wrote it, or start again without resuming"
            }
            Self::OtherRun { .. } => {
                "take the case, mesh and networks of the interrupted run, or another result directory, or start again \
                 without resuming: that replaces the results"
            }
        }
    }

    /// Returns true if the file cannot be used, but another checkpoint may be.
    fn is_of_file(&self) -> bool {
        matches!(self, Self::Damaged { .. } | Self::Unreadable { .. } | Self::Piece(_))
    }
}

/// Creates the folder of the checkpoints in the result directory `dir`; returns it.
///
/// # Errors
/// Returns [`ResultsError::Write`] if it cannot be created.
pub fn create_folder(dir: &Path) -> Result<PathBuf, ResultsError> {
    let folder = dir.join(CHECKPOINT_FOLDER);
    fs::create_dir_all(&folder).map_err(ResultsError::write(&folder))?;
    Ok(folder)
}

/// Returns the beginning of the names of all files of a checkpoint.
pub fn stem(step: usize) -> String {
    format!("step-{step:05}")
}

/// Writes the main file of a checkpoint into the result directory `dir`. The pieces and the results `written` must be on
/// disk. Then removes all but the last checkpoints.
///
/// # Errors
/// Returns [`ResultsError::Write`] if a file cannot be written or removed, or if this machine does not find a piece.
pub fn write(
    dir: &Path,
    identity: &Identity,
    state: SavedState,
    written: ResultsRecord,
    body: Vec<BodyStatePiece>,
    pieces: Vec<Piece>,
) -> Result<(), ResultsError> {
    let folder = create_folder(dir)?;
    let listed = body.iter().map(|piece| (&piece.file, piece.bytes));
    let mut listed = listed.chain(pieces.iter().map(|piece| (&piece.file, piece.bytes)));
    listed.try_for_each(|(file, bytes)| check_visible(&folder.join(file), bytes))?;
    let completed_steps = state.completed_steps;
    let record = Record { identity: identity.clone(), state, written, body, pieces };
    let path = folder.join(file_name(completed_steps));
    sealed_file::write(&path, |out| postcard::to_io(&record, out).map(drop).map_err(io::Error::other))
        .map_err(ResultsError::write(&path))?;
    output::sync_folder(&folder).map_err(ResultsError::write(&folder))?;
    keep_last(dir, completed_steps)
}

/// Checks that a piece of another rank has arrived in the folder that this machine sees.
fn check_visible(path: &Path, bytes: u64) -> Result<(), ResultsError> {
    let found = fs::File::open(path).and_then(|file| file.metadata()).map(|file| file.len());
    match found {
        Ok(found) if found == bytes => Ok(()),
        _ => Err(ResultsError::write(path)(io::Error::other(
            "a rank has written this file, but the first rank of the body does not find it: the result directory must \
             be on a file system that all ranks share",
        ))),
    }
}

/// Removes all checkpoints of a result directory except the last ones up to step `completed_steps`, and all files of
/// unfinished checkpoints.
///
/// # Errors
/// Returns [`ResultsError::Write`] if the folder cannot be read or a file cannot be removed.
pub fn keep_last(dir: &Path, completed_steps: usize) -> Result<(), ResultsError> {
    let folder = dir.join(CHECKPOINT_FOLDER);
    let steps = steps_in(&folder).map_err(ResultsError::write(&folder))?;
    let kept: Vec<usize> = steps.into_iter().filter(|&step| step <= completed_steps).take(CHECKPOINTS_KEPT).collect();
    remove_except(&folder, &kept)
}

/// Removes all checkpoints of a result directory.
///
/// # Errors
/// Returns [`ResultsError::Write`] if the folder cannot be read or a file cannot be removed.
pub fn clear(dir: &Path) -> Result<(), ResultsError> {
    remove_except(&dir.join(CHECKPOINT_FOLDER), &[])
}

/// Returns the newest checkpoint before step `before` whose main file is not damaged, `None` if there is none, and
/// warnings. The pieces are not read.
///
/// # Errors
/// Returns [`CheckpointError`] if all checkpoints before this step are damaged or unreadable, or if the newest undamaged
/// one belongs to another run or version.
pub fn latest(dir: &Path, before: usize, now: &Identity) -> Result<(Option<Checkpoint>, Vec<String>), CheckpointError> {
    let folder = dir.join(CHECKPOINT_FOLDER);
    let steps = steps_in(&folder).map_err(|source| CheckpointError::Unreadable(folder.clone(), source))?;
    let mut warnings = Vec::new();
    let mut last = None;
    for step in steps.into_iter().filter(|&step| step < before) {
        let path = folder.join(file_name(step));
        match read(&path, now) {
            Ok((checkpoint, remarks)) => {
                let changed = "continuing with settings that differ from those of the run so far";
                warnings.extend(remarks.into_iter().map(|remark| format!("{changed}: {remark}")));
                return Ok((Some(checkpoint), warnings));
            }
            Err(error) if error.is_of_file() => {
                warnings.push(trying_another(&error));
                last = Some(error);
            }
            Err(error) => return Err(error),
        }
    }
    last.map_or(Ok((None, warnings)), Err)
}

/// Returns the warning about a checkpoint that cannot be used.
pub(in crate::app) fn trying_another(error: &dyn std::error::Error) -> String {
    format!("{error}; trying the one before")
}

fn read(path: &Path, now: &Identity) -> Result<(Checkpoint, Vec<String>), CheckpointError> {
    let content = sealed_file::read(path).map_err(|error| match error {
        SealError::Unreadable(source) => CheckpointError::Unreadable(path.into(), source),
        SealError::Damaged(what) => CheckpointError::Damaged(path.into(), what),
        SealError::Version(found) => CheckpointError::Version { path: path.into(), found, expected: VERSION },
    })?;
    let damaged = |what: String| CheckpointError::Damaged(path.into(), what);
    let Record { identity, state, written, body, pieces } = match postcard::take_from_bytes(&content) {
        Ok((record, [])) => record,
        Ok((_, rest)) => return Err(damaged(format!("{} bytes are left over", rest.len()))),
        Err(error) => return Err(damaged(error.to_string())),
    };
    let stem = stem(state.completed_steps);
    let listed = body.iter().map(|piece| (&piece.file, body_pieces::stem_of(&piece.file)));
    let of_rves = pieces.iter().map(|piece| (&piece.file, piece_stem(&piece.file)));
    if let Some((other, _)) = listed.chain(of_rves).find(|(_, of)| *of != Some(&stem)) {
        return Err(damaged(format!("lists the piece {other:?}")));
    }
    let remarks = identity.check(now).map_err(|reason| CheckpointError::OtherRun(path.into(), reason))?;
    Ok((Checkpoint { path: path.into(), state, body, pieces, written }, remarks))
}

fn file_name(step: usize) -> String {
    file_of(&stem(step))
}

fn file_of(stem: &str) -> String {
    format!("{stem}.bin")
}

fn step_of(name: &str) -> Option<usize> {
    let step = name.strip_prefix("step-")?.strip_suffix(".bin")?.parse().ok()?;
    (file_name(step) == name).then_some(step)
}

/// Returns the step of a checkpoint to whose pieces a file of this name belongs.
fn step_of_piece(name: &str) -> Option<usize> {
    step_of(&file_of(body_pieces::stem_of(name).or_else(|| piece_stem(name))?))
}

/// Returns true if `name` is the name of a file of a checkpoint.
pub(in crate::app) fn is_file_name(name: &str) -> bool {
    step_of(name).or_else(|| step_of_piece(name)).is_some()
}

/// Returns true if a file, which may be truncated, begins like a file of a checkpoint.
pub(in crate::app) fn is_begin(bytes: &[u8]) -> bool {
    sealed_file::is_begin(bytes)
}

/// Returns the steps that have a checkpoint, newest first; empty if the folder does not exist.
fn steps_in(folder: &Path) -> io::Result<Vec<usize>> {
    let mut steps: Vec<usize> = names_in(folder)?.iter().filter_map(|name| step_of(name)).collect();
    steps.sort_unstable_by(|a, b| b.cmp(a));
    Ok(steps)
}

/// Removes all checkpoints except those of the steps `kept`, and all unfinished files. Main files are removed before
/// pieces, so that none lists pieces that were removed.
fn remove_except(folder: &Path, kept: &[usize]) -> Result<(), ResultsError> {
    remove_as(folder, |name, unfinished| step_of(name).is_some_and(|step| unfinished || !kept.contains(&step)))?;
    remove_as(folder, |name, unfinished| step_of_piece(name).is_some_and(|step| unfinished || !kept.contains(&step)))
}
