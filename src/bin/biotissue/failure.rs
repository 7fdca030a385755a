//! The failure of a command: one block on stderr (problem, place, what was expected, cure) and an exit code.

use std::fmt;
use std::path::Path;
use std::process::ExitCode;

use biotissue::input::{InputError, InputErrors, printable};

/// The reason why a command failed.
#[derive(Debug)]
pub enum Failure {
    /// Errors in the input files: exit code 2.
    Input(InputErrors),
    /// Errors in the arguments; `what` names the argument or the file: exit code 2.
    Arguments { what: String, expected: String, cure: String },
    /// The solution did not converge: exit code 3. The converged steps are on disk.
    NotConverged { what: String, place: String, expected: String, cure: String },
    /// An error of the environment: disk, a library, MPI; `what` names the file or the component: exit code 4.
    Environment { what: String, expected: String, cure: String },
    /// A rank that runs as a thread panicked and ended the others: exit code 101, as for any panic.
    Panicked(String),
}

impl Failure {
    /// Returns the documented exit code.
    pub fn exit_code(&self) -> ExitCode {
        self.code().into()
    }

    /// Returns the exit code as a number.
    pub fn code(&self) -> u8 {
        match self {
            Self::Input(_) | Self::Arguments { .. } => 2,
            Self::NotConverged { .. } => 3,
            Self::Environment { .. } => 4,
            Self::Panicked(_) => 101,
        }
    }

    /// Creates an error in the arguments.
    pub fn arguments(what: impl Into<String>, expected: impl Into<String>, cure: impl Into<String>) -> Self {
        Self::Arguments { what: what.into(), expected: expected.into(), cure: cure.into() }
    }

    /// Creates an error of the environment.
    pub fn environment(what: impl Into<String>, expected: impl Into<String>, cure: impl Into<String>) -> Self {
        Self::Environment { what: what.into(), expected: expected.into(), cure: cure.into() }
    }

    /// Creates the error for a file that cannot be written.
    pub fn unwritable(file: &Path, error: &std::io::Error) -> Self {
        Self::environment(
            format!("{}: cannot be written: {error}", file.display()),
            "a writable path on a disk with free space",
            "check the name, that its folder can be made, its permissions and the space on the disk",
        )
    }

    /// Creates the error for a failure of a linear-algebra library.
    pub fn library(error: impl fmt::Display) -> Self {
        Self::environment(
            error.to_string(),
            "a linear-algebra library that works",
            "try another --backend; `biotissue info` lists them",
        )
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
