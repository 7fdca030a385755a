//! One value of a case file: converted to the expected type, or reported with its line.

use std::fmt::Display;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

use toml::de::{DeInteger, DeTable, DeValue};

use super::networks::missing_file;
use super::problems::{Problems, alternatives, nearest};
use super::range::Range;
use super::table::Table;
use crate::app::expression::{Expression, ExpressionError};
use crate::input::excerpt;

/// The maximum length of a quoted string, in characters.
const LONGEST: usize = 60;

/// A value with its path and line. Every reader reports its error and then returns `None`.
#[derive(Clone)]
pub(super) struct Value<'d> {
    pub(super) problems: &'d Problems<'d>,
    /// The path of keys to this value, such as `region.material.law`.
    pub(super) path: String,
    pub(super) line: usize,
    pub(super) inner: &'d DeValue<'d>,
}

impl<'d> Value<'d> {
    /// Reports an error of this value; the message is its path followed by `complaint`.
    pub(super) fn report_error(&self, complaint: &str, expected: impl Into<String>, cure: impl Into<String>) {
        self.problems.report(self.line, format!("`{}` {complaint}", self.path), expected, cure);
    }

    /// Reports this value as invalid and shows it.
    pub(super) fn report_invalid(&self, expected: impl Into<String>, cure: impl Into<String>) {
        self.report_error(&format!("is {}", shown(self.inner)), expected, cure);
    }

    /// Reports a value of the wrong type; for a quoted number the cure is to remove the quotes.
    fn wrong_type(&self, expected: impl Into<String>, form: &str) {
        let cure = match self.inner {
            DeValue::String(text) if text.trim().parse::<f64>().is_ok() && form.contains("number") => {
                "remove the quotes".to_string()
            }
            _ => format!("write {form}"),
        };
        self.report_invalid(expected, cure);
    }

    /// Reads a finite number in a range; integers are accepted.
    pub(super) fn number(&self, range: Range) -> Option<f64> {
        self.number_or(range, format!("a number{}", range.describe()))
    }

