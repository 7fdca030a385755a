//! Runs on several ranks: threads of one process, and MPI processes in builds with MPI.

use std::path::Path;
use std::process::Command;

use crate::run::{PRESSED, events, fibers, run, write_case};
use crate::{frozen, line};

/// The numbers of ranks of the macro and the micro scale in these tests.
const SHARES: [(usize, usize); 5] = [(1, 1), (1, 3), (2, 2), (3, 1), (4, 4)];

/// The dogbone of the examples with a coarser mesh and three steps, solved to the rounding limit.
fn coarse_dogbone() -> String {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/dogbone");
    let text = std::fs::read_to_string(folder.join("dogbone.toml")).unwrap();
    let replacements = [
        ("element_size = 0.002", "element_size = 0.004".to_owned()),
        ("networks/", format!("{}/networks/", folder.display())),
        ("count = 20", "count = 3".into()),
        ("tolerance = 1e-10", "tolerance = 1e-12".into()),
        ("2.5e4", "5.0e3".into()),
    ];
    replacements.iter().fold(text, |text, (before, after)| {
        assert!(text.contains(before), "{before}");
        text.replace(before, after)
    })
}

fn with_scales(text: &str, (above, below): (usize, usize)) -> String {
    format!("{text}\n[scales]\nmacro = {above}\nmicro = {below}\n")
}

