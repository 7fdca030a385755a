//! Errors in input files: the position, the problem, the expected content, and the cure.

#[cfg(feature = "app")]
mod rows;

use std::collections::HashSet;
use std::fmt::{self, Write as _};
use std::path::{Path, PathBuf};

#[cfg(feature = "app")]
pub(crate) use rows::{Row, Rows};

/// The number of errors that a message shows.
pub const MOST_SHOWN: usize = 20;
/// The maximum length of a line of a message, in characters.
const MOST_IN_LINE: usize = 600;
/// The maximum length of a quotation from a file in a message, in characters.
const MOST_QUOTED: usize = 60;
/// The byte-order mark with which some editors begin a UTF-8 file.
const BYTE_ORDER_MARK: &[u8] = "\u{feff}".as_bytes();

/// Returns the content of a text file without its leading byte-order mark, if there is one.
pub fn without_byte_order_mark(bytes: &[u8]) -> &[u8] {
    bytes.strip_prefix(BYTE_ORDER_MARK).unwrap_or(bytes)
}

/// Returns the beginning of a text from a user's file for quotation in a message: one line without control characters,
/// at most 60 characters long.
pub fn excerpt(text: &str) -> String {
    clipped(text.trim(), MOST_QUOTED)
}

/// Prepares a text for the terminal: keeps its line breaks, clips lines that are longer than any message of this
/// program, and escapes control characters, which could move the cursor or hide text.
pub fn printable(text: &str) -> String {
    text.split('\n').map(|line| clipped(line, MOST_IN_LINE)).collect::<Vec<_>>().join("\n")
}

fn clipped(text: &str, most: usize) -> String {
    let mut shown = String::new();
    for (k, c) in text.chars().enumerate() {
        if k == most {
            shown.push_str("...");
            break;
        }
        // Includes the characters that change the direction of text.
        if c.is_control() || matches!(c, '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}' | '\u{feff}') {
            shown.extend(c.escape_debug());
        } else {
            shown.push(c);
        }
    }
    shown
}

/// One error in one file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct InputError {
    /// The file, as named by the user.
    pub file: PathBuf,
    /// Line, from 1; `None` for an error of the whole file.
    pub line: Option<usize>,
    /// The problem, including the offending text or number.
    pub problem: String,
    /// The expected content.
    pub expected: String,
    /// The action that the user should take.
    pub cure: String,
}

impl InputError {
    /// Creates an error of the file as a whole.
    pub fn in_file(
        file: &Path,
        problem: impl Into<String>,
        expected: impl Into<String>,
        cure: impl Into<String>,
    ) -> Self {
        Self { file: file.into(), line: None, problem: problem.into(), expected: expected.into(), cure: cure.into() }
    }

    /// Creates an error at a line, counted from 1.
    pub fn at_line(
        file: &Path,
        line: usize,
        problem: impl Into<String>,
        expected: impl Into<String>,
        cure: impl Into<String>,
    ) -> Self {
        Self { line: Some(line), ..Self::in_file(file, problem, expected, cure) }
    }

    /// Creates the error for a file that cannot be read.
    pub fn unreadable(file: &Path, error: &std::io::Error) -> Self {
        Self::in_file(
            file,
            format!("cannot be read: {error}"),
            "a file that exists and may be read",
            "check the name and its permissions; if a file names it, the path is relative to that file",
        )
    }
}

impl fmt::Display for InputError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut position = self.file.display().to_string();
        if let Some(line) = self.line {
            write!(position, ":{line}")?;
        }
        write!(f, "{}: {}", clipped(&position, usize::MAX), clipped(&self.problem, MOST_IN_LINE))?;
        let (expected, cure) = (clipped(&self.expected, MOST_IN_LINE), clipped(&self.cure, MOST_IN_LINE));
        write!(f, "\n  expected: {expected}\n  cure: {cure}")
    }
}

impl std::error::Error for InputError {}

/// All errors in the files of one request. The message shows the first 20, the number of the others, and the names of all
/// other files with errors.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct InputErrors(pub Vec<InputError>);

impl InputErrors {
    /// Combines the errors of several files: all errors if there is one file, and otherwise the first error of every
    /// file with the number of its other errors, so that a message names as many files as possible. `None` if there are
    /// no files.
    pub fn of_files(mut files: Vec<Self>) -> Option<Self> {
        if files.len() == 1 {
            return files.pop();
        }
        let first_of = |Self(errors): Self| {
            let more = errors.len().saturating_sub(1);
            let mut first = errors.into_iter().next()?;
            if more > 0 {
                let errors = if more == 1 { "error" } else { "errors" };
                let _ = write!(first.problem, " (and {more} more {errors} in this file)");
            }
            Some(first)
        };
        let firsts: Vec<InputError> = files.into_iter().filter_map(first_of).collect();
        (!firsts.is_empty()).then_some(Self(firsts))
    }
}

