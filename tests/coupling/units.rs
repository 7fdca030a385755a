//! Units of couplings between threads.

use crate::checks::units;
use crate::on_all;

#[test]
fn tables_are_those_published() {
    on_all(units::tables_are_those_published);
}

#[test]
fn another_layout_on_the_other_side_is_refused_by_both() {
    on_all(units::another_layout_on_the_other_side_is_refused_by_both);
}

#[test]
fn wrong_calls_say_what_is_wrong() {
    on_all(units::wrong_calls_say_what_is_wrong);
}

#[test]
fn units_that_come_one_by_one_are_spread_evenly() {
    on_all(units::units_that_come_one_by_one_are_spread_evenly);
}

#[test]
fn three_scales_are_coupled_in_a_ring() {
    on_all(units::three_scales_are_coupled_in_a_ring);
}

#[test]
fn values_come_in_while_a_rank_works() {
    on_all(units::values_come_in_while_a_rank_works);
}

#[test]
fn receiving_for_units_of_before_is_refused() {
    on_all(units::receiving_for_units_of_before_is_refused);
}

#[cfg(any(feature = "sparse", feature = "dense", feature = "batched"))]
#[test]
fn local_values_go_from_vector_to_vector() {
    #[cfg(feature = "sparse")]
    on_all(|comm| units::local_values_go_from_vector_to_vector::<biotissue::backends::sparse::Sparse, _>(comm, &()));
    #[cfg(feature = "dense")]
    on_all(|comm| units::local_values_go_from_vector_to_vector::<biotissue::backends::dense::Dense, _>(comm, &()));
    #[cfg(feature = "batched")]
    on_all(|comm| units::local_values_go_from_vector_to_vector::<biotissue::backends::batched::Batched, _>(comm, &()));
}
