//! Networks from other sources: doubled fibers, older files, libraries of networks.

use std::path::Path;

use crate::{frozen, line};

const STRETCH: [&str; 2] = ["--F", "1.2 0 0 0 0.95 0 0 0 0.95"];

/// Returns the stress of a network by `biotissue rve`.
fn stress(folder: &Path, network: &str, scale: &str) -> Vec<f64> {
    let object =
        crate::biotissue(folder, &["rve", network, STRETCH[0], STRETCH[1], "--scale", scale, "--json"]).object();
    let rows = object["pk1"].as_array().unwrap();
    rows.iter().flat_map(|row| row.as_array().unwrap()).map(|value| value.as_f64().unwrap()).collect()
}

/// Checks that two networks have the same stress, up to the tolerance of the equilibrium.
fn assert_same_stress(folder: &Path, one: &str, other: &str) {
    for scale in ["raw", "0.003"] {
        let (one, other) = (stress(folder, one, scale), stress(folder, other, scale));
        let largest = one.iter().fold(0.0f64, |largest, x| largest.max(x.abs()));
        assert!(largest > 0.0);
        for (a, b) in one.iter().zip(&other) {
            assert!((a - b).abs() <= 1e-7 * largest, "{one:?} {other:?}");
        }
    }
}

/// Writes `double.txt`: the frozen network whose last six fibers are there twice, the last one with another law.
fn write_doubled(folder: &Path) {
    let text = std::fs::read_to_string(frozen()).unwrap();
    let (header, rest) = text.split_once('\n').unwrap();
    let words: Vec<&str> = header.split_whitespace().collect();
    let fibers: usize = words[1].parse().unwrap();
    let lines: Vec<&str> = rest.lines().collect();
    let again = lines[lines.len() - 6..].join("\n");
    let text = format!("{} {} 0\n{}\n{again}\n", words[0], fibers + 6, lines.join("\n"));
    std::fs::write(folder.join("double.txt"), text).unwrap();
    let mut params = format!("3 {}\n0 5e-8 1e8 1000\n0 7e-8 1e8 1000\n0 5e-8 3e7 1000\n", fibers + 6);
    params.push_str(&"0\n".repeat(fibers));
    params.push_str("1\n1\n0\n0\n0\n2\n");
    std::fs::write(folder.join("double.txt.params"), params).unwrap();
}

#[test]
fn cleaning_merges_doubled_fibers_of_one_law() {
    let folder = tempfile::tempdir().unwrap();
    write_doubled(folder.path());
    let before = line(folder.path(), "network check double.txt");
    let merged =
        "and 0 unsupported fibers, 0 nodes; 5 doubled fibers (merged with those of the same law beside them)\n";
    assert!(
        before.done().contains(&format!("to remove (--clean -o FILE): 0 short, 0 dangling {merged}")),
        "{}",
        before.stdout
    );
    let kept = "\n  not merged: 1 doubled fiber, since fibers with the same nodes have different laws\n";
    assert!(before.done().contains(kept), "{}", before.stdout);
    let cleaned = line(folder.path(), "network check double.txt --clean -o single.txt --json").object();
    assert_eq!((&cleaned["doubled_fibers"], &cleaned["kept_doubled_fibers"]), (&6.into(), &1.into()));
    assert_eq!(cleaned["removable"]["merged_fibers"], 5);
    assert_eq!((&cleaned["cleaned"]["doubled_fibers"], &cleaned["cleaned"]["fibers"]), (&1.into(), &152.into()));
    assert_eq!(cleaned["cleaned"]["laws"].as_array().unwrap().len(), 5);
    assert!(folder.path().join("single.txt.params").exists());
    assert_same_stress(folder.path(), "double.txt", "single.txt");
    let text = line(folder.path(), "network check single.txt");
    assert!(text.done().contains(kept) && text.done().contains("\n  nothing to remove\n"), "{}", text.stdout);
    // Without laws there are no areas to sum.
    std::fs::remove_file(folder.path().join("double.txt.params")).unwrap();
    let text = line(folder.path(), "network check double.txt");
    let kept = "\n  not merged: 6 doubled fibers, since the network has no laws\n";
    assert!(text.done().contains(kept) && text.done().contains("\n  nothing to remove\n"), "{}", text.stdout);
}

