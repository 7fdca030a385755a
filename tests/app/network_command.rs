//! `biotissue network`, run as a program.
use std::path::Path;
use std::process::{Command, Output};

/// Runs `biotissue network` with arguments in one line; underscores stand for spaces within an argument.
fn biotissue(folder: &Path, arguments: &str) -> Output {
    Command::new(env!("CARGO_BIN_EXE_biotissue"))
        .current_dir(folder)
        .arg("network")
        .args(arguments.split_whitespace().map(|argument| argument.replace('_', " ")))
        .output()
        .unwrap()
}

fn text(bytes: &[u8]) -> &str {
    std::str::from_utf8(bytes).unwrap()
}

#[test]
fn generate_check_and_info_agree() {
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
    let words = biotissue(folder.path(), "check net.txt --shorter-than 0.2 --clean -o clean.txt");
    let fibers = check["cleaned"]["fibers"].as_u64().unwrap();
    let after = text(&words.stdout).split("after cleaning\n").nth(1).unwrap();
    assert!(after.contains(&format!("\n  fibers           {fibers} (")) && after.contains("  rigidity "), "{after}");
    let again = biotissue(folder.path(), "info clean.txt --json");
    let again: serde_json::Value = serde_json::from_slice(&again.stdout).unwrap();
    assert!(again["fibers"].as_u64().unwrap() <= info["fibers"].as_u64().unwrap() - short);
    assert_eq!((&again["laws"], &again["fibers"]), (&info["laws"], &check["cleaned"]["fibers"]));
    // A network that replaces another does not inherit its laws.
    assert!(biotissue(folder.path(), "generate --nodes 300 -o net.txt").status.success());
    assert!(!folder.path().join("net.txt.params").exists());
}

/// Both commands apply the increments in the same way; this network has more than one equilibrium.
#[test]
fn draw_shows_the_equilibrium_that_rve_finds() {
    let folder = tempfile::tempdir().unwrap();
    assert!(biotissue(folder.path(), "generate --kind voronoi --points 40 -o v.txt").status.success());
    let pressed = "--F 0.7_0_0_0_1_0_0_0_1 --steps 5 --law linear --youngs-modulus 1e8 --radius 5e-8";
    let drawn = biotissue(folder.path(), &format!("draw v.txt -o deep/v.vtp {pressed}"));
    assert!(drawn.status.success(), "{}", text(&drawn.stderr));
    let solved = Command::new(env!("CARGO_BIN_EXE_biotissue"))
        .current_dir(folder.path())
        .args(["rve", "v.txt", "--json"])
        .args(pressed.split_whitespace().map(|word| word.replace('_', " ")))
        .output()
        .unwrap();
    let solved: serde_json::Value = serde_json::from_slice(&solved.stdout).unwrap();
    let drawn = biotissue::app::results::read_vtp(&folder.path().join("deep/v.vtp")).unwrap();
    let along = |&[a, b]: &[u32; 2]| {
        let d = [0, 1, 2].map(|k| drawn.points[b as usize][k] - drawn.points[a as usize][k]);
        d[0] * d[0] / d.iter().map(|x| x * x).sum::<f64>()
    };
    let mean = drawn.fibers.iter().map(along).sum::<f64>() / drawn.fibers.len() as f64;
    let expected = solved["orientation"]["current"][0][0].as_f64().unwrap();
    assert!((mean - expected).abs() < 1e-10, "{mean} {expected}");
}

