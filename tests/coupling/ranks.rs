//! Messages between threads, and errors that end all ranks.

use std::time::{Duration, Instant};

use biotissue::backends::comm::thread::{Failed, run};
use biotissue::coupling::{Plan, Scales, Share};
use biotissue::las::{Comm, CommError, Message, Tag};

use crate::checks::ranks;
use crate::on_all;

const TAG: Tag = Tag::of(3);

#[test]
fn messages_of_a_tag_arrive_in_order_independently_of_other_tags() {
    on_all(ranks::messages_of_a_tag_arrive_in_order_independently_of_other_tags);
}

#[test]
fn messages_of_any_length_arrive_complete() {
    on_all(ranks::messages_of_any_length_arrive_complete);
}

#[test]
fn collective_operations_give_the_same_result_on_all_ranks() {
    on_all(ranks::collective_operations_give_the_same_result_on_all_ranks);
}

#[test]
fn groups_do_not_receive_messages_of_each_other() {
    on_all(ranks::groups_do_not_receive_messages_of_each_other);
}

#[test]
fn all_ranks_agree_on_the_failure_of_one() {
    on_all(ranks::all_ranks_agree_on_the_failure_of_one);
}

#[test]
fn a_time_out_of_receive_names_the_sender() {
    on_all(ranks::a_time_out_of_receive_names_the_sender);
}

#[test]
fn sums_are_along_a_fixed_tree() {
    on_all(ranks::sums_are_along_a_fixed_tree);
}

#[test]
fn a_time_out_of_gather_names_the_missing_rank() {
    on_all(ranks::a_time_out_of_gather_names_the_missing_rank);
}

#[test]
fn messages_of_abandoned_receives_do_not_arrive_elsewhere() {
    on_all(ranks::messages_of_abandoned_receives_do_not_arrive_elsewhere);
}

#[test]
fn ranks_that_do_not_exist_are_errors() {
    on_all(ranks::ranks_that_do_not_exist_are_errors);
}

#[test]
fn a_failing_rank_ends_all_ranks() {
    let start = Instant::now();
    let failed = run(4, |comm| -> Result<(), String> {
        if comm.rank() == 2 {
            return Err("the law is broken".to_owned());
        }
        let ended = comm.receive(3 - comm.rank(), TAG).map(drop);
        Err(ended.expect_err("no rank sends").to_string())
    });
    let expected = Failed { rank: 2, reason: "the law is broken".into(), has_panicked: false };
    assert_eq!(failed.map(drop), Err(expected));
    assert!(start.elapsed() < Duration::from_secs(5));
}

#[test]
fn a_panicking_rank_ends_all_ranks() {
    let failed = run(3, |comm| -> Result<(), CommError> {
        assert!(comm.rank() != 1, "one too many");
        comm.barrier()
    });
    let failed = failed.map(drop).expect_err("a rank panicked");
    assert_eq!((failed.rank, failed.reason.as_str(), failed.has_panicked), (1, "panicked: one too many", true));
}

#[test]
fn a_rank_with_a_time_out_ends_all_ranks() {
    let failed = run(2, |comm| {
        let timed = comm.duplicate(Some(Duration::from_millis(50)))?;
        if comm.rank() == 0 { timed.receive(1, TAG).map(drop) } else { comm.receive(0, TAG).map(drop) }
    });
    let failed = failed.map(drop).expect_err("no rank sends");
    assert_eq!((failed.rank, failed.reason.as_str()), (0, "no message from rank 1 within 0.05 s"));
}

#[test]
fn a_rank_that_ends_without_sending_is_an_error() {
    let failed = run(3, |comm| -> Result<(), CommError> {
        match comm.rank() {
            0 => comm.send(2, TAG, Message::text("the last word")),
            1 => comm.receive(2, TAG).map(drop),
            // A message that was sent before its sender ended arrives.
            _ => comm.receive(0, TAG).and_then(|_| comm.receive(0, TAG)).map(drop),
        }
    });
    let failed = failed.map(drop).expect_err("no rank sends");
    assert_eq!(failed.rank, 2);
    assert!(failed.reason.contains("rank 0 failed: it ended without sending"), "{}", failed.reason);
}

#[test]
fn different_plans_on_the_ranks_are_an_error() {
    let failed = run(3, |comm| {
        let plan = Plan::default().with("macro", Share::Count(1 + comm.rank() / 2)).with("micro", Share::Ratio(1.0));
        Scales::new(&comm, &plan).map(drop)
    });
    let failed = failed.map(drop).expect_err("rank 2 has another plan");
    assert_eq!(failed.rank, 2);
    assert!(failed.reason.contains("Count(2)") && failed.reason.contains("Count(1)"), "{}", failed.reason);
}
