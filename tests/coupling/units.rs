//! Units of couplings between threads.

use crate::checks::units;
use crate::on;

#[test]
fn tables_are_those_published() {
    on(&[12, 16], units::tables_are_those_published);
}

#[test]
fn another_layout_on_the_other_side_is_refused_by_both() {
    on(&[2, 3, 4, 16], units::another_layout_on_the_other_side_is_refused_by_both);
}

#[test]
fn wrong_calls_say_what_is_wrong() {
    on(&[2, 3], units::wrong_calls_say_what_is_wrong);
}

#[test]
fn units_that_come_one_by_one_are_spread_evenly() {
    on(&[5, 6], units::units_that_come_one_by_one_are_spread_evenly);
}

#[test]
fn three_scales_are_coupled_in_a_ring() {
    on(&[7, 8], units::three_scales_are_coupled_in_a_ring);
}