#[test]
fn failures_have_a_message_and_an_exit_code() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("broken.txt"), "2 1 0\n0 0 0\n1 1 1\n0 2\n").unwrap();
    for (arguments, code, message) in [
        ("generate --kind vornoi --points 9 -o x.txt", 2, "error: there is no kind of network called `vornoi`"),
        ("generate -o x.txt", 2, "error: no option gives the size of the network"),
        ("generate --points 9 --density 30 -o x.txt", 2, "error: more than one option gives the size"),
        ("generate --nodes 300 --points 9 -o x.txt", 2, "error: more than one option gives the size"),
        ("generate --nodes 3 -o x.txt", 2, "error: no network can be generated: 3 nodes requested"),
        ("generate --density 0.5 -o x.txt", 2, "error: no network can be generated: a density of 0.5 requested"),
        ("generate --density 1e9 -o x.txt", 2, "error: no network can be generated: a density of 1000000000 requested"),
        ("generate --points 9 --align 1_0_0 -o x.txt", 2, "error: --align without --strength S"),
        ("generate --points 9 --strength 0.5 -o x.txt", 2, "error: --strength without --align"),
        (
            "generate --points 9 --align 0_0_0 --strength 0.5 -o x.txt",
            2,
            "error: no network can be generated: the direction",
        ),
        ("generate --points 9 --align 1_0 --strength 0.5 -o x.txt", 2, "error: invalid --align \"1 0\""),
        (
            "generate --points 9 --align 1_0_0 --strength 1 -o x.txt",
            2,
            "error: no network can be generated: the strength of the alignment is 1;",
        ),
        (
            "generate --points 9 --align 1_0_0 --strength -1 -o x.txt",
            2,
            "error: no network can be generated: the strength of the alignment is -1;",
        ),
        ("generate --points 9 --merge 1 -o x.txt", 2, "error: no network can be generated: the merge length is 1 "),
        ("generate --points 9 --shorter-than 0 -o x.txt", 2, "error: --shorter-than is 0"),
        ("check broken.txt broken.txt --clean -o x.txt", 2, "error: --clean with 2 network files"),
        ("draw broken.txt -o x.txt", 2, "error: invalid --output x.txt"),
        ("draw broken.txt -o x.svg", 2, "error: broken.txt:4: there is no node 2"),
        ("draw broken.txt -o x.svg --color stretch", 2, "error: --color stretch of a network at rest"),
        ("draw broken.txt -o x.svg --width 3", 2, "error: invalid --width 3"),
        ("draw broken.txt -o x.svg --steps 0 --F 1_0_0_0_1_0_0_0_1", 2, "error: invalid --steps 0"),
        ("draw broken.txt -o x.svg --steps 2", 2, "error: the following required arguments were not provided"),
        (
            "draw broken.txt -o x.svg --law linear --youngs-modulus 1 --radius 1",
            2,
            "error: --law of a network at rest, where no fiber carries a force",
        ),
        (
            "generate --density 60 --align 1_1_0 --strength 0.95 -o x.txt",
            2,
            "error: no network can be generated: no fiber crosses the face ",
        ),
        ("draw broken.txt -o x.svg --F 1_0_0_0_1_0_0_0_-1", 2, "error: --F has determinant -1"),
        ("check broken.txt --backend none", 2, "error: broken.txt:4: there is no node 2"),
        ("generate --points 0 -o x.txt", 2, "error: no network can be generated: 0 points requested"),
        ("generate --points 9 -o broken.txt/x.txt", 4, "error: broken.txt/x.txt: cannot be written: "),
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
        let by_clap = stderr.contains("Usage: ");
        assert!(by_clap || (stderr.contains("\n  expected: ") && stderr.contains("\n  cure: ")), "{stderr}");
        assert!(output.stdout.is_empty());
    }
    assert!(!folder.path().join("x.txt").exists() && !folder.path().join("x.svg").exists());
}

