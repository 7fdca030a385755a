//! How a command ends when it does not succeed: one block on stderr and an exit code.

use std::fmt;
use std::path::Path;
use std::process::ExitCode;

use biotissue::input::{InputError, InputErrors};

/// Why a command failed.
#[derive(Debug)]
pub enum Failure {
    /// Something wrong in the files given: exit code 2.
    Input(InputErrors),
    /// Something wrong in the arguments given: exit code 2.
    Arguments { what: String, expected: String, cure: String },
    /// The physics did not converge: exit code 3. What converged is on disk.
    NotConverged { what: String, place: String, cure: String },
    /// The machine: disk, a library, MPI: exit code 4.
    Environment { what: String, cure: String },
}

impl Failure {
    /// The exit code of the contract.
    pub fn exit_code(&self) -> ExitCode {
        match self {
            Self::Input(_) | Self::Arguments { .. } => ExitCode::from(2),
            Self::NotConverged { .. } => ExitCode::from(3),
            Self::Environment { .. } => ExitCode::from(4),
        }
    }

    /// A file could not be written.
    pub fn unwritable(file: &Path, error: &std::io::Error) -> Self {
        Self::Environment {
            what: format!("{}: cannot be written: {error}", file.display()),
            cure: "check that the folder exists, may be written and has space left".into(),
        }
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Input(errors) => write!(f, "error: {errors}"),
            Self::Arguments { what, expected, cure } => {
                write!(f, "error: {what}\n  expected: {expected}\n  cure: {cure}")
            }
            Self::NotConverged { what, place, cure } => write!(f, "error: {what}\n  at: {place}\n  cure: {cure}"),
            Self::Environment { what, cure } => write!(f, "error: {what}\n  cure: {cure}"),
        }
    }
}

impl From<InputErrors> for Failure {
    fn from(errors: InputErrors) -> Self {
        Self::Input(errors)
    }
}

impl From<InputError> for Failure {
    fn from(error: InputError) -> Self {
        Self::Input(error.into())
    }
}
