//! A run that was interrupted and resumed gives the results of an uninterrupted run.

mod intervals;
mod left_behind;
mod pieces;

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use biotissue::app::Progress;
use biotissue::app::case::Case;
use biotissue::app::checkpoint::{CheckpointError, Mismatch};
use biotissue::app::results::log::{self, Cut, Step};
use biotissue::app::results::{Collection, Event, read_vtp, read_vtu};
use biotissue::app::run::{ResumeError, Resumed, Simulation, SimulationError};
use biotissue::backends::sparse::Sparse;

/// A block of 12 elements pulled along x, whose material is fibers in a soft matrix.
const CASE: &str = r#"
title = "pull"
[mesh]
generate = { shape = "box", cells = [2, 1, 1], size = [2.0, 1.0, 1.0] }
[[region]]
name = "*"
[region.material]
model = "fiber-rve"
networks = ["NETWORK"]
fiber_volume_fraction = 0.003
law = { name = "exponential", youngs_modulus = 1.0e8, radius = 5.0e-8, nonlinearity = 1.2 }
matrix = { model = "neo-hookean", shear_modulus = 1000.0, poisson_ratio = 0.3 }
[[boundary]]
surface = "x0"
displacement = { x = 0.0, y = 0.0, z = 0.0 }
[[boundary]]
surface = "x1"
displacement = { x = 0.4 }
[[point]]
at = [2.0, 0.0, 0.0]
displacement = { y = 0.0, z = 0.0 }
[steps]
count = 4
[output]
rve = [0, 7]
"#;

fn case(text: &str) -> Case {
    let network = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/networks/frozen.txt");
    let text = text.replace("NETWORK", network.to_str().unwrap());
    Case::parse(&text, Path::new("/nowhere/pull.toml")).unwrap_or_else(|errors| panic!("{errors}")).case
}

fn simulation(text: &str) -> Simulation<Sparse> {
    Simulation::new((), case(text)).unwrap_or_else(|error| panic!("{error}"))
}

fn run(text: &str, dir: &Path) {
    simulation(text).run(dir, &mut ()).unwrap_or_else(|error| panic!("{error}"));
}

fn resume(text: &str, dir: &Path) -> Resumed {
    let mut simulation = simulation(text);
    let resumed = simulation.resume(dir).unwrap_or_else(|error| panic!("{error}"));
    simulation.run(dir, &mut ()).unwrap_or_else(|error| panic!("{error}"));
    resumed
}

/// Copies the results while a step is being recorded: the state of the directory if the run is killed at that moment.
struct Killed<'a> {
    from: &'a Path,
    to: &'a Path,
    step: usize,
}

impl Progress for Killed<'_> {
    fn converged(&mut self, step: &Step) {
        if step.step == self.step {
            copy(self.from, self.to);
        }
    }

    fn failed(&mut self, _: &Cut) {}
}

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let path = entry.unwrap().path();
        let goal = to.join(path.file_name().unwrap());
        if path.is_dir() { copy(&path, &goal) } else { fs::copy(&path, &goal).map(drop).unwrap() }
    }
}

/// Returns the contents of all files except the log, whose times differ, and the lock of a killed run.
fn contents(dir: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut files = BTreeMap::new();
    let mut folders = vec![dir.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if !path.ends_with("log.jsonl") && !path.ends_with(".biotissue.lock") {
                files.insert(path.strip_prefix(dir).unwrap().to_owned(), fs::read(&path).unwrap());
            }
        }
    }
    files
}

/// Returns the results of an uninterrupted run, and of one that was killed while it recorded its third step.
fn whole_and_killed(root: &Path) -> (PathBuf, PathBuf) {
    let (whole, killed) = (root.join("whole"), root.join("killed"));
    simulation(CASE).run(&whole, &mut Killed { from: &whole, to: &killed, step: 3 }).unwrap();
    (whole, killed)
}

#[track_caller]
fn assert_same(a: &Path, b: &Path) {
    let (a, b) = (contents(a), contents(b));
    assert_eq!(a.keys().collect::<Vec<_>>(), b.keys().collect::<Vec<_>>());
    for (name, content) in &a {
        assert!(*content == b[name], "{} differs", name.display());
    }
}

