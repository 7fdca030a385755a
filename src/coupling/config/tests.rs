use super::*;
use crate::coupling::plan::Share;

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

/// Returns the errors in a text, without the name of the file.
fn errors(text: &str) -> String {
    parse(text).unwrap_err().to_string().replace("case/amsi.cfg:", "")
}

/// The continuation of an error message after its first line.
fn with_cure(expected: &str, cure: &str) -> String {
    format!("\n  expected: {expected}\n  cure: {cure}")
}

#[test]
fn invalid_sections_are_reported() {
    let unknown =
        with_cure("`@scales`, `@relations`, `@util` or `@analysis`", "correct its name, or remove the section");
    let outside = with_cure(
        "a section, such as `@scales`, before the first entry",
        "put the name of its section on a line above it",
    );
    let behind = with_cure("the name of the section alone", "put what belongs to it on lines of their own");
    let table = [
        ("@scale\nmacro many\n", format!("1: there is no section `@scale`{unknown}")),
        ("\nmacro 1\n@scales\n", format!("2: `macro` is outside all sections{outside}")),
        ("@scales macro 1\n", format!("1: `macro` follows `@scales`{behind}")),
    ];
    for (text, expected) in table {
        assert_eq!(errors(text), expected, "{text}");
    }
}

#[test]
fn invalid_scales_are_reported() {
    let count = with_cure("a whole number from 1 to 16777216", "write how many ranks the scale gets");
    let form = with_cure("`NAME COUNT`, `NAME ranks 0 1 5-7` or `NAME ratio 1.5`", "write one of these");
    let ranks = with_cure(
        "a rank from 0 to 16777215, such as `1`, or a span of them, such as `5-7`",
        "write numbers, the smaller one first",
    );
    let ratio = with_cure("a positive number", "write one, such as `1.5`");
    let twice = with_cure("a name of its own for each scale", "rename one of them, or remove it");
    let table = [
        ("a 0", format!("2: `0` is not a number of ranks{count}")),
        ("a -3", format!("2: `-3` is not a number of ranks{count}")),
        ("a 1.5", format!("2: `1.5` is not a number of ranks{count}")),
        ("a 99999999999", format!("2: `99999999999` is not a number of ranks{count}")),
        ("a", format!("2: `a` does not give the ranks of the scale{form}")),
        ("a 1 2", format!("2: `a 1 2` does not give the ranks of the scale{form}")),
        ("a ranks", format!("2: `a ranks` does not give the ranks of the scale{form}")),
        ("a ratio", format!("2: `a ratio` does not give the ranks of the scale{form}")),
        ("a ranks 0 7-5", format!("2: `7-5` names no ranks{ranks}")),
        ("a ranks 0-99999999999", format!("2: `0-99999999999` names no ranks{ranks}")),
        ("a ratio -1", format!("2: `-1` is not a ratio{ratio}")),
        ("a ratio inf", format!("2: `inf` is not a ratio{ratio}")),
        ("a 1\na 2", format!("3: there are two scales `a`; the first is on line 2{twice}")),
    ];
    for (entry, expected) in table {
        assert_eq!(errors(&format!("@scales\n{entry}\n")), expected, "{entry}");
    }
}

#[test]
fn invalid_relations_are_reported() {
    let pair =
        with_cure("two scales: `PRODUCER CONSUMER`", "name the scale that has the data, then the one that gets them");
    let scale = with_cure("a scale: `a`, `b`", "correct the name, or add the scale to `@scales`");
    let once = with_cure("each relation once", "remove one of the two");
    let other = with_cure("two scales", "name another scale, or remove the line");
    let table = [
        ("a", format!("5: `a` is not a relation{pair}")),
        ("a b a", format!("5: `a b a` is not a relation{pair}")),
        ("a c", format!("5: there is no scale `c`{scale}")),
        ("a a", format!("5: the relation `a a` couples a scale with itself{other}")),
        ("a b\nb a\na b", format!("7: the relation `a b` was already given on line 5{once}")),
    ];
    for (entry, expected) in table {
        assert_eq!(errors(&format!("@scales\na 1\nb 1\n@relations\n{entry}\n")), expected, "{entry}");
    }
}

#[test]
fn invalid_folders_are_reported() {
    let key = with_cure("`results`", "correct the name, or remove the line");
    let folder = with_cure("`results PATH`, with a path without blanks", "name one folder");
    let unset = |name: &str, path: &str| {
        let cure = format!("set it (`export {name}=...`), or write the path itself");
        let cure = with_cure("a variable with a part of the path", &cure);
        format!("2: the environment variable {name} in `{path}` is not set, or is empty{cure}")
    };
    let name = with_cure("`$NAME` or `${NAME}`", "name the environment variable, or remove the `$`");
    let line = with_cure("one line `results`", "remove one of the two");
    let table = [
        ("result out", format!("2: there is no `result` in `@util`{key}")),
        ("results", format!("2: `results` does not name one folder{folder}")),
        ("results my out", format!("2: `results my out` does not name one folder{folder}")),
        ("results $HERE/x", unset("HERE", "$HERE/x")),
        ("results ${EMPTY}", unset("EMPTY", "${EMPTY}")),
        ("results x$/y", format!("2: a `$` in `x$/y` has no name after it{name}")),
        ("results x\nresults y", format!("3: the folder of the results was already given on line 2{line}")),
    ];
    for (entry, expected) in table {
        assert_eq!(errors(&format!("@util\n{entry}\n")), expected, "{entry}");
    }
}

#[test]
fn all_errors_of_a_file_are_reported_in_the_order_of_lines() {
    let text = "macro 1\n@relations\nmacro micro\n@scales\nmacro none\n@util\nresults $ONE/$TWO\n@rest\n";
    let found: Vec<(Option<usize>, String)> =
        parse(text).unwrap_err().0.into_iter().map(|error| (error.line, error.problem)).collect();
    let expected: [(usize, &str); 6] = [
        (1, "`macro` is outside all sections"),
        (3, "there is no scale `micro`"),
        (5, "`none` is not a number of ranks"),
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
    assert!(errors.0[0].problem.starts_with("cannot be read: "), "{errors}");
    std::fs::write(&file, "@scales\na 2\n@util\nresults out\n").unwrap();
    assert_eq!(Config::read(&file).unwrap().results, Some(folder.path().join("out")));
}
