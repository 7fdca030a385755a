//! One table of a case file, read key by key; keys that the reader never requested are reported as unknown.

use std::fmt::Display;
use std::ops::RangeInclusive;

use toml::de::{DeString, DeTable, DeValue};

use super::problems::{Problems, alternatives, nearest};
use super::range::Range;
use super::value::Value;
use crate::input::excerpt;

/// The top-level tables of a case, used to recognize one that was written below another header.
const SECTIONS: [&str; 12] = [
    "mesh",
    "region",
    "body",
    "boundary",
    "point",
    "body_force",
    "constraint",
    "steps",
    "newton",
    "micro",
    "scales",
    "output",
];

/// Common symbols and the keys that a case uses instead.
const SYMBOLS: [(&str, &str); 9] = [
    ("E", "youngs_modulus"),
    ("nu", "poisson_ratio"),
    ("mu", "shear_modulus"),
    ("G", "shear_modulus"),
    ("lambda", "lame_lambda"),
    ("B", "nonlinearity"),
    ("lambda_t", "transition"),
    ("phi", "fiber_volume_fraction"),
    ("force", "traction"),
];

/// Keys of one or two sections, which users look for in others.
const HOMES: [(&str, &str); 14] = [
    ("count", "[steps]"),
    ("adaptive", "[steps]"),
    ("max_cuts", "[steps], or [micro] for those of RVEs"),
    ("max_iterations", "[newton], or [micro] for those of RVEs"),
    ("tolerance", "[newton], or [micro] for that of RVEs"),
    ("start", "[newton]"),
    ("solver", "[newton], or [micro] for that of RVEs"),
    ("lanes", "[micro]"),
    ("device", "[micro]"),
    ("directory", "[output]"),
    ("every", "[output]"),
    ("fields", "[output]"),
    ("checkpoint", "[output]"),
    ("material", "[[region]]"),
];

/// Which of two alternative keys a table has.
pub(super) enum Either<'d> {
    First(Value<'d>),
    Second(Value<'d>),
}

/// A table with its path and line.
pub(super) struct Table<'d> {
    pub(super) problems: &'d Problems<'d>,
    /// The path of keys to this table, such as `region.material`; empty at the top level.
    path: String,
    pub(super) line: usize,
    entries: &'d DeTable<'d>,
    known: Vec<&'static str>,
}

impl<'d> Table<'d> {
    pub(super) fn new(problems: &'d Problems<'d>, path: String, line: usize, entries: &'d DeTable<'d>) -> Self {
        Self { problems, path, line, entries, known: Vec::new() }
    }

    /// Returns the name of the table in error messages.
    fn name(&self) -> String {
        if self.path.is_empty() { "the case".into() } else { format!("`{}`", self.path) }
    }

    /// Returns the path of keys to this table.
    pub(super) fn path(&self) -> &str {
        &self.path
    }

    fn path_of(&self, key: &str) -> String {
        if self.path.is_empty() { key.into() } else { format!("{}.{key}", self.path) }
    }

    /// Reports an error of the table as a whole: at its line, or for the whole file at the top level.
    pub(super) fn report(&self, what: &str, expected: impl Into<String>, cure: impl Into<String>) {
        let what = format!("{} {what}", self.name());
        if self.path.is_empty() {
            self.problems.report_file(what, expected, cure);
        } else {
            self.problems.report(self.line, what, expected, cure);
        }
    }

