//! RVEs in the lanes of the processor's vector registers.

use std::sync::{Mutex, PoisonError};

use nalgebra::Matrix3;
use rayon::prelude::*;

use super::queue::{Job, Queue};
use super::{OfModel, network_data, rows};
use crate::backends::networks::lanes::{LaneEnd, LaneGroup, LaneStart, Level, NetworkLanes, PhaseTimes};
use crate::backends::networks::{BatchParams, Status};
use crate::fiber::batch::{BatchEquilibrium, BatchProgress, BatchSolver};
use crate::fiber::equilibrium::EquilibriumParams;
use crate::fiber::rve::{Rve, RveModel};
use crate::las::RealBackend;
use crate::parallel;
use crate::processor_time::ProcessorTime;

/// A solver for many RVEs of one model at once, as many as a vector register has lanes; the threads of the current
/// rayon pool take one group of consecutive RVEs after the other. RVEs that need more iterations than most of their group
/// go on in later ones.
///
/// The result of an RVE does not depend on the others, on the number of threads, or, in double precision, on the number
/// of lanes, as long as the machine has fused multiply-adds.
#[derive(Debug)]
pub struct LaneBatch {
    lanes: NetworkLanes,
    of_model: OfModel,
    predicts: bool,
}

impl LaneBatch {
    /// Makes a solver for RVEs of this model. With `predicts`, a solution keeps the sensitivities of the interior
    /// nodes, and the next one starts from a first-order prediction.
    ///
    /// Returns `None` if a law of the model is a table or a custom law, if an interior node of the network has no
    /// fiber, or if the machine has no lanes (on x86-64: neither AVX2 nor AVX-512).
    pub fn new<B: RealBackend>(model: &RveModel<B>, predicts: bool) -> Option<Self> {
        let lanes = NetworkLanes::new(&network_data(model)?)?;
        Some(Self { lanes, of_model: OfModel::new(model), predicts })
    }

    /// Makes a solver like [`LaneBatch::new`] if it is faster than one RVE after the other, if there are enough RVEs
    /// ([`NetworkLanes::are_faster`]).
    pub fn new_if_faster<B: RealBackend>(model: &RveModel<B>, predicts: bool) -> Option<Self> {
        let network = network_data(model).filter(NetworkLanes::are_faster)?;
        Some(Self { lanes: NetworkLanes::new(&network)?, of_model: OfModel::new(model), predicts })
    }

    /// Makes a solver with these instructions.
    ///
    /// Returns `None` for models as [`LaneBatch::new`] does.
    pub fn with_level<B: RealBackend>(model: &RveModel<B>, predicts: bool, level: Level) -> Option<Self> {
        let lanes = NetworkLanes::with_level(&network_data(model)?, level);
        Some(Self { lanes, of_model: OfModel::new(model), predicts })
    }

    /// Uses factors of single precision where this machine is faster with them
    /// ([`NetworkLanes::use_single_precision`]). Results then agree with those of double precision to the tolerance of
    /// the equilibria, but not to rounding errors. An RVE may take another iteration, or fewer, because the number of
    /// steps with the same factor is not limited.
    #[must_use]
    pub fn with_single_precision(mut self) -> Self {
        self.lanes.use_single_precision();
        self
    }

    /// The RVEs of a body from which it pays to solve them in lanes, even if they are divided among a few ranks.
    pub const LEAST_RVES: usize = 16;

    /// The lanes.
    pub fn lanes(&self) -> &NetworkLanes {
        &self.lanes
    }

    /// Brings RVEs to equilibrium at these deformation gradients, as [`BatchSolver::solve`].
    ///
    /// # Panics
    /// Panics if there is not one target for each RVE.
    pub fn solve(
        &self,
        rves: &mut [&mut Rve],
        targets: &[Matrix3<f64>],
        params: &EquilibriumParams,
    ) -> Vec<Option<BatchEquilibrium>> {
        self.solve_with_progress(rves, targets, params, &())
    }

