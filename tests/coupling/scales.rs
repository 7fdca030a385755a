//! Scales on threads.

use crate::checks::scales;
use crate::{on, on_all};

#[test]
fn each_rank_belongs_to_one_scale_and_finds_the_others() {
    on_all(scales::each_rank_belongs_to_one_scale_and_finds_the_others);
}

#[test]
fn each_scale_runs_its_own_main() {
    on_all(scales::each_scale_runs_its_own_main);
}

#[test]
fn a_broadcast_reaches_all_ranks_of_another_scale() {
    on_all(scales::a_broadcast_reaches_all_ranks_of_another_scale);
}

#[test]
fn a_plan_for_another_number_of_ranks_is_rejected_on_all_ranks() {
    on_all(scales::a_plan_for_another_number_of_ranks_is_rejected_on_all_ranks);
}

#[test]
fn a_time_out_names_the_scale_that_does_not_send() {
    // The check uses two ranks and waits twice.
    on(&[1, 2, 16], scales::a_time_out_names_the_scale_that_does_not_send);
}
