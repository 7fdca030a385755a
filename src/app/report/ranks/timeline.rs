//! What each rank of a run did when, as far as the log tells.
//!
//! The log has durations per rank and evaluation, not times of day. Each rank records its time without gaps, so that its
//! durations add up to the wall time, apart from the setup and from the time in which a rank of the macro scale takes over
//! responses. Within an evaluation, the order follows from the protocol of the scales:
//!
//! | scale | order |
//! |---|---|
//! | macro | computes, or waits for the root of the scale; waits for the plan of a migration; balances; exchanges; waits for the RVEs |
//! | micro | waits for tasks; balances; exchanges; computes; waits for the slowest rank |
//!
//! How the waiting time of a micro rank is divided is not logged: its ranks start to compute together, and the slowest
//! one waits only before. The time for exchange is drawn in one piece, though a part of it follows the computation.

use super::history::{Outcome, RankRun};
use crate::app::results::log::RankTimes;

/// What a rank does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// It computes.
    Busy,
    /// It packs, sends, receives or unpacks messages.
    Exchanging,
    /// It plans or carries out a migration of RVEs.
    Balancing,
    /// It waits for a message.
    Idle,
}

impl Status {
    /// All of them, in the order in which charts stack them.
    pub const ALL: [Self; 4] = [Self::Busy, Self::Exchanging, Self::Balancing, Self::Idle];
}

/// A time in which a rank does one thing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    /// Start, s.
    pub start: f64,
    /// End, s.
    pub end: f64,
    /// What the rank does.
    pub status: Status,
}

/// The end of an attempt at a load step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AttemptEnd {
    /// Time, s.
    pub time: f64,
    /// The load step, from 1.
    pub step: usize,
    /// How the attempt ended.
    pub outcome: Outcome,
}

/// A run in wall time, from the start of its ranks.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Timeline {
    /// The segments of each rank, in order.
    pub ranks: Vec<Vec<Segment>>,
    /// The ends of the attempts.
    pub ends: Vec<AttemptEnd>,
    /// The times of the migrations, s.
    pub migrations: Vec<f64>,
    /// The end of the last segment, s.
    pub seconds: f64,
}

/// Returns a duration from the log, without rounding errors below zero.
fn duration(seconds: f64) -> f64 {
    if seconds.is_finite() { seconds.max(0.0) } else { 0.0 }
}

/// Returns the recorded time of a rank in an evaluation, s.
fn total(times: &RankTimes) -> f64 {
    [times.busy, times.idle, times.communication, times.balancing].into_iter().map(duration).sum()
}

impl Timeline {
    /// Lays out a run.
    pub fn of(run: &RankRun) -> Self {
        let mut timeline = Self { ranks: vec![Vec::new(); run.ranks()], ..Self::default() };
        let mut now = vec![0.0; run.ranks()];
        let split = run.first_micro();
        for attempt in &run.attempts {
            let last = attempt.sweeps.len();
            for (number, sweep) in (1..).zip(&attempt.sweeps) {
                let (above, below) = sweep.split_at(split.min(sweep.len()));
                let (start, end) = timeline.add_micro(below, split, &mut now);
                if attempt.migrations.iter().any(|migration| migration.iteration == number) {
                    timeline.migrations.push(start);
                }
                // The last evaluation of the root includes its wait for the reports of the micro scale.
                let end = if number < last { end } else { 0.0 };
                timeline.add_macro(above, below, end, &mut now);
            }
            let time = now[..split].iter().copied().fold(0.0, f64::max);
            timeline.ends.push(AttemptEnd { time, step: attempt.step, outcome: attempt.outcome });
        }
        timeline.seconds = now.into_iter().fold(0.0, f64::max);
        timeline
    }

    /// Adds pieces to a rank, one after the other.
    fn add(&mut self, rank: usize, now: &mut f64, pieces: &[(Status, f64)]) {
        for &(status, seconds) in pieces.iter().filter(|(_, seconds)| *seconds > 0.0) {
            self.ranks[rank].push(Segment { start: *now, end: *now + seconds, status });
            *now += seconds;
        }
    }

