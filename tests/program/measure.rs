//! `biotissue check --measure`.

use serde_json::Value;

use crate::frozen;
use crate::line;
use crate::ranks::{with_life_cycles, with_scales};
use crate::run::{PRESSED, fibers, write_case};

/// Returns what `check --measure` prints of a case, and that it writes nothing.
fn measured(text: &str) -> (Value, String) {
    let folder = tempfile::tempdir().unwrap();
    write_case(folder.path(), "case.toml", text);
    let plan = line(folder.path(), "check case.toml --measure --json").object();
    let text = line(folder.path(), "check case.toml --measure").done().to_owned();
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "only the case");
    (plan["measured"].clone(), text)
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is not a number"))
}

#[test]
fn a_few_rves_of_each_network_are_solved() {
    let (measured, text) = measured(&fibers(&frozen()).replace("cells = [1, 1, 1]", "cells = [2, 2, 2]"));
    assert_eq!(measured["converged"], true, "{measured}");
    let [network] = &measured["networks"].as_array().unwrap()[..] else { panic!("{measured}") };
    assert_eq!((&network["rves"], &network["name"]), (&48.into(), &"frozen.txt".into()));
    let samples = network["samples"].as_u64().unwrap();
    assert!([3, 4, 8].contains(&samples), "three, or as many as the lanes of the processor: {samples}");
    let [seconds, longest] = ["seconds", "longest"].map(|key| number(&network[key]));
    assert!(0.0 < seconds && seconds <= longest && number(&network["iterations"]) > 0.0, "{network}");
    assert!(number(&measured["body_seconds"]) > 0.0 && number(&measured["evaluations"]) > 1.0, "{measured}");
    let forecast = &measured["forecast"];
    let splits = forecast["splits"].as_array().unwrap();
    for split in splits {
        assert!(number(&split["seconds"]) >= longest, "{split}");
    }
    let proposed = &forecast["proposal"];
    assert!(splits.contains(proposed) && forecast["of_case"].is_null() && number(&forecast["step_seconds"]) > 0.0);
    // The text is of another measurement, which may propose another split.
    let proposal =
        |split: &Value| format!("proposal   macro = {} and micro = {} in [scales]", split["macro"], split["micro"]);
    assert!(
        splits.iter().any(|split| text.contains(&proposal(split))) && text.contains(&format!("{samples} RVEs solved")),
        "{text}"
    );
}

/// Where the first step fails, the times up to the failure are reported; RVEs that are to be created later are solved too.
#[test]
fn all_cases_are_measured() {
    let (pressed, text) = measured(&PRESSED.replace("count = 5", "count = 1"));
    assert_eq!((&pressed["converged"], &pressed["networks"]), (&false.into(), &serde_json::json!([])));
    assert!(text.contains("the first load step did not converge") && text.contains("proposal   no ranks"), "{text}");
    let (waiting, text) = measured(&with_scales(&with_life_cycles(), (1, 3)));
    assert_eq!(waiting["forecast"]["of_case"]["micro"], 3);
    assert!(text.contains("this case    1 macro +      3 micro ranks: "), "{text}");
    let [network] = &waiting["networks"].as_array().unwrap()[..] else { panic!("{waiting}") };
    assert_eq!(network["rves"], 24, "all of the body");
    assert!(number(&network["seconds"]) > 0.0 && number(&waiting["evaluations"]) > 0.0, "{waiting}");
    assert_eq!(waiting["failures"], 0);
    // Their memory counts too.
    let bytes = |text: &str| {
        let folder = tempfile::tempdir().unwrap();
        write_case(folder.path(), "case.toml", text);
        line(folder.path(), "check case.toml --json").object()["memory"]["rves"].as_u64().unwrap()
    };
    let later = with_life_cycles();
    assert_eq!(bytes(&later), bytes(&later.replace("created_at = 0.025, ", "")));
}

/// `--ranks` plans a run on so many ranks, and starts none.
#[test]
fn a_check_is_for_the_requested_ranks() {
    let folder = tempfile::tempdir().unwrap();
    write_case(folder.path(), "case.toml", &fibers(&frozen()));
    let plan = line(folder.path(), "check case.toml --ranks 8 --measure --json").object();
    let of_case = &plan["measured"]["forecast"]["of_case"];
    assert_eq!((&plan["ranks"], &of_case["macro"], &of_case["micro"]), (&8.into(), &1.into(), &7.into()), "{plan}");
    assert!(line(folder.path(), "check case.toml --ranks 3").done().contains("ranks      3, with"));
    assert!(line(folder.path(), "check case.toml --ranks 1").done().contains("ranks      1, with"));
    assert!(line(folder.path(), "check case.toml --ranks 0").failed(2).contains("error: invalid --ranks 0\n"));
    write_case(folder.path(), "scales.toml", &with_scales(&fibers(&frozen()), (1, 3)));
    let failed = line(folder.path(), "check scales.toml --ranks 5");
    assert!(failed.failed(2).contains("start 4 ranks, or change [scales] in scales.toml"), "{}", failed.block());
}
