//! Tests of scales and couplings on ranks that are threads.

mod balance;
mod checks;
mod random_changes;
mod ranks;
mod scales;
mod units;

use biotissue::backends::comm::thread::{ThreadComm, run};

use checks::Outcome;

/// Runs a check on 1 to 16 ranks.
fn on_all(check: impl Fn(&ThreadComm) -> Outcome + Sync) {
    on(&(1..=16).collect::<Vec<_>>(), check);
}

/// Runs a check on each of these numbers of ranks.
fn on(counts: &[usize], check: impl Fn(&ThreadComm) -> Outcome + Sync) {
    for &ranks in counts {
        run(ranks, |comm| check(&comm)).unwrap_or_else(|failed| panic!("{ranks} ranks: {failed}"));
    }
}
