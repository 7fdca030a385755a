//! The configuration file of the original AMSI: which scales there are, on how many ranks, and who produces for whom.
//!
//! ```text
//! @scales
//! macro 16
//! micro 240
//! @relations
//! macro micro
//! micro macro
//! @util
//! results $RESULTS_DIR
//! ```
//!
//! A section begins with `@` and its name, and may come back later in the file; an entry is words on one line, with
//! blanks between them. A word that begins with `#` or `//` begins a comment. Beside a count of ranks (`micro 240`) a
//! scale may have ranks by number (`macro ranks 0 1 5-7`) or a part of those that are left (`micro ratio 1.5`). Of
//! `@analysis` nothing has an effect here; each of its lines is a warning.
//!
//! After listing 2.3 of W. R. Tobin, *The Adaptive Multiscale Simulation Infrastructure* (RPI 2018).

use std::path::{Path, PathBuf};

use super::plan::{Plan, Share};
use crate::input::{InputError, InputErrors};

/// The most ranks that a file can ask for: more than there are on any machine, and few enough to list.
const MOST_RANKS: usize = 1 << 24;

/// What the file says.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Config {
    /// The scales, in the order of the file, with their shares of the ranks.
    pub plan: Plan,
    /// Who produces data for whom, in the order of the file.
    pub relations: Vec<Relation>,
    /// The folder of the results; a relative one is put behind the folder of the file.
    pub results: Option<PathBuf>,
    /// Lines without an effect, with their place and the reason.
    pub warnings: Vec<String>,
}

/// Data that go from one scale to another.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Relation {
    /// The scale that has them.
    pub producer: String,
    /// The scale that gets them.
    pub consumer: String,
}

impl Config {
    /// Reads a file, with the environment variables of the process.
    ///
    /// # Errors
    /// [`InputErrors`]: the file cannot be read, or everything that is wrong in it.
    pub fn read(path: &Path) -> Result<Self, InputErrors> {
        let text = std::fs::read_to_string(path).map_err(|error| InputError::unreadable(path, &error))?;
        Self::parse(&text, path, |name| std::env::var(name).ok())
    }

    /// Reads the text of a file; `variable` gives the environment variables.
    ///
    /// # Errors
    /// [`InputErrors`]: everything that is wrong in the file, in the order of its lines.
    pub fn parse(text: &str, file: &Path, variable: impl Fn(&str) -> Option<String>) -> Result<Self, InputErrors> {
        let mut reader = Reader::new(file, &variable);
        for (k, line) in text.lines().enumerate() {
            reader.line = k + 1;
            let entry = words(line);
            let Some((&head, behind)) = entry.split_first() else { continue };
            match head.strip_prefix('@') {
                Some(name) => reader.begin(name, behind),
                None => reader.entry(head, behind),
            }
        }
        reader.finish()
    }
}

/// The words of a line up to a comment.
fn words(line: &str) -> Vec<&str> {
    line.split_whitespace().take_while(|word| !word.starts_with('#') && !word.starts_with("//")).collect()
}

#[derive(Clone, Copy)]
enum Section {
    Scales,
    Relations,
    Util,
    Analysis,
    /// One that there is not: what stands in it is passed over, since its name is the mistake.
    Unknown,
}