    /// Reads a finite number in a range, like [`Value::number`], where other values are possible too; `expected` describes
    /// all of them.
    pub(super) fn number_or(&self, range: Range, expected: String) -> Option<f64> {
        let value = match self.inner {
            DeValue::Float(float) => float.as_str().parse().unwrap_or(f64::NAN),
            #[expect(
                clippy::cast_precision_loss,
                reason = "a whole number of 17 digits is rounded as its decimal would be"
            )]
            DeValue::Integer(whole) => integer(whole).map_or(f64::NAN, |whole| whole as f64),
            _ => {
                self.wrong_type(expected, "a number");
                return None;
            }
        };
        if range.contains(value) {
            return Some(value);
        }
        self.report_invalid(
            expected,
            if value.is_finite() { "choose a value in that range" } else { "write a finite number" },
        );
        None
    }

    /// Reads an integer in a range.
    pub(super) fn integer<T: TryFrom<i128> + PartialOrd + Display>(&self, range: &RangeInclusive<T>) -> Option<T> {
        let expected = format!("a whole number from {} to {}", range.start(), range.end());
        match self.inner {
            DeValue::Integer(whole) => {
                let value =
                    integer(whole).and_then(|whole| T::try_from(whole).ok()).filter(|value| range.contains(value));
                if value.is_none() {
                    self.report_invalid(expected, "choose a value in that range");
                }
                value
            }
            DeValue::Float(float) if float.as_str().parse::<f64>().is_ok_and(|value| value.fract() == 0.0) => {
                self.report_invalid(expected, "write it without decimal point and exponent");
                None
            }
            _ => {
                self.wrong_type(expected, "a whole number");
                None
            }
        }
    }

    pub(super) fn boolean(&self) -> Option<bool> {
        if let DeValue::Boolean(value) = self.inner {
            return Some(*value);
        }
        self.wrong_type("true or false", "true or false, without quotes");
        None
    }

    /// Reads a string that is not blank.
    pub(super) fn text(&self, expected: &str) -> Option<&'d str> {
        match self.inner {
            DeValue::String(text) if !text.trim().is_empty() => return Some(text),
            DeValue::String(_) => {
                self.report_invalid(expected, "write something between the quotes, or remove the key")
            }
            _ => self.wrong_type(expected, "a string in quotes"),
        }
        None
    }

    /// Reads one of the given keywords.
    pub(super) fn choice<T: Clone>(&self, words: &[(&'static str, T)]) -> Option<T> {
        let names: Vec<&str> = words.iter().map(|(name, _)| *name).collect();
        self.named(&names, |text| words.iter().find(|(name, _)| *name == text).map(|(_, meaning)| meaning.clone()))
    }

    /// Reads a keyword that `meaning` knows; messages list `names`.
    pub(super) fn named<T>(&self, names: &[&str], meaning: impl Fn(&str) -> Option<T>) -> Option<T> {
        let expected = alternatives(names.iter().copied(), '"');
        let DeValue::String(text) = self.inner else {
            self.report_invalid(
                &*expected,
                if names.len() == 1 { "write this, in quotes" } else { "write one of these, in quotes" },
            );
            return None;
        };
        let found = meaning(text);
        if found.is_none() {
            self.report_invalid(&*expected, did_you_mean(text, names));
        }
        found
    }

    /// Returns the elements of a list.
    pub(super) fn list(&self, expected: &str, form: &str) -> Option<Vec<Self>> {
        let DeValue::Array(elements) = self.inner else {
            self.wrong_type(expected, form);
            return None;
        };
        Some(elements.iter().enumerate().map(|(k, element)| self.element(k, element)).collect())
    }

    fn element(&self, k: usize, element: &'d toml::Spanned<DeValue<'d>>) -> Self {
        Self {
            problems: self.problems,
            path: format!("{}[{k}]", self.path),
            line: self.problems.line_of(element.span().start),
            inner: element.get_ref(),
        }
    }

    /// Returns the elements of a list of exactly `N`; `expected` describes the whole list.
    fn exactly<const N: usize>(&self, expected: &str, form: &str) -> Option<[Self; N]> {
        let elements = self.list(expected, form)?;
        let count = elements.len();
        let exact = <[Self; N]>::try_from(elements).ok();
        if exact.is_none() {
            let complaint = format!("has {count} value{}", if count == 1 { "" } else { "s" });
            self.report_error(&complaint, expected, format!("write {form}"));
        }
        exact
    }

    /// Reads three numbers: x, y, z.
    pub(super) fn vector(&self, range: Range) -> Option<[f64; 3]> {
        let [x, y, z] = self.components(range)?.map(|component| component.number(range));
        Some([x?, y?, z?])
    }

    /// Returns the elements of a list of three: x, y, z.
    pub(super) fn components(&self, range: Range) -> Option<[Self; 3]> {
        let expected = format!("three numbers{}: x, y, z", range.describe());
        self.exactly::<3>(&expected, "three numbers in brackets, such as [0.0, 0.0, 1.0]")
    }

    /// Reads an expression in quotes, in which these variables may occur.
    pub(super) fn expression(&self, expected: &str, variables: &[&str]) -> Option<Expression> {
        let text = self.text(expected)?;
        let parsed = Expression::parse(text, variables);
        let report = |error: &ExpressionError| {
            let complaint = format!("is the string {}: {error}", around(text, error.column));
            self.report_error(&complaint, expected, error.cure.clone());
        };
        parsed.inspect_err(report).ok()
    }

    /// Reads the path of a file that exists, relative to the folder `base`.
    pub(super) fn existing_file(&self, base: &Path, expected: &str) -> Option<PathBuf> {
        let text = self.text(expected)?;
        let file = base.join(text);
        if file.is_file() {
            return Some(file);
        }
        let (what, cure) = match file.is_dir() {
            true => ("which is a folder", "name a file in it".to_owned()),
            false => ("but this file does not exist", missing_file(&file)),
        };
        self.report_error(&format!("names {text:?}, {what}"), expected, cure);
        None
    }

    /// Reads three integers; `what` describes them.
    pub(super) fn integer_vector(&self, range: &RangeInclusive<usize>, what: &str) -> Option<[usize; 3]> {
        let expected = format!("three whole numbers from {} to {}: {what}", range.start(), range.end());
        let components = self.exactly::<3>(&expected, "three whole numbers in brackets, such as [4, 4, 4]")?;
        let [x, y, z] = components.map(|component| component.integer(range));
        Some([x?, y?, z?])
    }

    /// Reads two numbers, each in its range.
    pub(super) fn pair(&self, ranges: [Range; 2], expected: &str) -> Option<[f64; 2]> {
        let [first, second] = self.exactly::<2>(expected, "two numbers in brackets, such as [0.5, 1.0]")?;
        let (first, second) = (first.number(ranges[0]), second.number(ranges[1]));
        Some([first?, second?])
    }

    /// Reads this value as a table.
    pub(super) fn table(&self) -> Option<Table<'d>> {
        let DeValue::Table(entries) = self.inner else {
            let name = self.path.rsplit('.').next().unwrap_or_default();
            let is_list_of_tables =
                matches!(self.inner, DeValue::Array(list) if list.iter().all(|v| v.get_ref().is_table()));
            let cure = if is_list_of_tables && !self.path.contains('.') {
                format!("write [{name}] instead of [[{name}]], and only once")
            } else {
                format!("write {name} = {{ ... }} with its keys in the braces")
            };
            self.report_invalid("a table", cure);
            return None;
        };
        Some(self.table_of(entries))
    }

    fn table_of(&self, entries: &'d DeTable<'d>) -> Table<'d> {
        Table::new(self.problems, self.path.clone(), self.line, entries)
    }
}

