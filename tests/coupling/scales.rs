//! Scales on threads.

use crate::checks::scales;
use crate::on_all;

#[test]
fn each_rank_is_of_one_scale_and_finds_the_others() {
    on_all(scales::each_rank_is_of_one_scale_and_finds_the_others);
}

#[test]
fn each_scale_runs_its_own_main() {
    on_all(scales::each_scale_runs_its_own_main);
}

#[test]
fn what_a_scale_tells_all_ranks_of_another_hear() {
    on_all(scales::what_a_scale_tells_all_ranks_of_another_hear);
}

#[test]
fn a_plan_for_other_ranks_is_refused_by_all() {
    on_all(scales::a_plan_for_other_ranks_is_refused_by_all);
}

#[test]
fn a_scale_that_does_not_answer_is_named() {
    on_all(scales::a_scale_that_does_not_answer_is_named);
}
