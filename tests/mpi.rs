//! Scales and couplings on ranks that are MPI processes: the checks that threads pass too, and the end of all processes
//! if one fails. This program runs itself under `mpirun`, because MPI can be initialized only once per process; the
//! environment variable `MPIRUN` names another launcher, such as `mpirun.mpich`.
//!
//! `cargo test --features mpi --test mpi -- WORD` runs the checks whose names contain the word. The check of messages
//! beyond 2^31 bytes runs only if it is named in this way: `longer_than_2_31_bytes`.

#[path = "coupling/checks/mod.rs"]
mod checks;
#[path = "support/launcher.rs"]
mod launcher;

use std::ops::Range;
use std::process::{Command, ExitCode};
use std::time::{Duration, Instant};

use biotissue::backends::comm::mpi::{MpiComm, run};
use biotissue::las::{Comm, Message, ReceiveRequest, Tag};
use bytemuck::{cast_slice, cast_slice_mut};

use biotissue::coupling::balance::{Moves, migrate};
use checks::{Outcome, balance, random_changes, ranks, scales, units};
use launcher::Launcher;

/// The environment variable with the name of what a launched process runs.
const LAUNCHED: &str = "BIOTISSUE_MPI_TEST";

/// The value of [`LAUNCHED`] in a process that runs checks.
const CHECK: &str = "check";

