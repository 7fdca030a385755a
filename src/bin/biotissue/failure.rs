//! The failure of a command: one block on stderr (problem, place, what was expected, cure) and an exit code.

use std::fmt;
use std::path::Path;
use std::process::ExitCode;

use biotissue::input::{InputError, InputErrors, printable};

/// The exit code of an interrupted run.
pub const INTERRUPTED: u8 = 130;

/// The reason why a command failed.
#[derive(Debug)]
pub enum Failure {
    /// Errors in the input files: exit code 2.
    Input(InputErrors),
    /// Another error with its exit code; `what` names the argument, the file or the component.
    General { code: u8, what: String, place: Option<String>, expected: String, cure: String },
    /// A signal has ended the run, with this message: exit code 130, by shell convention that of a process ended by
    /// Ctrl-C.
    Interrupted(String),
    /// The failure of another rank, with its exit code and its text.
    OfRank { code: u8, text: String },
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
            Self::Input(_) => 2,
            Self::General { code, .. } | Self::OfRank { code, .. } => *code,
            Self::Interrupted(_) => INTERRUPTED,
            Self::Panicked(_) => 101,
        }
    }

    /// Creates an error in the arguments: exit code 2.
    pub fn arguments(what: impl Into<String>, expected: impl Into<String>, cure: impl Into<String>) -> Self {
        Self::General { code: 2, what: what.into(), place: None, expected: expected.into(), cure: cure.into() }
    }

    /// Creates the error for a solution that did not converge: exit code 3. The converged load steps of a run are on
    /// disk.
    pub fn not_converged(what: String, place: String, expected: &str, cure: String) -> Self {
        Self::General { code: 3, what, place: Some(place), expected: expected.into(), cure }
    }

    /// Creates an error of the environment (disk, a library, MPI): exit code 4.
    pub fn environment(what: impl Into<String>, expected: impl Into<String>, cure: impl Into<String>) -> Self {
        Self::General { code: 4, what: what.into(), place: None, expected: expected.into(), cure: cure.into() }
    }

    /// Gives an error the exit code of the environment.
    pub fn of_environment(mut self) -> Self {
        if let Self::General { code, .. } = &mut self {
            *code = 4;
        }
        self
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
            Self::General { what, place, expected, cure, .. } => {
                let at = place.as_ref().map_or_else(String::new, |place| format!("  at: {place}\n"));
                format!("error: {what}\n{at}  expected: {expected}\n  cure: {cure}")
            }
            Self::Interrupted(text) | Self::OfRank { text, .. } => text.clone(),
            Self::Panicked(what) => {
                format!("error: {what}\n  expected: no panic\n  cure: report this as a bug, with the case")
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
