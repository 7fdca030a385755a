//! The errors and warnings collected while a case is read, with their lines.

use std::cell::RefCell;
use std::path::Path;

use strsim::damerau_levenshtein;

use crate::input::{InputError, InputErrors};

/// Maximum length, in bytes, of a word for which [`nearest`] searches a similar one.
const LONGEST_WORD: usize = 200;
/// Maximum number of words that a message lists.
const MOST_WORDS: usize = 20;

/// The errors and warnings so far. All tables being read share it, hence the `RefCell`s.
pub(super) struct Problems<'d> {
    file: &'d Path,
    /// Byte offsets at which lines start.
    line_starts: Vec<usize>,
    errors: RefCell<Vec<InputError>>,
    warnings: RefCell<Vec<String>>,
}

impl<'d> Problems<'d> {
    pub(super) fn new(file: &'d Path, text: &str) -> Self {
        let line_starts = std::iter::once(0).chain(text.match_indices('\n').map(|(at, _)| at + 1)).collect();
        Self { file, line_starts, errors: RefCell::default(), warnings: RefCell::default() }
    }

    /// Returns the line, from 1, of a byte offset.
    pub(super) fn line_of(&self, offset: usize) -> usize {
        self.line_starts.partition_point(|&start| start <= offset).max(1)
    }

    pub(super) fn report(
        &self,
        line: usize,
        what: impl Into<String>,
        expected: impl Into<String>,
        cure: impl Into<String>,
    ) {
        self.errors.borrow_mut().push(InputError::at_line(self.file, line, what, expected, cure));
    }

    pub(super) fn report_file(&self, what: impl Into<String>, expected: impl Into<String>, cure: impl Into<String>) {
        self.errors.borrow_mut().push(InputError::in_file(self.file, what, expected, cure));
    }

    pub(super) fn warn(&self, line: usize, text: &str) {
        self.warnings.borrow_mut().push(format!("{}:{line}: {text}", self.file.display()));
    }

    /// Returns the warnings, or all errors in the order of their lines.
    pub(super) fn finish(self) -> Result<Vec<String>, InputErrors> {
        let mut errors = self.errors.into_inner();
        if errors.is_empty() {
            return Ok(self.warnings.into_inner());
        }
        errors.sort_by_key(|error| error.line);
        Err(InputErrors(errors))
    }
}

/// Returns the known word most similar to `word`, if one is similar enough to be a misspelling: it differs by a few
/// typing errors, or one of the words begins with the other.
pub(super) fn nearest<'k>(word: &str, known: impl IntoIterator<Item = &'k str>) -> Option<&'k str> {
    // A word this long is no misspelling, and the comparison takes time quadratic in its length.
    if word.len() > LONGEST_WORD {
        return None;
    }
    let plain = |s: &str| s.to_lowercase().replace([' ', '-'], "_");
    let word = plain(word);
    let slips_if_meant = |candidate: &str| {
        let other = plain(candidate);
        let slips = damerau_levenshtein(&word, &other);
        let longest = word.chars().count().max(other.chars().count());
        let begins = word.len() >= 3 && other.starts_with(&word) || other.len() >= 4 && word.starts_with(&other);
        (3 * slips <= longest || begins).then_some(slips)
    };
    known
        .into_iter()
        .filter(|candidate| candidate.len() <= LONGEST_WORD)
        .filter_map(|candidate| Some((slips_if_meant(candidate)?, candidate)))
        .min()
        .map(|(_, candidate)| candidate)
}

/// Formats `a, b or c`, each word between `quote`s; a long list is cut after [`MOST_WORDS`] words.
pub(super) fn alternatives<'k>(words: impl IntoIterator<Item = &'k str>, quote: char) -> String {
    let mut words = words.into_iter();
    let quoted: Vec<String> = words.by_ref().take(MOST_WORDS).map(|word| format!("{quote}{word}{quote}")).collect();
    let more = words.count();
    if more > 0 {
        return format!("{} or one of {more} more", quoted.join(", "));
    }
    match quoted.split_last() {
        Some((last, [])) => last.clone(),
        Some((last, others)) => format!("{} or {last}", others.join(", ")),
        None => "nothing".into(),
    }
}
