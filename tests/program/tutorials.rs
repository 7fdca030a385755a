//! The tutorials: every file that they show is written, and every command is executed.

use std::path::Path;
use std::process::Command;

use crate::skip::skip;

/// A part of a tutorial.
enum Part {
    /// A file: its name and its content.
    File(String, String),
    /// Commands of a shell.
    Commands(String),
}

/// Returns the files and commands of a tutorial, in order. A file is a block after a line with nothing but its name as code;
/// commands are in a block `sh`.
fn parts(text: &str) -> Vec<Part> {
    let (mut parts, mut lines, mut file) = (Vec::new(), text.lines(), None);
    while let Some(line) = lines.next() {
        if let Some(language) = line.strip_prefix("```") {
            let block: String =
                lines.by_ref().take_while(|line| *line != "```").map(|line| format!("{line}\n")).collect();
            match file.take() {
                Some(name) => parts.push(Part::File(name, block)),
                None if language == "sh" => parts.push(Part::Commands(block)),
                None => {}
            }
        } else if !line.is_empty() {
            let name = line.strip_prefix('`').and_then(|rest| rest.strip_suffix('`'));
            file = name.filter(|name| !name.contains(['`', ' '])).map(str::to_owned);
        }
    }
    parts
}

/// Follows a tutorial in an empty folder; returns what its commands print.
fn followed(name: &str) -> String {
    let tutorials = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/tutorials");
    let text = std::fs::read_to_string(tutorials.join(name)).unwrap();
    let folder = tempfile::tempdir().unwrap();
    if text.contains("plate.msh") {
        std::fs::copy(tutorials.join("plate.msh"), folder.path().join("plate.msh")).unwrap();
    }
    let program = Path::new(env!("CARGO_BIN_EXE_biotissue")).parent().unwrap();
    let path = format!("{}:{}", program.display(), std::env::var("PATH").unwrap());
    let (mut printed, mut commands) = (String::new(), 0);
    for part in parts(&text) {
        match part {
            Part::File(file, content) => {
                let kept = tutorials.join(&file);
                assert!(!kept.exists() || std::fs::read_to_string(kept).unwrap() == content, "{file} in {name}");
                std::fs::write(folder.path().join(file), content).unwrap();
            }
            Part::Commands(block) => {
                let mut shell = Command::new("bash");
                shell.args(["-e", "-u", "-o", "pipefail", "-c", &block]).current_dir(folder.path()).env("PATH", &path);
                let output = shell.output().unwrap();
                let [out, err] =
                    [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes).into_owned());
                assert!(output.status.success(), "{name}:\n{block}\n{out}\n{err}");
                // On a slow machine, a run is interrupted before its first step is complete.
                let unexpected = |line: &&str| line.contains("warning") && !line.contains("no checkpoint");
                assert_eq!(err.lines().find(unexpected), None, "{name}:\n{block}");
                printed += &out;
                commands += 1;
            }
        }
    }
    assert!(commands > 1, "{name}: {commands} blocks of commands");
    printed
}

/// Returns the text of a tutorial and the line in it that begins with a command.
fn line_of(name: &str, command: &str) -> (String, String) {
    let tutorials = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/tutorials");
    let text = std::fs::read_to_string(tutorials.join(name)).unwrap();
    let line = text.lines().find(|line| line.starts_with(command)).expect(command).to_owned();
    (text, line)
}

fn is_installed(program: &str) -> bool {
    Command::new(program).arg("--version").output().is_ok_and(|output| output.status.success())
}

/// Runs a command of a shell in a folder and returns what it prints.
fn shell(folder: &Path, command: &str) -> String {
    let program = Path::new(env!("CARGO_BIN_EXE_biotissue")).parent().unwrap();
    let path = format!("{}:{}", program.display(), std::env::var("PATH").unwrap());
    let mut shell = Command::new("bash");
    shell.args(["-e", "-u", "-o", "pipefail", "-c", command]).current_dir(folder).env("PATH", &path);
    let output =
        shell.envs([("OMPI_ALLOW_RUN_AS_ROOT", "1"), ("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1")]).output().unwrap();
    let [out, err] = [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes).into_owned());
    assert!(output.status.success(), "{command}\n{out}\n{err}");
    out
}

/// Writes the files of a tutorial that have these names.
fn write_files(folder: &Path, text: &str, names: &[&str]) {
    for part in parts(text) {
        if let Part::File(name, content) = part
            && names.contains(&name.as_str())
        {
            std::fs::write(folder.join(name), content).unwrap();
        }
    }
}