type Check = (&'static str, fn(&MpiComm) -> Outcome);

const CHECKS: &[Check] = &[
    ("messages_in_order", ranks::messages_of_a_tag_arrive_in_order_independently_of_other_tags),
    ("messages_of_any_length", ranks::messages_of_any_length_arrive_complete),
    ("collectives", ranks::collective_operations_give_the_same_result_on_all_ranks),
    ("groups", ranks::groups_do_not_receive_messages_of_each_other),
    ("agree", ranks::all_ranks_agree_on_the_failure_of_one),
    ("sums", ranks::sums_are_along_a_fixed_tree),
    ("time_out_of_receive", ranks::a_time_out_of_receive_names_the_sender),
    ("time_out_of_gather", ranks::a_time_out_of_gather_names_the_missing_rank),
    ("late_messages", ranks::messages_of_abandoned_receives_do_not_arrive_elsewhere),
    ("no_such_rank", ranks::ranks_that_do_not_exist_are_errors),
    ("scales", scales::each_rank_belongs_to_one_scale_and_finds_the_others),
    ("mains", scales::each_scale_runs_its_own_main),
    ("broadcast_to_a_scale", scales::a_broadcast_reaches_all_ranks_of_another_scale),
    ("plan_for_other_ranks", scales::a_plan_for_another_number_of_ranks_is_rejected_on_all_ranks),
    ("time_out_of_a_scale", scales::a_time_out_names_the_scale_that_does_not_send),
    ("published", units::distributions_are_those_published),
    ("layouts", units::different_layouts_are_rejected_on_both_sides),
    ("pending_exchanges", units::several_exchanges_are_pending_at_once),
    ("receive_before_a_change", units::receives_started_before_a_change_are_rejected),
    #[cfg(feature = "sparse")]
    ("local_values_sparse", |comm| {
        units::local_values_are_sent_from_vector_to_vector::<biotissue::backends::sparse::Sparse, _>(comm, &())
    }),
    #[cfg(feature = "batched")]
    ("local_values_batched", |comm| {
        units::local_values_are_sent_from_vector_to_vector::<biotissue::backends::batched::Batched, _>(comm, &())
    }),
    #[cfg(feature = "petsc")]
    ("local_values_petsc", |comm| {
        use biotissue::backends::petsc::{Context, Petsc, Session};
        let alone = Context::new(&Session::new()?, &mpi::topology::SimpleCommunicator::self_comm());
        units::local_values_are_sent_from_vector_to_vector::<Petsc, _>(comm, &alone)
    }),
    ("one_by_one", units::units_that_are_added_one_by_one_are_distributed_evenly),
    ("invalid_calls", units::invalid_calls_are_errors),
    ("separate_streams", units::channels_are_separate_streams),
    ("ring", units::three_scales_are_coupled_in_a_ring),
    ("published_migration", balance::the_published_example_in_three_phases),
    ("published_balance", balance::the_published_coupling_is_balanced),
    ("several_couplings_migrate", balance::several_couplings_follow_one_migration),
    ("invalid_moves", balance::invalid_moves_are_errors_on_all_ranks),
    ("receive_before_a_migration", balance::receives_started_before_a_migration_are_rejected),
    ("random_changes", random_changes_of_two_scales),
    ("random_changes_of_three", random_changes_of_three_scales),
];

/// Checks that need 9 GiB of memory and run only if they are named.
const ON_REQUEST: &[Check] = &[("longer_than_2_31_bytes", messages_of_more_than_2_31_bytes)];

/// A failure of a process: its name, the function that fails, and a text that must be printed.
type Failure = (&'static str, fn(&MpiComm) -> Outcome, &'static str);

const FAILURES: &[Failure] = &[
    ("a_rank_that_fails", fail, "the law is broken"),
    ("a_rank_that_fails_with_a_message_underway", fail_with_a_message_underway, "the law is broken"),
    ("a_rank_that_fails_while_others_wait_in_a_collective", fail_in_a_collective, "the law is broken"),
    ("a_rank_that_panics", panic_on_one_rank, "one too many"),
    ("a_rank_that_is_killed", kill_one_rank, "signal 9"),
    ("a_rank_that_fails_before_a_migration", fail_before_a_migration, "the law is broken"),
    ("a_rank_that_panics_during_a_migration", panic_during_a_migration, "one too many"),
    ("a_rank_that_is_killed_during_a_migration", die_during_a_migration, "signal 9"),
];

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).filter(|word| !word.starts_with('-')).collect();
    if let Ok(what) = std::env::var(LAUNCHED) {
        run(|comm| run_in_process(&comm, &what, &words), |_| 1);
        return ExitCode::SUCCESS;
    }
    let launcher = match Launcher::find() {
        Ok(launcher) => launcher,
        Err(error) => {
            println!("cannot run mpirun: {error}");
            return ExitCode::FAILURE;
        }
    };
    let mut all_passed = true;
    for ranks in 1..=8 {
        all_passed &= report(&format!("checks on {ranks} ranks"), || check(&launcher, ranks, &words));
    }
    if is_selected("published", &words) {
        all_passed &= report("checks on 12 ranks", || check(&launcher, 12, &["published".to_owned()]));
    }
    for failure in FAILURES.iter().filter(|(name, ..)| is_selected(name, &words)) {
        all_passed &= report(&format!("{} ends all", failure.0), || check_that_all_end(&launcher, failure));
    }
    if all_passed { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

fn is_selected(name: &str, words: &[String]) -> bool {
    words.is_empty() || words.iter().any(|word| name.contains(word.as_str()))
}

/// Runs a test, prints its outcome and its duration, and returns true if it succeeded.
fn report(name: &str, test: impl FnOnce() -> Outcome) -> bool {
    let start = Instant::now();
    let outcome = test();
    let word = if outcome.is_ok() { "ok" } else { "FAILED" };
    println!("{name} ... {word} ({:.1} s)", start.elapsed().as_secs_f64());
    if let Err(error) = &outcome {
        println!("{error}");
    }
    outcome.is_ok()
}

/// Runs the checks in new processes.
fn check(launcher: &Launcher, ranks: usize, words: &[String]) -> Outcome {
    let status = launcher.command(&std::env::current_exe()?, ranks, 1200).args(words).env(LAUNCHED, CHECK).status()?;
    if status.success() { Ok(()) } else { Err(format!("{status}").into()) }
}

/// Makes one of three processes fail and checks that all end within seconds and print the text of the failure.
fn check_that_all_end(launcher: &Launcher, &(name, _, text): &Failure) -> Outcome {
    const LIMIT: Duration = Duration::from_secs(20);
    let start = Instant::now();
    let output = launcher.command(&std::env::current_exe()?, 3, 60).env(LAUNCHED, name).output()?;
    let taken = start.elapsed();
    // The launcher may print its own messages to either stream.
    let printed = [output.stderr, output.stdout].map(|text| String::from_utf8_lossy(&text).into_owned()).concat();
    if output.status.success() || taken > LIMIT || !printed.contains(text) {
        return Err(format!("{} after {:.1} s, output: {printed}", output.status, taken.as_secs_f64()).into());
    }
    Ok(())
}

/// Sends a message of 2^31 bytes and a longer one between two ranks. MPI counts in 32 bits, so messages are sent in
/// parts of 2^30 bytes: the first consists of whole parts, the second does not.
fn messages_of_more_than_2_31_bytes(comm: &MpiComm) -> Outcome {
    let value = |k: usize| (k as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let is_whole = |found: &[u64]| found.iter().enumerate().all(|(k, &found)| found == value(k));
    if comm.size() != 2 {
        return Ok(());
    }
    for words in [1 << 28, (1 << 28) + 5] {
        let mut values: Vec<u64> = if comm.rank() == 0 { (0..words).map(value).collect() } else { vec![0; words] };
        if comm.rank() == 0 {
            comm.send_bytes(Tag::of(3), &[(1, cast_slice(&values))])?;
            comm.send(1, Tag::of(3), Message::of(&values))?;
            comm.send_bytes(Tag::of(3), &[(1, cast_slice(&values))])?;
        } else {
            comm.receive_bytes(0, Tag::of(3), cast_slice_mut(&mut values))?;
            assert!(is_whole(&values), "{words} words, in place");
            assert!(is_whole(comm.receive(0, Tag::of(3))?.values().unwrap_or_default()), "{words} words");
            let arriving = comm.start_receive(0, Tag::of(3), 8 * words, Message::new())?;
            assert!(is_whole(arriving.wait()?.values().unwrap_or_default()), "{words} words, expected");
        }
        let own = Message::of(if comm.rank() == 0 { &values } else { &[] });
        assert!(is_whole(comm.broadcast(0, own.clone())?.values().unwrap_or_default()), "{words} words, broadcast");
        let gathered = comm.gather(1, own)?;
        assert_eq!(gathered.is_some(), comm.rank() == 1);
        assert!(gathered.is_none_or(|all| is_whole(all[0].values().unwrap_or_default())), "{words} words, gathered");
    }
    Ok(())
}

/// Runs the checks or the failure that this process was launched for.
fn run_in_process(comm: &MpiComm, what: &str, words: &[String]) -> Outcome {
    comm.barrier()?;
    if what != CHECK {
        let (_, fail, _) = FAILURES.iter().find(|(name, ..)| *name == what).ok_or("there is no such failure")?;
        return fail(comm);
    }
    let on_request = ON_REQUEST.iter().filter(|(name, _)| words.iter().any(|word| word == name));
    for (name, check) in CHECKS.iter().filter(|(name, _)| is_selected(name, words)).chain(on_request) {
        let start = Instant::now();
        check(comm).map_err(|error| format!("{name}: {error}"))?;
        comm.barrier()?;
        if comm.rank() == 0 {
            println!("  {name} ... ok ({:.2} s)", start.elapsed().as_secs_f64());
        }
    }
    Ok(())
}

fn random_changes_of_two_scales(comm: &MpiComm) -> Outcome {
    random_changes::every_unit_arrives_once(comm, seeds(comm, 400), 2)
}

fn random_changes_of_three_scales(comm: &MpiComm) -> Outcome {
    random_changes::every_unit_arrives_once(comm, seeds(comm, 200), 3)
}

/// Returns different seeds for each number of ranks, and fewer for more ranks, which are slower.
fn seeds(comm: &MpiComm, count: u64) -> Range<u64> {
    let ranks = comm.size() as u64;
    1_000_000 * ranks..1_000_000 * ranks + count / ranks
}

/// The tag of a message that is never sent; the ranks that do not fail wait for it.
const NEVER: Tag = Tag::of(7);

fn wait_forever(comm: &MpiComm) -> Outcome {
    comm.receive(1, NEVER)?;
    Ok(())
}

fn fail(comm: &MpiComm) -> Outcome {
    if comm.rank() == 1 { Err("the law is broken".into()) } else { wait_forever(comm) }
}

/// Fails while a message is pending, which is so long that it is sent only when it is received, and never received.
fn fail_with_a_message_underway(comm: &MpiComm) -> Outcome {
    if comm.rank() != 1 {
        return wait_forever(comm);
    }
    let _underway = comm.start_send(0, Tag::of(8), Message::zeros(1 << 26))?;
    Err("the law is broken".into())
}

fn fail_in_a_collective(comm: &MpiComm) -> Outcome {
    comm.broadcast(2, Message::text("the last one"))?;
    if comm.rank() == 1 {
        return Err("the law is broken".into());
    }
    comm.gather_all(Message::new())?;
    wait_forever(comm)
}

fn panic_on_one_rank(comm: &MpiComm) -> Outcome {
    assert!(comm.rank() != 1, "one too many");
    wait_forever(comm)
}

fn kill_one_rank(comm: &MpiComm) -> Outcome {
    if comm.rank() == 1 {
        kill_this_process()?;
    }
    wait_forever(comm)
}

fn kill_this_process() -> Outcome {
    Command::new("sh").args(["-c", &format!("kill -9 {}", std::process::id())]).status()?;
    Ok(())
}

fn fail_before_a_migration(comm: &MpiComm) -> Outcome {
    if comm.rank() == 1 {
        return Err("the law is broken".into());
    }
    migrate_to_the_next_rank(comm, || Ok(()))
}

fn panic_during_a_migration(comm: &MpiComm) -> Outcome {
    migrate_to_the_next_rank(comm, || {
        assert!(comm.rank() != 1, "one too many");
        Ok(())
    })
}

fn die_during_a_migration(comm: &MpiComm) -> Outcome {
    migrate_to_the_next_rank(comm, || if comm.rank() == 1 { kill_this_process() } else { Ok(()) })
}

/// Moves units that are so long that they are sent only when they are received, and calls `fail` between two of them.
fn migrate_to_the_next_rank(comm: &MpiComm, fail: impl Fn() -> Outcome) -> Outcome {
    let moves = Moves::default().with(&[0, 1], (comm.rank() + 1) % comm.size());
    migrate(comm, &moves, &[0, 1], |index| {
        if index == 1 {
            fail().expect("the shell kills");
        }
        Message::zeros(1 << 24)
    })?;
    wait_forever(comm)
}
