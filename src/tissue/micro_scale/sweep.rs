//! Sweeps over the RVEs of one rank on all of its threads: equilibria, and the verification of equilibria.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, PoisonError};

use nalgebra::Matrix3;

use super::batches::Done;
use super::error::PointFailure;
use super::library::Library;
use super::order::Order;
use super::unit::{RveStats, Unit, UnitError};
use super::units::{FailedRve, Units};
use super::worker::Worker;
use crate::coupling::balance::Cost;
use crate::las::RealBackend;
use crate::parallel;

/// Returns the deformation gradient that an RVE is to reach, from its index and its point; `None` leaves it alone. A trait
/// object, so that all callers share the code of a sweep: one call takes nothing beside the solution of an RVE.
pub(in crate::tissue) type GradientOf<'a> = dyn Fn(usize, usize) -> Option<Matrix3<f64>> + Sync + 'a;

impl<B: RealBackend> Units<B> {
    /// Brings the RVEs to equilibrium, each at the deformation gradient that `gradient` returns for its index and its
    /// point; an RVE without a gradient is not changed.
    ///
    /// # Errors
    /// Returns the failure of the lowest point that has one. Points above it are skipped if the failure is known in
    /// time, and all RVEs are reverted to the last [`Units::commit`], so that nothing depends on which of them were
    /// solved.
    pub fn solve(&mut self, gradient: &GradientOf<'_>) -> Result<(), PointFailure> {
        let activity = Arc::clone(&self.activity);
        let _evaluation = activity.evaluate(self.units.len());
        let order = self.expected_order();
        let done = self.solve_batches(gradient, &order).inspect_err(|_| self.revert())?;
        let solved = self.for_each_unit(gradient, (done, &order), |unit, gradient, library, worker, stats| {
            unit.respond(gradient, library, worker, stats).map(|_| false)
        });
        solved.map(drop)
    }

    /// Verifies that the equilibria of the last [`Units::solve`], at the same gradients, continue the last committed
    /// ones, whatever the trial states in between, and replaces those that do not. Returns the indices of the replaced
    /// RVEs, ascending.
    ///
    /// # Errors
    /// As for [`Units::solve`].
    pub fn verify(&mut self, gradient: &GradientOf<'_>) -> Result<Vec<usize>, PointFailure> {
        let activity = Arc::clone(&self.activity);
        let _evaluation = activity.evaluate(self.units.len());
        let order = self.expected_order();
        let done = self.verify_batches(gradient, &order).inspect_err(|_| self.revert())?;
        self.for_each_unit(gradient, (done, &order), Unit::verify)
    }

    /// Applies `action` to every unit that has a gradient and is not in `done`, on all threads, the longest first; returns
    /// the indices of the units for which it returned true, ascending.
    fn for_each_unit(
        &mut self,
        gradient: &GradientOf<'_>,
        (done, order): (Done, &Order),
        action: impl Fn(
            &mut Unit,
            &Matrix3<f64>,
            &Library<B>,
            &mut Worker<B>,
            &mut RveStats,
        ) -> Result<bool, UnitError<B::Error>>
        + Sync,
    ) -> Result<Vec<usize>, PointFailure> {
        let order = order.longest_first();
        let Self { library, units, points, costs, workers, activity, .. } = self;
        activity.restart(done.iter().flatten().count());
        let (library, points) = (&*library, &*points);
        costs.fill(Cost::default());
        let mut waiting: Vec<Option<&mut Unit>> = units.iter_mut().map(Some).collect();
        let in_order: Vec<_> = order.iter().filter_map(|&number| Some((number, waiting[number].take()?))).collect();
        let lowest = AtomicUsize::new(usize::MAX);
        let outcomes = parallel::map(in_order, |(number, unit): (usize, &mut Unit)| {
            let (mut stats, point) = (RveStats::default(), points[number]);
            if let Some((stats, increment)) = done[number] {
                return (stats, increment, Ok(false));
            }
            // One failure is enough: an RVE without an equilibrium takes long to fail.
            if point > lowest.load(Ordering::Relaxed) {
                return (stats, 0.0, Ok(false));
            }
            let Some(gradient) = gradient(number, point) else {
                activity.skip(1);
                return (stats, 0.0, Ok(false));
            };
            let increment = unit.response.map_or(0.0, |(last, _)| (gradient - last).norm());
            let slot = rayon::current_thread_index().unwrap_or(0) % workers.len();
            // A worker is scratch memory: data left by a panicking thread is overwritten.
            let mut worker = workers[slot].lock().unwrap_or_else(PoisonError::into_inner);
            let _solution = activity.solve(unit.location, worker.stage());
            // This thread must not start another RVE, which needs the same worker, before this one is done.
            let outcome = parallel::alone(|| action(unit, &gradient, library, &mut worker, &mut stats));
            let outcome = outcome.map_err(|reason| {
                lowest.fetch_min(point, Ordering::Relaxed);
                (gradient, reason)
            });
            (stats, increment, outcome)
        });
        let mut outcomes: Vec<_> = order.into_iter().zip(outcomes).collect();
        outcomes.sort_unstable_by_key(|&(number, _)| number);
        let (lowest, mut sum) = (lowest.into_inner(), RveStats::default());
        let (mut chosen, mut failed) = (Vec::new(), None);
        // Points above the failed one may or may not have been solved and are not counted.
        for (number, (stats, increment, outcome)) in
            outcomes.into_iter().filter(|(number, _)| points[*number] <= lowest)
        {
            sum = sum.merge(stats);
            costs[number] = stats.cost(increment);
            match outcome {
                Ok(true) => chosen.push(number),
                Ok(false) => {}
                Err((gradient, reason)) if points[number] == lowest => failed = Some((number, gradient, reason)),
                Err(_) => {}
            }
        }
        let all = self.stats.get_mut().unwrap_or_else(PoisonError::into_inner);
        *all = all.merge(sum);
        self.keep_sweep(lowest);
        let Some((number, gradient, reason)) = failed else { return Ok(chosen) };
        // Those that were skipped would seem to cost nothing.
        self.costs.iter_mut().zip(&self.histories).for_each(|(cost, history)| *cost = history.last());
        let failure = self.failure(number, &gradient, &reason);
        self.revert();
        Err(failure)
    }

    fn failure(&mut self, number: usize, gradient: &Matrix3<f64>, reason: &UnitError<B::Error>) -> PointFailure {
        let (unit, library) = (&self.units[number], &self.library);
        let fibers = unit.fibers.as_ref();
        let network = fibers.map(|f| library.models[f.model].network().name().to_owned());
        if let (UnitError::Rve(_), Some(fibers)) = (reason, fibers) {
            *self.failed_rve.get_mut().unwrap_or_else(PoisonError::into_inner) =
                Some(FailedRve::new(library, (unit.location, fibers.network()), &fibers.current, gradient));
        }
        PointFailure::of_unit(unit.location, network, reason)
    }
}
