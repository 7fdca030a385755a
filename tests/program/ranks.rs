//! Runs on several ranks, which are threads of one process, or MPI processes in builds with MPI.

use std::path::Path;
use std::process::Command;

use crate::run::{PRESSED, events, fibers, run, write_case};
use crate::{frozen, line};

/// The numbers of ranks of the macro and the micro scale in these tests.
const SHARES: [(usize, usize); 5] = [(1, 1), (1, 3), (2, 2), (3, 1), (4, 4)];

/// Returns the dogbone of the examples with a coarser mesh, two steps and a smaller tolerance.
fn coarse_dogbone() -> String {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/dogbone");
    let text = std::fs::read_to_string(folder.join("dogbone.toml")).unwrap();
    let replacements = [
        ("element_size = 0.002", "element_size = 0.004".to_owned()),
        ("networks/", format!("{}/networks/", folder.display())),
        ("count = 20", "count = 2".into()),
        ("tolerance = 1e-10", "tolerance = 1e-12".into()),
        ("2.5e4", "5.0e3".into()),
    ];
    replacements.iter().fold(text, |text, (before, after)| replaced(&text, before, after))
}

/// Replaces a part of a text that must contain it.
fn replaced(text: &str, before: &str, after: &str) -> String {
    assert!(text.contains(before), "{before}");
    text.replace(before, after)
}

pub fn with_scales(text: &str, (above, below): (usize, usize)) -> String {
    format!("{text}\n[scales]\nmacro = {above}\nmicro = {below}\n")
}

