//! Random sequences of changes to couplings between threads.

use crate::checks::random_changes::every_unit_arrives_once;
use crate::{on, on_all};

/// Number of sequences that run one after the other on the same threads, whose mailboxes keep the addresses of all
/// former groups.
const SEQUENCES: u64 = 100;

#[test]
fn every_unit_arrives_once_between_two_scales() {
    // Most of the sequences have few ranks, because these are fast.
    let ranks = [2, 3, 2, 4, 3, 2, 5, 2, 3, 9];
    for (first, ranks) in (0..10_000).step_by(SEQUENCES as usize).zip(ranks.into_iter().cycle()) {
        on(&[ranks], |comm| every_unit_arrives_once(comm, first..first + SEQUENCES, 2));
    }
    on_all(|comm| every_unit_arrives_once(comm, 10_000..10_010, 2));
}

#[test]
fn every_unit_arrives_once_between_three_scales() {
    let ranks = [3, 4, 3, 5, 3];
    for (first, ranks) in (0..2_500).step_by(SEQUENCES as usize).zip(ranks.into_iter().cycle()) {
        on(&[ranks], |comm| every_unit_arrives_once(comm, first..first + SEQUENCES, 3));
    }
    on_all(|comm| every_unit_arrives_once(comm, 2_500..2_510, 3));
}
