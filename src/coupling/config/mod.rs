//! Parser of the configuration file of the original AMSI.

mod share;

use std::path::{Path, PathBuf};

use self::share::share;
use super::plan::Plan;
use crate::input::{InputError, InputErrors};

/// A configuration file of the original AMSI: the scales, their shares of the ranks, and their producer-consumer
/// relations.
///
/// ```text
/// @scales
/// macro 16
/// micro 240
/// @relations
/// macro micro
/// micro macro
/// @util
/// results $RESULTS_DIR
/// ```
///
/// A section begins with `@` and its name, and may appear more than once; an entry is a line of words separated by
/// blanks. A word that starts with `#` or `//` starts a comment.
///
/// | section | entry | meaning |
/// |---|---|---|
/// | `@scales` | `micro 240` | a scale that gets this number of ranks |
/// | | `macro ranks 0 1 5-7` | a scale that gets these ranks |
/// | | `micro ratio 1.5` | a scale that gets a share of the remaining ranks, in proportion to its ratio |
/// | `@relations` | `macro micro` | the producer, and the consumer of its data |
/// | `@util` | `results PATH` | the results directory; `$NAME` and `${NAME}` are environment variables |
/// | `@analysis` | any | no effect; each entry produces a warning |
///
/// After listing 2.3 of W. R. Tobin, *The Adaptive Multiscale Simulation Infrastructure* (RPI 2018).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Config {
    /// The scales, in the order of the file, with their shares of the ranks.
    pub plan: Plan,
    /// The relations between producers and consumers, in the order of the file.
    pub relations: Vec<Relation>,
    /// The results directory; a relative path is relative to the directory of the file.
    pub results: Option<PathBuf>,
    /// Warnings about lines without effect, with line number and reason.
    pub warnings: Vec<String>,
}

/// A directed relation between two scales.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Relation {
    /// The scale that provides the data.
    pub producer: String,
    /// The scale that receives the data.
    pub consumer: String,
}

impl Config {
    /// Reads a file; uses the environment variables of the process.
    ///
    /// # Errors
    /// Returns [`InputErrors`] if the file cannot be read, or with all errors in the file.
    pub fn read(path: &Path) -> Result<Self, InputErrors> {
        let text = std::fs::read_to_string(path).map_err(|error| InputError::unreadable(path, &error))?;
        Self::parse(&text, path, |name| std::env::var(name).ok())
    }

    /// Parses the content of a file; `variable` returns the value of an environment variable.
    ///
    /// # Errors
    /// Returns [`InputErrors`] with all errors in the file, in the order of the lines.
    pub fn parse(text: &str, file: &Path, variable: impl Fn(&str) -> Option<String>) -> Result<Self, InputErrors> {
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        let mut reader = Reader::new(file, &variable);
        for (k, line) in text.lines().enumerate() {
            reader.line = k + 1;
            let entry = words(line);
            let Some((&head, rest)) = entry.split_first() else { continue };
            match head.strip_prefix('@') {
                Some(name) => reader.begin(name, rest),
                None => reader.entry(head, rest),
            }
        }
        reader.finish()
    }
}

/// Splits a line into words and drops the comment.
fn words(line: &str) -> Vec<&str> {
    line.split_whitespace().take_while(|word| !word.starts_with('#') && !word.starts_with("//")).collect()
}

/// A method of the reader that reads an entry: its first word and the others.
type ReadEntry<'a> = fn(&mut Reader<'a>, &str, &[&str]);

/// The state of the parser.
struct Reader<'a> {
    file: &'a Path,
    variable: &'a dyn Fn(&str) -> Option<String>,
    /// Current line, from 1.
    line: usize,
    /// Reads the entries of the current section.
    section: Option<ReadEntry<'a>>,
    config: Config,
    /// Names and line numbers of the scales, including those with an invalid share.
    names: Vec<(String, usize)>,
    /// Line numbers of the relations.
    relation_lines: Vec<usize>,
    /// Line number of the results directory.
    results_line: Option<usize>,
    errors: Vec<InputError>,
}