/// What was read up to a line.
struct Reader<'a> {
    file: &'a Path,
    variable: &'a dyn Fn(&str) -> Option<String>,
    /// From 1.
    line: usize,
    section: Option<Section>,
    config: Config,
    /// Names of scales, those with a wrong share too, and the lines where they stand.
    names: Vec<(String, usize)>,
    /// The lines of the relations.
    relation_lines: Vec<usize>,
    /// The line of the folder of results.
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

    /// An error at the line under reading.
    fn report(&mut self, what: impl Into<String>, expected: impl Into<String>, cure: impl Into<String>) {
        self.errors.push(InputError::at_line(self.file, self.line, what, expected, cure));
    }

    fn begin(&mut self, name: &str, behind: &[&str]) {
        let section = match name {
            "scales" => Section::Scales,
            "relations" => Section::Relations,
            "util" => Section::Util,
            "analysis" => Section::Analysis,
            _ => Section::Unknown,
        };
        self.section = Some(section);
        if matches!(section, Section::Unknown) {
            let known = "`@scales`, `@relations`, `@util` or `@analysis`";
            self.report(format!("there is no section `@{name}`"), known, "correct its name, or remove the section");
        }
        if let Some(extra) = behind.first() {
            let what = format!("`{extra}` stands behind `@{name}`");
            self.report(what, "the name of the section alone", "put what belongs to it on lines of their own");
        }
    }

    fn entry(&mut self, head: &str, behind: &[&str]) {
        match self.section {
            Some(Section::Scales) => self.scale(head, behind),
            Some(Section::Relations) => self.relation(head, behind),
            Some(Section::Util) => self.util(head, behind),
            Some(Section::Analysis) => self.analysis(head, behind),
            Some(Section::Unknown) => {}
            None => self.report(
                format!("`{head}` stands in no section"),
                "a section, such as `@scales`, before the first entry",
                "put the name of its section on a line above it",
            ),
        }
    }

    fn scale(&mut self, name: &str, behind: &[&str]) {
        if let Some(&(_, first)) = self.names.iter().find(|(other, _)| other == name) {
            self.report(
                format!("there are two scales `{name}`; the first is on line {first}"),
                "a name of its own for each scale",
                "rename one of them, or remove it",
            );
        } else {
            self.names.push((name.to_owned(), self.line));
        }
        match share(name, behind) {
            Ok(share) => self.config.plan.scales.push((name.to_owned(), share)),
            Err((what, expected, cure)) => self.report(what, expected, cure),
        }
    }

    fn relation(&mut self, producer: &str, behind: &[&str]) {
        if let [consumer] = behind {
            let relation = Relation { producer: producer.to_owned(), consumer: (*consumer).to_owned() };
            self.config.relations.push(relation);
            self.relation_lines.push(self.line);
        } else {
            self.report(
                format!("`{}` is no relation", sentence(producer, behind)),
                "two scales: `PRODUCER CONSUMER`",
                "name the scale that has the data, then the one that gets them",
            );
        }
    }

    fn util(&mut self, key: &str, behind: &[&str]) {
        match (key, behind) {
            ("results", [path]) => self.results(path),
            ("results", _) => self.report(
                format!("`{}` does not name one folder", sentence(key, behind)),
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
            let what = format!("the folder of the results is named again; it stands on line {first} already");
            self.report(what, "one line `results`", "remove one of the two");
        }
        self.results_line = Some(self.results_line.unwrap_or(self.line));
        let expanded = self.expand(path);
        let folder = self.file.parent().unwrap_or_else(|| Path::new(""));
        self.config.results = expanded.map(|path| folder.join(path));
    }

    /// A path with the values of the environment variables in it; `None` where one has none, which is reported.
    fn expand(&mut self, path: &str) -> Option<String> {
        let (mut expanded, mut rest, mut complete) = (String::new(), path, true);
        while let Some((before, behind)) = rest.split_once('$') {
            expanded.push_str(before);
            let (name, after) = name_ahead(behind);
            rest = after;
            let value = if name.is_empty() { None } else { (self.variable)(name).filter(|value| !value.is_empty()) };
            complete &= value.is_some();
            match value {
                Some(value) => expanded.push_str(&value),
                None if name.is_empty() => self.report(
                    format!("a `$` in `{path}` has no name behind it"),
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

    /// Nothing of it has an effect; a key belongs to the package that its first word names.
    fn analysis(&mut self, key: &str, behind: &[&str]) {
        let package = key.split_once('_').map_or(key, |(package, _)| package);
        let reason = match package {
            "petsc" => "options are given to the backend `petsc` by PETSC_OPTIONS".to_owned(),
            _ => format!("this program uses no {package}"),
        };
        let line = sentence(key, behind);
        let warning = format!("{}:{}: `{line}` has no effect: {reason}", self.file.display(), self.line);
        self.config.warnings.push(warning);
    }

    /// The relations against the scales, wherever these stand in the file; then all, or all errors.
    fn finish(mut self) -> Result<Config, InputErrors> {
        let relations = std::mem::take(&mut self.config.relations);
        for (k, relation) in relations.iter().enumerate() {
            self.line = self.relation_lines[k];
            self.check_scale(&relation.producer);
            if relation.consumer != relation.producer {
                self.check_scale(&relation.consumer);
            }
            if let Some(first) = relations[..k].iter().position(|other| other == relation) {
                let (Relation { producer, consumer }, first) = (relation, self.relation_lines[first]);
                let what =
                    format!("the relation `{producer} {consumer}` is given again; it stands on line {first} already");
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

/// The words of an entry, one blank between them.
fn sentence(head: &str, behind: &[&str]) -> String {
    [&[head][..], behind].concat().join(" ")
}

/// The name of a variable, `NAME` or `{NAME}`, at the beginning of a text, and what is behind it.
fn name_ahead(text: &str) -> (&str, &str) {
    if let Some(braced) = text.strip_prefix('{').and_then(|behind| behind.split_once('}')) {
        return braced;
    }
    let end = text.find(|c: char| !(c.is_ascii_alphanumeric() || c == '_')).unwrap_or(text.len());
    text.split_at(end)
}

/// What is wrong, what was expected, and the cure.
type Wrong = (String, &'static str, &'static str);

/// The ranks of a scale, by what stands behind its name.
fn share(name: &str, behind: &[&str]) -> Result<Share, Wrong> {
    match behind {
        ["ranks", spans @ ..] if !spans.is_empty() => {
            let ranks = spans.iter().map(|span| ranks(span)).collect::<Result<Vec<_>, _>>()?;
            Ok(Share::Ranks(ranks.concat()))
        }
        ["ratio", ratio] => {
            let positive = ratio.parse().ok().filter(|ratio: &f64| *ratio > 0.0 && ratio.is_finite());
            let wrong = || (format!("`{ratio}` is no ratio"), "a positive number", "write one, such as `1.5`");
            positive.map(Share::Ratio).ok_or_else(wrong)
        }
        [count] if !["ranks", "ratio"].contains(count) => {
            let positive = count.parse().ok().filter(|count: &usize| (1..=MOST_RANKS).contains(count));
            let wrong = || {
                let what = format!("`{count}` is no number of ranks");
                (what, "a whole number from 1 to 16777216", "write how many ranks the scale gets")
            };
            positive.map(Share::Count).ok_or_else(wrong)
        }
        _ => Err((
            format!("`{}` does not say what ranks the scale gets", sentence(name, behind)),
            "`NAME COUNT`, `NAME ranks 0 1 5-7` or `NAME ratio 1.5`",
            "write one of these",
        )),
    }
}

/// A rank, or all from one to another: `5` or `5-7`.
fn ranks(span: &str) -> Result<Vec<usize>, Wrong> {
    let rank = |word: &str| word.parse().ok().filter(|&rank: &usize| rank < MOST_RANKS);
    let (first, last) = span.split_once('-').unwrap_or((span, span));
    match (rank(first), rank(last)) {
        (Some(first), Some(last)) if first <= last => Ok((first..=last).collect()),
        _ => Err((
            format!("`{span}` names no ranks"),
            "a rank from 0 to 16777215, such as `1`, or a span of them, such as `5-7`",
            "write numbers, the smaller one first",
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LISTING: &str = "\
@scales
macro 16
micro 240
@relations
macro micro
micro macro
@util
results $RESULTS_DIR
@analysis
petsc true
petsc_options petsc_opts
simmetrix true
simmetrix_license license.txt
";

    fn parse(text: &str) -> Result<Config, InputErrors> {
        let variable = |name: &str| match name {
            "RESULTS_DIR" => Some("/scratch/results".to_owned()),
            "RUN" => Some("run7".to_owned()),
            "EMPTY" => Some(String::new()),
            _ => None,
        };
        Config::parse(text, Path::new("case/amsi.cfg"), variable)
    }

    fn relation(producer: &str, consumer: &str) -> Relation {
        Relation { producer: producer.to_owned(), consumer: consumer.to_owned() }
    }

    #[test]
    fn the_listing_of_the_thesis_is_read() {
        let config = parse(LISTING).unwrap();
        assert_eq!(config.plan, Plan::default().with("macro", Share::Count(16)).with("micro", Share::Count(240)));
        let error = config.plan.assign(4).map_err(|error| error.to_string());
        assert_eq!(error, Err("macro 16 + micro 240 = 256 ranks, but 4 were started".to_owned()));
        assert_eq!(config.relations, [relation("macro", "micro"), relation("micro", "macro")]);
        assert_eq!(config.results, Some(PathBuf::from("/scratch/results")));
        let petsc = "has no effect: options are given to the backend `petsc` by PETSC_OPTIONS";
        let simmetrix = "has no effect: this program uses no simmetrix";
        let warnings = [
            format!("case/amsi.cfg:10: `petsc true` {petsc}"),
            format!("case/amsi.cfg:11: `petsc_options petsc_opts` {petsc}"),
            format!("case/amsi.cfg:12: `simmetrix true` {simmetrix}"),
            format!("case/amsi.cfg:13: `simmetrix_license license.txt` {simmetrix}"),
        ];
        assert_eq!(config.warnings, warnings);
    }

    #[test]
    fn shares_comments_and_the_order_of_sections_are_free() {
        let text = "\
# two codes
  @relations // who for whom
micro macro
\t@scales

macro   ranks 0 1 5-7 # the first ones
meso ratio 1.5
@util
results out//${RUN}_$RUN/x
@scales
micro 3
";
        let config = parse(text).unwrap();
        let plan = Plan::default()
            .with("macro", Share::Ranks(vec![0, 1, 5, 6, 7]))
            .with("meso", Share::Ratio(1.5))
            .with("micro", Share::Count(3));
        assert_eq!(config.plan, plan);
        assert_eq!(config.relations, [relation("micro", "macro")]);
        assert_eq!(config.results, Some(PathBuf::from("case/out//run7_run7/x")));
        assert_eq!(config.warnings, [""; 0]);
    }

    /// What is wrong with the text, without the name of the file.
    fn errors(text: &str) -> String {
        parse(text).unwrap_err().to_string().replace("case/amsi.cfg:", "")
    }

    /// How an error goes on.
    fn hint(expected: &str, cure: &str) -> String {
        format!("\n  expected: {expected}\n  cure: {cure}")
    }

    #[test]
    fn wrong_sections_are_shown() {
        let unknown =
            hint("`@scales`, `@relations`, `@util` or `@analysis`", "correct its name, or remove the section");
        let outside = hint(
            "a section, such as `@scales`, before the first entry",
            "put the name of its section on a line above it",
        );
        let behind = hint("the name of the section alone", "put what belongs to it on lines of their own");
        let table = [
            ("@scale\nmacro many\n", format!("1: there is no section `@scale`{unknown}")),
            ("\nmacro 1\n@scales\n", format!("2: `macro` stands in no section{outside}")),
            ("@scales macro 1\n", format!("1: `macro` stands behind `@scales`{behind}")),
        ];
        for (text, expected) in table {
            assert_eq!(errors(text), expected, "{text}");
        }
    }

    #[test]
    fn wrong_scales_are_shown() {
        let count = hint("a whole number from 1 to 16777216", "write how many ranks the scale gets");
        let form = hint("`NAME COUNT`, `NAME ranks 0 1 5-7` or `NAME ratio 1.5`", "write one of these");
        let ranks = hint(
            "a rank from 0 to 16777215, such as `1`, or a span of them, such as `5-7`",
            "write numbers, the smaller one first",
        );
        let ratio = hint("a positive number", "write one, such as `1.5`");
        let twice = hint("a name of its own for each scale", "rename one of them, or remove it");
        let table = [
            ("a 0", format!("2: `0` is no number of ranks{count}")),
            ("a -3", format!("2: `-3` is no number of ranks{count}")),
            ("a 1.5", format!("2: `1.5` is no number of ranks{count}")),
            ("a 99999999999", format!("2: `99999999999` is no number of ranks{count}")),
            ("a", format!("2: `a` does not say what ranks the scale gets{form}")),
            ("a 1 2", format!("2: `a 1 2` does not say what ranks the scale gets{form}")),
            ("a ranks", format!("2: `a ranks` does not say what ranks the scale gets{form}")),
            ("a ratio", format!("2: `a ratio` does not say what ranks the scale gets{form}")),
            ("a ranks 0 7-5", format!("2: `7-5` names no ranks{ranks}")),
            ("a ranks 0-99999999999", format!("2: `0-99999999999` names no ranks{ranks}")),
            ("a ratio -1", format!("2: `-1` is no ratio{ratio}")),
            ("a ratio inf", format!("2: `inf` is no ratio{ratio}")),
            ("a 1\na 2", format!("3: there are two scales `a`; the first is on line 2{twice}")),
        ];
        for (entry, expected) in table {
            assert_eq!(errors(&format!("@scales\n{entry}\n")), expected, "{entry}");
        }
    }

    #[test]
    fn wrong_relations_are_shown() {
        let pair =
            hint("two scales: `PRODUCER CONSUMER`", "name the scale that has the data, then the one that gets them");
        let scale = hint("a scale: `a`, `b`", "correct the name, or add the scale to `@scales`");
        let once = hint("each relation once", "remove one of the two");
        let table = [
            ("a", format!("5: `a` is no relation{pair}")),
            ("a b a", format!("5: `a b a` is no relation{pair}")),
            ("a c", format!("5: there is no scale `c`{scale}")),
            ("a b\nb a\na b", format!("7: the relation `a b` is given again; it stands on line 5 already{once}")),
        ];
        for (entry, expected) in table {
            assert_eq!(errors(&format!("@scales\na 1\nb 1\n@relations\n{entry}\n")), expected, "{entry}");
        }
    }

    #[test]
    fn wrong_folders_are_shown() {
        let key = hint("`results`", "correct the name, or remove the line");
        let folder = hint("`results PATH`, with a path without blanks", "name one folder");
        let unset = |name: &str, path: &str| {
            let cure = format!("set it (`export {name}=...`), or write the path itself");
            let hint = hint("a variable with a part of the path", &cure);
            format!("2: the environment variable {name} in `{path}` is not set, or is empty{hint}")
        };
        let name = hint("`$NAME` or `${NAME}`", "name the environment variable, or remove the `$`");
        let line = hint("one line `results`", "remove one of the two");
        let table = [
            ("result out", format!("2: there is no `result` in `@util`{key}")),
            ("results", format!("2: `results` does not name one folder{folder}")),
            ("results my out", format!("2: `results my out` does not name one folder{folder}")),
            ("results $HERE/x", unset("HERE", "$HERE/x")),
            ("results ${EMPTY}", unset("EMPTY", "${EMPTY}")),
            ("results x$/y", format!("2: a `$` in `x$/y` has no name behind it{name}")),
            (
                "results x\nresults y",
                format!("3: the folder of the results is named again; it stands on line 2 already{line}"),
            ),
        ];
        for (entry, expected) in table {
            assert_eq!(errors(&format!("@util\n{entry}\n")), expected, "{entry}");
        }
    }

    #[test]
    fn all_errors_of_a_file_are_shown_in_the_order_of_lines() {
        let text = "macro 1\n@relations\nmacro micro\n@scales\nmacro none\n@util\nresults $ONE/$TWO\n@rest\n";
        let found: Vec<(Option<usize>, String)> =
            parse(text).unwrap_err().0.into_iter().map(|error| (error.line, error.what)).collect();
        let expected: [(usize, &str); 6] = [
            (1, "`macro` stands in no section"),
            (3, "there is no scale `micro`"),
            (5, "`none` is no number of ranks"),
            (7, "the environment variable ONE in `$ONE/$TWO` is not set, or is empty"),
            (7, "the environment variable TWO in `$ONE/$TWO` is not set, or is empty"),
            (8, "there is no section `@rest`"),
        ];
        assert_eq!(found, expected.map(|(line, what)| (Some(line), what.to_owned())));
    }

    #[test]
    fn a_file_that_cannot_be_read_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("absent.cfg");
        let errors = Config::read(&file).unwrap_err();
        assert_eq!(errors.0.len(), 1);
        assert_eq!((&errors.0[0].file, errors.0[0].line), (&file, None));
        assert!(errors.0[0].what.starts_with("cannot be read: "), "{errors}");
        std::fs::write(&file, "@scales\na 2\n@util\nresults out\n").unwrap();
        assert_eq!(Config::read(&file).unwrap().results, Some(folder.path().join("out")));
    }
}
