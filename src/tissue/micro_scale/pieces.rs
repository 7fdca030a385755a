//! The pieces of a checkpoint: files with the states of RVEs, one for each rank that has any.
//!
//! A piece holds the states one after the other, then an index with the point and the place of each, so that a rank
//! that resumes reads only the states of its own RVEs, one at a time, from however many ranks wrote them.

use std::fs::File;
use std::io::{self, BufReader, BufWriter, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::saved::UnitState;
use super::units::Units;
use crate::las::RealBackend;
use crate::output;
use crate::sealed_file::{self, HEAD, Hashing, Seal, SealError, TAIL};

/// Bytes of an index entry: the point, the position of its state in the file, and the length of the state.
const ENTRY: usize = 3 * size_of::<u64>();

/// A piece, as the checkpoint lists it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Piece {
    /// Name of the file in the folder of checkpoints.
    pub file: String,
    /// Length of the file in bytes.
    pub bytes: u64,
    /// The hash at the end of the file.
    pub hash: u64,
    /// Number of RVEs.
    pub rves: usize,
}

/// The reason why a piece cannot be used or written.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum PieceError {
    /// It cannot be written.
    #[error("{0}: cannot be written: {1}")]
    Write(PathBuf, String),
    /// It cannot be read.
    #[error("{0}: cannot be read: {1}")]
    Unreadable(PathBuf, String),
    /// It does not exist.
    #[error("{0}: is missing")]
    Missing(PathBuf),
    /// It is not as it was written: the defect.
    #[error("{0}: damaged: {1}")]
    Damaged(PathBuf, String),
    /// Communication between the ranks failed.
    #[error("{0}")]
    Ranks(String),
}

impl PieceError {
    fn read(path: &Path, error: &io::Error) -> Self {
        match error.kind() {
            io::ErrorKind::NotFound => Self::Missing(path.into()),
            _ => Self::Unreadable(path.into(), error.to_string()),
        }
    }

    pub(crate) fn damaged(path: &Path, what: impl Into<String>) -> Self {
        Self::Damaged(path.into(), what.into())
    }
}

/// Returns the name of the piece that a rank writes; `stem` is the name of the checkpoint without extension.
pub fn piece_file(stem: &str, rank: usize) -> String {
    format!("{stem}-part-{rank:04}.bin")
}

/// Returns `stem` of a name that [`piece_file`] returned; `None` for any other name.
pub fn piece_stem(name: &str) -> Option<&str> {
    let (stem, rank) = name.strip_suffix(".bin")?.rsplit_once("-part-")?;
    (piece_file(stem, rank.parse().ok()?) == name).then_some(stem)
}

impl<B: RealBackend> Units<B> {
    /// Writes the states of all RVEs of this rank to a piece, which is complete and on the disk then; returns `None` and
    /// writes nothing without RVEs.
    ///
    /// # Errors
    /// Returns [`PieceError::Write`].
    pub fn write_piece(&self, folder: &Path, stem: &str, rank: usize) -> Result<Option<Piece>, PieceError> {
        let states = self.points().iter().enumerate().map(|(number, &point)| (point as u64, self.state(number)));
        write(folder, piece_file(stem, rank), states)
    }
}

/// Writes a piece with these points and states.
fn write(
    folder: &Path,
    file: String,
    states: impl ExactSizeIterator<Item = (u64, UnitState)>,
) -> Result<Option<Piece>, PieceError> {
    let rves = states.len();
    if rves == 0 {
        return Ok(None);
    }
    let Seal { bytes, hash } = write_sealed(folder, &file, |out| {
        let mut index = Vec::with_capacity(ENTRY * rves);
        for (point, state) in states {
            let start = out.position();
            postcard::to_io(&state, &mut *out).map_err(io::Error::other)?;
            for number in [point, start, out.position() - start] {
                index.extend_from_slice(&number.to_le_bytes());
            }
        }
        let at = out.position();
        out.write_all(&index)?;
        out.write_all(&at.to_le_bytes())
    })?;
    Ok(Some(Piece { file, bytes, hash, rves }))
}

/// Writes a file of a checkpoint, whose content `write` appends; it is complete and on the disk then.
pub(crate) fn write_sealed(
    folder: &Path,
    file: &str,
    write: impl FnOnce(&mut Hashing<BufWriter<&mut File>>) -> io::Result<()>,
) -> Result<Seal, PieceError> {
    let path = folder.join(file);
    let written = sealed_file::write(&path, write).and_then(|seal| output::sync_folder(folder).map(|()| seal));
    written.map_err(|error| PieceError::Write(path, error.to_string()))
}