/// A network in the older format: chains along the axes of a cube of edge 2 through its center, and their links.
const OLDER: &str = "7 21 9\n1 1 7 -1 0.1 0 0.1 0 0\n2 2 7 1 0 -0.1 0.1 0 0\n3 3 7 0.2 -1 0 0.1 0 0\n4 4 7 0 1 0.1 0.1 0 0\n\
                     5 5 7 0 0.1 -1 0.1 0 0\n6 6 7 0.1 0 1 0.1 0 0\n7 1 3 -1 0.1 0 0.2 -1 0\n8 2 4 1 0 -0.1 0 1 0.1\n\
                     9 5 6 0 0.1 -1 0.1 0 1\n";

#[test]
fn older_files_are_read_everywhere_and_converted() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    std::fs::write(at("old.txt"), OLDER).unwrap();
    std::fs::write(
        at("old.txt.params"),
        format!("2 9\n0 5e-8 1e8 1000\n1 6e-8 1e7 1.2 1.4 1000\n0\n{}", "1\n".repeat(8)),
    )
    .unwrap();
    let info = line(folder.path(), "network info old.txt --json").object();
    assert_eq!((&info["nodes"], &info["fibers"], &info["interior_nodes"]), (&7.into(), &9.into(), &1.into()));
    assert_eq!(info["cube"]["edges"], serde_json::json!([2.0, 2.0, 2.0]));
    let done = line(folder.path(), "network convert old.txt new.txt");
    let text = "new.txt: 7 nodes, 9 fibers, 2 laws; lengths in units of the cube's edge, which is 2 in old.txt\n";
    assert_eq!((done.done(), done.stderr.as_str()), (text, ""));
    assert!(std::fs::read_to_string(at("new.txt")).unwrap().starts_with("7 9 0\n-0.5 0.05"));
    assert!(at("new.txt.params").exists() && at("new.txt.toml").exists());
    assert_same_stress(folder.path(), "old.txt", "new.txt");
    let case = crate::run::fibers("old.txt");
    crate::run::write_case(folder.path(), "case.toml", &case);
    line(folder.path(), "check case.toml").done();
    // A current file is written as it was, and an error names the line.
    let again = line(folder.path(), "network convert new.txt again.txt --json").object();
    assert_eq!(again["written"], "again.txt");
    assert_eq!(std::fs::read(at("new.txt")).unwrap(), std::fs::read(at("again.txt")).unwrap());
    std::fs::write(at("old.txt"), OLDER.replace("9 5 6", "9 5 8")).unwrap();
    let failed = line(folder.path(), "network convert old.txt bad.txt");
    assert!(failed.failed(2).starts_with("error: old.txt:10: there is no node 8\n"), "{}", failed.stderr);
    assert!(!at("bad.txt").exists());
}

/// Two parallel fibers that reach two faces of the cube: it keeps its size when the network is written.
#[test]
fn networks_that_do_not_reach_all_faces_keep_their_cube() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(
        folder.path().join("old.txt"),
        "4 12 2\n1 1 2 -0.5 0.2 0 0.5 0.2 0\n2 3 4 -0.5 -0.2 0 0.5 -0.2 0\n0.5\n",
    )
    .unwrap();
    let done = line(folder.path(), "network convert old.txt new.txt");
    assert!(
        done.done().contains(" 6 nodes, 2 fibers, no law; ") && done.stderr.contains("at its corners"),
        "{}",
        done.stderr
    );
    let info = line(folder.path(), "network info new.txt --json").object();
    assert_eq!((&info["total_length"], &info["cube"]["edges"][1]), (&2.0.into(), &1.0.into()));
    line(folder.path(), "network check new.txt --clean -o clean.txt").done();
    let info = line(folder.path(), "network info clean.txt --json").object();
    assert_eq!((&info["total_length"], &info["fibers"]), (&2.0.into(), &2.into()));
}