/// Returns the cure for an unknown keyword.
pub(super) fn did_you_mean(word: &str, known: &[&str]) -> String {
    match (nearest(word, known.iter().copied()), known) {
        (Some(near), _) => format!("did you mean \"{near}\"?"),
        (None, [only]) => format!("write \"{only}\""),
        (None, _) => "choose one of these".into(),
    }
}

fn integer(whole: &DeInteger<'_>) -> Option<i128> {
    i128::from_str_radix(whole.as_str(), whole.radix()).ok()
}

/// Quotes a text, or the part of a long text around a column (from 1).
fn around(text: &str, column: usize) -> String {
    let count = text.chars().count();
    if count <= LONGEST {
        return format!("{text:?}");
    }
    let start = column.saturating_sub(1 + LONGEST / 2).min(count - LONGEST);
    let part: String = text.chars().skip(start).take(LONGEST).collect();
    let [before, after] = [start > 0, start + LONGEST < count].map(|is_cut| if is_cut { "..." } else { "" });
    format!("{before}{part:?}{after}")
}

/// Formats a value for an error message: numbers and short strings as written, other values by their type.
pub(super) fn shown(value: &DeValue<'_>) -> String {
    match value {
        DeValue::String(text) if text.chars().count() <= LONGEST => format!("the string {text:?}"),
        DeValue::String(text) => format!("the string {:?}...", text.chars().take(LONGEST).collect::<String>()),
        DeValue::Integer(whole) => excerpt(&whole.to_string()),
        DeValue::Float(float) => excerpt(&float.to_string()),
        DeValue::Boolean(boolean) => boolean.to_string(),
        DeValue::Datetime(date) => format!("the date {date}"),
        DeValue::Array(list) if list.is_empty() => "an empty list".into(),
        DeValue::Array(_) => "a list".into(),
        DeValue::Table(_) => "a table".into(),
    }
}
