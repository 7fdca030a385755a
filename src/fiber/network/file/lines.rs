//! Parser of text files with lines of whitespace-separated numbers; it reports errors with their lines.

use std::path::Path;

use crate::input::{InputError, InputErrors, MOST_SHOWN, excerpt, without_byte_order_mark};

/// A nonblank line.
#[derive(Clone, Copy, Debug)]
pub(super) struct Line<'a> {
    /// Line number from 1; blank lines are counted.
    pub(super) number: usize,
    pub(super) text: &'a str,
}

/// A file being read, with the errors and warnings found so far.
#[derive(Debug)]
pub(super) struct Parser<'a> {
    pub(super) file: &'a Path,
    errors: Vec<InputError>,
    /// Number of lines with extra numbers, and the first of these lines.
    trailing: Option<(usize, usize)>,
}

impl<'a> Parser<'a> {
    pub(super) fn new(file: &'a Path) -> Self {
        Self { file, errors: Vec::new(), trailing: None }
    }

    /// Returns the nonblank lines of the file.
    pub(super) fn lines<'t>(&self, bytes: &'t [u8]) -> Result<Vec<Line<'t>>, InputError> {
        let bytes = without_byte_order_mark(bytes);
        let text = std::str::from_utf8(bytes).map_err(|error| {
            let before = &bytes[..error.valid_up_to()];
            let line = 1 + before.iter().filter(|&&byte| byte == b'\n').count();
            let byte = bytes.get(error.valid_up_to()).copied().unwrap_or_default();
            self.error(line, format!("the byte 0x{byte:02x} is not text"), "numbers in plain text", NOT_TEXT)
        })?;
        let numbered = text.lines().enumerate().map(|(k, text)| Line { number: k + 1, text });
        Ok(numbered.filter(|line| !line.text.trim().is_empty()).collect())
    }

    /// Creates an error at a line of this file.
    pub(super) fn error(
        &self,
        line: usize,
        what: impl Into<String>,
        expected: impl Into<String>,
        cure: impl Into<String>,
    ) -> InputError {
        InputError::at_line(self.file, line, what, expected, cure)
    }

    /// Creates the error of a header whose counts require `announced` lines although `following` lines follow.
    pub(super) fn wrong_line_count(
        &self,
        header: Line<'_>,
        what: String,
        announced: u128,
        following: usize,
    ) -> InputError {
        let missing = announced > following as u128;
        let cure = if missing { "was the file cut short?" } else { "does the file have too many lines?" };
        self.error(header.number, what, "one line for each counted item", format!("correct it; {cure}"))
    }

    /// Records an error; returns an `Err` with all errors, which ends the reading, once there are [`MOST_SHOWN`].
    pub(super) fn record(&mut self, error: InputError) -> Result<(), InputErrors> {
        self.errors.push(error);
        if self.errors.len() < MOST_SHOWN { Ok(()) } else { self.outcome() }
    }

    /// Returns the value, or `None` after recording the error.
    pub(super) fn ok_or_record<T>(&mut self, value: Result<T, InputError>) -> Result<Option<T>, InputErrors> {
        match value {
            Ok(value) => Ok(Some(value)),
            Err(error) => self.record(error).map(|()| None),
        }
    }

    /// Returns an `Err` with all errors so far, if there are any.
    pub(super) fn outcome(&mut self) -> Result<(), InputErrors> {
        if self.errors.is_empty() { Ok(()) } else { Err(InputErrors(std::mem::take(&mut self.errors))) }
    }

    /// Returns warnings about the irregularities that did not prevent reading.
    pub(super) fn warnings(&self) -> Vec<String> {
        let text = self.trailing.map(|(lines, first)| {
            let (file, have) = (self.file.display(), if lines == 1 { "line has" } else { "lines have" });
            format!("{file}:{first}: {lines} {have} extra numbers (this is the first); they are ignored")
        });
        text.into_iter().collect()
    }

    /// Returns the first `N` words of a line. Further words must be numbers; they are ignored with a warning.
    pub(super) fn words<'t, const N: usize>(
        &mut self,
        line: Line<'t>,
        expected: &str,
    ) -> Result<[&'t str; N], InputError> {
        let mut words = line.text.split_whitespace();
        let mut counted = [""; N];
        for (k, place) in counted.iter_mut().enumerate() {
            *place = words.next().ok_or_else(|| {
                let are = if k == 1 { "is 1 word" } else { &format!("are {k} words") };
                let what = format!("there {are} on this line, `{}`", excerpt(line.text));
                self.error(line.number, what, expected, COMPARE)
            })?;
        }
        let mut more = words.peekable();
        if more.peek().is_some() {
            for word in more {
                self.real(line, word)?;
            }
            let (lines, first) = self.trailing.unwrap_or((0, line.number));
            self.trailing = Some((lines + 1, first));
        }
        Ok(counted)
    }

    /// Parses a finite number.
    pub(super) fn real(&self, line: Line<'_>, word: &str) -> Result<f64, InputError> {
        let expected = "a finite number like 0.25 or -1e-3";
        let Ok(value) = word.parse::<f64>() else {
            return Err(self.error(line.number, format!("`{}` is not a number", excerpt(word)), expected, COMPARE));
        };
        if !value.is_finite() {
            let what = format!("`{}` is not finite", excerpt(word));
            return Err(self.error(line.number, what, expected, "find the cause in the program that wrote the file"));
        }
        Ok(value)
    }

    /// Parses an integer of either sign.
    pub(super) fn whole(&self, line: Line<'_>, word: &str) -> Result<i64, InputError> {
        word.parse::<i64>().map_err(|_| {
            let what = format!("`{}` is not a whole number", excerpt(word));
            self.error(line.number, what, "a whole number like 12", COMPARE)
        })
    }

    /// Parses a count: a nonnegative integer.
    pub(super) fn count(&self, line: Line<'_>, word: &str) -> Result<u64, InputError> {
        word.parse::<u64>().map_err(|_| {
            let what = format!("`{}` is not a count", excerpt(word));
            self.error(line.number, what, "a nonnegative whole number", COMPARE)
        })
    }

    /// Parses a number above zero.
    pub(super) fn positive(&self, line: Line<'_>, what: &str, word: &str) -> Result<f64, InputError> {
        let value = self.real(line, word)?;
        if value > 0.0 {
            return Ok(value);
        }
        let expected = format!("a {what} above 0");
        Err(self.error(line.number, format!("the {what} is {value}"), expected, "give the value of a real fiber"))
    }
}

pub(super) const COMPARE: &str = "compare with the format of network files; was the file cut off or edited by hand?";
const NOT_TEXT: &str = "give the network in the text format; was the file damaged or is it another kind of file?";
