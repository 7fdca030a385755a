//! One table of a case file, read key by key; what was never asked for is unknown.

use std::fmt::Display;
use std::ops::RangeInclusive;

use toml::de::{DeTable, DeValue};

use super::problems::{Problems, alternatives, nearest};
use super::range::Range;
use super::value::Value;

/// The tables at the top of a case, for keys that slipped below another header.
const SECTIONS: [&str; 11] =
    ["mesh", "region", "boundary", "point", "body_force", "constraint", "steps", "newton", "micro", "scales", "output"];

/// A table with its place.
pub(super) struct Table<'d> {
    pub(super) problems: &'d Problems<'d>,
    /// The keys that lead here, such as `region.material`; empty at the top.
    path: String,
    pub(super) line: usize,
    entries: &'d DeTable<'d>,
    known: Vec<&'static str>,
}

impl<'d> Table<'d> {
    pub(super) fn new(problems: &'d Problems<'d>, path: String, line: usize, entries: &'d DeTable<'d>) -> Self {
        Self { problems, path, line, entries, known: Vec::new() }
    }

    /// What errors call it.
    fn name(&self) -> String {
        if self.path.is_empty() { "the case".into() } else { format!("`{}`", self.path) }
    }

    fn path_of(&self, key: &str) -> String {
        if self.path.is_empty() { key.into() } else { format!("{}.{key}", self.path) }
    }

    /// Reports something about the table as a whole: at its line, or of the file where it is the file.
    pub(super) fn report(&self, what: &str, expected: impl Into<String>, cure: impl Into<String>) {
        let what = format!("{} {what}", self.name());
        if self.path.is_empty() {
            self.problems.report_whole(what, expected, cure);
        } else {
            self.problems.report(self.line, what, expected, cure);
        }
    }

    /// The value of a key, which is known from here on.
    pub(super) fn take(&mut self, key: &'static str) -> Option<Value<'d>> {
        self.known.push(key);
        let (name, value) = self.entries.get_key_value(key)?;
        let line = self.problems.line_of(name.span().start);
        Some(Value { problems: self.problems, path: self.path_of(key), line, inner: value.get_ref() })
    }

    /// The value of a key that must be there.
    pub(super) fn require(&mut self, key: &'static str, expected: &str) -> Option<Value<'d>> {
        let value = self.take(key);
        if value.is_none() {
            self.report(&format!("has no `{key}`"), expected, format!("add `{key} = ...`"));
        }
        value
    }

    /// Exactly one of two or more keys: its position among them and its value.
    pub(super) fn exactly_one(&mut self, keys: &[&'static str]) -> Option<(usize, Value<'d>)> {
        let mut present = Vec::new();
        for (position, &key) in keys.iter().enumerate() {
            present.extend(self.take(key).map(|value| (position, value)));
        }
        present.sort_by_key(|(_, value)| value.line);
        let expected = format!("exactly one of {}", alternatives(keys.iter().copied(), '`'));
        if present.len() > 1 {
            let last = present.last().map_or(self.line, |(_, value)| value.line);
            let named: Vec<String> = present
                .iter()
                .map(|(position, value)| format!("`{}` (line {})", keys[*position], value.line))
                .collect();
            let what = format!("{} has {}", self.name(), named.join(" and "));
            self.problems.report(last, what, expected, "keep one of them and remove the rest");
            return None;
        }
        let found = present.pop();
        if found.is_none() {
            let cure = format!("add {}", alternatives(keys.iter().copied(), '`'));
            self.report(&format!("has none of {}", alternatives(keys.iter().copied(), '`')), expected, cure);
        }
        found
    }

    /// A number, where the key is there.
    pub(super) fn number(&mut self, key: &'static str, range: Range) -> Option<f64> {
        self.take(key)?.number(range)
    }

    /// A number that must be there.
    pub(super) fn required_number(&mut self, key: &'static str, range: Range) -> Option<f64> {
        self.require(key, &format!("a number{}", range.describe()))?.number(range)
    }

    /// A whole number, where the key is there.
    pub(super) fn whole<T>(&mut self, key: &'static str, range: RangeInclusive<T>) -> Option<T>
    where
        T: TryFrom<i128> + PartialOrd + Display,
    {
        self.take(key)?.whole(&range)
    }

    /// One of some words, where the key is there.
    pub(super) fn choice<T: Copy>(&mut self, key: &'static str, words: &[(&'static str, T)]) -> Option<T> {
        self.take(key)?.choice(words)
    }

    /// A table below, where the key is there.
    pub(super) fn table(&mut self, key: &'static str) -> Option<Table<'d>> {
        self.take(key)?.table()
    }

    /// A table below that must be there.
    pub(super) fn required_table(&mut self, key: &'static str, expected: &str) -> Option<Table<'d>> {
        let value = self.take(key);
        if value.is_none() {
            let form = if self.path.is_empty() { format!("[{key}]") } else { format!("`{key} = {{ ... }}`") };
            self.report(&format!("has no `{key}`"), expected, format!("add {form}"));
        }
        value?.table()
    }

    /// The tables written `[[key]]`, in the order of the file.
    pub(super) fn tables(&mut self, key: &'static str) -> Vec<Table<'d>> {
        let Some(value) = self.take(key) else { return Vec::new() };
        let form = format!("[[{key}]] instead of [{key}]");
        let elements = value.list("a list of tables", &form).unwrap_or_default();
        elements.iter().filter_map(Value::table).collect()
    }

    /// Whether a key is there, read or not.
    pub(super) fn has(&self, key: &str) -> bool {
        self.entries.contains_key(key)
    }

    /// Reports every key that was never asked for.
    pub(super) fn finish(self) {
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
                format!("unknown key `{}`", self.path_of(key)),
                expected,
                self.cure_of_unknown(key, value.get_ref(), &known),
            );
        }
    }

    fn cure_of_unknown(&self, key: &str, value: &DeValue<'_>, known: &[&'static str]) -> String {
        if let Some(near) = nearest(key, known.iter().copied()) {
            return format!("did you mean `{near}`?");
        }
        if !self.path.is_empty() && SECTIONS.contains(&key) && value.is_table() {
            return format!("write it under a header [{key}] of its own");
        }
        if self.path.is_empty() && !value.is_table() {
            return "move it below the header of its table, or remove it".into();
        }
        "remove it".into()
    }
}
