//! What the messages about the pieces of a checkpoint contain: their folder, and why one cannot be used.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::tissue::micro_scale::PieceError;

/// The path of a folder, which need not be text.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct FolderName(Vec<u8>);

impl From<&Path> for FolderName {
    fn from(path: &Path) -> Self {
        #[cfg(unix)]
        let bytes = std::os::unix::ffi::OsStrExt::as_bytes(path.as_os_str()).to_vec();
        #[cfg(not(unix))]
        let bytes = path.to_string_lossy().into_owned().into_bytes();
        Self(bytes)
    }
}

impl From<FolderName> for PathBuf {
    fn from(name: FolderName) -> Self {
        #[cfg(unix)]
        let name: std::ffi::OsString = std::os::unix::ffi::OsStringExt::from_vec(name.0);
        #[cfg(not(unix))]
        let name = String::from_utf8_lossy(&name.0).into_owned();
        name.into()
    }
}

/// A [`PieceError`] of a rank. The other side knows the folder, whose name need not be text.
#[derive(Debug, Serialize, Deserialize)]
pub struct PieceFailure {
    kind: PieceFailureKind,
    file: String,
    what: String,
}

#[derive(Debug, Serialize, Deserialize)]
enum PieceFailureKind {
    Write,
    Unreadable,
    Missing,
    Damaged,
    Ranks,
}

impl From<PieceError> for PieceFailure {
    fn from(error: PieceError) -> Self {
        let (kind, path, what) = match error {
            PieceError::Write(path, what) => (PieceFailureKind::Write, path, what),
            PieceError::Unreadable(path, what) => (PieceFailureKind::Unreadable, path, what),
            PieceError::Missing(path) => (PieceFailureKind::Missing, path, String::new()),
            PieceError::Damaged(path, what) => (PieceFailureKind::Damaged, path, what),
            PieceError::Ranks(what) => (PieceFailureKind::Ranks, PathBuf::new(), what),
        };
        let file = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        Self { kind, file, what }
    }
}

impl PieceFailure {
    /// Returns the error for the pieces in `folder`.
    pub fn in_folder(self, folder: &Path) -> PieceError {
        let Self { kind, file, what } = self;
        let path = folder.join(file);
        match kind {
            PieceFailureKind::Write => PieceError::Write(path, what),
            PieceFailureKind::Unreadable => PieceError::Unreadable(path, what),
            PieceFailureKind::Missing => PieceError::Missing(path),
            PieceFailureKind::Damaged => PieceError::Damaged(path, what),
            PieceFailureKind::Ranks => PieceError::Ranks(what),
        }
    }
}
