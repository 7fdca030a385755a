//! Scales and couplings on ranks that are MPI processes: the same checks as on threads, and the end of all processes if
//! one fails. This program runs itself under `mpirun`, because MPI can be initialized only once per process; the
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

use checks::{Outcome, lives, ranks, scales, units};
use launcher::Launcher;

/// The environment variable that tells a process what to run.
const LAUNCHED: &str = "BIOTISSUE_MPI_TEST";

/// Its value in a process that runs checks.
const CHECK: &str = "check";

type Check = (&'static str, fn(&MpiComm) -> Outcome);

const CHECKS: &[Check] = &[
    ("messages_in_order", ranks::messages_of_one_tag_arrive_in_order_and_tags_stay_apart),
    ("messages_of_any_length", ranks::messages_of_any_length_arrive_whole),
    ("together", ranks::what_all_do_together_is_the_same_for_all),
    ("groups", ranks::groups_do_not_hear_each_other),
    ("agree", ranks::a_failure_of_one_is_agreed_on_by_all),
    ("sums", ranks::sums_are_in_the_order_of_the_ranks),
    ("time_out", ranks::who_does_not_answer_in_time_is_named),
    ("time_out_together", ranks::who_does_not_take_part_in_time_is_named),
    ("no_such_rank", ranks::there_is_no_rank_beyond_the_last),
    ("scales", scales::each_rank_is_of_one_scale_and_finds_the_others),
    ("mains", scales::each_scale_runs_its_own_main),
    ("news", scales::what_a_scale_tells_all_ranks_of_another_hear),
    ("plan_for_others", scales::a_plan_for_other_ranks_is_refused_by_all),
    ("time_out", scales::a_scale_that_does_not_answer_is_named),
    ("published", units::tables_are_those_published),
    ("layouts", units::another_layout_on_the_other_side_is_refused_by_both),
    ("while_a_rank_works", units::values_come_in_while_a_rank_works),
    ("units_of_before", units::receiving_for_units_of_before_is_refused),
    #[cfg(feature = "sparse")]
    ("local_values_sparse", |comm| {
        units::local_values_go_from_vector_to_vector::<biotissue::backends::sparse::Sparse, _>(comm, &())
    }),
    #[cfg(feature = "batched")]
    ("local_values_batched", |comm| {
        units::local_values_go_from_vector_to_vector::<biotissue::backends::batched::Batched, _>(comm, &())
    }),
    #[cfg(feature = "petsc")]
    ("local_values_petsc", |comm| {
        use biotissue::backends::petsc::{Context, Petsc, Session};
        let alone = Context::new(&Session::new()?, &mpi::topology::SimpleCommunicator::self_comm());
        units::local_values_go_from_vector_to_vector::<Petsc, _>(comm, &alone)
    }),
    ("one_by_one", units::units_that_come_one_by_one_are_spread_evenly),
    ("wrong_calls", units::wrong_calls_say_what_is_wrong),
    ("ring", units::three_scales_are_coupled_in_a_ring),
    ("lives", random_lives),
    ("lives_of_three", random_lives_of_three),
];

/// Checks that take 9 GiB of memory and run only if they are named.
const ON_REQUEST: &[Check] = &[("longer_than_2_31_bytes", messages_of_more_than_2_31_bytes)];

/// A failure of a process: its name, the function that fails, and a text that must be printed.
type Failure = (&'static str, fn(&MpiComm) -> Outcome, &'static str);

const FAILURES: &[Failure] = &[
    ("a_rank_that_fails", fail, "the law is broken"),
    ("a_rank_that_fails_with_a_message_underway", fail_with_a_message_underway, "the law is broken"),
    ("a_rank_that_fails_where_others_wait_together", fail_in_a_collective, "the law is broken"),
    ("a_rank_that_panics", panic_alone, "one too many"),
    ("a_rank_that_is_killed", be_killed, "signal 9"),
];

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).filter(|word| !word.starts_with('-')).collect();
    if let Ok(what) = std::env::var(LAUNCHED) {
        run(|comm| take_part(&comm, &what, &words), |_| 1);
        return ExitCode::SUCCESS;
    }
    let launcher = match Launcher::find() {
        Ok(launcher) => launcher,
        Err(error) => {
            println!("there is no mpirun: {error}");
            return ExitCode::FAILURE;
        }
    };
    let mut all_well = true;
    for ranks in 1..=8 {
        all_well &= report(&format!("checks on {ranks} ranks"), || check(&launcher, ranks, &words));
    }
    if is_meant("published", &words) {
        all_well &= report("checks on 12 ranks", || check(&launcher, 12, &["published".to_owned()]));
    }
    for failure in FAILURES.iter().filter(|(name, ..)| is_meant(name, &words)) {
        all_well &= report(&format!("{} ends all", failure.0), || ends_all(&launcher, failure));
    }
    if all_well { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

fn is_meant(name: &str, words: &[String]) -> bool {
    words.is_empty() || words.iter().any(|word| name.contains(word.as_str()))
}

/// Prints the outcome of `what` and its duration, and returns true if it succeeded.
fn report(name: &str, what: impl FnOnce() -> Outcome) -> bool {
    let start = Instant::now();
    let outcome = what();
    let well = if outcome.is_ok() { "ok" } else { "FAILED" };
    println!("{name} ... {well} ({:.1} s)", start.elapsed().as_secs_f64());
    if let Err(error) = &outcome {
        println!("{error}");
    }
    outcome.is_ok()
}

/// Runs the checks in new processes.
fn check(launcher: &Launcher, ranks: usize, words: &[String]) -> Outcome {
    let status = launcher.command(ranks, 1200)?.args(words).env(LAUNCHED, CHECK).status()?;
    if status.success() { Ok(()) } else { Err(format!("{status}").into()) }
}

/// Lets one of three processes fail; all must end within seconds.
fn ends_all(launcher: &Launcher, &(name, _, says): &Failure) -> Outcome {
    const LIMIT: Duration = Duration::from_secs(20);
    let start = Instant::now();
    let output = launcher.command(3, 60)?.env(LAUNCHED, name).output()?;
    let taken = start.elapsed();
    // The launcher may print its own messages to either stream.
    let said = [output.stderr, output.stdout].map(|text| String::from_utf8_lossy(&text).into_owned()).concat();
    if output.status.success() || taken > LIMIT || !said.contains(says) {
        return Err(format!("{} after {:.1} s, saying: {said}", output.status, taken.as_secs_f64()).into());
    }
    Ok(())
}

/// For two ranks: a message of 2^31 bytes and a longer one. MPI counts in 32 bits, so messages are sent in parts of
/// 2^30 bytes: the first consists of whole parts, the second does not.
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
fn take_part(comm: &MpiComm, what: &str, words: &[String]) -> Outcome {
    comm.barrier()?;
    if what != CHECK {
        let (_, fail, _) = FAILURES.iter().find(|(name, ..)| *name == what).ok_or("there is no such failure")?;
        return fail(comm);
    }
    let on_request = ON_REQUEST.iter().filter(|(name, _)| words.iter().any(|word| word == name));
    for (name, check) in CHECKS.iter().filter(|(name, _)| is_meant(name, words)).chain(on_request) {
        let start = Instant::now();
        check(comm).map_err(|error| format!("{name}: {error}"))?;
        comm.barrier()?;
        if comm.rank() == 0 {
            println!("  {name} ... ok ({:.2} s)", start.elapsed().as_secs_f64());
        }
    }
    Ok(())
}

fn random_lives(comm: &MpiComm) -> Outcome {
    lives::nothing_is_lost(comm, seeds(comm, 400), 2)
}

fn random_lives_of_three(comm: &MpiComm) -> Outcome {
    lives::nothing_is_lost(comm, seeds(comm, 200), 3)
}

/// Returns other seeds for each number of ranks, and fewer for more ranks, which are slower.
fn seeds(comm: &MpiComm, count: u64) -> Range<u64> {
    let ranks = comm.size() as u64;
    1_000_000 * ranks..1_000_000 * ranks + count / ranks
}

/// The tag of a message that is never sent; the ranks that do not fail wait for it.
const NEVER: Tag = Tag::of(7);

fn wait_for_ever(comm: &MpiComm) -> Outcome {
    comm.receive(1, NEVER)?;
    Ok(())
}

fn fail(comm: &MpiComm) -> Outcome {
    if comm.rank() == 1 { Err("the law is broken".into()) } else { wait_for_ever(comm) }
}

/// The message is so long that it is sent only when received, and it is never received.
fn fail_with_a_message_underway(comm: &MpiComm) -> Outcome {
    if comm.rank() != 1 {
        return wait_for_ever(comm);
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
    wait_for_ever(comm)
}

fn panic_alone(comm: &MpiComm) -> Outcome {
    assert!(comm.rank() != 1, "one too many");
    wait_for_ever(comm)
}

fn be_killed(comm: &MpiComm) -> Outcome {
    if comm.rank() == 1 {
        Command::new("sh").args(["-c", &format!("kill -9 {}", std::process::id())]).status()?;
    }
    wait_for_ever(comm)
}
