//! What is wrong in a file that a person wrote: always with the place, what was expected, and the cure.

use std::fmt;
use std::path::{Path, PathBuf};

/// One thing wrong in one file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct InputError {
    /// The file, as the user named it.
    pub file: PathBuf,
    /// Line, from 1, where the trouble has one.
    pub line: Option<usize>,
    /// What is wrong, with the offending text or number in it.
    pub what: String,
    /// What should stand there.
    pub expected: String,
    /// What the user can do.
    pub cure: String,
}

impl InputError {
    /// An error of the file as a whole.
    pub fn in_file(file: &Path, what: impl Into<String>, expected: impl Into<String>, cure: impl Into<String>) -> Self {
        Self { file: file.into(), line: None, what: what.into(), expected: expected.into(), cure: cure.into() }
    }

    /// An error at a line, counted from 1.
    pub fn at_line(
        file: &Path,
        line: usize,
        what: impl Into<String>,
        expected: impl Into<String>,
        cure: impl Into<String>,
    ) -> Self {
        Self { line: Some(line), ..Self::in_file(file, what, expected, cure) }
    }

    /// A file that could not be read at all.
    #[must_use]
    pub fn unreadable(file: &Path, error: &std::io::Error) -> Self {
        Self::in_file(
            file,
            format!("cannot be read: {error}"),
            "a file that exists and may be read",
            "check the name and its permissions; a path in a case file is relative to that file",
        )
    }
}

impl fmt::Display for InputError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.line {
            Some(line) => write!(f, "{}:{line}: {}", self.file.display(), self.what)?,
            None => write!(f, "{}: {}", self.file.display(), self.what)?,
        }
        write!(f, "\n  expected: {}\n  cure: {}", self.expected, self.cure)
    }
}

impl std::error::Error for InputError {}

/// Everything wrong in the files of one request, all shown at once.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct InputErrors(pub Vec<InputError>);

impl fmt::Display for InputErrors {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (k, error) in self.0.iter().enumerate() {
            if k > 0 {
                writeln!(f)?;
            }
            write!(f, "{error}")?;
        }
        Ok(())
    }
}

impl std::error::Error for InputErrors {}

impl From<InputError> for InputErrors {
    fn from(error: InputError) -> Self {
        Self(vec![error])
    }
}
