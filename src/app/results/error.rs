//! Errors of reading and writing the files of a result directory.

use std::io;
use std::path::{Path, PathBuf};

use thiserror::Error;

use crate::tissue::micro_scale::PieceError;

/// A result file could not be written or read.
#[derive(Debug, Error)]
pub enum ResultsError {
    /// A file or directory cannot be written.
    #[error("{0}: cannot be written: {1}")]
    Write(PathBuf, #[source] io::Error),
    /// Another process of the run failed to write its results.
    #[error("{0}")]
    OtherRank(String),
    /// A file that would be replaced or removed was not written by a run: the file and the property that shows this.
    /// Nothing was changed.
    #[error("{0}: {1}")]
    UnknownOrigin(PathBuf, &'static str),
    /// The directory that a case names for its results holds those of another case: the directory, and the file of that
    /// case. Nothing was changed.
    #[error("{0}: holds the results of {1}")]
    OtherCase(PathBuf, PathBuf),
    /// Another run writes its results to the same directory: the directory and, as far as known, the process that holds
    /// its lock, with its machine.
    #[error("{0}: in use by another run: {1}")]
    Locked(PathBuf, String),
    /// A file or directory cannot be read.
    #[error("{0}: cannot be read: {1}")]
    Read(PathBuf, #[source] io::Error),
    /// A file is missing or does not have the content that a run writes.
    #[error("{}{}: {what}; expected {expected}", path.display(), line.map(|l| format!(":{l}")).unwrap_or_default())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// Line, from 1, if the error has one.
        line: Option<usize>,
        /// The defect found.
        what: String,
        /// The expected content.
        expected: &'static str,
    },
    /// A field does not have one value per point or element of the mesh, or a row does not have the columns of its
    /// file.
    #[error("{}: `{name}` has {found} values; expected {expected}", path.display())]
    Length {
        /// The file that was to be written, or that was read.
        path: PathBuf,
        /// The name of the field or argument, or the kind of columns.
        name: String,
        /// Number of values given.
        found: usize,
        /// Number of values required.
        expected: usize,
    },
    /// An element refers to a node that does not exist.
    #[error("{}: element {element} names node {node}, but there are {nodes} nodes (from 0)", path.display())]
    ElementNode {
        /// The file.
        path: PathBuf,
        /// The element, from 0.
        element: usize,
        /// The invalid node.
        node: i64,
        /// Number of nodes.
        nodes: usize,
    },
}

impl From<PieceError> for ResultsError {
    fn from(error: PieceError) -> Self {
        match error {
            PieceError::Write(path, what) => Self::Write(path, io::Error::other(what)),
            other => Self::OtherRank(other.to_string()),
        }
    }
}

impl ResultsError {
    /// Checks the number of values of a field.
    pub(super) fn check_length(path: &Path, name: &str, found: usize, expected: usize) -> Result<(), Self> {
        if found == expected {
            Ok(())
        } else {
            Err(Self::Length { path: path.into(), name: name.into(), found, expected })
        }
    }

    /// Returns true if the file to be read does not exist.
    pub(super) fn is_not_found(&self) -> bool {
        matches!(self, Self::Read(_, source) if source.kind() == io::ErrorKind::NotFound)
    }

    pub(crate) fn write(path: &Path) -> impl FnOnce(io::Error) -> Self {
        move |source| Self::Write(path.into(), source)
    }

    pub(in crate::app) fn read(path: &Path) -> impl FnOnce(io::Error) -> Self {
        move |source| Self::Read(path.into(), source)
    }

    pub(super) fn damaged(path: &Path, line: Option<usize>, what: impl Into<String>, expected: &'static str) -> Self {
        Self::Damaged { path: path.into(), line, what: what.into(), expected }
    }
}
