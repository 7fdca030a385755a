//! Errors and warnings on a terminal: their number, length and characters, and the mistakes that they name.

use std::path::Path;

use biotissue::app::results::read_vtu;

use crate::run::{PRESSED, fibers, run, write_case};
use crate::{biotissue, frozen, line};

/// Checks that a text contains no control characters and no very long lines.
fn assert_printable(text: &str) {
    assert!(!text.chars().any(|c| c.is_control() && c != '\n'), "{text:?}");
    assert!(text.lines().all(|line| line.chars().count() < 1000), "{text}");
}

#[test]
fn at_most_twenty_errors_are_shown() {
    let folder = tempfile::tempdir().unwrap();
    let boundary = "[[boundary]]\nsurface = \"x0\"\ndisplacement = { x = 1.0 }\n";
    let done = run(folder.path(), &format!("{PRESSED}{}", boundary.repeat(1000)), "");
    let text = done.failed(2);
    assert_eq!(text.matches("surface \"x0\" has x prescribed here and at line 8").count(), 20, "{text}");
    assert!(text.ends_with("\nand 980 more\n"), "{text}");
    assert!(text.len() < 10_000, "{} bytes", text.len());
    let point = "[[point]]\nat = [0.0, 0.0, 0.0]\ndisplacement = { x = 0.0, y = 0.0 }\n";
    let done = run(folder.path(), &format!("{PRESSED}{}", point.repeat(1000)), "");
    assert!(done.failed(2).ends_with("\nand 979 more\n"), "{}", done.stderr);
}

/// Text from files and arguments is escaped, because an escape sequence could clear the screen or fake a success.
#[test]
fn quoted_text_is_short_and_printable() {
    let folder = tempfile::tempdir().unwrap();
    let network = frozen();
    let wild = format!("\u{1b}[2J\u{7}\u{9b}1m\u{202e}{}", "x".repeat(100_000));
    let identity = "1 0 0 0 1 0 0 0 1";
    for arguments in [
        vec!["rve", &network, "--F", &wild],
        vec!["rve", &network, "--F", identity, "--scale", &wild],
        vec!["rve", &network, "--F", identity, "--law", &wild],
        vec!["rve", &network, "--F", identity, "--tolerance", &wild],
        vec!["rve", &network, "--F", identity, "--backend", &wild],
        vec!["run", &wild],
        vec![&wild],
    ] {
        let outcome = biotissue(folder.path(), &arguments);
        assert_eq!(outcome.code, 2);
        assert_printable(&outcome.stderr);
    }
    for text in [
        format!("{wild}\n"),
        format!("[mesh]\n\"{}\" = 1\n", wild.replace(|c: char| c.is_control(), "\\u001b")),
        PRESSED.replace("\"x0\"", &format!("\"{}\"", wild.replace(|c: char| c.is_control(), "\\u001b"))),
        PRESSED.replace("count = 5", &format!("count = {}", "9".repeat(100_000))),
    ] {
        assert_printable(run(folder.path(), &text, "").failed(2));
    }
    for text in [format!("9 8 {wild}\n"), wild.clone(), format!("1 0 0\n0 0 {wild}\n")] {
        std::fs::write(folder.path().join("net.txt"), text).unwrap();
        assert_printable(line(folder.path(), "network check net.txt").failed(2));
    }
    for text in [
        wild.clone(),
        format!("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n${wild}\n"),
        format!("$MeshFormat\n2.2 0 8 {wild}\n"),
        format!("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n{wild}\n"),
    ] {
        std::fs::write(folder.path().join("a.msh"), text).unwrap();
        assert_printable(&run(folder.path(), &with_mesh("a.msh"), "").stderr);
    }
    std::fs::write(folder.path().join("curve.csv"), format!("1,0\n{wild},1\n")).unwrap();
    let table =
        fibers(&network).replace("name = \"linear\", youngs_modulus = 1.0e8", "name = \"table\", file = \"curve.csv\"");
    let refused = run(folder.path(), &table, "");
    assert_eq!(refused.code, 2);
    assert_printable(&refused.stderr);
}

fn with_mesh(file: &str) -> String {
    let generated = "generate = { shape = \"box\", cells = [1, 1, 1], size = [1.0, 1.0, 1.0] }";
    PRESSED.replace(generated, &format!("file = \"{file}\"")).replace("x = -1.5", "x = -0.1")
}