    /// Adds an evaluation on the ranks of the micro scale, from rank `first`. Returns the time before they balance, and
    /// the end of their computations.
    fn add_micro(&mut self, sweep: &[RankTimes], first: usize, now: &mut [f64]) -> (f64, f64) {
        let before = |times: &RankTimes| duration(times.balancing) + duration(times.communication);
        let at = |k: usize| now[first + k];
        let latest = |(k, times): (usize, &RankTimes)| at(k) + duration(times.idle) + before(times);
        let common = sweep.iter().enumerate().map(latest).fold(f64::INFINITY, f64::min);
        let (mut balanced, mut end) = (f64::INFINITY, 0.0_f64);
        for (k, times) in sweep.iter().enumerate() {
            let at = &mut now[first + k];
            let idle = duration(times.idle);
            let waits = (common - *at - before(times)).clamp(0.0, idle);
            balanced = balanced.min(*at + waits);
            let busy = duration(times.busy);
            let pieces = [
                (Status::Idle, waits),
                (Status::Balancing, duration(times.balancing)),
                (Status::Exchanging, duration(times.communication)),
                (Status::Busy, busy),
            ];
            self.add(first + k, at, &pieces);
            end = end.max(*at);
            self.add(first + k, at, &[(Status::Idle, idle - waits)]);
        }
        (if balanced.is_finite() { balanced } else { 0.0 }, end)
    }

