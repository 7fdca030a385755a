//! Units of couplings between threads.

use crate::checks::units;
use crate::on_all;

#[test]
fn distributions_are_those_published() {
    on_all(units::distributions_are_those_published);
}

#[test]
fn different_layouts_are_rejected_on_both_sides() {
    on_all(units::different_layouts_are_rejected_on_both_sides);
}

#[test]
fn channels_are_separate_streams() {
    on_all(units::channels_are_separate_streams);
}

#[test]
fn invalid_calls_are_errors() {
    on_all(units::invalid_calls_are_errors);
}

#[test]
fn units_that_are_added_one_by_one_are_distributed_evenly() {
    on_all(units::units_that_are_added_one_by_one_are_distributed_evenly);
}

#[test]
fn three_scales_are_coupled_in_a_ring() {
    on_all(units::three_scales_are_coupled_in_a_ring);
}

#[test]
fn several_exchanges_are_pending_at_once() {
    on_all(units::several_exchanges_are_pending_at_once);
}

#[test]
fn receives_started_before_a_change_are_rejected() {
    on_all(units::receives_started_before_a_change_are_rejected);
}

#[cfg(any(feature = "sparse", feature = "dense", feature = "batched"))]
#[test]
fn local_values_are_sent_from_vector_to_vector() {
    #[cfg(feature = "sparse")]
    on_all(|comm| {
        units::local_values_are_sent_from_vector_to_vector::<biotissue::backends::sparse::Sparse, _>(comm, &())
    });
    #[cfg(feature = "dense")]
    on_all(|comm| {
        units::local_values_are_sent_from_vector_to_vector::<biotissue::backends::dense::Dense, _>(comm, &())
    });
    #[cfg(feature = "batched")]
    on_all(|comm| {
        units::local_values_are_sent_from_vector_to_vector::<biotissue::backends::batched::Batched, _>(comm, &())
    });
}
