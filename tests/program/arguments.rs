//! Valid and malformed arguments of every kind.

use std::ffi::OsString;

use crate::run::{PRESSED, write_case};
use crate::{biotissue, frozen, keys, line};

#[test]
fn every_command_succeeds_with_valid_arguments() {
    let folder = tempfile::tempdir().unwrap();
    let info = line(folder.path(), "info --json").object();
    assert_eq!(keys(&info), ["backends", "features", "threads", "version"]);
    assert_eq!(info["version"], env!("CARGO_PKG_VERSION"));
    let backends: Vec<&str> =
        info["backends"].as_array().unwrap().iter().map(|backend| backend["name"].as_str().unwrap()).collect();
    assert_eq!(backends, biotissue::backends::compiled());
    assert!(line(folder.path(), "info").done().starts_with(concat!("biotissue  ", env!("CARGO_PKG_VERSION"), "\n")));
    assert_eq!(line(folder.path(), "--version").done(), concat!("biotissue ", env!("CARGO_PKG_VERSION"), "\n"));

    let made = line(folder.path(), "network generate --points 12 --seed 3 -o net.txt");
    assert!(made.done().starts_with("net.txt: ") && made.stderr.is_empty());
    let checked = line(folder.path(), "network check net.txt");
    assert!(checked.done().starts_with("net.txt\n") && checked.done().contains("  parts            "));
    assert_eq!(line(folder.path(), "network info net.txt --json").object()["interior_nodes"], 12);

    let mesh = line(folder.path(), "mesh box --cells 2,1,1 -o box.msh --json").object();
    assert_eq!((&mesh["elements"], &mesh["nodes"]), (&12.into(), &12.into()));
    assert!(line(folder.path(), "mesh dogbone --element-size 0.004 -o bone.msh").done().contains("region    gauge"));
    let generated = "generate = { shape = \"box\", cells = [1, 1, 1], size = [1.0, 1.0, 1.0] }";
    let case = PRESSED.replace(generated, "file = \"box.msh\"").replace("x = -1.5", "x = -0.1");
    write_case(folder.path(), "case.toml", &case);
    line(folder.path(), "check case.toml").done();
    line(folder.path(), "run case.toml").done();
    assert_eq!(line(folder.path(), "report results --picture a.svg").done(), "a.svg\n");
}

#[test]
fn help_is_printed_on_stdout() {
    let folder = tempfile::tempdir().unwrap();
    let help = line(folder.path(), "--help");
    for command in ["run", "check", "rve", "network", "mesh", "report", "info"] {
        assert!(help.done().contains(&format!("\n  {command} ")), "{command}: {}", help.stdout);
        let help = line(folder.path(), &format!("{command} --help"));
        assert!(help.done().contains(&format!("Usage: biotissue {command}")) && help.stderr.is_empty());
    }
    for command in ["", "network", "mesh", "run", "rve", "report", "nonsense", "run --nonsense"] {
        let usage = line(folder.path(), command);
        assert_eq!((usage.code, usage.stdout.as_str()), (2, ""), "{command}");
        assert!(usage.stderr.contains("Usage: biotissue"), "{command}: {}", usage.stderr);
    }
}