    /// Returns the value of a key if present, and marks the key as known.
    pub(super) fn get(&mut self, key: &'static str) -> Option<Value<'d>> {
        self.known.push(key);
        let (name, value) = self.entries.get_key_value(key)?;
        let line = self.problems.line_of(name.span().start);
        Some(Value { problems: self.problems, path: self.path_of(key), line, inner: value.get_ref() })
    }

    /// Returns the value of a required key.
    pub(super) fn require(&mut self, key: &'static str, expected: &str) -> Option<Value<'d>> {
        let value = self.get(key);
        if value.is_none() {
            self.report(&format!("has no `{key}`"), expected, format!("add `{key} = ...`"));
        }
        value
    }

    /// Returns the value of one of two keys, exactly one of which is required.
    pub(super) fn either(&mut self, first: &'static str, second: &'static str) -> Option<Either<'d>> {
        let expected = format!("exactly one of `{first}` and `{second}`");
        match (self.get(first), self.get(second)) {
            (Some(value), None) => Some(Either::First(value)),
            (None, Some(value)) => Some(Either::Second(value)),
            (Some(one), Some(other)) => {
                let (early, late) = if one.line <= other.line { (one, other) } else { (other, one) };
                let what = format!("`{}` is given in addition to `{}` of line {}", late.path, early.path, early.line);
                self.problems.report(late.line, what, expected, "keep one of them and remove the other");
                None
            }
            (None, None) => {
                self.report(&format!("has neither `{first}` nor `{second}`"), expected, "add one of them");
                None
            }
        }
    }

    /// Returns the key and the value of the only one of several keys; exactly one is required.
    pub(super) fn one_of(&mut self, keys: &[&'static str]) -> Option<(&'static str, Value<'d>)> {
        let mut given: Vec<_> = keys.iter().filter_map(|&key| Some((key, self.get(key)?))).collect();
        given.sort_by_key(|(_, value)| value.line);
        let names = alternatives(keys.iter().copied(), '`').replace(" or ", " and ");
        let expected = format!("exactly one of {names}");
        match &given[..] {
            [] => {
                self.report(&format!("has none of {names}"), expected, "add one of them");
                None
            }
            [_] => given.pop(),
            [(_, early), rest @ ..] => {
                for (_, late) in rest {
                    let what =
                        format!("`{}` is given in addition to `{}` of line {}", late.path, early.path, early.line);
                    self.problems.report(late.line, what, &*expected, "keep one of them and remove the other");
                }
                None
            }
        }
    }

    /// Reads an optional number.
    pub(super) fn number(&mut self, key: &'static str, range: Range) -> Option<f64> {
        self.get(key)?.number(range)
    }

    /// Reads a required number.
    pub(super) fn required_number(&mut self, key: &'static str, range: Range) -> Option<f64> {
        self.require(key, &format!("a number{}", range.describe()))?.number(range)
    }

    /// Reads an optional integer.
    pub(super) fn integer<T>(&mut self, key: &'static str, range: RangeInclusive<T>) -> Option<T>
    where
        T: TryFrom<i128> + PartialOrd + Display,
    {
        self.get(key)?.integer(&range)
    }

    /// Reads an optional truth value.
    pub(super) fn boolean(&mut self, key: &'static str) -> Option<bool> {
        self.get(key)?.boolean()
    }

    /// Reads a required string that is not blank.
    pub(super) fn required_text(&mut self, key: &'static str, expected: &str) -> Option<&'d str> {
        self.require(key, expected)?.text(expected)
    }

    /// Reads an optional keyword out of `words`.
    pub(super) fn choice<T: Copy>(&mut self, key: &'static str, words: &[(&'static str, T)]) -> Option<T> {
        self.get(key)?.choice(words)
    }

    /// Reads an optional subtable.
    pub(super) fn table(&mut self, key: &'static str) -> Option<Table<'d>> {
        self.get(key)?.table()
    }

    /// Reads an optional subtable by `read`, which is given the default, and reports the keys that `read` did not
    /// request. Returns the default if there is no such subtable.
    pub(super) fn section<T>(&mut self, key: &'static str, default: T, read: impl FnOnce(&mut Self, &T) -> T) -> T {
        let Some(mut table) = self.table(key) else { return default };
        let section = read(&mut table, &default);
        table.report_unknown_keys();
        section
    }

    /// Reads a required subtable.
    pub(super) fn required_table(&mut self, key: &'static str, expected: &str) -> Option<Table<'d>> {
        let value = self.get(key);
        if value.is_none() {
            let form = if self.path.is_empty() { format!("[{key}]") } else { format!("`{key} = {{ ... }}`") };
            self.report(&format!("has no `{key}`"), expected, format!("add {form}"));
        }
        value?.table()
    }

    /// Returns the tables written as `[[key]]`, in the order of the file.
    pub(super) fn tables(&mut self, key: &'static str) -> Vec<Table<'d>> {
        let Some(value) = self.get(key) else { return Vec::new() };
        let form = format!("[[{key}]] instead of [{key}]");
        let elements = value.list("a list of tables", &form).unwrap_or_default();
        if value.inner.as_array().is_some_and(|elements| elements.is_empty()) {
            value.report_invalid("a list of tables", format!("write [[{key}]], or remove the key"));
        }
        let unnumbered = |element| Value { path: value.path.clone(), ..element };
        elements.into_iter().map(unnumbered).filter_map(|element| element.table()).collect()
    }

    /// Returns all keys with their values, for a table whose keys are names that the user chose.
    pub(super) fn all(&self) -> Vec<(&'d str, Value<'d>)> {
        let value = |(name, value): (&'d toml::Spanned<DeString<'d>>, &'d toml::Spanned<DeValue<'d>>)| {
            let key = name.get_ref().as_ref();
            let line = self.problems.line_of(name.span().start);
            (key, Value { problems: self.problems, path: self.path_of(&excerpt(key)), line, inner: value.get_ref() })
        };
        self.entries.iter().map(value).collect()
    }

    /// Returns true if the table has this key, read or not.
    pub(super) fn has(&self, key: &str) -> bool {
        self.entries.contains_key(key)
    }

    /// Reports every key that was never requested.
    pub(super) fn report_unknown_keys(self) {
        let mut known = self.known.clone();
        known.sort_unstable();
        known.dedup();
        for (name, value) in self.entries {
            let key = name.get_ref().as_ref();
            if known.contains(&key) {
                continue;
            }
            let expected = format!("one of the keys of {}: {}", self.name(), known.join(", "));
            self.problems.report(
                self.problems.line_of(name.span().start),
                format!("unknown key `{}`", self.path_of(&excerpt(key))),
                expected,
                self.cure_of_unknown(key, value.get_ref(), &known),
            );
        }
    }

    fn cure_of_unknown(&self, key: &str, value: &DeValue<'_>, known: &[&'static str]) -> String {
        if let Some(near) = nearest(key, known.iter().copied()) {
            return format!("did you mean `{near}`?");
        }
        let spelled_out = SYMBOLS.iter().find(|(symbol, spelled)| *symbol == key && known.contains(spelled));
        if let Some((_, spelled)) = spelled_out {
            return format!("did you mean `{spelled}`?");
        }
        if !self.path.is_empty() && SECTIONS.contains(&key) {
            let header = if value.is_array() { format!("[[{key}]]") } else { format!("[{key}]") };
            return format!("write it under a header {header} of its own");
        }
        if !self.path.is_empty() && key == "title" {
            return "move it above the first [header]".into();
        }
        // The keys of nested tables, as those of a linear solver, have other meanings.
        let home = HOMES.iter().find(|(known, _)| *known == key).filter(|_| !self.path.contains('.'));
        if let Some((_, home)) = home {
            return format!("it belongs in {home}");
        }
        if self.path.is_empty() && !value.is_table() {
            return "move it below the header of its table, or remove it".into();
        }
        "remove it".into()
    }
}