    /// Adds an evaluation on the ranks of the macro scale; those that have recorded less time than until `end`, the end of
    /// the computations of the micro scale, start later.
    fn add_macro(&mut self, sweep: &[RankTimes], micro: &[RankTimes], end: f64, now: &mut [f64]) {
        let Some(root) = sweep.first() else { return };
        let planned = micro.iter().map(|times| duration(times.balancing)).fold(0.0, f64::max);
        let ready = duration(root.busy) + (planned - duration(root.balancing)).clamp(0.0, duration(root.idle));
        for (rank, times) in sweep.iter().enumerate() {
            let at = &mut now[rank];
            *at = at.max(end - total(times));
            let (busy, idle) = (duration(times.busy), duration(times.idle));
            let waits = (ready - busy).clamp(0.0, idle);
            let pieces = [
                (Status::Busy, busy),
                (Status::Idle, waits),
                (Status::Balancing, duration(times.balancing)),
                (Status::Exchanging, duration(times.communication)),
                (Status::Idle, idle - waits),
            ];
            self.add(rank, at, &pieces);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::history::Attempt;
    use super::*;
    use crate::app::results::log::MigrationReport;

    fn times(busy: f64, idle: f64, balancing: f64, communication: f64) -> RankTimes {
        RankTimes { busy, idle, balancing, communication, ..RankTimes::default() }
    }

    fn run(sweeps: Vec<Vec<RankTimes>>, migrations: Vec<MigrationReport>) -> RankRun {
        let attempt = Attempt { step: 1, outcome: Outcome::Converged, sweeps, migrations };
        RankRun { macro_ranks: 1, resumed_from: 0, attempts: vec![attempt] }
    }

    /// Asserts that the segments of a rank are these: what it does, and until when.
    fn assert_segments(timeline: &Timeline, rank: usize, expected: &[(Status, f64)]) {
        let of_rank: Vec<_> = timeline.ranks[rank].iter().map(|segment| (segment.status, segment.end)).collect();
        assert_eq!(of_rank.len(), expected.len(), "{rank}: {of_rank:?}");
        for ((status, end), (expected, at)) in of_rank.iter().zip(expected) {
            assert!(status == expected && (end - at).abs() < 1e-12, "{rank}: {of_rank:?}");
        }
    }

    #[test]
    fn micro_ranks_start_together_and_wait_for_the_slowest() {
        let sweep = vec![times(2.0, 5.0, 0.0, 0.0), times(5.0, 2.0, 0.0, 0.0), times(3.0, 4.0, 0.0, 0.0)];
        let timeline = Timeline::of(&run(vec![sweep.clone(), sweep], Vec::new()));
        use Status::{Busy, Idle};
        assert_segments(&timeline, 0, &[(Busy, 2.0), (Idle, 7.0), (Busy, 9.0), (Idle, 14.0)]);
        assert_segments(&timeline, 1, &[(Idle, 2.0), (Busy, 7.0), (Idle, 9.0), (Busy, 14.0)]);
        let third = [(Idle, 2.0), (Busy, 5.0), (Idle, 7.0), (Idle, 9.0), (Busy, 12.0), (Idle, 14.0)];
        assert_segments(&timeline, 2, &third);
        assert_eq!(timeline.ends, [AttemptEnd { time: 14.0, step: 1, outcome: Outcome::Converged }]);
        assert_eq!(timeline.seconds, 14.0);
    }

    #[test]
    fn a_migration_follows_the_work_of_the_macro_scale() {
        let first = vec![times(1.0, 2.0, 0.0, 0.0), times(2.0, 1.0, 0.0, 0.0)];
        let second = vec![times(1.0, 2.5, 0.5, 0.0), times(2.0, 1.0, 1.0, 0.0)];
        let timeline =
            Timeline::of(&run(vec![first, second], vec![MigrationReport { iteration: 2, ..Default::default() }]));
        assert_eq!(timeline.migrations, [4.0]);
        use Status::{Balancing, Busy, Idle};
        assert_segments(&timeline, 1, &[(Idle, 1.0), (Busy, 3.0), (Idle, 4.0), (Balancing, 5.0), (Busy, 7.0)]);
        // The root waits for the plan before it balances.
        let root = [(Busy, 1.0), (Idle, 3.0), (Busy, 4.0), (Idle, 4.5), (Balancing, 5.0), (Idle, 7.0)];
        assert_segments(&timeline, 0, &root);
    }

    /// The setup, and the time in which the root takes over responses.
    #[test]
    fn time_that_is_not_recorded_is_a_gap_of_the_macro_scale() {
        let first = vec![times(1.0, 2.0, 0.0, 0.0), times(2.0, 11.0, 0.0, 0.0)];
        let second = vec![times(1.0, 2.0, 0.0, 0.0), times(2.0, 1.5, 0.0, 0.0)];
        let timeline = Timeline::of(&run(vec![first, second.clone(), second], Vec::new()));
        let starts: Vec<f64> = timeline.ranks[0].iter().map(|segment| segment.start).collect();
        // The last evaluation of an attempt may end later than those of the micro scale.
        assert_eq!(starts, [10.0, 11.0, 13.5, 14.5, 16.5, 17.5]);
    }

    #[test]
    fn the_other_ranks_of_the_macro_scale_wait_for_its_root() {
        let sweep = vec![times(3.0, 2.0, 0.0, 0.0), times(0.0, 4.5, 0.0, 0.5), times(2.0, 3.0, 0.0, 0.0)];
        let timeline = Timeline::of(&RankRun { macro_ranks: 2, ..run(vec![sweep], Vec::new()) });
        use Status::{Exchanging, Idle};
        assert_segments(&timeline, 1, &[(Idle, 3.0), (Exchanging, 3.5), (Idle, 5.0)]);
    }

    #[test]
    fn times_that_are_zero_negative_or_missing_take_no_time() {
        let sweep = vec![times(0.0, -1e-9, f64::NAN, 0.0), times(0.0, 0.0, 0.0, 0.0)];
        let timeline = Timeline::of(&run(vec![sweep, Vec::new(), vec![times(1.0, 0.0, 0.0, 0.0)]], Vec::new()));
        assert_eq!((timeline.ranks[0].len(), timeline.ranks[1].len(), timeline.seconds), (1, 0, 1.0));
    }
}
