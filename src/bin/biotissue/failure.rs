//! How a command ends when it does not succeed: one block on stderr (what, where, what was expected, what to do) and an
//! exit code.

use std::fmt;
use std::path::Path;
use std::process::ExitCode;

use biotissue::input::{InputError, InputErrors, printable};

/// Why a command failed.
#[derive(Debug)]
pub enum Failure {
    /// Something wrong in the files given: exit code 2.
    Input(InputErrors),
    /// Something wrong in the arguments given; `what` names the argument or the file: exit code 2.
    Arguments { what: String, expected: String, cure: String },
    /// The physics did not converge: exit code 3. What converged is on disk.
    NotConverged { what: String, place: String, expected: String, cure: String },
    /// The machine: disk, a library, MPI; `what` names the file or the part: exit code 4.
    Environment { what: String, expected: String, cure: String },
    /// A rank that is a thread panicked, and ended the others: the exit code of any panic, 101.
    Panicked(String),
}

impl Failure {
    /// The exit code of the contract.
    pub fn exit_code(&self) -> ExitCode {
        self.code().into()
    }

    /// The same as a number.
    pub fn code(&self) -> u8 {
        match self {
            Self::Input(_) | Self::Arguments { .. } => 2,
            Self::NotConverged { .. } => 3,
            Self::Environment { .. } => 4,
            Self::Panicked(_) => 101,
        }
    }

    /// Something wrong in the arguments.
    pub fn arguments(what: impl Into<String>, expected: impl Into<String>, cure: impl Into<String>) -> Self {
        Self::Arguments { what: what.into(), expected: expected.into(), cure: cure.into() }
    }

    /// A file could not be written.
    pub fn unwritable(file: &Path, error: &std::io::Error) -> Self {
        Self::Environment {
            what: format!("{}: cannot be written: {error}", file.display()),
            expected: "a place that may be written and has space left".into(),
            cure: "check the name, that its folder can be made, its permissions and the space on the disk".into(),
        }
    }

    /// A linear-algebra library failed.
    pub fn library(error: impl fmt::Display) -> Self {
        Self::Environment {
            what: error.to_string(),
            expected: "a linear-algebra library that works".into(),
            cure: "try another --backend; `biotissue info` lists them".into(),
        }
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let text = match self {
            Self::Input(errors) => format!("error: {errors}"),
            Self::Arguments { what, expected, cure } | Self::Environment { what, expected, cure } => {
                format!("error: {what}\n  expected: {expected}\n  cure: {cure}")
            }
            Self::Panicked(what) => {
                format!("error: {what}\n  expected: no panic\n  cure: report this as a bug, with the case")
            }
            Self::NotConverged { what, place, expected, cure } => {
                format!("error: {what}\n  at: {place}\n  expected: {expected}\n  cure: {cure}")
            }
        };
        f.write_str(&printable(&text))
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