/// Some editors write a byte-order mark at the beginning of a text file.
#[test]
fn a_byte_order_mark_is_skipped_in_every_file() {
    let folder = tempfile::tempdir().unwrap();
    let marked = |name: &str, text: &str| std::fs::write(folder.path().join(name), format!("\u{feff}{text}")).unwrap();
    line(folder.path(), "mesh box --cells 1,1,1 -o box.msh").done();
    let mesh = std::fs::read_to_string(folder.path().join("box.msh")).unwrap();
    marked("marked.msh", &mesh);
    marked("net.txt", &std::fs::read_to_string(frozen()).unwrap());
    marked("net.txt.params", &std::fs::read_to_string(frozen() + ".params").unwrap());
    marked("net.txt.toml", "[units]\nlength = \"m\"\n");
    marked("curve.csv", "0.9,-1e6\n1,0\n1.1,1e6\n");
    marked("amsi.conf", "@util\nresults there\n");
    marked("case.toml", &with_mesh("marked.msh"));
    assert_eq!(line(folder.path(), "run case.toml --amsi amsi.conf --json").object()["steps"], 5);
    assert!(folder.path().join("there/loads.csv").is_file());
    let own = fibers("net.txt").replace("law = { name = \"linear\", youngs_modulus = 1.0e8, radius = 5.0e-8 }", "");
    marked("case.toml", &own);
    line(folder.path(), "check case.toml").done();
    let table = "name = \"table\", file = \"curve.csv\"";
    marked("case.toml", &fibers("net.txt").replace("name = \"linear\", youngs_modulus = 1.0e8", table));
    line(folder.path(), "check case.toml").done();
    // The table is valid only with its first point, so that the mark was not read as a header.
    marked("curve.csv", "1,0\n1.1,1e6\n");
    line(folder.path(), "check case.toml").done();
}

/// Returns the first line of the message, which names the mistake and its place.
fn first_line(folder: &Path, text: &str) -> String {
    let outcome = run(folder, text, "");
    outcome.failed(2).lines().next().unwrap().to_owned()
}

#[test]
fn messages_name_the_mistake_and_its_line() {
    let folder = tempfile::tempdir().unwrap();
    let message = |text: &str| first_line(folder.path(), text);

    let bone = PRESSED.replace(
        "generate = { shape = \"box\", cells = [1, 1, 1], size = [1.0, 1.0, 1.0] }",
        "generate = { shape = \"dogbone\", element_size = 0.5 }",
    );
    let bone = bone.replace("\"x0\"", "\"left\"").replace("\"x1\"", "\"right\"");
    assert!(message(&bone).starts_with("error: case.toml:4: the element size 0.5 exceeds the "), "{}", message(&bone));
    let scaled = PRESSED.replace("size = [1.0, 1.0, 1.0] }", "size = [1.0, 1.0, 1.0] }\nscale = 1e-200");
    let what = "error: case.toml:4: the mesh cannot be scaled by 1e-200: element 0 ";
    assert!(message(&scaled).starts_with(what), "{}", message(&scaled));
    let cells = PRESSED.replace("[1, 1, 1]", "[1000, 1000, 100]");
    let what = "error: case.toml:4: 600000000 elements are more than the 50000000 that are allowed";
    assert_eq!(message(&cells), what);
    let point = format!("{PRESSED}[[point]]\nnode = 8\ndisplacement = {{ x = 0.0 }}\n");
    assert_eq!(message(&point), "error: case.toml:16: there is no node 8: the mesh has nodes 0 to 7");
    let conflict = PRESSED.replace("[steps]", "[[boundary]]\nsurface = \"y0\"\ndisplacement = { x = 0.5 }\n[steps]");
    let what =
        "error: case.toml:14: node 0 is given two x-displacements: 0e0 m by surface `x0` and 5e-1 m by surface `y0`";
    assert!(message(&conflict).starts_with(what), "{}", message(&conflict));

    line(folder.path(), "mesh box --cells 1,1,1 -o box.msh").done();
    let surface = with_mesh("box.msh").replace("\"x1\"", "\"top\"");
    let surface_message = message(&surface);
    assert!(surface_message.starts_with("error: case.toml:11: the mesh /"), "{surface_message}");
    assert!(surface_message.ends_with("/box.msh has no surface \"top\""), "{surface_message}");
    let mesh = std::fs::read_to_string(folder.path().join("box.msh")).unwrap();
    std::fs::write(folder.path().join("bad.msh"), mesh.replacen("$Nodes", "$\n$Nodes", 1)).unwrap();
    let line_of_nodes = mesh.lines().position(|line| line == "$Nodes").unwrap() + 1;
    let section_message = message(&with_mesh("bad.msh"));
    let what = format!("/bad.msh:{line_of_nodes}: a `$` without the name of a section");
    assert!(section_message.ends_with(&what), "{section_message}");

    std::fs::copy(frozen(), folder.path().join("net.txt")).unwrap();
    let sidecar = "[generated]\nkind = \"delaunay\"\npoints = 12\nseed = 99999999999999999999\nprogram = \"p\"\n";
    std::fs::write(folder.path().join("net.txt.toml"), sidecar).unwrap();
    let seed_message = message(&fibers("net.txt"));
    let what = "/net.txt.toml:4: `seed` is the whole number 99999999999999999999";
    assert!(seed_message.ends_with(what), "{seed_message}");
}