#[test]
fn generate_and_info_print_the_same_statistics() {
    let folder = tempfile::tempdir().unwrap();
    let size = "--kind voronoi --density 45 --align 1_-1_0 --strength 0.5 --seed 3 -o gel.txt";
    let json = |arguments: &str| -> serde_json::Value {
        let output = biotissue(folder.path(), arguments);
        assert!(output.status.success(), "{arguments}: {}", text(&output.stderr));
        serde_json::from_slice(&output.stdout).unwrap()
    };
    let made = json(&format!("generate {size} --json"));
    assert!((made["density"].as_f64().unwrap() / 45.0 - 1.0).abs() < 0.05, "{}", made["density"]);
    assert!((made["order_of_alignment"].as_f64().unwrap() - 0.5).abs() < 0.1, "{}", made["order_of_alignment"]);
    let params = &made["generated"];
    assert_eq!(
        (&params["kind"], &params["strength"], &params["merge"]),
        (&"voronoi".into(), &0.5.into(), &0.05.into())
    );
    assert_eq!(params["align"], serde_json::json!([1.0, -1.0, 0.0]));
    assert!(params.get("min_distance").is_none() && params.get("shorter_than").is_none(), "{params}");
    assert_eq!(made["unsupported_components"], 0);
    let info = json("info gel.txt --json");
    for key in ["nodes", "fibers", "length", "total_length", "orientation", "order", "coordination", "components"] {
        assert_eq!(made[key], info[key], "{key}");
    }
    assert!(info["rigidity"]["zero_modes"].as_u64().unwrap() > 20);
    let mean = made["length"]["mean"].as_f64().unwrap();
    assert!((mean * made["fibers"].as_f64().unwrap() / 45.0 - 1.0).abs() < 0.05);
    assert!(made["length"]["deviation"].as_f64().unwrap() > 0.2 * mean);
    let words = biotissue(folder.path(), &format!("generate {size}"));
    for line in ["nodes ", "fiber length ", "density ", "coordination ", "orientation ", "by length ", "order "] {
        assert!(text(&words.stdout).contains(&format!("\n  {line}")) || line == "by length ", "{line}");
    }
    // The same parameters give the same file.
    let once = std::fs::read(folder.path().join("gel.txt")).unwrap();
    json("generate --kind voronoi --density 45 --align 1,-1,0 --strength 0.5 --seed 3 -o gel2.txt --json");
    assert_eq!(once, std::fs::read(folder.path().join("gel2.txt")).unwrap());
}

#[test]
fn several_files_are_checked_at_once() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("broken.txt"), "2 1 0\n0 0 0\n1 1 1\n0 2\n").unwrap();
    for (kind, file) in [("voronoi", "gel.txt"), ("delaunay", "web.txt")] {
        let made = biotissue(folder.path(), &format!("generate --kind {kind} --points 15 -o {file}"));
        assert!(made.status.success(), "{}", text(&made.stderr));
    }
    let both = biotissue(folder.path(), "check gel.txt web.txt --json");
    let lines: Vec<serde_json::Value> =
        text(&both.stdout).lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let [gel, web] = &lines[..] else { panic!("{lines:?}") };
    assert_eq!((&web["rigidity"]["zero_modes"], &web["rigidity"]["most_mobile"]), (&0.into(), &serde_json::json!([])));
    let found = &gel["rigidity"];
    assert!(found["zero_modes"].as_u64() > Some(20) && found["most_mobile"][0]["mobility"].as_f64() > Some(0.5));
    assert_eq!(found["unknowns"], gel["free_dofs"]);
    // Valid files are reported although another file is broken.
    let with_broken = biotissue(folder.path(), "check broken.txt gel.txt");
    assert_eq!(with_broken.status.code(), Some(2));
    assert!(text(&with_broken.stdout).contains("floppy: at rest the network does not resist"));
    assert!(text(&with_broken.stderr).starts_with("error: broken.txt:4: there is no node 2"));
}

