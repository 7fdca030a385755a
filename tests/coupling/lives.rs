//! Random sequences of changes to couplings between threads.

use crate::checks::lives::nothing_is_lost;
use crate::{on, on_all};

/// Number of sequences on the same threads, whose mailboxes keep the addresses of all former groups.
const LIVES: u64 = 100;

#[test]
fn nothing_is_lost_in_random_lives() {
    // Few ranks in most of the sequences, because these are fast.
    let ranks = [2, 3, 2, 4, 3, 2, 5, 2, 3, 9];
    for (first, ranks) in (0..10_000).step_by(LIVES as usize).zip(ranks.into_iter().cycle()) {
        on(&[ranks], |comm| nothing_is_lost(comm, first..first + LIVES, 2));
    }
    on_all(|comm| nothing_is_lost(comm, 10_000..10_010, 2));
}

#[test]
fn nothing_is_lost_between_three_scales() {
    let ranks = [3, 4, 3, 5, 3];
    for (first, ranks) in (0..2_500).step_by(LIVES as usize).zip(ranks.into_iter().cycle()) {
        on(&[ranks], |comm| nothing_is_lost(comm, first..first + LIVES, 3));
    }
    on_all(|comm| nothing_is_lost(comm, 2_500..2_510, 3));
}
