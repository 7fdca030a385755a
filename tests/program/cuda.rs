//! Graphics processors, on machines without one: what is missing is reported, by one rank.
#![cfg(feature = "cuda")]

use std::path::Path;

use crate::run::{fibers, write_case};
use crate::{frozen, line, skip};

/// Writes two cases, of which `device.toml` solves its RVEs on a device. Returns false if there is a device.
fn has_no_device(folder: &Path) -> bool {
    if biotissue::backends::cuda::Device::open(0).is_ok() {
        skip::skip("there is a device");
        return false;
    }
    let text = fibers(&frozen());
    write_case(folder, "case.toml", &text);
    write_case(folder, "device.toml", &format!("{text}\n[micro]\ndevice = \"cuda\"\n"));
    true
}

#[test]
fn a_missing_device_is_reported_once() {
    let folder = tempfile::tempdir().unwrap();
    if !has_no_device(folder.path()) {
        return;
    }
    for arguments in ["case.toml --backend cuda", "device.toml", "device.toml --ranks 3"] {
        let outcome = line(folder.path(), &format!("run {arguments} --out results"));
        let message = outcome.failed(2).lines().next().unwrap();
        assert_eq!(outcome.stderr.contains("error: rank "), arguments.contains("ranks"), "{}", outcome.stderr);
        let missing = ["libcuda.so", "libnvrtc.so", "CUDA device number", "the CUDA driver failed"];
        assert!(missing.iter().any(|missing| message.contains(missing)), "{arguments}: {message}");
        assert!(!folder.path().join("results/loads.csv").exists(), "{arguments}");
    }
}

#[test]
fn a_body_without_rves_needs_no_device() {
    const BODY: &str = r#"
[mesh]
generate = { shape = "box", cells = [2, 1, 1], size = [2.0, 1.0, 1.0] }
[[region]]
name = "*"
material = { model = "neo-hookean", youngs_modulus = 1e3, poisson_ratio = 0.3 }
[[boundary]]
surface = "x0"
displacement = { x = 0.0, y = 0.0, z = 0.0 }
[[boundary]]
surface = "x1"
displacement = { x = 0.1, y = 0.0, z = 0.0 }
[steps]
count = 1
[micro]
device = "cuda"
"#;
    let folder = tempfile::tempdir().unwrap();
    write_case(folder.path(), "body.toml", BODY);
    line(folder.path(), "run body.toml --out results").done();
}

/// A check needs no device. It says that few RVEs do not pay there, and counts the memory through which they would get there.
#[test]
fn a_check_needs_no_device() {
    let folder = tempfile::tempdir().unwrap();
    if !has_no_device(folder.path()) {
        return;
    }
    let bytes = |case: &str| {
        let plan = line(folder.path(), &format!("check {case} --json")).object();
        plan["memory"]["networks"].as_u64().unwrap()
    };
    assert!(bytes("device.toml") > bytes("case.toml"));
    let outcome = line(folder.path(), "check device.toml");
    outcome.done();
    let warning = "the largest number of RVEs of a network is 6: set `device = \"none\"`";
    assert!(outcome.stderr.contains(warning), "{}", outcome.stderr);
}