#[test]
fn a_network_is_drawn_at_rest_and_deformed() {
    let folder = tempfile::tempdir().unwrap();
    let run = |arguments: &str| {
        let output = biotissue(folder.path(), arguments);
        assert!(output.status.success(), "{arguments}: {}", text(&output.stderr));
        text(&output.stdout).to_owned()
    };
    run("generate --points 12 --seed 1 -o web.txt");
    assert_eq!(run("draw web.txt -o rest.svg --title the_web"), "rest.svg\n");
    let picture = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap();
    assert!(picture("rest.svg").starts_with("<svg ") && picture("rest.svg").contains(">the web</text>"));
    let law = "--law exponential --youngs-modulus 1e8 --radius 5e-8 --nonlinearity 1.2";
    let deformed = format!("--F 1.2_0.1_0_0_0.9_0_0_0_0.95 --steps 2 {law}");
    run(&format!("draw web.txt -o stretched.svg {deformed}"));
    assert!(picture("stretched.svg").contains(">fiber stretch</text>"));
    run(&format!("draw web.txt -o pulled.svg {deformed} --color force --axis x --width 600"));
    assert!(picture("pulled.svg").contains(">fiber force in "));
    // The same state as a VTK file: `F` maps the boundary nodes, and stretches are current over reference lengths.
    run(&format!("draw web.txt -o stretched.vtp {deformed}"));
    let drawn = biotissue::app::results::read_vtp(&folder.path().join("stretched.vtp")).unwrap();
    let network = biotissue::fiber::network::file::read(&folder.path().join("web.txt")).unwrap().network;
    for &node in network.boundary() {
        let ([x, y, z], moved) = (network.nodes()[node as usize], drawn.points[node as usize]);
        let expected = [1.2 * x + 0.1 * y, 0.9 * y, 0.95 * z];
        assert!((0..3).all(|k| (moved[k] - expected[k]).abs() < 1e-14), "{moved:?} {expected:?}");
    }
    assert_eq!(drawn.fibers, network.fibers());
    for (fiber, &[a, b]) in drawn.fibers.iter().enumerate() {
        let [a, b] = [a, b].map(|node| drawn.points[node as usize]);
        let length = (0..3).map(|k| (b[k] - a[k]).powi(2)).sum::<f64>().sqrt();
        assert!((drawn.stretch[fiber] - length / network.lengths()[fiber]).abs() < 1e-12);
        assert_eq!(drawn.force[fiber] > 0.0, drawn.stretch[fiber] > 1.0);
    }
    // Without a law there is no equilibrium.
    let refused = biotissue(folder.path(), "draw web.txt -o x.svg --F 1.1_0_0_0_1_0_0_0_1");
    assert_eq!(refused.status.code(), Some(2));
    assert!(text(&refused.stderr).contains("cure: give --law"), "{}", text(&refused.stderr));
}

#[test]
fn several_networks_are_cleaned_and_seeds_without_a_network_are_passed_over() {
    let folder = tempfile::tempdir().unwrap();
    let run = |arguments: &str| {
        let output = biotissue(folder.path(), arguments);
        (output.status.code(), text(&output.stdout).to_owned(), text(&output.stderr).to_owned())
    };
    for name in ["a", "b"] {
        assert_eq!(run(&format!("generate --points 9 -o {name}.txt")).0, Some(0));
    }
    let (code, _, stderr) = run("check a.txt b.txt --clean --directory clean");
    assert_eq!(code, Some(0), "{stderr}");
    assert!(["clean/a.txt", "clean/b.txt"].iter().all(|name| folder.path().join(name).is_file()));
    let (code, _, stderr) = run("check a.txt clean/a.txt --clean --directory other");
    assert!(code == Some(2) && stderr.contains("two of the networks would be written to other/a.txt"), "{stderr}");
    let (code, _, stderr) = run("check a.txt --clean");
    assert!(code == Some(2) && stderr.contains("--clean without a place to write to"), "{stderr}");
    let (code, _, stderr) = run("convert a.txt -o again.txt");
    assert!(code == Some(0) && folder.path().join("again.txt").is_file(), "{stderr}");

    // So few points that the fibers of some seeds miss a face.
    let (code, stdout, stderr) =
        run("generate --points 2 --kind voronoi --align 1_0_0 --strength 0.6 --count 6 --directory few");
    assert_eq!(code, Some(0), "{stderr}");
    let skipped = stderr.matches("the next seed takes its place").count();
    assert!(skipped > 0 && stdout.contains(&format!("{skipped} seed")), "{stdout}{stderr}");
    let networks = std::fs::read_dir(folder.path().join("few")).unwrap();
    let networks = networks.filter(|entry| entry.as_ref().unwrap().path().extension().unwrap() == "txt");
    assert_eq!(networks.count(), 6);
}