/// Every network of a pattern is read before the first error is reported.
#[test]
fn all_unreadable_networks_of_a_pattern_are_reported() {
    let folder = tempfile::tempdir().unwrap();
    let good = std::fs::read_to_string(frozen()).unwrap();
    std::fs::create_dir(folder.path().join("nets")).unwrap();
    let write = |number: usize, text: &str| {
        std::fs::write(folder.path().join(format!("nets/{number:02}.txt")), text).unwrap();
    };
    let bad = good.replacen("0.", "zero", 3);
    for number in 0..30 {
        write(number, if number % 10 == 4 { &bad } else { &good });
    }
    crate::run::write_case(folder.path(), "case.toml", &crate::run::fibers("nets/*.txt"));
    for command in ["check case.toml", "run case.toml"] {
        let failed = line(folder.path(), command);
        let block = failed.failed(2);
        let files: Vec<&str> = block.lines().filter(|line| line.contains(".txt:")).collect();
        assert_eq!(files.len(), 3, "{block}");
        for (line, name) in files.iter().zip(["nets/04.txt:2: ", "nets/14.txt:2: ", "nets/24.txt:2: "]) {
            assert!(line.contains(name), "{line}");
        }
        assert!(!block.contains(" more errors in this file") && !block.contains("\nand "), "{block}");
    }
    assert!(!folder.path().join("results").exists());
    let worse = "2 1 0\n0 0 zero\n1 one 1\n0 1\n";
    (0..25).for_each(|number| write(number, worse));
    let failed = line(folder.path(), "check case.toml");
    let block = failed.failed(2);
    assert_eq!(block.matches("`zero` is not a number (and 1 more error in this file)\n").count(), 20, "{block}");
    let others = block.split("\nand 5 more, also in:\n").nth(1).unwrap_or_else(|| panic!("{block}"));
    let names = ["20.txt", "21.txt", "22.txt", "23.txt", "24.txt"];
    assert!(others.lines().map(str::trim).zip(names).all(|(line, name)| line.ends_with(name)), "{block}");
}

