//! Load balancing on threads.

use biotissue::backends::comm::thread::run;
use biotissue::coupling::balance::{BalanceError, Moves, migrate};
use biotissue::las::{Comm, Message};

use crate::checks::balance;
use crate::{on, on_all};

#[test]
fn the_published_example_in_three_phases() {
    on(&[12], balance::the_published_example_in_three_phases);
}

#[test]
fn the_published_coupling_is_balanced() {
    on(&[12, 13], balance::the_published_coupling_is_balanced);
}

#[test]
fn several_couplings_follow_one_migration() {
    on_all(balance::several_couplings_follow_one_migration);
}

#[test]
fn invalid_moves_are_errors_on_all_ranks() {
    on_all(balance::invalid_moves_are_errors_on_all_ranks);
}

#[test]
fn receives_started_before_a_migration_are_rejected() {
    on_all(balance::receives_started_before_a_migration_are_rejected);
}

#[test]
fn a_rank_that_fails_during_a_migration_ends_all_ranks() {
    for phase in 0..2 {
        let failed = run(4, |comm| {
            if comm.rank() == 2 && phase == 0 {
                return Err("the law is broken".to_owned());
            }
            let moves = Moves::default().with(&[0], (comm.rank() + 1) % 4);
            let pack = |_| {
                assert!(comm.rank() != 2, "one too many");
                Message::zeros(100)
            };
            migrate(&comm, &moves, &[comm.rank() as u64], pack).map_err(|error: BalanceError| error.to_string())
        });
        let failed = failed.map(drop).expect_err("a rank failed");
        let reason = ["the law is broken", "panicked: one too many"][phase];
        assert_eq!((failed.rank, failed.reason.as_str()), (2, reason));
    }
}
