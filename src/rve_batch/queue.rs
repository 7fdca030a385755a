//! The RVEs of a batch that wait for lanes: those that have not begun, and those that paused.

use nalgebra::Matrix3;

use crate::backends::networks::lanes::Paused;
use crate::fiber::batch::BatchEquilibrium;
use crate::fiber::rve::Rve;

/// An RVE to be solved.
pub(super) struct Job<'a> {
    /// Its number in the batch.
    pub number: usize,
    pub rve: &'a mut Rve,
    pub target: &'a Matrix3<f64>,
    /// Where its equilibrium is written.
    pub solved: &'a mut Option<BatchEquilibrium>,
    /// Where its solution paused.
    pub paused: Option<Paused>,
    /// Its processor time so far, in seconds.
    pub seconds: f64,
}

impl Job<'_> {
    /// Forgets where the solution paused. Returns the Newton iterations until then.
    pub fn end_pause(&mut self) -> usize {
        self.paused.take().map_or(0, |paused| paused.iterations())
    }
}

/// The RVEs that wait.
pub(super) struct Queue<'a> {
    lanes: usize,
    threads: usize,
    new: std::vec::IntoIter<Job<'a>>,
    paused: Vec<Job<'a>>,
}

impl<'a> Queue<'a> {
    /// Makes a queue for groups of so many RVEs, which so many threads take.
    pub fn new(jobs: Vec<Job<'a>>, lanes: usize, threads: usize) -> Self {
        Self { lanes, threads, new: jobs.into_iter(), paused: Vec::new() }
    }

    /// Returns the next group, and whether its RVEs may pause: not if the other threads take all that remains, so that what
    /// pauses would go on in a group of few. `None` if no RVE waits.
    pub fn next_group(&mut self) -> Option<(Vec<Job<'a>>, bool)> {
        let mut group = Vec::with_capacity(self.lanes);
        if self.paused.len() < self.lanes {
            group.extend(self.new.by_ref().take(self.lanes));
        }
        // The last new ones may leave lanes for others.
        let free = self.lanes - group.len();
        group.extend(self.paused.drain(..free.min(self.paused.len())));
        (!group.is_empty()).then(|| (group, self.new.len() > (self.threads - 1) * self.lanes))
    }

    /// Takes RVEs that paused.
    pub fn pause(&mut self, jobs: impl IntoIterator<Item = Job<'a>>) {
        self.paused.extend(jobs);
    }
}