impl<'a> Reader<'a> {
    fn new(file: &'a Path, variable: &'a dyn Fn(&str) -> Option<String>) -> Self {
        Self {
            file,
            variable,
            line: 0,
            section: None,
            config: Config::default(),
            names: Vec::new(),
            relation_lines: Vec::new(),
            results_line: None,
            errors: Vec::new(),
        }
    }

    /// Records an error in the current line.
    fn report(&mut self, what: impl Into<String>, expected: impl Into<String>, cure: impl Into<String>) {
        self.errors.push(InputError::at_line(self.file, self.line, what, expected, cure));
    }

    fn begin(&mut self, name: &str, rest: &[&str]) {
        let section: Option<ReadEntry<'a>> = match name {
            "scales" => Some(Self::scale),
            "relations" => Some(Self::relation),
            "util" => Some(Self::util),
            "analysis" => Some(Self::analysis),
            _ => None,
        };
        // The entries of an unknown section are skipped.
        self.section = Some(section.unwrap_or(|_, _, _| {}));
        if section.is_none() {
            let known = "`@scales`, `@relations`, `@util` or `@analysis`";
            self.report(format!("there is no section `@{name}`"), known, "correct its name, or remove the section");
        }
        if let Some(extra) = rest.first() {
            let what = format!("`{extra}` follows `@{name}`");
            self.report(what, "the name of the section alone", "put what belongs to it on lines of their own");
        }
    }

    fn entry(&mut self, head: &str, rest: &[&str]) {
        match self.section {
            Some(read) => read(self, head, rest),
            None => self.report(
                format!("`{head}` is outside all sections"),
                "a section, such as `@scales`, before the first entry",
                "put the name of its section on a line above it",
            ),
        }
    }

    fn scale(&mut self, name: &str, rest: &[&str]) {
        if let Some(&(_, first)) = self.names.iter().find(|(other, _)| other == name) {
            self.report(
                format!("there are two scales `{name}`; the first is on line {first}"),
                "a name of its own for each scale",
                "rename one of them, or remove it",
            );
        } else {
            self.names.push((name.to_owned(), self.line));
        }
        match share(name, rest) {
            Ok(share) => self.config.plan.scales.push((name.to_owned(), share)),
            Err((what, expected, cure)) => self.report(what, expected, cure),
        }
    }

    fn relation(&mut self, producer: &str, rest: &[&str]) {
        if let [consumer] = rest {
            let relation = Relation { producer: producer.to_owned(), consumer: (*consumer).to_owned() };
            self.config.relations.push(relation);
            self.relation_lines.push(self.line);
        } else {
            self.report(
                format!("`{}` is not a relation", sentence(producer, rest)),
                "two scales: `PRODUCER CONSUMER`",
                "name the scale that has the data, then the one that gets them",
            );
        }
    }

    fn util(&mut self, key: &str, rest: &[&str]) {
        match (key, rest) {
            ("results", [path]) => self.results(path),
            ("results", _) => self.report(
                format!("`{}` does not name one folder", sentence(key, rest)),
                "`results PATH`, with a path without blanks",
                "name one folder",
            ),
            _ => {
                let what = format!("there is no `{key}` in `@util`");
                self.report(what, "`results`", "correct the name, or remove the line");
            }
        }
    }

    fn results(&mut self, path: &str) {
        if let Some(first) = self.results_line {
            let what = format!("the folder of the results was already given on line {first}");
            self.report(what, "one line `results`", "remove one of the two");
        }
        self.results_line = Some(self.results_line.unwrap_or(self.line));
        let expanded = self.expand(path);
        let folder = self.file.parent().unwrap_or_else(|| Path::new(""));
        self.config.results = expanded.map(|path| folder.join(path));
    }

    /// Substitutes environment variables in a path. Reports a variable that is not set or is empty, and then returns
    /// `None`.
    fn expand(&mut self, path: &str) -> Option<String> {
        let (mut expanded, mut rest, mut complete) = (String::new(), path, true);
        while let Some((before, tail)) = rest.split_once('$') {
            expanded.push_str(before);
            let (name, after) = name_ahead(tail);
            rest = after;
            let value = if name.is_empty() { None } else { (self.variable)(name).filter(|value| !value.is_empty()) };
            complete &= value.is_some();
            match value {
                Some(value) => expanded.push_str(&value),
                None if name.is_empty() => self.report(
                    format!("a `$` in `{path}` has no name after it"),
                    "`$NAME` or `${NAME}`",
                    "name the environment variable, or remove the `$`",
                ),
                None => self.report(
                    format!("the environment variable {name} in `{path}` is not set, or is empty"),
                    "a variable with a part of the path",
                    format!("set it (`export {name}=...`), or write the path itself"),
                ),
            }
        }
        expanded.push_str(rest);
        complete.then_some(expanded)
    }

    /// Records a warning, because the section has no effect; the first part of the key names the package.
    fn analysis(&mut self, key: &str, rest: &[&str]) {
        let package = key.split_once('_').map_or(key, |(package, _)| package);
        let reason = match package {
            "petsc" => "options are given to the backend `petsc` by PETSC_OPTIONS".to_owned(),
            _ => format!("this program uses no {package}"),
        };
        let line = sentence(key, rest);
        let warning = format!("{}:{}: `{line}` has no effect: {reason}", self.file.display(), self.line);
        self.config.warnings.push(warning);
    }

    /// Checks the relations against the scales, which may follow them in the file; returns the configuration or all
    /// errors.
    fn finish(mut self) -> Result<Config, InputErrors> {
        let relations = std::mem::take(&mut self.config.relations);
        for (k, relation) in relations.iter().enumerate() {
            self.line = self.relation_lines[k];
            self.check_scale(&relation.producer);
            if relation.consumer == relation.producer {
                let what = format!("the relation `{0} {0}` couples a scale with itself", relation.producer);
                self.report(what, "two scales", "name another scale, or remove the line");
            } else {
                self.check_scale(&relation.consumer);
            }
            if let Some(first) = relations[..k].iter().position(|other| other == relation) {
                let (Relation { producer, consumer }, first) = (relation, self.relation_lines[first]);
                let what = format!("the relation `{producer} {consumer}` was already given on line {first}");
                self.report(what, "each relation once", "remove one of the two");
            }
        }
        self.config.relations = relations;
        if self.errors.is_empty() {
            return Ok(self.config);
        }
        self.errors.sort_by_key(|error| error.line);
        Err(InputErrors(self.errors))
    }

    fn check_scale(&mut self, name: &str) {
        if self.names.iter().any(|(other, _)| other == name) {
            return;
        }
        let names: Vec<String> = self.names.iter().map(|(name, _)| format!("`{name}`")).collect();
        let expected =
            if names.is_empty() { "a scale of `@scales`".to_owned() } else { format!("a scale: {}", names.join(", ")) };
        self.report(format!("there is no scale `{name}`"), expected, "correct the name, or add the scale to `@scales`");
    }
}

/// Joins the words of an entry with single blanks.
fn sentence(head: &str, rest: &[&str]) -> String {
    [&[head][..], rest].concat().join(" ")
}

/// Splits off the name of a variable, `NAME` or `{NAME}`, at the start of a text; returns the name and the rest.
fn name_ahead(text: &str) -> (&str, &str) {
    if let Some(braced) = text.strip_prefix('{').and_then(|rest| rest.split_once('}')) {
        return braced;
    }
    let end = text.find(|c: char| !(c.is_ascii_alphanumeric() || c == '_')).unwrap_or(text.len());
    text.split_at(end)
}

#[cfg(test)]
mod tests;
