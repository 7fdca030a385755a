//! The part of the report page on the ranks of a run.

use std::path::Path;

use biotissue::app::report::directory::Directory;
use biotissue::app::report::ranks::timeline::Timeline;

use crate::balance::{BY_ITERATIONS, restless, uneven};
use crate::ranks::{read, with_scales};
use crate::run::{events, fibers, run};
use crate::{frozen, line};

/// Returns the page of the results in `out`.
fn page(folder: &Path) -> String {
    line(folder, "report out").done();
    read(folder, "out/report.html")
}

/// Returns the values of a row of the table of ranks.
fn row<'a>(page: &'a str, name: &str) -> Vec<&'a str> {
    let (_, table) = page.split_once("some rank idle</th>").unwrap();
    let (_, row) = table.split_once(&format!("<tr><td>{name}</td>")).unwrap();
    let (row, _) = row.split_once("</tr>").unwrap();
    row.split("<td>").skip(1).map(|cell| cell.trim_end_matches("</td>")).collect()
}

/// Returns the number of status charts of a page.
fn status_charts(page: &str) -> usize {
    page.matches("aria-label=\"status of the ranks\"").count()
}

#[test]
fn a_run_on_ranks_has_its_status_its_deviations_and_a_table() {
    let folder = tempfile::tempdir().unwrap();
    let text = uneven(&fibers(&frozen())).replace("cells = [1, 1, 1]", "cells = [2, 2, 1]");
    let text = restless(&text, (2, 3), BY_ITERATIONS);
    run(folder.path(), &text, "--out out").done();
    let page = page(folder.path());
    assert_eq!(status_charts(&page), 1);
    for words in [
        "<h2>Ranks</h2>",
        ">macro scale<",
        ">rank 4<",
        ">migration<",
        "Some rank of the macro scale is idle for",
        "Run on 2 + 3 ranks.",
        "aria-label=\"deviation of seconds\"",
        "aria-label=\"deviation of iterations\"",
    ] {
        assert!(page.contains(words), "{words}");
    }
    assert!(!page.contains(">rank 5<") && !page.contains("failed attempt<"));
    let events = events(&folder.path().join("out"));
    let count = |kind: &str| events.iter().filter(|event| event["event"] == kind).count().to_string();
    let total = row(&page, "total");
    assert_eq!((total.len(), total[0], total[7]), (12, &*count("ranks"), &*count("migration")));
    let moved = |name: &str| row(&page, name)[8].parse::<usize>().unwrap();
    assert!(moved("total") > 0 && moved("1") + moved("2") == moved("total"));

    let written = line(folder.path(), "report out --charts charts");
    assert!(written.done().contains("charts/rank-status.svg\n"), "{}", written.stdout);
    for name in ["rank-status", "rank-seconds", "rank-iterations", "convergence"] {
        let svg = read(folder.path(), &format!("charts/{name}.svg"));
        assert!(svg.starts_with("<svg ") && page.contains(&svg), "{name}");
    }

    let directory = Directory::open(&folder.path().join("out")).unwrap();
    let timeline = Timeline::of(&directory.rank_runs[0]);
    assert_eq!((timeline.ranks.len(), timeline.ends.len()), (5, 2));
    assert_eq!(timeline.migrations.len().to_string(), count("migration"));
    for segments in &timeline.ranks {
        assert!(!segments.is_empty());
        assert!(segments.windows(2).all(|pair| pair[0].end <= pair[1].start), "{segments:?}");
        assert!(segments.iter().all(|segment| 0.0 <= segment.start && segment.end <= timeline.seconds));
    }
}

/// Each continuation has its own ranks; one in a single process has no chart.
#[test]
fn a_resumed_run_has_charts_of_each_part() {
    let folder = tempfile::tempdir().unwrap();
    let text = fibers(&frozen());
    let resume = |ranks: &str| {
        std::fs::remove_file(folder.path().join("out/checkpoint/step-00002.bin")).unwrap();
        run(folder.path(), &text, &format!("--ranks {ranks} --out out --resume")).done();
        page(folder.path())
    };
    run(folder.path(), &text, "--out out --ranks 1").done();
    let alone = page(folder.path());
    assert!(!alone.contains("Ranks</h2>") && status_charts(&alone) == 0);
    let continued = resume("3");
    assert_eq!(status_charts(&continued), 1);
    assert!(continued.contains("Run on 1 + 2 ranks, resumed after step 1.") && row(&continued, "total")[0] != "0");

    run(folder.path(), &text, "--ranks 3 --out out").done();
    let continued = resume("5");
    assert_eq!(status_charts(&continued), 2);
    assert!(
        continued.contains("Run on 1 + 2 ranks.") && continued.contains("Run on 1 + 4 ranks, resumed after step 1.")
    );
    assert_eq!(status_charts(&resume("1")), 1, "the second step was repeated in one process");
}

#[test]
fn runs_that_failed_and_logs_that_end_early_have_charts() {
    let folder = tempfile::tempdir().unwrap();
    let text = fibers(&frozen()).replace("x = 0.05", "x = -1.5").replace("count = 2", "count = 1\nmax_cuts = 1");
    run(folder.path(), &with_scales(&text, (1, 2)), "--out out").failed(3);
    let page = || page(folder.path());
    let failed = page();
    assert!(status_charts(&failed) == 1 && failed.contains(">failed attempt<"), "{failed}");
    assert!(!failed.contains("some rank idle</th>"), "no step has shares");
    let log = folder.path().join("out/log.jsonl");
    let whole = std::fs::read_to_string(&log).unwrap();
    let (before, _) = whole.split_once("{\"event\":\"cut\"").unwrap();
    std::fs::write(&log, format!("{before}{{\"event\":\"cu")).unwrap();
    let early = page();
    assert!(status_charts(&early) == 1 && !early.contains(">failed attempt<"));
    // A log of an old version, and one without any time.
    let old = r#"{"event":"start"}
{"event":"ranks","ranks":[{"busy":1.0},{"busy":2.0,"rves":3}]}
{"event":"step","step":1,"t":1.0,"newton":{},"scales":{}}"#;
    std::fs::write(&log, format!("{old}\n")).unwrap();
    let of_old = page();
    assert_eq!((status_charts(&of_old), row(&of_old, "total")[3]), (1, "\u{2013}"));
    std::fs::write(&log, format!("{}\n", old.replace("\"busy\":1.0", "").replace("\"busy\":2.0,", ""))).unwrap();
    assert_eq!(status_charts(&page()), 0);
}