/// Returns the main files of the checkpoints, after checking that each has its pieces and that there are no other files.
fn checkpoints(dir: &Path) -> Vec<String> {
    let (mains, pieces): (Vec<String>, Vec<String>) =
        checkpoint_files(dir).into_iter().partition(|name| name.matches('-').count() == 1);
    let of_main = |name: &String| ["-body-0000.bin", "-part-0000.bin"].map(|end| name.replace(".bin", end));
    let expected: Vec<String> = mains.iter().flat_map(of_main).collect();
    assert_eq!(pieces, expected);
    mains
}

fn checkpoint_files(dir: &Path) -> Vec<String> {
    let entries = fs::read_dir(dir.join("checkpoint")).unwrap();
    let mut names: Vec<String> = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn a_killed_run_is_resumed_bitwise() {
    let root = tempfile::tempdir().unwrap();
    let (whole, killed) = whole_and_killed(root.path());
    assert_eq!(checkpoints(&killed), ["step-00001.bin", "step-00002.bin"], "the third checkpoint is not yet written");
    assert_eq!(fs::read_to_string(killed.join("loads.csv")).unwrap().lines().count(), 4, "row 3 is written");

    let resumed = resume(CASE, &killed);
    assert_eq!(resumed, Resumed { step: 2, warnings: vec![] });
    assert_eq!(checkpoints(&killed), ["step-00003.bin", "step-00004.bin"]);
    assert_same(&whole, &killed);
    assert_eq!(Collection::read(killed.join("fields.pvd")).unwrap().entries().len(), 4);

    let events = log::read(&killed.join("log.jsonl")).unwrap();
    let from: Vec<usize> =
        events.iter().filter_map(|e| if let Event::Start(s) = e { Some(s.resumed_from) } else { None }).collect();
    assert_eq!(from, [0, 2]);
    let steps: Vec<usize> =
        events.iter().filter_map(|e| if let Event::Step(s) = e { Some(s.step) } else { None }).collect();
    assert_eq!(steps, [1, 2, 3, 4]);
    assert!(matches!(events.last(), Some(Event::End(end)) if end.converged && end.steps == 4));

    // A completed run has no steps left.
    assert_eq!(resume(CASE, &killed).step, 4);
    assert_same(&whole, &killed);
}

#[test]
fn a_run_is_resumed_from_the_checkpoint_before_a_damaged_one() {
    let root = tempfile::tempdir().unwrap();
    let (whole, killed) = whole_and_killed(root.path());
    let newest = killed.join("checkpoint/step-00002.bin");
    let bytes = fs::read(&newest).unwrap();
    fs::write(&newest, &bytes[..bytes.len() / 2]).unwrap();
    fs::write(killed.join("checkpoint/.step-00003.bin.77.part"), "half").unwrap();

    let resumed = resume(CASE, &killed);
    assert_eq!(resumed.step, 1);
    assert!(matches!(&resumed.warnings[..], [one] if one.contains("step-00002.bin: damaged")), "{resumed:?}");
    assert_same(&whole, &killed);

    for name in checkpoint_files(&killed) {
        fs::write(killed.join("checkpoint").join(name), b"BIOTISSU").unwrap();
    }
    let error = simulation(CASE).resume(&killed).unwrap_err();
    assert!(matches!(error, ResumeError::Checkpoint(CheckpointError::Damaged { .. })), "{error}");
}

#[test]
fn a_checkpoint_of_another_run_is_rejected() {
    let root = tempfile::tempdir().unwrap();
    let dir = root.path().join("results");
    run(CASE, &dir);
    let before = contents(&dir);
    let refused = |text: &str| match simulation(text).resume(&dir).unwrap_err() {
        ResumeError::Checkpoint(CheckpointError::OtherRun(path, reason)) => {
            assert!(path.ends_with("checkpoint/step-00004.bin"));
            reason
        }
        error => panic!("{error}"),
    };
    let reason = refused(&CASE.replace("count = 4", "count = 5"));
    assert_eq!(reason.to_string(), "the case differs in [steps]: `count = 4` before, `count = 5` now");
    let reason = refused(&CASE.replace("x = 0.4", "x = 0.5"));
    assert!(matches!(&reason, Mismatch::Case { section, .. } if section == "[[boundary]]"), "{reason}");
    let reason = refused(&CASE.replace("cells = [2,", "cells = [3,"));
    assert!(matches!(&reason, Mismatch::Case { section, .. } if section == "[mesh]"), "{reason}");
    let fewer = CASE.replace("[[point]]\nat = [2.0, 0.0, 0.0]\ndisplacement = { y = 0.0, z = 0.0 }\n", "");
    assert!(fewer.len() < CASE.len());
    assert!(matches!(refused(&fewer), Mismatch::Case { .. }));
    assert!(contents(&dir) == before, "files were changed");

    // Only solver settings may change, and a warning reports them.
    let resumed =
        simulation(&CASE.replace("[output]", "[newton]\nmax_iterations = 40\n[output]")).resume(&dir).unwrap();
    let message = "continuing with settings that differ from those of the run so far: \
                [newton] `max_iterations = 25` before, `max_iterations = 40` now";
    assert_eq!(resumed, Resumed { step: 4, warnings: vec![message.into()] });
    for (micro, message) in [
        ("lanes = \"off\"", "[micro] the default before, `lanes = \"off\"` now"),
        ("lanes = \"mixed\"", "[micro] the default before, `lanes = \"mixed\"` now"),
    ] {
        let text = CASE.replace("[output]", &format!("[micro]\n{micro}\n[output]"));
        let resumed = simulation(&text).resume(&dir).unwrap();
        assert!(resumed.warnings.len() == 1 && resumed.warnings[0].ends_with(message), "{resumed:?}");
    }
    // The title and the output settings may differ.
    let resumed = simulation(&CASE.replace("rve = [0, 7]", "every = 2").replace("\"pull\"", "\"push\"")).resume(&dir);
    assert_eq!(resumed.unwrap(), Resumed { step: 4, warnings: vec![] });
}

#[test]
fn networks_with_other_contents_are_rejected() {
    let root = tempfile::tempdir().unwrap();
    let frozen = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/networks/frozen.txt");
    let text = fs::read_to_string(frozen).unwrap();
    let network = |folder: &str, text: &str| {
        let path = root.path().join(folder).join("frozen.txt");
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(&path, text).unwrap();
        CASE.replace("NETWORK", path.to_str().unwrap())
    };
    let dir = root.path().join("results");
    run(&network("a", &text), &dir);
    assert_eq!(simulation(&network("moved", &text)).resume(&dir).unwrap().step, 4, "the folder does not matter");
    // The network without its last fiber.
    let mut lines: Vec<String> = text.lines().filter(|line| !line.trim().is_empty()).map(str::to_owned).collect();
    lines.pop();
    let counts: Vec<usize> = lines[0].split_whitespace().map(|count| count.parse().unwrap()).collect();
    lines[0] = format!("{} {} {}", counts[0], counts[1] - 1, counts[2]);
    let error = simulation(&network("b", &lines.join("\n"))).resume(&dir).unwrap_err();
    assert!(matches!(error, ResumeError::Checkpoint(CheckpointError::OtherRun(_, Mismatch::Networks))), "{error}");
}

#[test]
fn a_new_run_replaces_old_results_and_keeps_other_files() {
    let root = tempfile::tempdir().unwrap();
    let (short, used) = (root.path().join("short"), root.path().join("used"));
    let two_steps = CASE.replace("count = 4", "count = 2").replace("[0, 7]", "[3]");
    run(CASE, &used);
    fs::write(used.join("notes.txt"), "mine").unwrap();
    fs::write(used.join("fields-1.vtu"), "mine").unwrap();
    run(&two_steps, &used);
    run(&two_steps, &short);
    for name in ["notes.txt", "fields-1.vtu"] {
        assert_eq!(fs::read_to_string(used.join(name)).unwrap(), "mine");
        fs::remove_file(used.join(name)).unwrap();
    }
    assert_same(&short, &used);
    assert_eq!(checkpoints(&used), ["step-00001.bin", "step-00002.bin"]);

    // Without a checkpoint, the run warns and starts from the beginning.
    let fresh = root.path().join("fresh");
    let resumed = resume(&two_steps, &fresh);
    assert!(
        matches!(&resumed.warnings[..], [one] if resumed.step == 0 && one.contains("no checkpoint")),
        "{resumed:?}"
    );
    assert_same(&short, &fresh);
}

#[test]
fn requested_networks_are_written_and_match_the_fields() {
    let root = tempfile::tempdir().unwrap();
    let dir = root.path().join("results");
    run(&CASE.replace("[output]", "[output]\nevery = 3"), &dir);
    let mut names: Vec<String> =
        fs::read_dir(dir.join("rve")).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    let of =
        |element: &str| ["-step-00003.vtp", "-step-00004.vtp", ".pvd"].map(|end| format!("element-{element}{end}"));
    assert_eq!(names, [of("00000"), of("00007")].concat());
    let collection = Collection::read(dir.join("rve/element-00007.pvd")).unwrap();
    let entries: Vec<_> = collection.entries().iter().map(|e| (e.time, e.file.as_str(), e.step())).collect();
    let [three, four, _] = &of("00007");
    assert_eq!(entries, [(0.75, three.as_str(), Some(3)), (1.0, four.as_str(), Some(4))]);

    let network = read_vtp(&dir.join("rve").join(four)).unwrap();
    let fields = read_vtu(&dir.join("fields-00004.vtu")).unwrap();
    let f = fields.cell_tensor("deformation_gradient").unwrap()[7];
    let reference =
        biotissue::fiber::network::file::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/networks/frozen.txt"));
    let reference = reference.unwrap().network;
    assert_eq!(network.fibers, reference.fibers());
    assert_eq!(network.kind, reference.material_of().iter().map(|&kind| i64::from(kind)).collect::<Vec<_>>());
    for &node in reference.boundary() {
        let x = reference.nodes()[node as usize];
        let moved: [f64; 3] = std::array::from_fn(|i| f[3 * i] * x[0] + f[3 * i + 1] * x[1] + f[3 * i + 2] * x[2]);
        assert_eq!(network.points[node as usize], moved);
    }
    let extreme = |name: &str| fields.cell_scalar(name).unwrap()[7];
    let (least, most) = network.stretch.iter().fold((f64::MAX, 0.0_f64), |(a, b), &s| (a.min(s), b.max(s)));
    assert_eq!((least, most), (extreme("stretch_min"), extreme("stretch_max")));
    // The law of the case, and equilibrium of the interior nodes.
    let (e, b, area) = (1.0e8, 1.2, std::f64::consts::PI * 5.0e-8 * 5.0e-8);
    let mut sums = vec![[0.0; 3]; network.points.len()];
    let mut largest = 0.0_f64;
    for (fiber, &[from, to]) in network.fibers.iter().enumerate() {
        let (stretch, force) = (network.stretch[fiber], network.force[fiber]);
        let d: [f64; 3] = std::array::from_fn(|i| network.points[to as usize][i] - network.points[from as usize][i]);
        let length = d.iter().map(|d| d * d).sum::<f64>().sqrt();
        assert!((length / reference.lengths()[fiber] - stretch).abs() < 1e-14);
        let expected = area * e / b * ((b * 0.5 * (stretch * stretch - 1.0)).exp() - 1.0);
        assert!((force - expected).abs() < 1e-12 * area * e, "fiber {fiber}: {force:e}, {expected:e}");
        largest = largest.max(force.abs());
        for i in 0..3 {
            sums[from as usize][i] += force * d[i] / length;
            sums[to as usize][i] -= force * d[i] / length;
        }
    }
    for &node in reference.interior() {
        assert!(sums[node as usize].iter().all(|sum| sum.abs() < 1e-8 * largest), "node {node}");
    }
}

#[test]
fn elements_without_a_network_are_reported() {
    let text = CASE.replace("[0, 7]", "[3, 12, 99]");
    let Err(SimulationError::Input(errors)) = Simulation::<Sparse>::new((), case(&text)) else { panic!("accepted") };
    let what: Vec<&str> = errors.0.iter().map(|error| error.problem.as_str()).collect();
    let message = |element| format!("`output.rve` names element {element}; the mesh has 12 elements");
    assert_eq!(what, [message(12), message(99)]);
    assert_eq!(errors.0[0].file, Path::new("/nowhere/pull.toml"));

    let (start, end) = (CASE.find("[region.material]").unwrap(), CASE.find("[[boundary]]").unwrap());
    let plain = "[region.material]\nmodel = \"neo-hookean\"\nyoungs_modulus = 1.0e3\npoisson_ratio = 0.3\n";
    let text = format!("{}{plain}{}", &CASE[..start], &CASE[end..]);
    let Err(SimulationError::Input(errors)) = Simulation::<Sparse>::new((), case(&text)) else { panic!("accepted") };
    assert_eq!(errors.0[0].problem, "`output.rve` names element 0, which has no fibers");
    // A body without fibers has checkpoints too.
    let text = text.replace("[0, 7]", "\"all\"");
    let root = tempfile::tempdir().unwrap();
    run(&text, root.path());
    assert_eq!(simulation(&text).resume(root.path()).unwrap(), Resumed { step: 4, warnings: vec![] });
}

/// Runs `biotissue run` with these arguments; returns the exit code and the text on stderr.
fn command(dir: &Path, text: &str, arguments: &[&str]) -> (Option<i32>, String) {
    let network = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/networks/frozen.txt");
    fs::write(dir.join("pull.toml"), text.replace("NETWORK", network.to_str().unwrap())).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_biotissue"));
    let output =
        command.current_dir(dir).args(["run", "pull.toml", "--threads", "2"]).args(arguments).output().unwrap();
    (output.status.code(), String::from_utf8(output.stderr).unwrap())
}

#[test]
fn the_program_resumes_a_failed_run() {
    let root = tempfile::tempdir().unwrap();
    // The prescribed displacement of the third step turns the body inside out.
    let unrecoverable = CASE.replace("x = 0.4 }", "x = 0.4 }\ncurve = [[0.0, 0.0], [0.5, 0.1], [0.75, -9.0]]");
    let (code, message) = command(root.path(), &unrecoverable, &["--resume"]);
    assert_eq!(code, Some(3), "{message}");
    assert!(
        message.contains("warning: ") && message.contains("no checkpoint: starting from the beginning"),
        "{message}"
    );
    let loads = fs::read(root.path().join("results/loads.csv")).unwrap();

    // The resumed run fails in the same step and does not repeat the converged steps.
    let (code, message) = command(root.path(), &unrecoverable, &["--resume"]);
    assert_eq!(code, Some(3), "{message}");
    assert!(message.contains("continuing after step 2 of 4") && !message.contains("step 2/4 t"), "{message}");
    assert_eq!(fs::read(root.path().join("results/loads.csv")).unwrap(), loads);

    let (code, message) = command(root.path(), CASE, &["--resume"]);
    assert_eq!(code, Some(2), "{message}");
    for part in ["belongs to another run: the case differs in [[boundary]]", "expected: ", "cure: ", "--resume"] {
        assert!(message.contains(part), "{message}");
    }
    assert_eq!(fs::read(root.path().join("results/loads.csv")).unwrap(), loads, "files were changed");

    let (code, message) = command(root.path(), CASE, &[]);
    assert_eq!(code, Some(0), "{message}");
    assert_eq!(checkpoints(&root.path().join("results")), ["step-00003.bin", "step-00004.bin"]);
}

#[test]
fn results_of_a_partial_step_are_kept_with_those_of_full_steps_and_removed_with_them() {
    let root = tempfile::tempdir().unwrap();
    let (failed, third) = (root.path().join("failed"), root.path().join("third"));
    // The last displacement turns the body inside out: three steps of ten converge in full, and a part of the fourth
    // after cuts.
    let pressed = CASE.replace("x = 0.4", "x = -4.0").replace("count = 4", "count = 10");
    let pressed = pressed.replace("networks = [\"NETWORK\"]", "networks = []").replace("rve = [0, 7]", "");
    let fails = |text: &str, dir: &Path, resumed: bool, progress: &mut dyn Progress| {
        let mut simulation = simulation(text);
        if resumed {
            simulation.resume(dir).unwrap();
        }
        simulation.run(dir, progress).unwrap_err()
    };
    fails(&pressed, &failed, false, &mut ());
    let steps = simulation(&pressed).resume(&failed).unwrap().step;
    assert!(steps > 0);
    fails(&pressed, &failed, false, &mut Killed { from: &failed, to: &third, step: steps });

    let partial = format!("fields-{steps:05}-partial.vtu");
    let entries = Collection::read(failed.join("fields.pvd")).unwrap().entries().to_vec();
    let [.., full, last] = entries.as_slice() else { panic!("{entries:?}") };
    assert_eq!((full.step(), last.file.as_str()), (Some(steps), partial.as_str()));
    assert!(last.time > full.time);
    let field = format!("fields-{steps:05}.vtu");
    assert_eq!(fs::read(failed.join(&field)).unwrap(), fs::read(third.join(&field)).unwrap(), "the full step differs");

    let before = contents(&failed);
    fails(&pressed, &failed, true, &mut ());
    assert!(contents(&failed) == before, "the same failure leaves the same files");

    run(CASE, &failed);
    assert!(!failed.join(&partial).exists());
    let whole = root.path().join("whole");
    run(CASE, &whole);
    assert_same(&failed, &whole);
}
