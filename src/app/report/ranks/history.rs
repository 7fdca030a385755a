//! The evaluations of a run on several ranks, from the events of its log.

use crate::app::results::log::{Event, MigrationReport, RankTimes, Start};

/// A run, or one of its continuations, as far as the log tells how its ranks spent their time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RankRun {
    /// Number of ranks of the macro scale; 0 if the log does not say.
    pub macro_ranks: usize,
    /// The last converged step before a resumed run; 0 for a run from the beginning.
    pub resumed_from: usize,
    /// The attempts at load steps or their increments, in order.
    pub attempts: Vec<Attempt>,
}

/// An attempt at a load step or an increment of it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Attempt {
    /// The load step, from 1.
    pub step: usize,
    /// How the attempt ended.
    pub outcome: Outcome,
    /// The times of all ranks in each evaluation of a trial state.
    pub sweeps: Vec<Vec<RankTimes>>,
    /// The migrations of RVEs before these evaluations.
    pub migrations: Vec<MigrationReport>,
}

/// How an attempt ended.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Outcome {
    /// The log ends, or the run, before it tells.
    #[default]
    Unknown,
    /// The increment converged.
    Converged,
    /// The attempt failed.
    Failed,
}

/// Returns the runs of a log in which several ranks shared the work.
pub fn runs(events: &[Event]) -> Vec<RankRun> {
    let mut collector = Collector::default();
    events.iter().for_each(|event| collector.add(event));
    collector.close(Outcome::Unknown);
    let mut runs = collector.runs;
    runs.retain(|run| run.ranks() > 1);
    runs
}

impl RankRun {
    /// Returns the evaluations of all attempts, in order.
    pub fn sweeps(&self) -> impl Iterator<Item = &[RankTimes]> {
        self.attempts.iter().flat_map(|attempt| attempt.sweeps.iter().map(Vec::as_slice))
    }

    /// Returns the number of ranks of both scales; 0 without evaluations.
    pub fn ranks(&self) -> usize {
        self.sweeps().map(<[RankTimes]>::len).max().unwrap_or(0)
    }

    /// Returns the number of the first rank of the micro scale. If the log does not say, these are the ranks from the
    /// first that has RVEs.
    pub fn first_micro(&self) -> usize {
        let ranks = self.ranks();
        if self.macro_ranks > 0 {
            return self.macro_ranks.min(ranks);
        }
        let first = self.sweeps().filter_map(|sweep| sweep.iter().position(|times| times.rves > 0)).min();
        first.unwrap_or(1).clamp(1, ranks.max(1))
    }
}

/// Sorts events into runs and attempts.
#[derive(Default)]
struct Collector {
    runs: Vec<RankRun>,
    open: Attempt,
}

impl Collector {
    fn add(&mut self, event: &Event) {
        match event {
            Event::Start(Start { ranks, resumed_from, .. }) => {
                self.close(Outcome::Unknown);
                let (macro_ranks, resumed_from) = (ranks[0], *resumed_from);
                self.runs.push(RankRun { macro_ranks, resumed_from, attempts: Vec::new() });
            }
            Event::Migration(migration) => {
                // The log has the migrations of an attempt before its evaluations.
                if !self.open.sweeps.is_empty() || self.open.step != migration.step {
                    self.close(Outcome::Unknown);
                }
                self.open.step = migration.step;
                self.open.migrations.push(migration.report);
            }
            Event::Ranks(of_sweep) => {
                let is_next = of_sweep.iteration == 0 || of_sweep.iteration > self.open.sweeps.len();
                if self.open.step != of_sweep.step || !is_next {
                    self.close(Outcome::Unknown);
                }
                self.open.step = of_sweep.step;
                self.open.sweeps.push(of_sweep.ranks.clone());
            }
            Event::Step(_) => self.close(Outcome::Converged),
            Event::Cut(_) => self.close(Outcome::Failed),
            Event::End(_) => self.close(Outcome::Unknown),
            Event::Unknown => {}
        }
    }