#[test]
fn check_and_run_warn_of_inconsistent_units() {
    let folder = tempfile::tempdir().unwrap();
    let long = PRESSED.replace("size = [1.0, 1.0, 1.0]", "size = [80.0, 40.0, 20.0]");
    write_case(folder.path(), "case.toml", &long);
    let edge =
        "warning: case.toml:4: the body measures 80 x 40 x 20 m: if the mesh is in mm, set `scale = 0.001` in [mesh]\n";
    for command in ["check case.toml", "run case.toml --ranks 1"] {
        let outcome = line(folder.path(), command);
        assert!(outcome.stderr.starts_with(edge), "{}", outcome.stderr);
        assert_eq!(outcome.stderr.matches("warning: ").count(), 1, "{}", outcome.stderr);
    }
    // The traction is 100 MPa, although the stiffness of the network is at most 50 kPa.
    let pulled = fibers(&frozen()).replace("displacement = { x = 0.05 }", "traction = [1.0e8, 0.0, 0.0]");
    write_case(folder.path(), "case.toml", &pulled);
    let checked = line(folder.path(), "check case.toml");
    checked.done();
    let traction = "warning: case.toml:15: the traction on surface \"x1\" is 1.0e8 Pa, 2000 times the stiffness of the region \
                    \"*\", about 5.0e4 Pa: are both in Pa?\n";
    assert_eq!(checked.stderr, traction);
    write_case(folder.path(), "case.toml", &fibers(&frozen()));
    assert_eq!(line(folder.path(), "check case.toml").stderr, "");
}

/// There is one warning per file for all its doubled fibers, and at most 20 warnings for a library of networks.
#[test]
fn doubled_fibers_cause_one_warning_per_file() {
    let folder = tempfile::tempdir().unwrap();
    let whole = std::fs::read_to_string(frozen()).unwrap();
    let fibers_of_it = whole.lines().next().unwrap().split_whitespace().nth(1).unwrap();
    let count: usize = fibers_of_it.parse().unwrap();
    let mut lines: Vec<String> = whole.lines().map(str::to_owned).collect();
    lines[0] = lines[0].replacen(fibers_of_it, &(count + 2).to_string(), 1);
    let last = lines.last().unwrap().clone();
    lines.extend([last.clone(), last.split_whitespace().rev().collect::<Vec<_>>().join(" ")]);
    std::fs::create_dir(folder.path().join("nets")).unwrap();
    for k in 0..25 {
        std::fs::write(folder.path().join(format!("nets/{k:02}.txt")), lines.join("\n")).unwrap();
    }
    let done = run(folder.path(), &fibers("nets/00.txt"), "--ranks 1");
    done.done();
    let (network, warning) = ("nets/00.txt", "2 fibers join two nodes that another fiber already joins");
    assert_eq!(done.stderr.matches(warning).count(), 1, "{}", done.stderr);
    assert!(done.stderr.lines().any(|line| line.starts_with("warning: ") && line.contains(&format!("{network}:"))));
    write_case(folder.path(), "case.toml", &fibers("nets/*.txt"));
    let checked = line(folder.path(), "check case.toml");
    checked.done();
    assert_eq!(checked.stderr.lines().count(), 21, "{}", checked.stderr);
    assert!(checked.stderr.ends_with("warning: and 5 more\n"), "{}", checked.stderr);
    let report = line(folder.path(), "network check nets/00.txt --json").object();
    assert_eq!((&report["doubled_fibers"], &report["fibers"]), (&2.into(), &(count + 2).into()));
    let text = line(folder.path(), "network check nets/00.txt");
    assert!(
        text.done().contains("\n  doubled fibers   2 join the same two nodes as another fiber\n"),
        "{}",
        text.stdout
    );
}

/// The Cauchy stress `P F^T / J` of a linear-elastic body would not be symmetric; the written stress is that of small
/// strains.
#[test]
fn the_stress_of_linear_elasticity_is_that_of_small_strains() {
    let folder = tempfile::tempdir().unwrap();
    let sheared = PRESSED.replace("neo-hookean", "linear-elastic").replace("x = -1.5, y = 0.0", "x = 0.0, y = 0.4");
    run(folder.path(), &sheared, "--out out").done();
    let fields = read_vtu(&folder.path().join("out/fields-00005.vtu")).unwrap();
    let stress = fields.cell_tensor("cauchy_stress").unwrap();
    let gradients = fields.cell_tensor("deformation_gradient").unwrap();
    let (mu, lambda) = (1.0e3 / 2.6, 1.0e3 * 0.3 / (1.3 * 0.4));
    for (sigma, f) in stress.iter().zip(gradients) {
        let trace = f[0] + f[4] + f[8] - 3.0;
        for (k, &found) in sigma.iter().enumerate() {
            let (i, j) = (k / 3, k % 3);
            let delta = if i == j { 1.0 } else { 0.0 };
            let expected = mu * (f[k] + f[3 * j + i] - 2.0 * delta) + lambda * trace * delta;
            assert!((found - expected).abs() < 1e-9 * mu, "{i}{j}: {found} {expected}");
        }
    }
}
