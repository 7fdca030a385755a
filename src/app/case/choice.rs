//! Networks that are chosen by fields: by their index in the list of networks, or by the numbers in their names.

use std::path::{Path, PathBuf};

use super::networks;
use super::parameter::{FieldCase, FieldSource, ParameterCase};
use super::range::Range;
use super::value::Value;
use super::write::{Entry, entry, quoted, table};

/// The key of the field that gives the index of a network.
pub const INDEX: &str = "index";

/// The most digits to which a number in a name is filled with zeros.
const MOST_DIGITS: usize = 20;

/// The choice of the network of every point by fields.
#[derive(Clone, Debug, PartialEq)]
pub struct NetworkChoice {
    /// The name of the files, with a place for every field; `None` if the only field is the index of a network, from 0,
    /// in the list of networks.
    pub pattern: Option<NetworkPattern>,
    /// The fields.
    pub fields: Vec<ChoiceField>,
    /// Line of the case file.
    pub line: usize,
}

/// A field of whole numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct ChoiceField {
    /// Its name in the pattern, or [`INDEX`].
    pub name: String,
    /// The values.
    pub values: ParameterCase,
    /// How values become whole numbers; `None` if they are.
    pub bins: Option<Bins>,
    /// The key in the case file.
    pub key: String,
    /// Line of the case file.
    pub line: usize,
}

/// Bins of equal width.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bins {
    /// Their number.
    pub count: u32,
    /// The lower end of the first one and the upper end of the last one; `None`: the least and the greatest value of the
    /// source.
    pub range: Option<[f64; 2]>,
    /// The number of the first one.
    pub first: u32,
}

impl Bins {
    /// Returns the number of the bin that holds a value; `None` if the value is outside of the range. Every bin contains
    /// its lower end, and the last one its upper end too.
    pub fn number(&self, value: f64, [low, high]: [f64; 2]) -> Option<u32> {
        let is_inside = low <= value && value <= high;
        let part = if high > low { (value - low) / (high - low) } else { 0.0 };
        is_inside.then(|| self.first + ((part * f64::from(self.count)) as u32).min(self.count - 1))
    }
}

/// A path with places for numbers, such as `networks/angle-{angle}-align-{align:02}.txt`. A star stands for any text: of the
/// files that then match, each point has a random one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NetworkPattern {
    /// The text in front of each place, and the place: its name and the least number of its digits.
    parts: Vec<(String, String, usize)>,
    /// The text behind the last place.
    end: String,
}

impl NetworkPattern {
    /// Parses a path, in which `{{` and `}}` are braces; `None` if it has no places.
    ///
    /// # Errors
    /// Returns the reason if a brace or the number of digits is wrong.
    pub fn parse(text: &str) -> Result<Option<Self>, String> {
        let (mut parts, mut before) = (Vec::new(), String::new());
        let mut rest = text.chars().peekable();
        while let Some(letter) = rest.next() {
            match letter {
                '{' | '}' if rest.next_if_eq(&letter).is_some() => before.push(letter),
                '{' => {
                    let place: String = rest.by_ref().take_while(|&letter| letter != '}').collect();
                    let (name, digits) = place.split_once(":0").unwrap_or((&place, "1"));
                    let digits: usize =
                        digits.parse().ok().filter(|digits| (1..=MOST_DIGITS).contains(digits)).ok_or(format!(
                            "`{{{place}}}` has no number of digits from 1 to {MOST_DIGITS} behind `:0`"
                        ))?;
                    let is_name = !name.is_empty() && name.chars().all(|c| c.is_alphanumeric() || c == '_' || c == '-');
                    if !is_name {
                        return Err(format!("`{{{place}}}` holds no name of a field"));
                    }
                    parts.push((std::mem::take(&mut before), name.to_owned(), digits));
                }
                '}' => return Err("`}` closes no `{`".into()),
                letter => before.push(letter),
            }
        }
        Ok((!parts.is_empty()).then_some(Self { parts, end: before }))
    }

    /// Returns the names of the places, each once.
    pub fn names(&self) -> Vec<&str> {
        let mut names: Vec<&str> = Vec::new();
        for (_, name, _) in &self.parts {
            if !names.contains(&name.as_str()) {
                names.push(name);
            }
        }
        names
    }

    /// Returns the path with the numbers that `number` returns for the names.
    pub fn path(&self, number: impl Fn(&str) -> u32) -> PathBuf {
        PathBuf::from(self.filled(str::to_owned, |name, digits| format!("{:0digits$}", number(name))))
    }