/// Compares a piece with the checkpoint that lists it; reads the file once, block by block.
pub(in crate::tissue) fn verify(folder: &Path, piece: &Piece) -> Result<(), PieceError> {
    let Piece { bytes, hash, .. } = *piece;
    verify_sealed(&folder.join(&piece.file), Seal { bytes, hash }, |_| ())
}

/// Compares a file with the checkpoint that lists it with this seal; reads it once, and calls `block` with the bytes of its
/// content.
pub(crate) fn verify_sealed(path: &Path, listed: Seal, block: impl FnMut(&[u8])) -> Result<(), PieceError> {
    let seal = sealed_file::verify_by(path, block).map_err(|error| match error {
        SealError::Unreadable(error) => PieceError::read(path, &error),
        SealError::Damaged(what) => PieceError::damaged(path, what),
        SealError::Version(version) => PieceError::damaged(path, format!("has version {version} of the format")),
    })?;
    if seal == listed { Ok(()) } else { Err(PieceError::damaged(path, "belongs to another checkpoint")) }
}

/// Compares all pieces with the checkpoint that lists them; returns the error of the first that differs.
pub(in crate::tissue) fn verify_all<'a>(
    folder: &Path,
    pieces: impl IntoIterator<Item = &'a Piece>,
) -> Result<(), PieceError> {
    pieces.into_iter().try_for_each(|piece| verify(folder, piece))
}

/// Reads a piece that was verified: calls `take` with the states of the points for which `is_wanted` returns true. Only
/// one state at a time is in memory.
pub(in crate::tissue) fn read<E: From<PieceError>>(
    folder: &Path,
    piece: &Piece,
    is_wanted: impl Fn(u64) -> bool,
    mut take: impl FnMut(u64, UnitState) -> Result<(), E>,
) -> Result<(), E> {
    let path = folder.join(&piece.file);
    let unreadable = |error: io::Error| match error.kind() {
        io::ErrorKind::UnexpectedEof => PieceError::damaged(&path, "ends within a state or its index"),
        _ => PieceError::read(&path, &error),
    };
    let mut file = BufReader::new(File::open(&path).map_err(unreadable)?);
    let (at, index) = read_index(&mut file, piece).map_err(unreadable)?;
    let Some(index) = index else { return Err(PieceError::damaged(&path, "its index is damaged").into()) };
    let mut bytes = Vec::new();
    for [point, start, length] in index.into_iter().filter(|&[point, ..]| is_wanted(point)) {
        let is_within = start >= HEAD as u64 && start.checked_add(length).is_some_and(|end| end <= at);
        let length = usize::try_from(length).ok().filter(|_| is_within);
        let Some(length) = length else { return Err(PieceError::damaged(&path, "its index is damaged").into()) };
        bytes.resize(length, 0);
        seek(&mut file, start).and_then(|()| file.read_exact(&mut bytes)).map_err(unreadable)?;
        match postcard::take_from_bytes(&bytes) {
            Ok((state, [])) => take(point, state)?,
            Ok(_) => return Err(PieceError::damaged(&path, "a state is followed by other bytes").into()),
            Err(error) => return Err(PieceError::damaged(&path, error.to_string()).into()),
        }
    }
    Ok(())
}

/// Returns the position of the index and its entries; no entries if they do not fit the file.
fn read_index(file: &mut BufReader<File>, piece: &Piece) -> io::Result<(u64, Option<Vec<[u64; 3]>>)> {
    let number = |bytes: &[u8]| bytes.first_chunk().map_or(0, |bytes| u64::from_le_bytes(*bytes));
    let Some(end) = piece.bytes.checked_sub((TAIL + size_of::<u64>()) as u64) else { return Ok((0, None)) };
    let mut at = [0; size_of::<u64>()];
    seek(file, end)?;
    file.read_exact(&mut at)?;
    let at = u64::from_le_bytes(at);
    let length = end.checked_sub(at).and_then(|length| usize::try_from(length).ok());
    let Some(length) = length.filter(|&length| Some(length) == piece.rves.checked_mul(ENTRY)) else {
        return Ok((at, None));
    };
    let mut index = vec![0; length];
    seek(file, at)?;
    file.read_exact(&mut index)?;
    let entries = index.chunks_exact(ENTRY).map(|entry| [0, 8, 16].map(|from| number(&entry[from..])));
    Ok((at, Some(entries.collect())))
}

/// Moves to a position, within the buffered bytes if possible.
fn seek(file: &mut BufReader<File>, to: u64) -> io::Result<()> {
    let from = file.stream_position()?;
    match i64::try_from(to).ok().zip(i64::try_from(from).ok()) {
        Some((to, from)) => file.seek_relative(to - from),
        None => file.seek(SeekFrom::Start(to)).map(drop),
    }
}

#[cfg(all(test, feature = "sparse"))]
mod tests;
