//! A reading position in a mesh file. It tracks sections and lines for error messages.

use std::path::Path;

use super::raw::Raw;
use crate::input::{InputError, excerpt};

pub(super) const DAMAGED: &str = "the file is damaged or was changed by hand: export it again";

/// The encoding of the numbers of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    Text,
    Binary {
        /// True if the file is big-endian.
        big_endian: bool,
        /// True if counts and tags of version 4 have eight bytes, false if four.
        eight_byte_sizes: bool,
    },
}

/// The number of items of a counted list read so far.
#[derive(Clone, Copy)]
struct Progress {
    noun: &'static str,
    done: u64,
    of: u64,
}

/// A reading position in a mesh file.
pub(super) struct Cursor<'a> {
    pub(super) bytes: &'a [u8],
    /// Index of the next byte.
    pub(super) at: usize,
    /// Line of the next byte, from 1.
    line: usize,
    /// Index of the first byte of the last token.
    token_at: usize,
    /// Line of the last token, from 1.
    token_line: usize,
    pub(super) path: &'a Path,
    pub(super) encoding: Encoding,
    section: String,
    progress: Option<Progress>,
    /// True if the next words must be on the current line.
    pub(super) in_row: bool,
    /// Number and text of the first line outside all sections.
    stray: Option<(usize, String)>,
}

impl<'a> Cursor<'a> {
    pub fn new(bytes: &'a [u8], path: &'a Path) -> Self {
        Self {
            bytes,
            at: 0,
            line: 1,
            token_at: 0,
            token_line: 1,
            path,
            encoding: Encoding::Text,
            section: String::new(),
            progress: None,
            in_row: false,
            stray: None,
        }
    }

    pub fn is_text(&self) -> bool {
        self.encoding == Encoding::Text
    }

    /// Returns the line of the last token; 0 in a binary file.
    pub fn line(&self) -> u32 {
        if self.is_text() { u32::try_from(self.token_line).unwrap_or(u32::MAX) } else { 0 }
    }

    /// Limits a count stated by the file to the number of items of at least `bytes` bytes that the rest of the file can
    /// contain; the result is a safe capacity for allocation.
    pub fn at_most(&self, count: u64, bytes: usize) -> usize {
        let room = (self.bytes.len() - self.at) / bytes;
        usize::try_from(count).map_or(room, |count| count.min(room))
    }

    // Errors

    /// Creates an error at the last token.
    pub fn error(
        &self,
        problem: impl Into<String>,
        expected: impl Into<String>,
        cure: impl Into<String>,
    ) -> InputError {
        match self.encoding {
            Encoding::Text => InputError::at_line(self.path, self.token_line, problem, expected, cure),
            Encoding::Binary { .. } => {
                let problem = format!("at byte {}: {}", self.token_at, problem.into());
                InputError::in_file(self.path, problem, expected, cure)
            }
        }
    }

    /// Creates the error for a premature end: of the file if `file`, otherwise of the section.
    pub(super) fn ended(&self, file: bool, expected: &str) -> InputError {
        let section = &self.section;
        let after = match self.progress {
            Some(Progress { noun, done, of }) => format!(" after {done} of {of} {noun}"),
            None => String::new(),
        };
        if file {
            let problem = format!("the file ends within ${section}{after}");
            return self.error(problem, expected, "the file was cut off: export or copy it again");
        }
        let problem = format!("${section} ends{}", if after.is_empty() { " too early" } else { &after });
        self.error(problem, expected, DAMAGED)
    }

    // Sections