/// The mesh that Gmsh writes has the regions and surfaces of the tutorial; its elements differ from version to version.
#[test]
fn gmsh_meshes_the_plate() {
    if !is_installed("gmsh") {
        return skip("needs gmsh");
    }
    let (text, command) = line_of("2-your-own-mesh.md", "gmsh ");
    let folder = tempfile::tempdir().unwrap();
    write_files(folder.path(), &text, &["plate.geo", "plate.toml"]);
    shell(folder.path(), &command);
    let plan = shell(folder.path(), "biotissue check plate.toml");
    let has = |words: &str| assert!(plan.contains(words), "`{words}` is not in\n{plan}");
    ["regions    gel", "surface \"left\" (", " faces, 2.0000e-5 m^2)"].iter().for_each(|words| has(words));
}

/// The lines of the jobs that start the ranks: with one thread each, and with several threads bound to cores.
#[cfg(feature = "mpi")]
#[test]
fn the_jobs_of_the_cluster_run() {
    if !is_installed("mpirun") {
        return skip("needs mpirun");
    }
    let (text, command) = line_of("5-on-a-cluster.md", "mpirun ");
    let _turn = crate::ranks::processes::one_at_a_time();
    let folder = tempfile::tempdir().unwrap();
    write_files(folder.path(), &text, &["pull.toml"]);
    let generate = parts(&text).into_iter().find_map(|part| match part {
        Part::Commands(block) if block.contains("network generate") => Some(block),
        _ => None,
    });
    shell(folder.path(), &generate.unwrap());
    // A scheduler gives the number of ranks.
    let printed = shell(folder.path(), &command.replace("mpirun ", "mpirun --oversubscribe -n 4 "));
    assert!(printed.contains("6 load steps") && printed.contains("micro ranks idle for "), "{printed}");
    shell(folder.path(), "biotissue run pull.toml --out alone && cmp alone/loads.csv results/loads.csv");
    let (_, bound) = line_of("5-on-a-cluster.md", "mpirun --map-by ");
    // A machine of two cores has no room for eight threads a rank.
    let bound = bound.replace("mpirun --map-by slot:PE=8 ", "mpirun --map-by slot:PE=1:OVERSUBSCRIBE -n 2 ");
    let bound = bound.replace("--threads 8", "--threads 2").replace("--resume", "--out bound");
    assert!(bound.contains("--out bound --time-out 600 --threads 2"), "{bound}");
    let printed = shell(folder.path(), &bound);
    assert!(printed.contains("6 load steps") && printed.contains("micro ranks idle for "), "{printed}");
    shell(folder.path(), "cmp alone/loads.csv bound/loads.csv");
}

fn assert_printed(name: &str, expected: &[&str]) {
    let printed = followed(name);
    expected.iter().for_each(|words| assert!(printed.contains(words), "{name}: `{words}` is not in\n{printed}"));
}

#[test]
fn a_dogbone_is_pulled() {
    // 20 N/m in the first step, 36 N/m in the last one.
    let expected = ["960 elements", "rigid: ", "0.001 m  0.0199 N\n", "0.009 m  0.2398 N\n0.010 m  0.2760 N\n"];
    assert_printed("1-pull-a-dogbone.md", &expected);
}

#[test]
fn a_mesh_of_gmsh_becomes_a_two_scale_run() {
    let expected = ["surface \"left\" (20 faces, 2.0000e-5 m^2)", "5 load steps", "proposal ", "two-scale.svg"];
    assert_printed("2-your-own-mesh.md", &expected);
}

#[test]
fn networks_are_rigid_or_floppy() {
    let expected = ["rigidity         rigid", "does not resist 195 of 957 motions", "P (Pa)           1.649"];
    assert_printed("3-your-own-networks.md", &expected);
}

#[test]
fn two_parameters_are_fitted() {
    assert_printed("4-fit-a-law.md", &["E = 2.984e+07 Pa, B = 4.046"]);
}

#[test]
fn ranks_and_interruptions_change_no_bit() {
    assert_printed("5-on-a-cluster.md", &["micro ranks idle for ", "forecast "]);
}

#[test]
fn all_tutorials_are_listed() {
    let tutorials = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/tutorials");
    let list = std::fs::read_to_string(tutorials.join("README.md")).unwrap();
    for entry in std::fs::read_dir(&tutorials).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        assert!(!name.ends_with(".md") || name == "README.md" || list.contains(&format!("]({name})")), "{name}");
    }
}