    /// Returns the files with these numbers: that of [`NetworkPattern::path`], or all that match its stars, in the order of
    /// the numbers in their names. Empty if there are none.
    pub fn files(&self, number: impl Fn(&str) -> u32) -> Vec<PathBuf> {
        let path = self.path(&number);
        if path.is_file() {
            return vec![path];
        }
        let glob = self.filled(escaped, |name, digits| format!("{:0digits$}", number(name)));
        networks::matching(&glob).map_or_else(|_| Vec::new(), |found| found.networks)
    }

    /// Returns the pattern of `glob` that matches all paths.
    pub(super) fn glob(&self) -> String {
        let mut glob = String::new();
        for letter in self.filled(escaped, |_, _| "*".into()).chars() {
            // Two stars would stand for folders.
            if letter != '*' || !glob.ends_with('*') {
                glob.push(letter);
            }
        }
        glob
    }

    /// Returns the path with the texts around the places, and what `place` returns for their names and least numbers of
    /// digits.
    fn filled(&self, around: impl Fn(&str) -> String, place: impl Fn(&str, usize) -> String) -> String {
        let parts = self.parts.iter().map(|(before, name, digits)| around(before) + &place(name, *digits));
        parts.collect::<String>() + &around(&self.end)
    }

    /// Returns the pattern with its folder in front of it.
    pub(super) fn in_folder(mut self, folder: &Path) -> Self {
        let first = &mut self.parts[0].0;
        *first = folder.join(&*first).to_string_lossy().into_owned();
        self
    }

    /// Removes the folders, so that the pattern stays the same if they are moved.
    pub(crate) fn remove_folders(&mut self) {
        let last = |text: &str| text.rfind(std::path::is_separator).map(|at| text[at + 1..].to_owned());
        if let Some(name) = last(&self.parts[0].0) {
            self.parts[0].0 = name;
        }
    }

    /// Formats the pattern as it is parsed.
    pub fn text(&self) -> String {
        let escaped = |text: &str| text.replace('{', "{{").replace('}', "}}");
        let part = |(before, name, digits): &(String, String, usize)| {
            let digits = if *digits > 1 { format!(":0{digits}") } else { String::new() };
            format!("{}{{{name}{digits}}}", escaped(before))
        };
        self.parts.iter().map(part).collect::<String>() + &escaped(&self.end)
    }
}

/// Returns the pattern of `glob` that matches a text in which only stars stand for other text.
fn escaped(text: &str) -> String {
    text.split('*').map(glob::Pattern::escape).collect::<Vec<_>>().join("*")
}

impl NetworkChoice {
    /// Reads the fields of `choose`, a table with a field for every place of the pattern, or with [`INDEX`]. Reports every
    /// error and then returns `None`.
    pub(super) fn read(value: &Value<'_>, pattern: Option<NetworkPattern>, base: &Path) -> Option<Self> {
        let names = pattern.as_ref().map_or(vec![INDEX], NetworkPattern::names);
        let expected = format!("a field for each of: {}", names.join(", "));
        let table = value.table()?;
        let mut is_complete = true;
        let given = table.all();
        for (name, other) in given.iter().filter(|(name, _)| !names.contains(name)) {
            let cure = match &pattern {
                None => "write `index = ...`, or a path with places in braces, such as \"networks/{angle}.txt\"".into(),
                Some(pattern) => format!("the path \"{}\" has no place {{{name}}}: remove it", pattern.text()),
            };
            other.report_error("is not a field that chooses networks", &*expected, cure);
            is_complete = false;
        }
        let fields: Vec<Option<ChoiceField>> = names
            .iter()
            .map(|name| match given.iter().find(|(key, _)| key == name) {
                Some((_, field)) => ChoiceField::read(name, field, base),
                None => {
                    value.report_error(&format!("has no field `{name}`"), &*expected, format!("add `{name} = ...`"));
                    None
                }
            })
            .collect();
        let fields = fields.into_iter().collect::<Option<Vec<_>>>()?;
        is_complete.then_some(Self { pattern, fields, line: value.line })
    }

    /// Returns the files that the fields are read from, without the mesh.
    pub fn files_mut(&mut self) -> impl Iterator<Item = &mut PathBuf> {
        self.fields.iter_mut().filter_map(|field| match &mut field.values {
            ParameterCase::Number(_) => None,
            ParameterCase::Field(values) => values.source.file_mut(),
        })
    }

    pub(super) fn toml(&self) -> String {
        let fields = self.fields.iter().map(|field| (quoted(&field.name), field.toml()));
        let fields: Vec<String> = fields.map(|(name, field)| format!("{name} = {field}")).collect();
        format!("{{ {} }}", fields.join(", "))
    }
}

