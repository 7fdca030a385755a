//! What the RVEs of a process are doing, for a thread that reports the progress of a run.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

use crate::fem::mesh::IntegrationPoint;
use crate::fiber::equilibrium::{Stage, StageInProgress};

/// Returns the state of the evaluation in progress, wherever its RVEs are solved; `None` if there is none.
pub type ProgressSource = Box<dyn Fn() -> Option<RveProgress> + Send>;

/// The RVEs of the evaluation in progress: how many are done, and which ones the threads are solving.
#[derive(Debug, Default)]
pub struct Activity {
    evaluation: Mutex<Evaluation>,
}

#[derive(Debug, Default)]
struct Evaluation {
    /// Its number, from 1.
    number: u64,
    is_in_progress: bool,
    rves: usize,
    done: usize,
    solving: Vec<Solving>,
}

#[derive(Debug)]
struct Solving {
    point: IntegrationPoint,
    since: Instant,
    stage: Arc<StageInProgress>,
}

/// The state of an evaluation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RveProgress {
    /// Number of RVEs.
    pub rves: usize,
    /// Number of those that are done.
    pub done: usize,
    /// The RVE that a thread has been solving for the longest time.
    pub slowest: Option<SlowestRve>,
}

/// The RVE that a thread has been solving for the longest time, or the first of a group that it solves at once.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SlowestRve {
    /// Its point.
    pub point: IntegrationPoint,
    /// The time since its solution began.
    pub elapsed: Duration,
    /// The stage of the solution; `None` before the first one.
    pub stage: Option<Stage>,
}

impl Activity {
    /// Returns the state of the evaluation in progress; `None` if there is none.
    pub fn progress(&self) -> Option<RveProgress> {
        let (_, is_in_progress, progress) = self.last();
        Some(progress).filter(|progress| is_in_progress && progress.rves > 0)
    }

    /// Returns the number of the last evaluation, from 1, whether it is in progress, and its state; all its RVEs are done
    /// once it has ended. 0 before the first one.
    pub(in crate::tissue) fn last(&self) -> (u64, bool, RveProgress) {
        let evaluation = self.lock();
        let slowest = evaluation.solving.iter().min_by_key(|solving| solving.since);
        let progress = RveProgress {
            rves: evaluation.rves,
            done: evaluation.done,
            slowest: slowest.map(|Solving { point, since, stage }| SlowestRve {
                point: *point,
                elapsed: since.elapsed(),
                stage: stage.get(),
            }),
        };
        (evaluation.number, evaluation.is_in_progress, progress)
    }

    /// Starts an evaluation of so many RVEs; it ends when the guard is dropped.
    pub(in crate::tissue) fn evaluate(&self, rves: usize) -> EvaluationGuard<'_> {
        let mut evaluation = self.lock();
        let number = evaluation.number + 1;
        *evaluation = Evaluation { number, is_in_progress: true, rves, ..Evaluation::default() };
        EvaluationGuard(self)
    }

    /// Counts RVEs as done that need no solution.
    pub(in crate::tissue) fn skip(&self, rves: usize) {
        self.lock().done += rves;
    }

    /// Continues with so many RVEs done, whatever was counted before.
    pub(super) fn restart(&self, done: usize) {
        self.lock().done = done;
    }

    /// Starts the solution of an RVE, whose stages `stage` follows; it ends when the guard is dropped.
    pub(super) fn solve(&self, point: IntegrationPoint, stage: &Arc<StageInProgress>) -> SolutionGuard<'_> {
        stage.set(None);
        self.begin_group(point, stage);
        SolutionGuard { activity: self, point }
    }

    /// Starts the solution of a group of RVEs at once, of which the first is that of `point`.
    pub(super) fn begin_group(&self, point: IntegrationPoint, stage: &Arc<StageInProgress>) {
        self.lock().solving.push(Solving { point, since: Instant::now(), stage: Arc::clone(stage) });
    }

    /// Ends the solution of a group, with so many of its RVEs done.
    pub(super) fn end_group(&self, point: IntegrationPoint, done: usize) {
        let mut evaluation = self.lock();
        evaluation.done += done;
        if let Some(at) = evaluation.solving.iter().position(|solving| solving.point == point) {
            evaluation.solving.swap_remove(at);
        }
    }

    fn lock(&self) -> MutexGuard<'_, Evaluation> {
        self.evaluation.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Ends an evaluation.
pub(in crate::tissue) struct EvaluationGuard<'a>(&'a Activity);

impl Drop for EvaluationGuard<'_> {
    fn drop(&mut self) {
        let mut evaluation = self.0.lock();
        (evaluation.is_in_progress, evaluation.done) = (false, evaluation.rves);
        evaluation.solving.clear();
    }
}

/// Ends the solution of an RVE.
pub(super) struct SolutionGuard<'a> {
    activity: &'a Activity,
    point: IntegrationPoint,
}

impl Drop for SolutionGuard<'_> {
    fn drop(&mut self) {
        self.activity.end_group(self.point, 1);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rve_that_was_started_first_is_the_slowest() {
        let activity = Activity::default();
        assert_eq!(activity.progress(), None);
        let stages = [0, 1].map(|_| Arc::new(StageInProgress::default()));
        let evaluation = activity.evaluate(3);
        let first = activity.solve(IntegrationPoint::of_element(7), &stages[0]);
        std::thread::sleep(Duration::from_millis(2));
        let second = activity.solve(IntegrationPoint::of_element(2), &stages[1]);
        stages[0].set(Some(Stage::Relaxation));
        let slowest = |activity: &Activity| activity.progress().and_then(|progress| progress.slowest).unwrap();
        let of_first = slowest(&activity);
        assert_eq!((of_first.point.element, of_first.stage), (7, Some(Stage::Relaxation)));
        assert!(of_first.elapsed >= Duration::from_millis(2));
        drop(first);
        assert_eq!((slowest(&activity).point.element, slowest(&activity).stage), (2, None));
        drop(second);
        activity.skip(1);
        assert_eq!(activity.progress(), Some(RveProgress { rves: 3, done: 3, slowest: None }));
        activity.restart(1);
        assert_eq!(activity.progress(), Some(RveProgress { rves: 3, done: 1, slowest: None }));
        activity.begin_group(IntegrationPoint::of_element(4), &stages[0]);
        assert_eq!(slowest(&activity).point.element, 4);
        activity.end_group(IntegrationPoint::of_element(4), 2);
        assert_eq!(activity.progress(), Some(RveProgress { rves: 3, done: 3, slowest: None }));
        activity.restart(2);
        drop(evaluation);
        assert_eq!(activity.progress(), None);
        assert_eq!(activity.last(), (1, false, RveProgress { rves: 3, done: 3, slowest: None }));
    }
}
