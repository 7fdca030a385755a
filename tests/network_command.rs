//! `biotissue network` as people run it.
#![cfg(feature = "app")]

use std::path::Path;
use std::process::{Command, Output};

fn biotissue(folder: &Path, arguments: &str) -> Output {
    Command::new(env!("CARGO_BIN_EXE_biotissue"))
        .current_dir(folder)
        .arg("network")
        .args(arguments.split_whitespace())
        .output()
        .unwrap()
}

fn text(bytes: &[u8]) -> &str {
    std::str::from_utf8(bytes).unwrap()
}

#[test]
fn generate_check_and_info_go_together() {
    let folder = tempfile::tempdir().unwrap();
    let law = "--law exponential-stretch --youngs-modulus 1e8 --radius 5e-8 --nonlinearity 1.2 --transition 1.4";
    let made = biotissue(folder.path(), &format!("generate --kind delaunay --points 30 --seed 7 -o net.txt {law}"));
    assert!(made.status.success(), "{}", text(&made.stderr));
    assert!(text(&made.stdout).starts_with("net.txt: "), "{}", text(&made.stdout));
    for beside in ["net.txt", "net.txt.params", "net.txt.toml"] {
        assert!(folder.path().join(beside).is_file(), "{beside}");
    }
    let info = biotissue(folder.path(), "info net.txt --json");
    let info: serde_json::Value = serde_json::from_slice(&info.stdout).unwrap();
    assert_eq!((&info["interior_nodes"], &info["free_dofs"]), (&30.into(), &90.into()));
    assert_eq!(info["laws"][0]["name"], "exponential-stretch");
    assert_eq!(info["warnings"], serde_json::json!([]));
    let check = biotissue(folder.path(), "check net.txt --shorter-than 0.2 --clean -o clean.txt --json");
    assert!(check.status.success(), "{}", text(&check.stderr));
    let check: serde_json::Value = serde_json::from_slice(&check.stdout).unwrap();
    let short = check["removable"]["short_fibers"].as_u64().unwrap();
    assert!(short > 0);
    let again = biotissue(folder.path(), "info clean.txt --json");
    let again: serde_json::Value = serde_json::from_slice(&again.stdout).unwrap();
    assert!(again["fibers"].as_u64().unwrap() <= info["fibers"].as_u64().unwrap() - short);
    assert_eq!(again["laws"], info["laws"]);
    // A network written over another does not keep the other's laws.
    assert!(biotissue(folder.path(), "generate --nodes 300 -o net.txt").status.success());
    assert!(!folder.path().join("net.txt.params").exists());
}

#[test]
fn what_cannot_be_done_is_told_with_its_exit_code() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("broken.txt"), "2 1 0\n0 0 0\n1 1 1\n0 2\n").unwrap();
    for (arguments, code, message) in [
        ("generate --kind voronoi --points 9 -o x.txt", 2, "error: there is no kind of network called `voronoi`"),
        ("generate --points 0 -o x.txt", 2, "error: no network can be generated: 0 points asked for"),
        ("generate --points 9 -o absent/x.txt", 4, "error: absent/x.txt: cannot be written: "),
        (
            "generate --points 9 -o x.txt --law exponential --youngs-modulus 1 --radius 1",
            2,
            "error: the law `exponential` needs a nonlinearity",
        ),
        ("generate --points 9 -o x.txt --radius 1", 2, "error: the following required arguments were not provided"),
        ("check broken.txt", 2, "error: broken.txt:4: there is no node 2"),
        ("check absent.txt", 2, "error: absent.txt: cannot be read: "),
        ("check broken.txt --shorter-than 2", 2, "error: --shorter-than is 2"),
    ] {
        let output = biotissue(folder.path(), arguments);
        let stderr = text(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{arguments}: {stderr}");
        assert!(stderr.starts_with(message), "{arguments}: {stderr}");
        assert!(output.stdout.is_empty());
    }
    assert!(!folder.path().join("x.txt").exists());
}