    /// Ends the open attempt, if it has evaluations.
    fn close(&mut self, outcome: Outcome) {
        let attempt = std::mem::take(&mut self.open);
        if attempt.sweeps.is_empty() {
            return;
        }
        if self.runs.is_empty() {
            self.runs.push(RankRun::default());
        }
        if let Some(run) = self.runs.last_mut() {
            run.attempts.push(Attempt { outcome, ..attempt });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reads the lines of a log.
    fn runs_of(lines: &[&str]) -> Vec<RankRun> {
        runs(&lines.iter().map(|line| serde_json::from_str(line).unwrap()).collect::<Vec<_>>())
    }

    const START: &str = r#"{"event":"start","ranks":[1,2]}"#;
    const STEP: &str = r#"{"event":"step","step":1,"t":0.5,"newton":{}}"#;
    const CUT: &str = r#"{"event":"cut","step":1,"t":0.5,"reason":"lost"}"#;
    const MIGRATION: &str = r#"{"event":"migration","step":1,"iteration":2,"units":3}"#;

    fn sweep(step: usize, iteration: usize, ranks: usize) -> String {
        let times = r#"{"busy":1.0,"rves":1}"#;
        let ranks = vec![times; ranks].join(",");
        format!(r#"{{"event":"ranks","step":{step},"iteration":{iteration},"ranks":[{ranks}]}}"#)
    }

    #[test]
    fn attempts_end_with_steps_cuts_and_the_log() {
        let [one, two, next] = [sweep(1, 1, 3), sweep(1, 2, 3), sweep(2, 1, 3)];
        let [run] = &runs_of(&[START, MIGRATION, &one, &two, CUT, &one, STEP, &next])[..] else { panic!() };
        let ends: Vec<_> = run.attempts.iter().map(|attempt| (attempt.outcome, attempt.sweeps.len())).collect();
        assert_eq!(ends, [(Outcome::Failed, 2), (Outcome::Converged, 1), (Outcome::Unknown, 1)]);
        assert_eq!([run.attempts[0].migrations.len(), run.attempts[1].migrations.len()], [1, 0]);
        assert_eq!((run.ranks(), run.first_micro()), (3, 1));
    }

    #[test]
    fn a_resumed_run_has_its_own_ranks() {
        let resumed = r#"{"event":"start","ranks":[2,3],"resumed_from":1}"#;
        let runs = runs_of(&[START, &sweep(1, 1, 3), STEP, &sweep(2, 1, 3), resumed, &sweep(2, 1, 5), STEP]);
        let of_run = |run: &RankRun| (run.ranks(), run.first_micro(), run.resumed_from, run.attempts.len());
        assert_eq!(runs.iter().map(of_run).collect::<Vec<_>>(), [(3, 1, 0, 2), (5, 2, 1, 1)]);
    }

    #[test]
    fn runs_of_one_process_and_runs_without_evaluations_are_left_out() {
        assert!(runs_of(&[]).is_empty() && runs_of(&[START, CUT, MIGRATION]).is_empty());
        assert!(runs_of(&[r#"{"event":"start","ranks":[1,0]}"#, STEP]).is_empty());
        assert!(runs_of(&[START, r#"{"event":"ranks"}"#, STEP]).is_empty());
    }

    /// Logs of old versions, and logs without their beginning.
    #[test]
    fn the_scales_of_a_log_that_does_not_name_them_follow_from_the_rves() {
        let times = r#"{"event":"ranks","ranks":[{"busy":1.0},{"busy":1.0},{"rves":4},{"rves":4}]}"#;
        let [run] = &runs_of(&[times, times])[..] else { panic!() };
        assert_eq!((run.first_micro(), run.attempts[0].sweeps.len()), (2, 2));
        let [run] = &runs_of(&[r#"{"event":"start"}"#, r#"{"event":"ranks","ranks":[{},{}]}"#])[..] else { panic!() };
        assert_eq!(run.first_micro(), 1);
    }
}