impl fmt::Display for InputErrors {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let shown: Vec<String> = self.0.iter().take(MOST_SHOWN).map(ToString::to_string).collect();
        f.write_str(&shown.join("\n"))?;
        let Some((shown, others)) = self.0.split_at_checked(MOST_SHOWN).filter(|(_, others)| !others.is_empty()) else {
            return Ok(());
        };
        write!(f, "\nand {} more", others.len())?;
        let mut named: HashSet<&Path> = shown.iter().map(|error| error.file.as_path()).collect();
        let files: Vec<&PathBuf> = others.iter().map(|error| &error.file).filter(|file| named.insert(file)).collect();
        f.write_str(if files.is_empty() { "" } else { ", also in:" })?;
        files.iter().try_for_each(|file| write!(f, "\n  {}", clipped(&file.display().to_string(), usize::MAX)))
    }
}

impl std::error::Error for InputErrors {}

impl From<InputError> for InputErrors {
    fn from(error: InputError) -> Self {
        Self(vec![error])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error(k: usize) -> InputError {
        InputError::at_line(Path::new("case.toml"), k, format!("mistake {k}"), "none", "correct it")
    }

    #[test]
    fn of_several_files_the_first_error_of_each_is_kept() {
        let of = |lines: std::ops::RangeInclusive<usize>| InputErrors(lines.map(error).collect());
        assert_eq!(InputErrors::of_files(Vec::new()), None);
        assert_eq!(InputErrors::of_files(vec![of(1..=3)]), Some(of(1..=3)));
        let text = InputErrors::of_files(vec![of(1..=3), of(4..=4), of(5..=6)]).unwrap().to_string();
        let problems: Vec<&str> = text.lines().filter(|line| line.starts_with("case.toml")).collect();
        assert_eq!(
            problems,
            [
                "case.toml:1: mistake 1 (and 2 more errors in this file)",
                "case.toml:4: mistake 4",
                "case.toml:5: mistake 5 (and 1 more error in this file)",
            ]
        );
    }

    #[test]
    fn twenty_errors_are_shown_and_the_others_counted() {
        let text = |count| InputErrors((1..=count).map(error).collect()).to_string();
        assert_eq!(text(20).lines().count(), 60);
        assert!(text(20).ends_with("case.toml:20: mistake 20\n  expected: none\n  cure: correct it"));
        assert_eq!(text(1000), text(20) + "\nand 980 more");
    }

    #[test]
    fn all_files_with_errors_are_named() {
        let of = |k: usize| InputError { file: format!("{}.txt", k / 2).into(), ..error(k) };
        let text = InputErrors((0..25).map(of).collect()).to_string();
        assert!(text.ends_with("\nand 5 more, also in:\n  10.txt\n  11.txt\n  12.txt"), "{text}");
        let text = InputErrors((0..41).map(|k| of(k % 20)).collect()).to_string();
        assert!(text.ends_with("\nand 21 more"), "{text}");
    }

    #[test]
    fn control_characters_and_long_lines_do_not_reach_the_terminal() {
        let problem = format!("`\u{1b}[2J\r\u{7}\u{202e}{}` is no number", "x".repeat(1_000_000));
        let error = InputError::in_file(Path::new("a\u{1b}[1mb.txt"), problem, "a\tnumber", "correct it");
        let text = error.to_string();
        let begin = r"a\u{1b}[1mb.txt: `\u{1b}[2J\r\u{7}\u{202e}xxx";
        assert!(text.starts_with(begin), "{text}");
        assert!(text.ends_with("xxx...\n  expected: a\\tnumber\n  cure: correct it"), "{text}");
        assert!(text.len() < 1000 && text.lines().count() == 3, "{text}");
        assert_eq!(printable("error: \u{9b}1m\n  at: here"), "error: \\u{9b}1m\n  at: here");
        assert_eq!(excerpt("  a \"quoted\" word\n"), "a \"quoted\" word");
        assert_eq!(excerpt(&"ä".repeat(61)), "ä".repeat(60) + "...");
    }

    #[test]
    fn a_byte_order_mark_is_skipped_once() {
        assert_eq!(without_byte_order_mark(b"\xef\xbb\xbf1 2"), b"1 2");
        assert_eq!(without_byte_order_mark(b"\xef\xbb"), b"\xef\xbb");
        assert_eq!(without_byte_order_mark(b""), b"");
    }
}