pub fn read(folder: &Path, name: &str) -> String {
    std::fs::read_to_string(folder.join(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
}

#[test]
fn the_dogbone_is_the_same_on_any_number_of_ranks() {
    let folder = tempfile::tempdir().unwrap();
    let text = coarse_dogbone();
    run(folder.path(), &text, "--out alone").done();
    let alone = read(folder.path(), "alone/loads.csv");
    assert_eq!(alone.lines().count(), 3);
    for (above, below) in SHARES {
        let out = format!("on-{above}-{below}");
        run(folder.path(), &with_scales(&text, (above, below)), &format!("--out {out}")).done();
        // The results are bitwise equal, because the order of all sums is the same for every distribution of the RVEs.
        assert_eq!(read(folder.path(), &format!("{out}/loads.csv")), alone, "{above} + {below}");
    }
}

/// Returns a case that requests ranks near each other.
fn near_each_other() -> String {
    with_scales(&fibers(&frozen()), (1, 2)) + "near = true\n"
}

#[test]
fn ranks_near_each_other_require_hwloc() {
    let folder = tempfile::tempdir().unwrap();
    let run = run(folder.path(), &near_each_other(), "--out out");
    let check = line(folder.path(), "check case.toml --json");
    if cfg!(feature = "hwloc") {
        run.done();
        assert_eq!(check.object()["ranks"], 3);
    } else {
        assert!(run.failed(2).contains("topology of machines"), "{}", run.stderr);
        assert!(run.stderr.contains("--features mpi,hwloc"), "{}", run.stderr);
        assert_eq!(check.failed(2), run.stderr);
    }
}

/// The results are also equal to those of a run in one process.
#[test]
fn the_option_ranks_gives_all_ranks_but_one_to_the_micro_scale() {
    let folder = tempfile::tempdir().unwrap();
    let text = fibers(&frozen());
    run(folder.path(), &text, "--out alone").done();
    let done = run(folder.path(), &text, "--ranks 3 --out three");
    done.done();
    assert!(done.stderr.contains(", 1 + 2 ranks\n"), "{}", done.stderr);
    assert_eq!(read(folder.path(), "three/loads.csv"), read(folder.path(), "alone/loads.csv"));
}

/// If neither the case nor the command gives the number of ranks of the micro scale, there is one.
#[test]
fn the_micro_scale_has_one_rank_by_default() {
    let folder = tempfile::tempdir().unwrap();
    let text = with_scales(&fibers(&frozen()), (2, 0));
    let done = run(folder.path(), &text, "--out out");
    done.done();
    assert!(done.stderr.contains(", 2 + 1 ranks\n"), "{}", done.stderr);
    assert_eq!(line(folder.path(), "check case.toml --json").object()["ranks"], 3);
}

/// The solver of the RVEs fails at rest; the message is the same as in one process.
#[test]
fn a_failure_at_rest_gives_the_same_message_on_any_number_of_ranks() {
    let folder = tempfile::tempdir().unwrap();
    let solver = "\n[micro]\nsolver = { method = \"cg\", max_iterations = 1 }\n";
    // RVEs that wait are not solved, but the response of their networks at rest is needed.
    let waiting = "life = { created_at = 0.025 }\nlaw = {";
    for text in [fibers(&frozen()), fibers(&frozen()).replace("law = {", waiting)] {
        let text = text + solver;
        let [alone, shared] = ["", "--ranks 3"].map(|ranks| run(folder.path(), &text, &format!("{ranks} --out out")));
        assert_eq!((alone.code, &alone.stderr), (shared.code, &shared.stderr));
        assert!(alone.stderr.contains("leave `solver` of [micro] out"), "{}", alone.stderr);
    }
}

#[test]
fn the_log_contains_the_times_of_every_rank() {
    let folder = tempfile::tempdir().unwrap();
    run(folder.path(), &with_scales(&fibers(&frozen()), (2, 2)), "--out out").done();
    let events = events(&folder.path().join("out"));
    assert_eq!(events[0]["ranks"], serde_json::json!([2, 2]));
    let of_ranks: Vec<_> = events.iter().filter(|event| event["event"] == "ranks").collect();
    let iterations: u64 = events.iter().filter_map(|event| event["newton"]["iterations"].as_u64()).sum();
    assert!(of_ranks.len() as u64 > iterations, "{} of {iterations}", of_ranks.len());
    for event in of_ranks {
        let ranks = event["ranks"].as_array().unwrap();
        let numbers: Vec<u64> = ranks.iter().map(|rank| rank["rank"].as_u64().unwrap()).collect();
        assert_eq!(numbers, [0, 1, 2, 3]);
        for rank in ranks {
            assert!(["busy", "idle", "exchanging"].iter().all(|what| rank[what].as_f64().unwrap() >= 0.0), "{rank}");
        }
    }
}

#[test]
fn written_networks_do_not_depend_on_the_number_of_ranks() {
    let folder = tempfile::tempdir().unwrap();
    let text = format!("{}\n[output]\nrve = [1, 4]\n", fibers(&frozen()));
    run(folder.path(), &text, "--out alone").done();
    run(folder.path(), &text, "--ranks 4 --out shared").done();
    for file in ["rve/element-00001-step-00002.vtp", "rve/element-00004-step-00001.vtp", "rve/element-00004.pvd"] {
        assert_eq!(read(folder.path(), &format!("alone/{file}")), read(folder.path(), &format!("shared/{file}")));
    }
}

#[test]
fn an_interrupted_run_is_resumed_on_another_number_of_ranks() {
    let folder = tempfile::tempdir().unwrap();
    let text = fibers(&frozen());
    run(folder.path(), &text, "--ranks 3 --out out").done();
    let whole = read(folder.path(), "out/loads.csv");
    std::fs::remove_file(folder.path().join("out/checkpoint/step-00002.bin")).unwrap();
    for options in ["--ranks 5", "--ranks 1"] {
        let done = run(folder.path(), &text, &format!("{options} --out out --resume"));
        done.done();
        assert!(done.stderr.contains("continuing after step 1 of 2"), "{}", done.stderr);
        assert_eq!(read(folder.path(), "out/loads.csv"), whole, "{options}");
        std::fs::remove_file(folder.path().join("out/checkpoint/step-00002.bin")).unwrap();
    }
}

/// Returns a case whose RVEs are created where the body is strained, sleep where the strain does not change, and are
/// deleted where the strain is large.
pub fn with_life_cycles() -> String {
    let matrix = "matrix = { model = \"neo-hookean\", shear_modulus = 1000.0, poisson_ratio = 0.3 }";
    let life = "life = { created_at = 0.025, asleep_below = 2e-3, deleted_at = 0.17 }";
    let text = fibers(&frozen()).replace("law = {", &format!("{matrix}\n{life}\nlaw = {{"));
    let curve = "displacement = { x = 0.2 }\ncurve = [[0.0, 0.0], [0.5, 0.45], [0.6, 0.452], [0.7, 0.454], [1.0, 1.0]]";
    text.replace("displacement = { x = 0.05 }", curve)
        .replace("cells = [1, 1, 1]", "cells = [2, 2, 1]")
        .replace("count = 2", "count = 10")
}

#[test]
fn life_cycles_of_rves_are_the_same_on_any_number_of_ranks() {
    let folder = tempfile::tempdir().unwrap();
    let text = with_life_cycles();
    run(folder.path(), &text, "--out alone").done();
    let loads = read(folder.path(), "alone/loads.csv");
    let counts = |out: &str| -> Vec<[u64; 4]> {
        let events = events(&folder.path().join(out));
        let rves = events.iter().filter(|event| event["event"] == "step").map(|event| &event["rve"]);
        rves.map(|rve| ["waiting", "asleep", "deleted", "solves"].map(|key| rve[key].as_u64().unwrap())).collect()
    };
    let alone = counts("alone");
    let most = |k: usize| alone.iter().map(|counts| counts[k]).max().unwrap();
    assert_eq!(alone[0][0], 24, "no RVE exists at first: {alone:?}");
    assert_eq!(alone[0][3], 0, "no RVE is solved at first");
    assert_eq!(alone[4][0], 0, "all RVEs exist in step 5: {alone:?}");
    assert!(most(1) > 0, "some RVEs sleep while the load is constant: {alone:?}");
    assert!(alone[9][2] > 0, "some RVEs are deleted at the end: {alone:?}");
    for options in ["--ranks 2", "--ranks 4"] {
        run(folder.path(), &text, &format!("{options} --out shared")).done();
        assert_eq!(read(folder.path(), "shared/loads.csv"), loads, "{options}");
        assert_eq!(counts("shared"), alone, "{options}");
    }
    run(folder.path(), &with_scales(&text, (3, 2)), "--out shared").done();
    assert_eq!(read(folder.path(), "shared/loads.csv"), loads);
    // The run is interrupted after some RVEs were deleted and while some sleep.
    let resting =
        text.replace("[0.5, 0.45], [0.6, 0.452], [0.7, 0.454], [1.0, 1.0]", "[0.7, 0.45], [0.85, 0.452], [1.0, 0.454]");
    for (text, last) in [(&text, 10), (&resting.replace("count = 10", "count = 7"), 7)] {
        run(folder.path(), text, "--out whole").done();
        let whole = read(folder.path(), "whole/loads.csv");
        for options in ["--ranks 3", "--ranks 1"] {
            std::fs::remove_file(folder.path().join(format!("whole/checkpoint/step-{last:05}.bin"))).unwrap();
            let resumed = run(folder.path(), text, &format!("{options} --out whole --resume"));
            resumed.done();
            assert!(resumed.stderr.contains(&format!("continuing after step {}", last - 1)), "{}", resumed.stderr);
            assert_eq!(read(folder.path(), "whole/loads.csv"), whole, "{last} {options}");
        }
    }
}

#[test]
fn a_configuration_file_of_amsi_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let text = "@scales\nmacro 1\nmicro 2\n@relations\nmacro micro\nmicro macro\n@util\nresults $RESULTS_DIR\n@analysis\n\
                simmetrix true\n";
    std::fs::write(folder.path().join("amsi.cfg"), text).unwrap();
    write_case(folder.path(), "case.toml", &fibers(&frozen()));
    let output = Command::new(env!("CARGO_BIN_EXE_biotissue"))
        .current_dir(folder.path())
        .args(["run", "case.toml", "-a", "amsi.cfg"])
        .env("RESULTS_DIR", "from-the-file")
        .output()
        .unwrap();
    let message = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{message}");
    assert!(
        message.contains("warning: ") && message.contains("simmetrix") && message.contains(", 1 + 2 ranks\n"),
        "{message}"
    );
    assert!(folder.path().join("from-the-file/loads.csv").is_file());
    let failed = line(folder.path(), "run case.toml -a amsi.cfg --ranks 5 --out out");
    assert!(failed.failed(2).contains("RESULTS_DIR"), "{}", failed.stderr);
    // A configuration file that only names the result directory.
    std::fs::write(folder.path().join("amsi.cfg"), "@util\nresults there\n").unwrap();
    line(folder.path(), "run case.toml -a amsi.cfg").done();
    assert!(folder.path().join("there/loads.csv").is_file());
    std::fs::write(folder.path().join("amsi.cfg"), "@scales\nmacro 1\nmeso 2\n").unwrap();
    let failed = line(folder.path(), "run case.toml -a amsi.cfg");
    assert!(failed.failed(2).contains("the scales are macro, meso"), "{}", failed.stderr);
    std::fs::write(folder.path().join("amsi.cfg"), "@scales\nmacro 1\nmicro 2\n@relations\nmacro micro\n").unwrap();
    let failed = line(folder.path(), "run case.toml -a amsi.cfg");
    assert!(failed.failed(2).contains("`micro macro` for stresses"), "{}", failed.stderr);
    // The scales in the file override those of the case; their ranks must add up to those started.
    std::fs::write(folder.path().join("amsi.cfg"), "@scales\nmacro 1\nmicro 2\n").unwrap();
    write_case(folder.path(), "case.toml", &with_scales(&fibers(&frozen()), (2, 2)));
    let failed = line(folder.path(), "run case.toml -a amsi.cfg --ranks 4");
    assert!(failed.failed(2).contains("macro 1 + micro 2 = 3 ranks, but 4 were started"), "{}", failed.stderr);
    assert!(failed.stderr.contains("[scales] has no effect"), "{}", failed.stderr);
    assert!(failed.stderr.contains("cure: start 3 ranks, or change @scales in amsi.cfg"), "{}", failed.stderr);
}

#[test]
fn a_body_of_several_ranks_is_written_in_parts() {
    let folder = tempfile::tempdir().unwrap();
    let text = fibers(&frozen());
    run(folder.path(), &text, "--out alone").done();
    run(folder.path(), &with_scales(&text, (2, 1)), "--out parts").done();
    let collection = read(folder.path(), "parts/fields.pvd");
    assert!(collection.contains("fields-00002.pvtu") && !collection.contains(".vtu\""), "{collection}");
    let index = read(folder.path(), "parts/fields-00002.pvtu");
    assert!(index.contains("fields-00002-part-0000.vtu") && index.contains("fields-00002-part-0001.vtu"), "{index}");
    line(folder.path(), "report parts").done();
}

/// The failure and its message are the same, whichever rank owns the RVE.
#[test]
fn a_failing_step_gives_the_same_message_on_any_number_of_ranks() {
    let folder = tempfile::tempdir().unwrap();
    let text = fibers(&frozen()).replace("x = 0.05", "x = -1.5").replace("count = 2", "count = 5\nmax_cuts = 1");
    let alone = run(folder.path(), &text, "--out out");
    let message = alone.failed(3).to_owned();
    for options in ["--ranks 2", "--ranks 5"] {
        let shared = run(folder.path(), &text, &format!("{options} --out out"));
        assert_eq!(shared.failed(3), message, "{options}");
    }
}

#[test]
fn errors_are_reported_once() {
    let folder = tempfile::tempdir().unwrap();
    let failed = run(folder.path(), &with_scales(PRESSED, (2, 3)), "--ranks 4 --out out");
    assert!(
        failed.failed(2).starts_with("error: macro 2 + micro 3 = 5 ranks, but 4 were started\n"),
        "{}",
        failed.stderr
    );
    assert!(failed.stderr.contains("cure: start 5 ranks, or change [scales] in "));
    let failed = run(folder.path(), &with_scales(PRESSED, (1, 3)), "--ranks 1 --out out");
    assert!(failed.failed(2).contains("macro 1 + micro 3 = 4 ranks, but 1 were started"), "{}", failed.stderr);
    // The micro scale gets the remaining ranks, but at least one.
    let failed = run(folder.path(), &with_scales(PRESSED, (2, 0)), "--ranks 2 --out out");
    assert!(failed.failed(2).contains("macro 2 + micro 1 = 3 ranks, but 2 were started"), "{}", failed.stderr);
    assert!(failed.stderr.contains("cure: start 3 ranks"), "{}", failed.stderr);
    let failed = run(folder.path(), &fibers("absent.txt"), "--ranks 4 --out out");
    assert!(failed.failed(2).contains("absent.txt"), "{}", failed.stderr);
    let unknown = PRESSED.replace("surface = \"x1\"", "surface = \"x9\"");
    let failed = run(folder.path(), &unknown, "--ranks 4 --out out");
    assert!(failed.failed(2).contains("the mesh has no surface \"x9\""), "{}", failed.stderr);
    assert!(!folder.path().join("out").exists());
}

/// Without RVEs, the ranks of the micro scale have no work, and the run succeeds.
#[test]
fn a_body_without_rves_runs_on_several_ranks() {
    let folder = tempfile::tempdir().unwrap();
    let text = PRESSED.replace("-1.5", "-0.4");
    run(folder.path(), &text, "--out alone").done();
    let shared = run(folder.path(), &text, "--ranks 3 --out shared");
    shared.done();
    assert!(shared.stderr.contains("2 of 3 ranks are for RVEs, of which the case has none"), "{}", shared.stderr);
    assert_eq!(read(folder.path(), "alone/loads.csv"), read(folder.path(), "shared/loads.csv"));
}

/// Each of six elements has an RVE.
#[test]
fn more_ranks_than_rves_are_reported() {
    let folder = tempfile::tempdir().unwrap();
    for (ranks, is_reported) in [(7, false), (8, true)] {
        let shared = run(folder.path(), &fibers(&frozen()), &format!("--ranks {ranks} --out out"));
        shared.done();
        let warning = format!("{} of {ranks} ranks are for RVEs, of which the case has at most 6", ranks - 1);
        assert_eq!(shared.stderr.contains(&warning), is_reported, "{}", shared.stderr);
    }
}

/// A build without MPI reports an error if `mpirun` started it, because each process would write the same files.
#[cfg(not(feature = "mpi"))]
#[test]
fn processes_need_a_build_with_mpi() {
    let folder = tempfile::tempdir().unwrap();
    write_case(folder.path(), "case.toml", PRESSED);
    let output = Command::new(env!("CARGO_BIN_EXE_biotissue"))
        .current_dir(folder.path())
        .args(["run", "case.toml"])
        .env("OMPI_COMM_WORLD_SIZE", "2")
        .output()
        .unwrap();
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(message.starts_with("error: started as 2 processes") && message.contains("--features mpi"), "{message}");
}

#[cfg(feature = "mpi")]
pub mod processes {
    #[cfg(target_os = "linux")]
    use std::process::Stdio;
    use std::sync::{Mutex, MutexGuard, PoisonError};
    use std::time::{Duration, Instant};

    use super::*;

    /// Returns a lock that serializes the runs of this module, because more processes than cores only slow each other
    /// down.
    pub fn one_at_a_time() -> MutexGuard<'static, ()> {
        static LOCK: Mutex<()> = Mutex::new(());
        LOCK.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns a command that starts the program under `mpirun`.
    pub fn launched(folder: &Path, ranks: usize, arguments: &str) -> Command {
        let launcher = std::env::var("MPIRUN").unwrap_or_else(|_| "mpirun".into());
        let mut command = Command::new(launcher);
        command
            .current_dir(folder)
            .args(["--oversubscribe", "-n", &ranks.to_string(), env!("CARGO_BIN_EXE_biotissue")])
            .args(arguments.split_whitespace())
            .envs([("OMPI_ALLOW_RUN_AS_ROOT", "1"), ("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1")]);
        command
    }

    fn mpirun(folder: &Path, ranks: usize, arguments: &str) -> std::process::Output {
        launched(folder, ranks, arguments).output().unwrap()
    }

    pub fn mpirun_done(folder: &Path, ranks: usize, arguments: &str) {
        let out = mpirun(folder, ranks, arguments);
        assert!(out.status.success(), "{ranks} ranks, {arguments}: {}", String::from_utf8_lossy(&out.stderr));
    }

    /// Returns the number of the process that runs this rank in this folder; `None` if there is none.
    #[cfg(target_os = "linux")]
    fn process_of(folder: &Path, rank: usize) -> Option<String> {
        let variable = format!("OMPI_COMM_WORLD_RANK={rank}");
        let is_it = |process: &Path| {
            let environment = std::fs::read(process.join("environ")).unwrap_or_default();
            std::fs::read_link(process.join("cwd")).is_ok_and(|cwd| cwd == folder)
                && environment.split(|&byte| byte == 0).any(|entry| entry == variable.as_bytes())
        };
        let all = std::fs::read_dir("/proc").unwrap().filter_map(Result::ok);
        let found = all.map(|entry| entry.path()).find(|process| is_it(process))?;
        Some(found.file_name()?.to_string_lossy().into_owned())
    }

    /// Starts the case of a folder on `ranks` ranks and sends a signal to the process of one rank after two more steps
    /// have converged; the run must fail. Returns its stderr, and the time from the signal to its end.
    #[cfg(target_os = "linux")]
    fn ended_by(signal: &str, rank: usize, folder: &Path, ranks: usize, options: &str) -> (String, Duration) {
        let steps = || std::fs::read_to_string(folder.join("out/loads.csv")).map_or(1, |text| text.lines().count()) - 1;
        let before = steps();
        let mut command = launched(folder, ranks, &format!("run case.toml --out out {options}"));
        let mut run = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
        let start = Instant::now();
        while steps() < before + 2 {
            assert!(start.elapsed() < Duration::from_secs(300), "no step converges");
            assert!(run.try_wait().unwrap().is_none(), "the run ended before two steps");
            std::thread::sleep(Duration::from_millis(20));
        }
        let process = process_of(&folder.canonicalize().unwrap(), rank).expect("the rank runs");
        let send = |signal: &str| Command::new("kill").args([signal, &process]).stderr(Stdio::null()).status().unwrap();
        assert!(send(signal).success());
        let sent = Instant::now();
        while run.try_wait().unwrap().is_none() && sent.elapsed() < Duration::from_secs(120) {
            std::thread::sleep(Duration::from_millis(20));
        }
        // A stopped process may outlive its launcher, and a run that does not end would block the tests.
        send("-KILL");
        let _ = run.kill();
        let ended = run.wait_with_output().unwrap();
        let taken = sent.elapsed();
        assert!(!ended.status.success());
        assert!(steps() >= before + 2);
        (String::from_utf8_lossy(&ended.stderr).into_owned(), taken)
    }

    /// Stops the process of one rank of a run on two scales; checks that the run ends in time, and returns its stderr.
    #[cfg(target_os = "linux")]
    fn ended_in_time((above, below): (usize, usize), options: &str, hanging: usize) -> String {
        let _turn = one_at_a_time();
        let folder = tempfile::tempdir().unwrap();
        let text = with_scales(&replaced(&coarse_dogbone(), "count = 2", "count = 2000"), (above, below));
        write_case(folder.path(), "case.toml", &text);
        let options = format!("--time-out 10 {options}");
        let (message, taken) = ended_by("-STOP", hanging, folder.path(), above + below, &options);
        assert!(taken < Duration::from_secs(60), "{taken:?}");
        message
    }

    /// The run ends within seconds, whichever rank is killed, and a resumed run gives the results of an uninterrupted
    /// one.
    #[cfg(target_os = "linux")]
    #[test]
    fn a_run_with_a_killed_rank_can_be_resumed() {
        let _turn = one_at_a_time();
        let folder = tempfile::tempdir().unwrap();
        let text = replaced(&fibers(&frozen()), "count = 2", "count = 300");
        run(folder.path(), &text, "--out alone").done();
        write_case(folder.path(), "case.toml", &with_scales(&text, (1, 2)));
        for (rank, options) in [(2, ""), (0, "--resume")] {
            let (message, taken) = ended_by("-KILL", rank, folder.path(), 3, &format!("--backend sparse {options}"));
            assert!(taken < Duration::from_secs(20), "{taken:?}: {message}");
        }
        let steps = read(folder.path(), "out/loads.csv").lines().count() - 1;
        assert!(steps < 300, "the run was not killed");
        mpirun_done(folder.path(), 3, "run case.toml --backend sparse --out out --resume");
        assert_eq!(read(folder.path(), "out/loads.csv"), read(folder.path(), "alone/loads.csv"));
    }

    /// The message names the scale of the rank that hangs.
    #[cfg(target_os = "linux")]
    #[test]
    fn a_time_out_names_the_scale_that_hangs() {
        let message = ended_in_time((1, 2), "", 2);
        assert!(message.contains(" 10 s") && message.contains("micro"), "{message}");
    }

    /// With the body on PETSc, the run ends in time, whether the rank that hangs belongs to the micro or the macro
    /// scale.
    #[cfg(all(feature = "petsc", target_os = "linux"))]
    #[test]
    fn a_time_out_ends_a_run_on_petsc() {
        for (hanging, scale) in [(2, "micro"), (1, "macro")] {
            let message = ended_in_time((2, 1), "--backend petsc", hanging);
            assert!(message.contains(" 10 s") && message.contains(scale), "{message}");
        }
    }

    /// Lines within a step say what the RVEs of all processes do.
    #[test]
    fn long_steps_of_processes_report_what_their_rves_do() {
        let _turn = one_at_a_time();
        let folder = tempfile::tempdir().unwrap();
        let text = replaced(&fibers(&frozen()), "cells = [1, 1, 1]", "cells = [6, 6, 5]");
        write_case(folder.path(), "case.toml", &with_scales(&text, (1, 2)));
        let out = mpirun(folder.path(), 3, "run case.toml --backend sparse --progress 0.02");
        let message = String::from_utf8_lossy(&out.stderr);
        assert!(out.status.success(), "{message}");
        crate::streams::assert_reports_rves(&message, 1080);
    }

    #[test]
    fn the_dogbone_is_the_same_on_processes() {
        let _turn = one_at_a_time();
        let folder = tempfile::tempdir().unwrap();
        let text = coarse_dogbone();
        run(folder.path(), &text, "--out alone").done();
        let alone = read(folder.path(), "alone/loads.csv");
        for (above, below) in SHARES {
            write_case(folder.path(), "case.toml", &with_scales(&text, (above, below)));
            mpirun_done(folder.path(), above + below, "run case.toml --backend sparse --out shared");
            assert_eq!(read(folder.path(), "shared/loads.csv"), alone, "{above} + {below}");
        }
    }

    #[test]
    fn results_do_not_depend_on_processes_for_any_element_type() {
        let _turn = one_at_a_time();
        crate::element_ranks::assert_results_do_not_depend_on_ranks(mpirun_done);
    }

    #[cfg(feature = "hwloc")]
    #[test]
    fn processes_near_each_other_give_the_same_results() {
        let _turn = one_at_a_time();
        let folder = tempfile::tempdir().unwrap();
        run(folder.path(), &fibers(&frozen()), "--out alone").done();
        write_case(folder.path(), "case.toml", &near_each_other());
        mpirun_done(folder.path(), 3, "run case.toml --backend sparse --out shared");
        assert_eq!(read(folder.path(), "shared/loads.csv"), read(folder.path(), "alone/loads.csv"));
    }

    /// The results are the same even if the run is resumed on other numbers of ranks.
    #[test]
    fn life_cycles_of_rves_are_the_same_on_processes() {
        let _turn = one_at_a_time();
        let folder = tempfile::tempdir().unwrap();
        let text = with_life_cycles();
        run(folder.path(), &text, "--out alone").done();
        let alone = read(folder.path(), "alone/loads.csv");
        let mut last = None;
        for ((above, below), options) in [((2, 2), ""), ((1, 3), "--resume"), ((3, 2), "--resume")] {
            last.into_iter().for_each(|last| std::fs::remove_file(last).unwrap());
            write_case(folder.path(), "case.toml", &with_scales(&text, (above, below)));
            mpirun_done(
                folder.path(),
                above + below,
                &format!("run case.toml --backend sparse --out shared {options}"),
            );
            assert_eq!(read(folder.path(), "shared/loads.csv"), alone, "{above} + {below}");
            last = Some(folder.path().join("shared/checkpoint/step-00010.bin"));
        }
    }

    /// As [`life_cycles_of_rves_are_the_same_on_processes`], with the body on PETSc.
    #[cfg(feature = "petsc")]
    #[test]
    fn life_cycles_of_rves_are_the_same_on_petsc() {
        let _turn = one_at_a_time();
        let folder = tempfile::tempdir().unwrap();
        let text = with_life_cycles();
        run(folder.path(), &text, "--out alone --backend sparse").done();
        let alone = read(folder.path(), "alone/loads.csv");
        for ((above, below), options) in
            [((2, 2), ""), ((3, 1), "--resume"), ((1, 2), "--resume"), ((3, 1), "--resume")]
        {
            write_case(folder.path(), "case.toml", &with_scales(&text, (above, below)));
            let command = format!("run case.toml --backend petsc --out shared {options}");
            mpirun_done(folder.path(), above + below, &command);
            assert_same_to_rounding(&read(folder.path(), "shared/loads.csv"), &alone);
            std::fs::remove_file(folder.path().join("shared/checkpoint/step-00010.bin")).unwrap();
        }
    }

    /// Elements of every type, patches of the F-bar method and the faces of follower pressures and of cavities are
    /// assembled in parts.
    #[cfg(feature = "petsc")]
    #[test]
    fn bodies_of_any_element_type_are_the_same_on_petsc() {
        let _turn = one_at_a_time();
        crate::element_ranks::compare_loads_on_ranks(mpirun_done, assert_same_to_rounding);
        let folder = crate::constraints::with_mesh();
        let text = crate::constraints::formula("", "tolerance = 1e-12");
        run(folder.path(), &text, "--out alone --backend sparse").done();
        write_case(folder.path(), "case.toml", &with_scales(&text, (3, 1)));
        mpirun_done(folder.path(), 4, "run case.toml --backend petsc --out shared");
        assert_same_to_rounding(&read(folder.path(), "shared/loads.csv"), &read(folder.path(), "alone/loads.csv"));
    }

    /// Rows of rigid surfaces and of nodes with frames are distributed like the others.
    #[cfg(feature = "petsc")]
    #[test]
    fn rigid_surfaces_and_inclined_planes_are_the_same_on_petsc() {
        let _turn = one_at_a_time();
        let folder = tempfile::tempdir().unwrap();
        let material = "{ model = \"fiber-rve\", networks = [], matrix = { model = \"neo-hookean\", \
                        shear_modulus = 1000.0, poisson_ratio = 0.3 } }";
        let tolerance = "[newton]\ntolerance = 1e-12\n";
        let generate = "generate = { shape = \"box\", cells = [4, 2, 2], size = [1.0, 0.5, 0.5] }";
        let twisted = crate::loads::twisted(material, generate) + tolerance;
        crate::loads::write_inclined_box(folder.path(), [3, 2, 2]);
        let inclined = crate::loads::inclined(material) + tolerance;
        for text in [twisted, inclined] {
            run(folder.path(), &text, "--out alone --backend sparse").done();
            let alone = read(folder.path(), "alone/loads.csv");
            for scales in [(2, 2), (3, 1)] {
                write_case(folder.path(), "case.toml", &with_scales(&text, scales));
                mpirun_done(folder.path(), 4, "run case.toml --backend petsc --out shared");
                assert_same_to_rounding(&read(folder.path(), "shared/loads.csv"), &alone);
            }
        }
    }

    /// Checks that forces agree to 1e-10 of the largest force of their step, and likewise areas, displacements,
    /// volumes, moments and rotations.
    #[cfg(feature = "petsc")]
    pub fn assert_same_to_rounding(found: &str, expected: &str) {
        let numbers = |line: &str| -> Vec<f64> { line.split(',').map(|value| value.parse().unwrap()).collect() };
        let header = expected.lines().next().unwrap();
        assert_eq!((found.lines().next(), found.lines().count()), (Some(header), expected.lines().count()));
        let kinds: Vec<Option<u8>> =
            header.split(',').map(|name| Some(*name.rsplit_once('.')?.1.as_bytes().first()?)).collect();
        for (found, expected) in found.lines().zip(expected.lines()).skip(1) {
            let both: Vec<(f64, f64)> = numbers(found).into_iter().zip(numbers(expected)).collect();
            for kind in *b"afuvmrd" {
                let of_kind =
                    || both.iter().zip(&kinds).filter(|(_, other)| **other == Some(kind)).map(|(both, _)| both);
                let largest = of_kind().map(|(_, expected)| expected.abs()).fold(0.0, f64::max);
                let error = of_kind().map(|(found, expected)| (found - expected).abs()).fold(0.0, f64::max);
                assert!(error <= 1e-10 * largest, "{}: {error:e} of {largest:e}", char::from(kind));
            }
        }
    }

    /// The linear systems of the body are distributed over its ranks; the results agree to rounding.
    #[cfg(feature = "petsc")]
    #[test]
    fn petsc_solves_for_the_body_on_its_ranks() {
        let _turn = one_at_a_time();
        let folder = tempfile::tempdir().unwrap();
        let text = coarse_dogbone();
        run(folder.path(), &text, "--out alone --backend sparse").done();
        let alone = read(folder.path(), "alone/loads.csv");
        let by_multigrid =
            text.replace("[newton]", "[newton]\nsolver = { method = \"cg\", preconditioner = \"multigrid\" }");
        let directly = [(1, 1), (1, 3), (2, 2), (4, 4)].map(|shares| (&text, shares));
        for (text, (above, below)) in directly.into_iter().chain([(&by_multigrid, (2, 2))]) {
            write_case(folder.path(), "case.toml", &with_scales(text, (above, below)));
            mpirun_done(folder.path(), above + below, "run case.toml --backend petsc --out shared");
            assert_same_to_rounding(&read(folder.path(), "shared/loads.csv"), &alone);
        }
    }

    #[test]
    fn errors_end_all_processes_within_seconds() {
        let _turn = one_at_a_time();
        let folder = tempfile::tempdir().unwrap();
        let start = Instant::now();
        write_case(folder.path(), "case.toml", &with_scales(PRESSED, (2, 3)));
        let out = mpirun(folder.path(), 4, "run case.toml --backend sparse");
        let message = String::from_utf8_lossy(&out.stderr);
        assert_eq!(message.matches("macro 2 + micro 3 = 5 ranks, but 4 were started").count(), 1, "{message}");
        assert!(!out.status.success());
        let out = mpirun(folder.path(), 3, "run case.toml --ranks 2");
        let message = String::from_utf8_lossy(&out.stderr);
        assert_eq!(message.matches("--ranks 2 under mpirun, which has started 3").count(), 1, "{message}");
        write_case(folder.path(), "case.toml", "title = 3");
        let out = mpirun(folder.path(), 3, "run case.toml --backend sparse");
        assert_eq!(out.status.code(), Some(2), "{}", String::from_utf8_lossy(&out.stderr));
        assert!(start.elapsed() < Duration::from_secs(30));
    }
}