impl ChoiceField {
    fn read(name: &str, value: &Value<'_>, base: &Path) -> Option<Self> {
        let (values, bins) = if value.inner.is_table() {
            let mut table = value.table()?;
            let source = FieldSource::read_from(value, &mut table, 1, base);
            let bins = Bins::read(value, &mut table);
            table.report_unknown_keys();
            (ParameterCase::Field(FieldCase::new(source?, value)), bins?)
        } else {
            (ParameterCase::read(value, Range::at_least(0.0, ""), base)?, None)
        };
        Some(Self { name: name.into(), values, bins, key: value.path.clone(), line: value.line })
    }

    fn toml(&self) -> String {
        let (ParameterCase::Field(field), Some(bins)) = (&self.values, self.bins) else { return self.values.toml() };
        table("", field.source.entries().into_iter().chain(bins.entries())).1
    }
}

impl Bins {
    /// Reads `bins`, `range` and `first`; `None` after an error.
    fn read(value: &Value<'_>, table: &mut super::table::Table<'_>) -> Option<Option<Self>> {
        let count = table.get("bins");
        let range = table.get("range");
        let first = table.get("first");
        let Some(count) = count else {
            if let Some(key) = range.map(|_| "range").or(first.map(|_| "first")) {
                let (complaint, cure) =
                    (format!("has `{key}` but no `bins`"), format!("add `bins`, or remove `{key}`"));
                value.report_error(&complaint, "a number of bins, such as `bins = 20`", cure);
                return None;
            }
            return Some(None);
        };
        let count = count.integer(&(1..=1_000_000));
        let first = first.map_or(Some(0), |first| first.integer(&(0..=1_000_000)));
        let range = range.map_or(Some(None), |range| {
            let ends =
                range.pair([Range::any(""); 2], "the lower end of the first bin and the upper end of the last one")?;
            if ends[0] >= ends[1] {
                range.report_error("is empty", "two numbers, the smaller one first", "correct the numbers");
                return None;
            }
            Some(Some(ends))
        });
        Some(Some(Self { count: count?, range: range?, first: first? }))
    }

    fn entries(&self) -> Vec<Entry<'static>> {
        let mut entries = vec![entry("bins", self.count)];
        entries.extend(self.range.map(|range| entry("range", range)));
        entries.extend((self.first > 0).then(|| entry("first", self.first)));
        entries
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patterns_name_files() {
        let pattern = NetworkPattern::parse("a{{1}}/angle-{angle}_{align:03}-{angle}.txt").unwrap().unwrap();
        assert_eq!(pattern.names(), ["angle", "align"]);
        let path = pattern.path(|name| if name == "angle" { 12 } else { 7 });
        assert_eq!(path, Path::new("a{1}/angle-12_007-12.txt"));
        assert_eq!(pattern.glob(), "a{1}/angle-*_*-*.txt");
        assert_eq!(NetworkPattern::parse(&pattern.text()).unwrap().unwrap(), pattern);
        assert_eq!(NetworkPattern::parse("{a}{b}{c}").unwrap().unwrap().glob(), "*");
        assert_eq!(NetworkPattern::parse("a*[{a}*{b}-*.txt").unwrap().unwrap().glob(), "a*[[]*-*.txt");
        let pattern = NetworkPattern::parse("{k}.txt").unwrap().unwrap().in_folder(Path::new("/d[1]"));
        assert_eq!((pattern.path(|_| 3), &*pattern.glob()), (PathBuf::from("/d[1]/3.txt"), "/d[[]1[]]/*.txt"));
    }

    #[test]
    fn wrong_patterns_are_reported() {
        assert_eq!(NetworkPattern::parse("networks/*.txt"), Ok(None));
        for text in ["a{}.txt", "a{b.txt", "a}b.txt", "a{b:0x}.txt", "a{b:099}.txt", "a{b c}.txt"] {
            assert!(NetworkPattern::parse(text).is_err(), "{text}");
        }
    }

    #[test]
    fn values_fall_into_bins() {
        let bins = Bins { count: 4, range: None, first: 1 };
        let number = |value| bins.number(value, [0.0, 2.0]);
        assert_eq!([0.0, 0.49, 0.5, 1.99, 2.0].map(number), [1, 1, 2, 4, 4].map(Some));
        assert_eq!([-0.1, 2.1, f64::NAN].map(number), [None; 3]);
        assert_eq!(bins.number(3.0, [3.0, 3.0]), Some(1));
    }
}