/// A value with a leading minus sign is a number, never an unknown option.
#[test]
fn a_minus_sign_after_a_numeric_option_begins_a_number() {
    let folder = tempfile::tempdir().unwrap();
    write_case(folder.path(), "case.toml", PRESSED);
    let network = frozen();
    let rve = ["rve", &network, "--F", "1 0 0 0 1 0 0 0 1"];
    let law = ["rve", &network, "--F", "1 0 0 0 1 0 0 0 1", "--law", "exponential-stretch"];
    let commands: [(&[&str], &[&str]); 9] = [
        (&["run", "case.toml"], &["--threads", "--ranks"]),
        (&["check", "case.toml"], &["--threads"]),
        (&rve, &["--scale", "--steps", "--tolerance", "--F"]),
        (&law, &["--youngs-modulus", "--radius", "--nonlinearity", "--transition"]),
        (&["network", "generate", "-o", "n.txt"], &["--points", "--nodes", "--seed", "--density", "--merge"]),
        (&["network", "generate", "-o", "n.txt", "--points", "9"], &["--strength", "--align", "--shorter-than"]),
        (&["network", "check", &network], &["--shorter-than"]),
        (&["network", "draw", &network, "-o", "n.svg"], &["--F", "--steps", "--width"]),
        (&["report", "."], &["--step"]),
    ];
    for (command, options) in commands {
        for option in options {
            let mut arguments = command.to_vec();
            arguments.extend([*option, "-3"]);
            let refused = biotissue(folder.path(), &arguments);
            assert_eq!((refused.code, refused.stdout.as_str()), (2, ""), "{arguments:?}: {}", refused.stderr);
            assert!(!refused.stderr.contains("unexpected argument"), "{arguments:?}: {}", refused.stderr);
        }
    }
    for shape in ["box --cells -1,1,1", "box --cells 1,1,1 --size -1,1,1", "dogbone --element-size -1"] {
        let refused = line(folder.path(), &format!("mesh {shape} -o a.msh"));
        assert_eq!(refused.code, 2, "{}", refused.stderr);
        assert!(!refused.stderr.contains("unexpected argument"), "{shape}: {}", refused.stderr);
    }
}

/// The program ends with one of its own exit codes, whatever its arguments.
#[test]
fn no_argument_causes_a_panic() {
    let folder = tempfile::tempdir().unwrap();
    write_case(folder.path(), "case.toml", PRESSED);
    let network = frozen();
    let rve = ["rve", &network, "--F", "1.1 0 0 0 1 0 0 0 1"];
    let law = ["--law", "exponential-stretch", "--youngs-modulus", "1", "--radius", "1"];
    let curve = ["--nonlinearity", "1", "--transition", "1.2"];
    let with_law = [&rve[..], &law, &curve].concat();
    let commands: [(&[&str], &[&str]); 11] = [
        (&["run", "case.toml", "--out", "out"], &["--threads", "--ranks", "--backend"]),
        (&["check"], &["", "--threads", "--backend"]),
        (&["rve", &network], &["--F", "--scale"]),
        (&with_law, &["--scale", "--steps", "--tolerance", "--backend", "--law"]),
        (&["rve", &network, "--F", "1 0 0 0 1 0 0 0 1", "--law", "linear", "--radius", "1"], &["--youngs-modulus"]),
        (&["network", "generate", "-o", "n.txt"], &["--points", "--nodes", "--seed", "--kind", "--density"]),
        (
            &["network", "generate", "-o", "n.txt", "--points", "9", "--align", "1 0 0"],
            &["--strength", "--align", "--merge", "--shorter-than"],
        ),
        (&["network", "check", &network], &["--shorter-than", "--clean", "--backend"]),
        (&["network", "draw", &network, "-o", "n.svg"], &["--F", "--title", "--color", "--width", "--axis"]),
        (&["mesh", "box", "--cells", "1,1,1", "-o", "b.msh"], &["--size", "--format"]),
        (&["report", "case.toml"], &["--step", "--field", "--axis"]),
    ];
    let values = ["", " ", "-", "--", "-0", "nan", "-inf", "1e999", "5e-324", "18446744073709551616", "\u{221e}"];
    for (command, options) in commands {
        for option in options {
            for value in values {
                let mut arguments: Vec<OsString> = command.iter().map(OsString::from).collect();
                arguments.extend([*option, value].iter().filter(|a| !a.is_empty()).map(OsString::from));
                biotissue(folder.path(), &arguments);
            }
        }
    }
}

#[test]
#[cfg(unix)]
fn file_names_need_not_be_utf8() {
    use std::os::unix::ffi::OsStringExt;
    let folder = tempfile::tempdir().unwrap();
    let name = OsString::from_vec(b"a\xff.toml".to_vec());
    assert_eq!(biotissue(folder.path(), &[OsString::from("run"), name.clone()]).code, 2);
    std::fs::write(folder.path().join(&name), PRESSED.replace("x = -1.5", "x = -0.1")).unwrap();
    let out = OsString::from_vec(b"out\xff".to_vec());
    let done = biotissue(folder.path(), &["run".into(), name, "--out".into(), out.clone()]);
    assert_eq!(done.code, 0, "{}", done.stderr);
    assert!(folder.path().join(out).join("loads.csv").is_file());
}