    /// Like [`LaneBatch::solve`], on the calling thread; adds to `times` what the phases of each group take.
    ///
    /// # Panics
    /// As for [`LaneBatch::solve`].
    pub fn solve_timed(
        &self,
        rves: &mut [&mut Rve],
        targets: &[Matrix3<f64>],
        params: &EquilibriumParams,
        times: &mut PhaseTimes,
    ) -> Vec<Option<BatchEquilibrium>> {
        assert_eq!(rves.len(), targets.len(), "one target for each RVE");
        let mut solved = vec![None; rves.len()];
        if let Some(params) = self.of_model.params(params) {
            self.solve_queue(&Mutex::new(self.queue(rves, targets, &mut solved, 1)), &params, &(), Some(times));
        }
        solved
    }

    pub(super) fn solve_with_progress(
        &self,
        rves: &mut [&mut Rve],
        targets: &[Matrix3<f64>],
        params: &EquilibriumParams,
        progress: &dyn BatchProgress,
    ) -> Vec<Option<BatchEquilibrium>> {
        assert_eq!(rves.len(), targets.len(), "one target for each RVE");
        let mut solved = vec![None; rves.len()];
        if let Some(params) = self.of_model.params(params) {
            let threads = parallel::threads();
            let queue = Mutex::new(self.queue(rves, targets, &mut solved, threads));
            parallel::map(0..threads, |_| self.solve_queue(&queue, &params, progress, None));
        }
        solved
    }

    /// Returns the RVEs that lanes can solve: what is not of this model keeps its state.
    fn queue<'a>(
        &self,
        rves: &'a mut [&mut Rve],
        targets: &'a [Matrix3<f64>],
        solved: &'a mut [Option<BatchEquilibrium>],
        threads: usize,
    ) -> Queue<'a> {
        let jobs = rves.iter_mut().zip(targets).zip(solved).enumerate();
        let jobs = jobs.map(|(number, ((rve, target), solved))| Job {
            number,
            rve,
            target,
            solved,
            paused: None,
            seconds: 0.0,
        });
        let is_possible =
            |job: &Job<'_>| job.rve.interior().len() == self.of_model.interior && job.target.determinant() > 0.0;
        Queue::new(jobs.filter(is_possible).collect(), self.lanes.lanes(), threads)
    }

    /// Solves groups of RVEs that wait, until none does.
    fn solve_queue(
        &self,
        queue: &Mutex<Queue<'_>>,
        params: &BatchParams,
        progress: &dyn BatchProgress,
        mut times: Option<&mut PhaseTimes>,
    ) {
        let locked = || queue.lock().unwrap_or_else(PoisonError::into_inner);
        let next_group = || locked().next_group();
        while let Some((mut group, may_pause)) = next_group() {
            let first = group[0].number;
            progress.begin(first);
            self.solve_group(&mut group, params, may_pause, times.as_deref_mut());
            progress.end(first, group.iter().filter(|job| job.solved.is_some()).count());
            locked().pause(group.into_iter().filter(|job| job.paused.is_some()));
        }
    }

    /// Solves a group. RVEs that neither have an equilibrium then, nor paused, are unchanged.
    fn solve_group(&self, jobs: &mut [Job<'_>], params: &BatchParams, may_pause: bool, times: Option<&mut PhaseTimes>) {
        let start = ProcessorTime::now();
        let mut group = Group { batch: self, jobs, found: Vec::new() };
        let paused = self.lanes.solve(&mut group, params, may_pause, times);
        let Group { jobs, found, .. } = group;
        let before: Vec<usize> = jobs.iter_mut().map(Job::end_pause).collect();
        // Each takes one factorization more than it has iterations.
        let work = |lane: usize, iterations: usize| (1 + iterations - before[lane]) as f64;
        let of_ended: f64 = found.iter().map(|(lane, found)| work(*lane, found.iterations)).sum();
        let of_paused: f64 = paused.iter().map(|(lane, paused)| work(*lane, paused.iterations())).sum();
        let seconds = start.seconds() / (of_ended + of_paused);
        for (lane, equilibrium) in found {
            let job = &mut jobs[lane];
            job.seconds += seconds * work(lane, equilibrium.iterations);
            *job.solved = Some(BatchEquilibrium { seconds: Some(job.seconds), ..equilibrium });
        }
        for (lane, paused) in paused {
            let job = &mut jobs[lane];
            job.seconds += seconds * work(lane, paused.iterations());
            job.paused = Some(paused);
        }
    }

    fn start<'a>(&self, job: &'a Job<'_>) -> LaneStart<'a> {
        let known = job.rve.sensitivities();
        let sensitivities = known.filter(|known| self.predicts && known.len() == self.of_model.interior);
        LaneStart { sensitivities, paused: job.paused.as_ref(), ..affine_start(job.rve, job.target) }
    }

    /// Returns for each RVE whether Newton evidently leads from the state in `from` to the equilibrium in `reached`, as
    /// [`BatchSolver::converge_to`].
    ///
    /// # Panics
    /// Panics if there is not one state for each other.
    pub fn converge_to(&self, from: &[&Rve], reached: &[&Rve], params: &EquilibriumParams) -> Vec<bool> {
        assert_eq!(from.len(), reached.len(), "one equilibrium for each start");
        let Some(params) = self.of_model.params(params) else { return vec![false; from.len()] };
        let lanes = self.lanes.lanes();
        let groups = from.par_chunks(lanes).zip(reached.par_chunks(lanes));
        groups.flat_map_iter(|(from, reached)| self.converge_group(from, reached, &params)).collect()
    }

    fn converge_group(&self, from: &[&Rve], reached: &[&Rve], params: &BatchParams) -> Vec<bool> {
        let mut leads = vec![false; from.len()];
        let interior = self.of_model.interior;
        let is_possible = |k: &usize| [from[*k], reached[*k]].iter().all(|rve| rve.interior().len() == interior);
        let possible: Vec<usize> = (0..from.len()).filter(is_possible).collect();
        let starts: Vec<LaneStart<'_>> =
            possible.iter().map(|&k| affine_start(from[k], reached[k].gradient())).collect();
        let positions: Vec<&[[f64; 3]]> = possible.iter().map(|&k| reached[k].interior()).collect();
        for (k, status) in possible.into_iter().zip(self.lanes.continues(&starts, &positions, params)) {
            leads[k] = status == Status::Continues;
        }
        leads
    }
}

