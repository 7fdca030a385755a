//! What can go wrong with the files of a result directory.

use std::io;
use std::path::{Path, PathBuf};

use thiserror::Error;

/// A result file could not be written or read.
#[derive(Debug, Error)]
pub enum ResultsError {
    /// The operating system refused to write.
    #[error("{}: cannot be written: {source}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Its answer.
        source: io::Error,
    },
    /// Another process of the run could not write.
    #[error("{reason}")]
    Elsewhere {
        /// The result directory.
        path: PathBuf,
        /// Its words.
        reason: String,
    },
    /// A file would be replaced or removed that no run has written. Nothing was touched.
    #[error("{}: {what}", path.display())]
    Foreign {
        /// The file.
        path: PathBuf,
        /// How that is known.
        what: &'static str,
    },
    /// Another run writes its results into the same directory.
    #[error("{}: in use by another run: {holder}", path.display())]
    Locked {
        /// The result directory.
        path: PathBuf,
        /// The process, and its machine, as far as they are known.
        holder: String,
    },
    /// The operating system refused to read.
    #[error("{}: cannot be read: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Its answer.
        source: io::Error,
    },
    /// A VTK file could not be put together.
    #[error("{}: cannot be put into VTK form: {source}", path.display())]
    Encode {
        /// The file.
        path: PathBuf,
        /// The writer's answer.
        source: vtkio::Error,
    },
    /// The text of a file is not what was written there.
    #[error("{}{}: {what}; expected {expected}", path.display(), line.map(|l| format!(":{l}")).unwrap_or_default())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// Line, from 1, where there is one.
        line: Option<usize>,
        /// What is wrong.
        what: String,
        /// What should stand there.
        expected: &'static str,
    },
    /// A field has another number of values than the mesh has points or elements, or a row other columns than the file.
    #[error("{}: `{name}` has {found} values where {expected} belong", path.display())]
    Length {
        /// The file that was to be written.
        path: PathBuf,
        /// The field, or the kind of columns.
        name: String,
        /// How many values were given.
        found: usize,
        /// How many there must be.
        expected: usize,
    },
    /// An element names a node that does not exist.
    #[error("{}: element {element} names node {node}, but there are {nodes} nodes (from 0)", path.display())]
    ElementNode {
        /// The file.
        path: PathBuf,
        /// The element, from 0.
        element: usize,
        /// The node it names.
        node: u64,
        /// How many nodes there are.
        nodes: usize,
    },
}

impl ResultsError {
    /// The file concerned.
    #[must_use]
    pub fn path(&self) -> &Path {
        match self {
            Self::Write { path, .. }
            | Self::Elsewhere { path, .. }
            | Self::Foreign { path, .. }
            | Self::Locked { path, .. }
            | Self::Read { path, .. }
            | Self::Encode { path, .. }
            | Self::Damaged { path, .. }
            | Self::Length { path, .. }
            | Self::ElementNode { path, .. } => path,
        }
    }

    /// Whether the file to be read is not there.
    pub(super) fn is_not_found(&self) -> bool {
        matches!(self, Self::Read { source, .. } if source.kind() == io::ErrorKind::NotFound)
    }

    pub(in crate::tissue) fn write(path: &Path) -> impl FnOnce(io::Error) -> Self {
        move |source| Self::Write { path: path.into(), source }
    }

    pub(in crate::tissue) fn read(path: &Path) -> impl FnOnce(io::Error) -> Self {
        move |source| Self::Read { path: path.into(), source }
    }

    pub(super) fn damaged(path: &Path, line: Option<usize>, what: impl Into<String>, expected: &'static str) -> Self {
        Self::Damaged { path: path.into(), line, what: what.into(), expected }
    }
}