fn read(folder: &Path, name: &str) -> String {
    std::fs::read_to_string(folder.join(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
}

#[test]
fn the_dogbone_is_the_same_on_any_ranks() {
    let folder = tempfile::tempdir().unwrap();
    let text = coarse_dogbone();
    run(folder.path(), &text, "--out alone").done();
    let alone = read(folder.path(), "alone/loads.csv");
    assert_eq!(alone.lines().count(), 4);
    for (above, below) in SHARES {
        let out = format!("on-{above}-{below}");
        run(folder.path(), &with_scales(&text, (above, below)), &format!("--out {out}")).done();
        // Equal bit for bit, because the order of all sums is the same wherever the RVEs are.
        assert_eq!(read(folder.path(), &format!("{out}/loads.csv")), alone, "{above} + {below}");
    }
    let done = run(folder.path(), &text, "--ranks 3 --out three");
    done.done();
    assert!(done.stderr.contains(", 1 + 2 ranks\n"), "{}", done.stderr);
    assert_eq!(read(folder.path(), "three/loads.csv"), alone);
}

/// A case that requests ranks near each other.
fn near_each_other() -> String {
    with_scales(&fibers(&frozen()), (1, 2)) + "near = true\n"
}

#[test]
fn ranks_are_near_each_other_where_hwloc_knows() {
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

/// If neither the case nor the command gives the number of ranks of the micro scale, there is one.
#[test]
fn ranks_of_the_body_alone_leave_one_for_rves() {
    let folder = tempfile::tempdir().unwrap();
    let text = with_scales(&fibers(&frozen()), (2, 0));
    let done = run(folder.path(), &text, "--out out");
    done.done();
    assert!(done.stderr.contains(", 2 + 1 ranks\n"), "{}", done.stderr);
    assert_eq!(line(folder.path(), "check case.toml --json").object()["ranks"], 3);
}

/// The solver of the RVEs fails even at rest: the message is the same as in one process.
#[test]
fn a_failure_at_rest_is_told_alike() {
    let folder = tempfile::tempdir().unwrap();
    let solver = "\n[micro]\nsolver = { method = \"cg\", max_iterations = 1 }\n";
    let text = fibers(&frozen()) + solver;
    let (alone, shared) = (run(folder.path(), &text, "--out out"), run(folder.path(), &text, "--ranks 3 --out out"));
    assert_eq!((alone.code, &alone.stderr), (shared.code, &shared.stderr));
    assert!(!alone.stderr.is_empty());
}

#[test]
fn the_log_says_where_the_time_of_every_rank_went() {
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
fn what_is_written_does_not_depend_on_ranks() {
    let folder = tempfile::tempdir().unwrap();
    let text = format!("{}\n[output]\nrve = [1, 4]\n", fibers(&frozen()));
    run(folder.path(), &text, "--out alone").done();
    run(folder.path(), &text, "--ranks 4 --out shared").done();
    for file in ["rve/element-00001-step-00002.vtp", "rve/element-00004-step-00001.vtp", "rve/element-00004.pvd"] {
        assert_eq!(read(folder.path(), &format!("alone/{file}")), read(folder.path(), &format!("shared/{file}")));
    }
}

#[test]
fn an_interrupted_run_goes_on_on_other_ranks() {
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

/// RVEs that are created as the body is strained, sleep where it is at rest, and are deleted where it is torn.
fn with_lives() -> String {
    let matrix = "matrix = { model = \"neo-hookean\", shear_modulus = 1000.0, poisson_ratio = 0.3 }";
    let life = "life = { created_at = 0.025, asleep_below = 2e-3, deleted_at = 0.17 }";
    let text = fibers(&frozen()).replace("law = {", &format!("{matrix}\n{life}\nlaw = {{"));
    let curve = "displacement = { x = 0.2 }\ncurve = [[0.0, 0.0], [0.5, 0.45], [0.6, 0.452], [0.7, 0.454], [1.0, 1.0]]";
    text.replace("displacement = { x = 0.05 }", curve)
        .replace("cells = [1, 1, 1]", "cells = [2, 2, 1]")
        .replace("count = 2", "count = 10")
}

#[test]
fn rves_come_sleep_and_go_alike_on_any_ranks() {
    let folder = tempfile::tempdir().unwrap();
    let text = with_lives();
    run(folder.path(), &text, "--out alone").done();
    let loads = read(folder.path(), "alone/loads.csv");
    let lives = |out: &str| -> Vec<[u64; 4]> {
        let events = events(&folder.path().join(out));
        let rves = events.iter().filter(|event| event["event"] == "step").map(|event| &event["rve"]);
        rves.map(|rve| ["waiting", "asleep", "deleted", "solves"].map(|key| rve[key].as_u64().unwrap())).collect()
    };
    let alone = lives("alone");
    let most = |k: usize| alone.iter().map(|lives| lives[k]).max().unwrap();
    assert_eq!(alone[0][0], 24, "all wait at first: {alone:?}");
    assert_eq!(alone[0][3], 0, "and nothing is solved");
    assert_eq!(alone[4][0], 0, "all are there in the middle: {alone:?}");
    assert!(most(1) > 0, "some sleep where the load rests: {alone:?}");
    assert!(alone[9][2] > 0, "some are gone at the end: {alone:?}");
    for options in ["--ranks 2", "--ranks 4"] {
        run(folder.path(), &text, &format!("{options} --out shared")).done();
        assert_eq!(read(folder.path(), "shared/loads.csv"), loads, "{options}");
        assert_eq!(lives("shared"), alone, "{options}");
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
fn a_configuration_file_of_the_original_is_understood() {
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
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{said}");
    assert!(said.contains("warning: ") && said.contains("simmetrix") && said.contains(", 1 + 2 ranks\n"), "{said}");
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

/// The failure and its message are the same, whichever rank the RVE is on.
#[test]
fn a_step_that_fails_fails_alike() {
    let folder = tempfile::tempdir().unwrap();
    let text = fibers(&frozen()).replace("x = 0.05", "x = -1.5").replace("count = 2", "count = 5\nmax_cuts = 1");
    let alone = run(folder.path(), &text, "--out out");
    let said = alone.failed(3).to_owned();
    for options in ["--ranks 2", "--ranks 5"] {
        let shared = run(folder.path(), &text, &format!("{options} --out out"));
        assert_eq!(shared.failed(3), said, "{options}");
    }
}

#[test]
fn mistakes_are_told_once() {
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
fn a_body_of_a_formula_runs_on_ranks_too() {
    let folder = tempfile::tempdir().unwrap();
    let text = PRESSED.replace("-1.5", "-0.4");
    run(folder.path(), &text, "--out alone").done();
    run(folder.path(), &text, "--ranks 3 --out shared").done();
    assert_eq!(read(folder.path(), "alone/loads.csv"), read(folder.path(), "shared/loads.csv"));
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
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(said.starts_with("error: started as 2 processes") && said.contains("--features mpi"), "{said}");
}

#[cfg(feature = "mpi")]
mod processes {
    #[cfg(target_os = "linux")]
    use std::process::Stdio;
    use std::sync::{Mutex, MutexGuard, PoisonError};
    use std::time::{Duration, Instant};

    use super::*;

    /// Lets the runs of this module follow each other, because more processes than cores only slow each other down.
    fn in_turn() -> MutexGuard<'static, ()> {
        static TURN: Mutex<()> = Mutex::new(());
        TURN.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn launched(folder: &Path, ranks: usize, arguments: &str) -> Command {
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

    fn mpirun_done(folder: &Path, ranks: usize, arguments: &str) {
        let out = mpirun(folder, ranks, arguments);
        assert!(out.status.success(), "{ranks} ranks, {arguments}: {}", String::from_utf8_lossy(&out.stderr));
    }

    /// Returns the process that runs this rank in this folder.
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
        let run = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
        let start = Instant::now();
        while steps() < before + 2 {
            assert!(start.elapsed() < Duration::from_secs(300), "no step converges");
            std::thread::sleep(Duration::from_millis(20));
        }
        let process = process_of(&folder.canonicalize().unwrap(), rank).expect("the rank runs");
        let send = |signal: &str| Command::new("kill").args([signal, &process]).stderr(Stdio::null()).status().unwrap();
        assert!(send(signal).success());
        let sent = Instant::now();
        let ended = run.wait_with_output().unwrap();
        let taken = sent.elapsed();
        // The launcher may have left the process running.
        send("-KILL");
        assert!(!ended.status.success());
        assert!(steps() >= before + 2);
        (String::from_utf8_lossy(&ended.stderr).into_owned(), taken)
    }

    /// Stops the process of one rank of a run on the ranks of two scales; the run must end in time. Returns its stderr.
    #[cfg(target_os = "linux")]
    fn ended_in_time((above, below): (usize, usize), options: &str, hanging: usize) -> String {
        let _turn = in_turn();
        let folder = tempfile::tempdir().unwrap();
        let text = with_scales(&coarse_dogbone().replace("count = 3", "count = 2000"), (above, below));
        write_case(folder.path(), "case.toml", &text);
        let options = format!("--time-out 10 {options}");
        let (said, taken) = ended_by("-STOP", hanging, folder.path(), above + below, &options);
        assert!(taken < Duration::from_secs(60), "{taken:?}");
        said
    }

    /// Whichever rank is killed, the run ends within seconds, and a resumed run gives the results of an uninterrupted
    /// one.
    #[cfg(target_os = "linux")]
    #[test]
    fn nothing_on_disk_is_lost_with_a_rank_that_is_killed() {
        let _turn = in_turn();
        let folder = tempfile::tempdir().unwrap();
        let text = fibers(&frozen()).replace("count = 2", "count = 300");
        run(folder.path(), &text, "--out alone").done();
        write_case(folder.path(), "case.toml", &with_scales(&text, (1, 2)));
        for (rank, options) in [(2, ""), (0, "--resume")] {
            let (said, taken) = ended_by("-KILL", rank, folder.path(), 3, &format!("--backend sparse {options}"));
            assert!(taken < Duration::from_secs(20), "{taken:?}: {said}");
        }
        let steps = read(folder.path(), "out/loads.csv").lines().count() - 1;
        assert!(steps < 300, "it was killed underway");
        mpirun_done(folder.path(), 3, "run case.toml --backend sparse --out out --resume");
        assert_eq!(read(folder.path(), "out/loads.csv"), read(folder.path(), "alone/loads.csv"));
    }

    /// The message names the scale of the rank that hangs.
    #[cfg(target_os = "linux")]
    #[test]
    fn a_scale_that_hangs_is_named_in_time() {
        let said = ended_in_time((1, 2), "", 2);
        assert!(said.contains(" 10 s") && said.contains("micro"), "{said}");
    }

    /// With the body on PETSc, the run ends in time, whether the rank that hangs solves RVEs or belongs to the body.
    #[cfg(all(feature = "petsc", target_os = "linux"))]
    #[test]
    fn ranks_on_petsc_that_hang_are_missed_in_time() {
        for (hanging, scale) in [(2, "micro"), (1, "macro")] {
            let said = ended_in_time((2, 1), "--backend petsc", hanging);
            assert!(said.contains(" 10 s") && said.contains(scale), "{said}");
        }
    }

    #[test]
    fn the_dogbone_is_the_same_on_processes() {
        let _turn = in_turn();
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

    #[cfg(feature = "hwloc")]
    #[test]
    fn processes_near_each_other_give_the_same() {
        let _turn = in_turn();
        let folder = tempfile::tempdir().unwrap();
        run(folder.path(), &fibers(&frozen()), "--out alone").done();
        write_case(folder.path(), "case.toml", &near_each_other());
        mpirun_done(folder.path(), 3, "run case.toml --backend sparse --out shared");
        assert_eq!(read(folder.path(), "shared/loads.csv"), read(folder.path(), "alone/loads.csv"));
    }

    /// Also if the run is resumed on other numbers of ranks.
    #[test]
    fn rves_come_sleep_and_go_alike_on_processes() {
        let _turn = in_turn();
        let folder = tempfile::tempdir().unwrap();
        let text = with_lives();
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

    /// As above, with the body on PETSc.
    #[cfg(feature = "petsc")]
    #[test]
    fn rves_come_sleep_and_go_alike_on_petsc() {
        let _turn = in_turn();
        let folder = tempfile::tempdir().unwrap();
        let text = with_lives();
        run(folder.path(), &text, "--out alone --backend sparse").done();
        let alone = read(folder.path(), "alone/loads.csv");
        write_case(folder.path(), "case.toml", &with_scales(&text, (2, 2)));
        mpirun_done(folder.path(), 4, "run case.toml --backend petsc --out shared");
        same_to_rounding(&read(folder.path(), "shared/loads.csv"), &alone);
        std::fs::remove_file(folder.path().join("shared/checkpoint/step-00010.bin")).unwrap();
        write_case(folder.path(), "case.toml", &with_scales(&text, (3, 1)));
        mpirun_done(folder.path(), 4, "run case.toml --backend petsc --out shared --resume");
        same_to_rounding(&read(folder.path(), "shared/loads.csv"), &alone);
    }

    /// Checks that forces agree to 1e-10 of the largest force of their step, and likewise areas, displacements and
    /// volumes.
    #[cfg(feature = "petsc")]
    fn same_to_rounding(found: &str, expected: &str) {
        let numbers = |line: &str| -> Vec<f64> { line.split(',').map(|value| value.parse().unwrap()).collect() };
        let header = expected.lines().next().unwrap();
        assert_eq!((found.lines().next(), found.lines().count()), (Some(header), expected.lines().count()));
        let kinds: Vec<Option<u8>> =
            header.split(',').map(|name| Some(*name.rsplit_once('.')?.1.as_bytes().first()?)).collect();
        for (found, expected) in found.lines().zip(expected.lines()).skip(1) {
            let both: Vec<(f64, f64)> = numbers(found).into_iter().zip(numbers(expected)).collect();
            for kind in *b"afuv" {
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
        let _turn = in_turn();
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
            same_to_rounding(&read(folder.path(), "shared/loads.csv"), &alone);
        }
    }

    #[test]
    fn mistakes_end_all_processes_within_seconds() {
        let _turn = in_turn();
        let folder = tempfile::tempdir().unwrap();
        let start = Instant::now();
        write_case(folder.path(), "case.toml", &with_scales(PRESSED, (2, 3)));
        let out = mpirun(folder.path(), 4, "run case.toml --backend sparse");
        let said = String::from_utf8_lossy(&out.stderr);
        assert_eq!(said.matches("macro 2 + micro 3 = 5 ranks, but 4 were started").count(), 1, "{said}");
        assert!(!out.status.success());
        let out = mpirun(folder.path(), 3, "run case.toml --ranks 2");
        let said = String::from_utf8_lossy(&out.stderr);
        assert_eq!(said.matches("--ranks 2 under mpirun, which has started 3").count(), 1, "{said}");
        write_case(folder.path(), "case.toml", "title = 3");
        let out = mpirun(folder.path(), 3, "run case.toml --backend sparse");
        assert_eq!(out.status.code(), Some(2), "{}", String::from_utf8_lossy(&out.stderr));
        assert!(start.elapsed() < Duration::from_secs(30));
    }
}