#[test]
fn a_library_has_a_network_for_every_seed() {
    let folder = tempfile::tempdir().unwrap();
    let options = "network generate --points 12 --law linear --youngs-modulus 1e8 --radius 5e-8";
    let done = line(folder.path(), &format!("{options} --seed 9 --count 3 --directory nets/a"));
    let text = "nets/a/network-0009.txt to nets/a/network-0011.txt: 3 delaunay networks, ";
    assert!(done.done().starts_with(text) && done.stdout.lines().count() == 1, "{}", done.stdout);
    let names = || {
        let entries = std::fs::read_dir(folder.path().join("nets/a")).unwrap();
        let mut names: Vec<String> = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    };
    let expected = |seeds: std::ops::RangeInclusive<u32>| -> Vec<String> {
        let files = |seed| ["", ".params", ".toml"].map(|suffix| format!("network-{seed:04}.txt{suffix}"));
        seeds.flat_map(files).collect()
    };
    assert_eq!(names(), expected(9..=11));
    // Each network is that of a single call.
    let read = |name: &str| std::fs::read(folder.path().join(name)).unwrap();
    for seed in 9..=11 {
        line(folder.path(), &format!("{options} --seed {seed} -o one.txt")).done();
        for suffix in ["", ".params", ".toml"] {
            let (one, member) = (format!("one.txt{suffix}"), format!("nets/a/network-{seed:04}.txt{suffix}"));
            assert_eq!(read(&one), read(&member), "{member}");
        }
    }
    // Nothing is replaced; the library can be continued.
    let before = read("nets/a/network-0011.txt.toml");
    for first in [8, 10, 11] {
        let failed = line(folder.path(), &format!("{options} --seed {first} --count 4 --directory nets/a"));
        let block = failed.failed(2);
        assert!(block.contains("exists") && block.contains("; nothing is written\n"), "{block}");
        assert_eq!(names(), expected(9..=11));
    }
    std::fs::write(folder.path().join("nets/a/network-0013.txt.toml"), "mine").unwrap();
    let failed = line(folder.path(), &format!("{options} --seed 12 --count 2 --directory nets/a"));
    assert!(failed.failed(2).starts_with("error: nets/a/network-0013.txt.toml exists; nothing"), "{}", failed.stderr);
    std::fs::remove_file(folder.path().join("nets/a/network-0013.txt.toml")).unwrap();
    let more = line(folder.path(), &format!("{options} --seed 12 --count 2 --directory nets/a --json"));
    let objects: Vec<serde_json::Value> = more.done().lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let seeds: Vec<_> = objects.iter().map(|object| object["generated"]["seed"].as_u64().unwrap()).collect();
    assert_eq!((seeds, names()), (vec![12, 13], expected(9..=13)));
    assert_eq!(read("nets/a/network-0011.txt.toml"), before);
    for (options, start) in [
        ("--count 0 --directory b", "error: --count is 0\n"),
        ("--count 2 --seed 9223372036854775807 --directory b", "error: --seed 9223372036854775807 and --count 2 give"),
        ("--count 2 --directory b --nodes 9", "error: more than one option gives the size"),
    ] {
        let failed = line(folder.path(), &format!("network generate --points 12 {options}"));
        assert!(failed.failed(2).starts_with(start), "{}", failed.stderr);
    }
    for options in ["", "--count 2", "--directory b", "--count 2 --directory b -o one.txt"] {
        let refused = line(folder.path(), &format!("network generate --points 12 {options}"));
        assert_eq!((refused.code, refused.stdout.as_str()), (2, ""), "{options}");
    }
    assert!(!folder.path().join("b").exists());
}

/// Every network is scaled to the unit cube, its radius is not: in a cube of edge 4, the radius divided by 4 gives a
/// sixteenth of the raw stress.
#[test]
fn the_raw_stress_refers_to_the_edge_of_the_cube() {
    let folder = tempfile::tempdir().unwrap();
    let text = std::fs::read_to_string(frozen()).unwrap();
    let is_node = |line: &str| line.contains('.');
    let times_four = |line: &str| {
        let numbers = line.split_whitespace().map(|word| (4.0 * word.parse::<f64>().unwrap()).to_string());
        numbers.collect::<Vec<_>>().join(" ")
    };
    let lines = text.lines().map(|line| if is_node(line) { times_four(line) } else { line.to_owned() });
    std::fs::write(folder.path().join("large.txt"), lines.collect::<Vec<_>>().join("\n")).unwrap();
    for command in ["info", "check"] {
        let printed = line(folder.path(), &format!("network {command} large.txt"));
        let edge = "\n  cube             edge 4 in the file; lengths below are relative to it\n";
        assert!(printed.done().contains(edge), "{}", printed.stdout);
        let object = line(folder.path(), &format!("network {command} large.txt --json")).object();
        assert_eq!(object["cube"]["edges"], serde_json::json!([4.0, 4.0, 4.0]));
    }
    let raw = |network: &str, radius: &str| {
        let law = ["--law", "linear", "--youngs-modulus", "1e8", "--radius", radius, "--json"];
        let object = crate::biotissue(folder.path(), &[&["rve", network, STRETCH[0], STRETCH[1]], &law[..]].concat());
        object.object()["pk1"][0][0].as_f64().unwrap()
    };
    let (unit, large, relative) = (raw(&frozen(), "8e-8"), raw("large.txt", "8e-8"), raw("large.txt", "2e-8"));
    assert!(unit > 0.0 && (large - unit).abs() < 1e-9 * unit, "{unit} {large}");
    assert!((16.0 * relative - unit).abs() < 1e-9 * unit, "{unit} {relative}");
}