/// The RVEs of a group, and the equilibria found so far, with their lanes.
struct Group<'g, 'a> {
    batch: &'g LaneBatch,
    jobs: &'g mut [Job<'a>],
    found: Vec<(usize, BatchEquilibrium)>,
}

impl LaneGroup for Group<'_, '_> {
    fn networks(&self) -> usize {
        self.jobs.len()
    }

    fn start(&self, lane: usize) -> LaneStart<'_> {
        self.batch.start(&self.jobs[lane])
    }

    fn end(&mut self, lane: usize, end: LaneEnd<'_>) {
        let job = &mut self.jobs[lane];
        if let Some(equilibrium) = self.batch.of_model.equilibrium(&end.result(), job.target) {
            job.rve.replace(job.target, end.positions, self.batch.predicts.then_some(end.sensitivities));
            self.found.push((lane, equilibrium));
        }
    }
}

/// The state of an RVE, to be moved affinely to a target.
fn affine_start<'a>(rve: &'a Rve, target: &Matrix3<f64>) -> LaneStart<'a> {
    LaneStart {
        gradient: rows(rve.gradient()),
        target: rows(target),
        positions: rve.interior(),
        sensitivities: None,
        paused: None,
    }
}

impl BatchSolver for LaneBatch {
    fn solve(
        &mut self,
        rves: &mut [&mut Rve],
        targets: &[Matrix3<f64>],
        params: &EquilibriumParams,
        progress: &dyn BatchProgress,
    ) -> Result<Vec<Option<BatchEquilibrium>>, String> {
        Ok(self.solve_with_progress(rves, targets, params, progress))
    }

    fn group(&self) -> usize {
        self.lanes.lanes()
    }

    fn bytes_per_thread(&self) -> usize {
        self.lanes.lanes() * self.lanes.bytes_per_lane()
    }

    fn converge_to(
        &mut self,
        from: &[&Rve],
        reached: &[&Rve],
        params: &EquilibriumParams,
    ) -> Result<Vec<bool>, String> {
        Ok(Self::converge_to(self, from, reached, params))
    }
}