    /// Returns the first word of the file without advancing; `None` if there is none.
    pub fn opening(&self) -> Option<&'a str> {
        let text = self.bytes.trim_ascii_start();
        let end = text.iter().position(u8::is_ascii_whitespace).unwrap_or(text.len());
        match std::str::from_utf8(&text[..end.min(40)]) {
            Ok("") => None,
            Ok(word) => Some(word),
            Err(_) => Some("bytes that are not text"),
        }
    }

    /// Advances past the opening line of the next section and returns the name of the section; `None` at the end of the
    /// file. Records the first line that lies outside all sections.
    pub fn next_section(&mut self) -> Result<Option<String>, InputError> {
        self.progress = None;
        loop {
            self.skip_whitespace();
            let line = self.bytes[self.at..].split(|&byte| byte == b'\n').next().unwrap_or_default();
            if line.is_empty() {
                return Ok(None);
            }
            self.mark();
            self.at += line.len();
            let text = String::from_utf8_lossy(line.trim_ascii());
            match text.strip_prefix('$') {
                Some(name) => {
                    self.section = self.section_name(name)?;
                    self.finish_line()?;
                    return Ok(Some(self.section.clone()));
                }
                None if self.stray.is_none() => self.stray = Some((self.token_line, clipped(line))),
                None => {}
            }
        }
    }

    /// Validates the name after `$` in an opening line.
    fn section_name(&self, name: &str) -> Result<String, InputError> {
        const EXPECTED: &str = "a line that opens a section, such as `$Nodes`";
        if name.is_empty() {
            return Err(self.error("a `$` without the name of a section", EXPECTED, DAMAGED));
        }
        if name.strip_prefix("End").is_some_and(|of| of.starts_with(char::is_uppercase)) {
            return Err(self.error(format!("`${name}` closes a section that is not open"), EXPECTED, DAMAGED));
        }
        Ok(name.to_owned())
    }

    /// Reads the closing line of the current section.
    pub fn end_section(&mut self) -> Result<(), InputError> {
        self.skip_whitespace();
        self.mark();
        let name = &self.section;
        let end = format!("$End{name}");
        let rest = &self.bytes[self.at..];
        let word = rest.split(|byte| byte.is_ascii_whitespace()).next().unwrap_or_default();
        if word == end.as_bytes() {
            self.at += word.len();
            return Ok(());
        }
        let problem = match (clipped(word), self.progress) {
            (word, _) if word.is_empty() => format!("`{end}` is missing: the file ends"),
            (word, _) if word.starts_with('$') => format!("`{end}` is missing: `{word}` was found instead"),
            (word, Some(Progress { noun, of, .. })) => format!("`{word}` follows the {of} {noun} announced"),
            (word, None) => format!("`{word}` was found at the end of ${name}"),
        };
        Err(self.error(problem, format!("`{end}`"), DAMAGED))
    }

    /// Advances past the end of an ignored section.
    pub fn skip_section(&mut self) -> Result<(), InputError> {
        let end = format!("\n$End{}", self.section);
        // In an empty section, the line break before `$End` is that of the opening line.
        let start = self.at.saturating_sub(1);
        let found = self.bytes[start..].windows(end.len()).enumerate().find(|&(at, window)| {
            let next = self.bytes.get(start + at + end.len());
            window == end.as_bytes() && next.is_none_or(u8::is_ascii_whitespace)
        });
        let Some((at, _)) = found else {
            let problem = format!("the section `${0}` is not closed: no line `$End{0}` follows", self.section);
            let cure = "the file was cut off: export or copy it again";
            return Err(self.error(problem, format!("`$End{}`", self.section), cure));
        };
        let stop = start + at + end.len();
        self.line += self.bytes[self.at..stop].iter().filter(|&&byte| byte == b'\n').count();
        self.at = stop;
        Ok(())
    }

    /// Adds a warning about lines outside all sections.
    pub fn finish(&self, raw: &mut Raw) {
        if let Some((line, text)) = &self.stray {
            raw.warnings.push(match self.encoding {
                Encoding::Text => format!("line {line}, `{text}`, is outside all sections and is ignored"),
                Encoding::Binary { .. } => format!("`{text}` is outside all sections and is ignored"),
            });
        }
    }

    // Rows and counts

    /// Starts a list with a known number of items.
    pub fn expect_count(&mut self, noun: &'static str, of: u64) {
        self.progress = Some(Progress { noun, done: 0, of });
    }

    /// Counts one item of the list.
    pub fn count_one(&mut self) {
        if let Some(progress) = &mut self.progress {
            progress.done += 1;
        }
    }

    /// Starts a row: in a text file, the following items are on one line.
    pub fn begin_row(&mut self) {
        if self.is_text() {
            self.skip_whitespace();
            self.in_row = true;
        }
    }

    /// Ends a row: in a text file, the line must end here.
    pub fn end_row(&mut self) -> Result<(), InputError> {
        if std::mem::take(&mut self.in_row) { self.finish_line() } else { Ok(()) }
    }

    /// Advances past the end of the line, which must not contain further words.
    pub(super) fn finish_line(&mut self) -> Result<(), InputError> {
        self.skip_spaces();
        match self.bytes.get(self.at) {
            None => Ok(()),
            Some(b'\n') => {
                self.at += 1;
                self.line += 1;
                Ok(())
            }
            Some(_) => {
                self.mark();
                let word = self.bytes[self.at..].split(|byte| byte.is_ascii_whitespace()).next().unwrap_or_default();
                Err(self.error(
                    format!("`{}` was found where the line should end", clipped(word)),
                    "a new line",
                    DAMAGED,
                ))
            }
        }
    }

    /// Sets the start of the last token to the current position.
    pub(super) fn mark(&mut self) {
        (self.token_at, self.token_line) = (self.at, self.line);
    }

    pub(super) fn skip_spaces(&mut self) {
        let blank = |byte: &&u8| matches!(byte, b' ' | b'\t' | b'\r');
        self.at += self.bytes[self.at..].iter().take_while(blank).count();
    }

    pub(super) fn skip_whitespace(&mut self) {
        let blank = self.bytes[self.at..].iter().take_while(|byte| byte.is_ascii_whitespace());
        let (count, lines) =
            blank.fold((0, 0), |(count, lines), &byte| (count + 1, lines + usize::from(byte == b'\n')));
        self.at += count;
        self.line += lines;
    }
}

/// Returns an excerpt of the file for a message.
pub(super) fn clipped(text: &[u8]) -> String {
    let text = text.trim_ascii();
    // A message shows fewer than 1000 bytes, so no more are decoded.
    excerpt(&String::from_utf8_lossy(&text[..text.len().min(1000)]))
}
