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
