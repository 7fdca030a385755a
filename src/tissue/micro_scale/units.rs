//! The RVEs of one rank, solved on all of its threads.

use std::collections::{HashMap, HashSet};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use nalgebra::Matrix3;
use rayon::prelude::*;

use super::error::PointFailure;
use super::formula::Formula;
use super::library::Library;
use super::saved::{FieldRestoreError, UnitState};
use super::unit::{Fibers, Origin, SweepStats, Unit, UnitError};
use super::worker::Worker;
use crate::fem::material::Response;
use crate::las::{Backend, Scalar};
use crate::tissue::replay::RveDump;

/// The RVEs of one rank, in the order in which they came, each the material of an element.
///
/// They are solved on all threads of the current rayon pool. Every RVE starts from its own last equilibrium and writes
/// its own answer, so results do not depend on the number of threads or on which thread solved what.
pub struct Units<B: Backend> {
    library: Library<B>,
    units: Vec<Unit>,
    /// The element of every unit.
    elements: Vec<usize>,
    workers: Vec<Mutex<Worker<B>>>,
    /// Behind a lock, because whoever watches a run only has the units for reading.
    stats: Mutex<SweepStats>,
    /// The last RVE that found no equilibrium.
    lost: Mutex<Option<LostRve>>,
}

/// An RVE that found no equilibrium.
#[derive(Clone, Debug)]
pub struct LostRve {
    /// Its element, from 0.
    pub element: usize,
    /// The number of its model.
    pub model: usize,
    /// Everything that repeats the failure.
    pub dump: RveDump,
}

impl<B: Backend<Scalar = f64>> Units<B>
where
    B::Reduced: Scalar,
{
    /// None yet.
    #[must_use]
    pub fn new(library: Library<B>) -> Self {
        let models = library.models.len();
        let workers = (0..rayon::current_num_threads()).map(|_| Mutex::new(Worker::new(models))).collect();
        let (units, elements, stats, lost) = Default::default();
        Self { library, units, elements, workers, stats, lost }
    }

    /// What all of them share.
    #[must_use]
    pub fn library(&self) -> &Library<B> {
        &self.library
    }

    /// One more RVE at rest, behind the others: the material of an element.
    pub fn add(&mut self, element: usize, model: Option<usize>, matrix: Option<Formula>) {
        self.units.push(Unit::new(model, &self.library.models, matrix));
        self.elements.push(element);
    }

    /// Without those of these elements; the others keep their order.
    pub fn remove(&mut self, elements: &HashSet<usize>) {
        let mut stays = self.elements.iter().map(|element| !elements.contains(element));
        self.units.retain(|_| stays.next().unwrap_or(true));
        self.elements.retain(|element| !elements.contains(element));
    }

    /// How many there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.units.len()
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.units.is_empty()
    }

    /// The elements whose material they are.
    #[must_use]
    pub fn elements(&self) -> &[usize] {
        &self.elements
    }

    pub(super) fn unit(&self, number: usize) -> Option<&Unit> {
        self.units.get(number)
    }

    /// The last answer of each, with the element.
    pub fn answers(&self) -> impl Iterator<Item = (usize, Option<&Response>)> {
        let answers = self.units.iter().map(|unit| unit.answer.as_ref().map(|(_, answer)| answer));
        self.elements.iter().copied().zip(answers)
    }

    /// For every model of the library the number of RVEs that use it.
    #[must_use]
    pub fn users(&self) -> Vec<usize> {
        let mut users = vec![0; self.library.models.len()];
        for fibers in self.units.iter().filter_map(|unit| unit.fibers.as_ref()) {
            users[fibers.model] += 1;
        }
        users
    }

    /// Bytes that all RVEs own in a run: states, last answers, and what the next solves start from.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.units.iter().map(|unit| unit.bytes(self.library.predict)).sum()
    }

    /// What the RVEs have taken since this was last asked.
    pub fn take_stats(&self) -> SweepStats {
        std::mem::take(&mut self.stats.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// The RVE that made the last solve fail, once.
    pub fn take_lost(&self) -> Option<LostRve> {
        self.lost.lock().unwrap_or_else(PoisonError::into_inner).take()
    }

    /// Brings them to equilibrium, each at the gradient that `gradient` gives for its number and its element; those without
    /// one stay as they are.
    ///
    /// # Errors
    /// That of the lowest element which finds none. Elements above it are left out where the failure is known in time, and
    /// all are back at the last [`Units::commit`], so that nothing depends on which of them were solved.
    pub fn solve(
        &mut self,
        gradient: impl Fn(usize, usize) -> Option<Matrix3<f64>> + Sync,
    ) -> Result<(), PointFailure> {
        self.sweep(gradient, |unit, gradient, library, worker, stats| {
            unit.respond(gradient, library, worker, stats).map(|_| false)
        })?;
        Ok(())
    }

    /// Makes the equilibria of the last [`Units::solve`], at the same gradients, continue the last committed ones, whatever
    /// trial states came in between. Returns the numbers of those that were replaced, ascending.
    ///
    /// # Errors
    /// As for [`Units::solve`], for the lowest element without one.
    pub fn verify(
        &mut self,
        gradient: impl Fn(usize, usize) -> Option<Matrix3<f64>> + Sync,
    ) -> Result<Vec<usize>, PointFailure> {
        self.sweep(gradient, Unit::verify)
    }

    /// Does something to each unit that has a gradient, on all threads; returns the numbers of those for which it gave
    /// true, ascending.
    fn sweep(
        &mut self,
        gradient: impl Fn(usize, usize) -> Option<Matrix3<f64>> + Sync,
        each: impl Fn(
            &mut Unit,
            &Matrix3<f64>,
            &Library<B>,
            &mut Worker<B>,
            &mut SweepStats,
        ) -> Result<bool, UnitError<B::Fault>>
        + Sync,
    ) -> Result<Vec<usize>, PointFailure> {
        let Self { library, units, elements, workers, .. } = self;
        let (library, elements) = (&*library, &*elements);
        let lowest = AtomicUsize::new(usize::MAX);
        let outcomes: Vec<_> = units
            .par_iter_mut()
            .enumerate()
            .map(|(number, unit)| {
                let mut swept = Swept { stats: SweepStats::default(), outcome: Ok(false) };
                // One failure is enough: an RVE without an equilibrium takes long to show it.
                if elements[number] > lowest.load(Ordering::Relaxed) {
                    return swept;
                }
                let Some(gradient) = gradient(number, elements[number]) else { return swept };
                let slot = rayon::current_thread_index().unwrap_or(0) % workers.len();
                // A worker is scratch: whatever a panicking thread left in it is overwritten.
                let mut worker = workers[slot].lock().unwrap_or_else(PoisonError::into_inner);
                swept.outcome = each(unit, &gradient, library, &mut worker, &mut swept.stats).map_err(|reason| {
                    lowest.fetch_min(elements[number], Ordering::Relaxed);
                    (number, gradient, reason)
                });
                swept
            })
            .collect();
        let (lowest, mut sum) = (lowest.into_inner(), SweepStats::default());
        let (mut chosen, mut failed) = (Vec::new(), None);
        // What lies behind the failure may or may not have been swept, and counts for nothing.
        for (number, swept) in outcomes.into_iter().enumerate().filter(|&(number, _)| elements[number] <= lowest) {
            sum = sum.and(swept.stats);
            match swept.outcome {
                Ok(true) => chosen.push(number),
                Ok(false) => {}
                Err(failure) if elements[number] == lowest => failed = Some(failure),
                Err(_) => {}
            }
        }
        let all = self.stats.get_mut().unwrap_or_else(PoisonError::into_inner);
        *all = all.and(sum);
        let Some((number, gradient, reason)) = failed else { return Ok(chosen) };
        let failure = self.failure(number, &gradient, &reason);
        self.revert();
        Err(failure)
    }

    fn failure(&mut self, number: usize, gradient: &Matrix3<f64>, reason: &UnitError<B::Fault>) -> PointFailure {
        let (element, library) = (self.elements[number], &self.library);
        let fibers = self.units[number].fibers.as_ref();
        let network = fibers.map(|f| library.models[f.model].network().name().to_owned());
        if let (UnitError::Rve(_), Some(fibers)) = (reason, fibers) {
            let origin = format!("element {element}");
            let ends = (&fibers.current, gradient);
            let dump = RveDump::new(origin, &library.models[fibers.model], ends, &library.params);
            *self.lost.get_mut().unwrap_or_else(PoisonError::into_inner) =
                Some(LostRve { element, model: fibers.model, dump });
        }
        PointFailure::of_unit(element, network, reason)
    }

    /// The current equilibria become the start of the next load step.
    pub fn commit(&mut self) {
        self.units.par_iter_mut().for_each(Unit::commit);
    }

    /// Back to the last [`Units::commit`].
    pub fn revert(&mut self) {
        self.units.par_iter_mut().for_each(Unit::revert);
    }

    /// The memory of all RVEs in their order; right after a commit it is all that the next load step depends on.
    pub fn states(&self) -> impl ExactSizeIterator<Item = UnitState> + '_ {
        (0..self.units.len()).map(|number| self.state(number))
    }

    /// The memory of one RVE.
    ///
    /// # Panics
    /// Where there is no such number.
    #[must_use]
    pub fn state(&self, number: usize) -> UnitState {
        let unit = &self.units[number];
        UnitState {
            // Right after a commit this is the committed state, with the prediction that goes with it.
            rve: unit.fibers.as_ref().map(|f| f.current.clone()),
            answer: unit.answer,
            iterations: unit.committed_iterations,
        }
    }

    /// Takes all RVEs back to what [`Units::states`] gave.
    ///
    /// # Errors
    /// [`FieldRestoreError`]; nothing has changed then.
    pub fn restore(&mut self, states: Vec<UnitState>) -> Result<(), FieldRestoreError> {
        let (found, expected) = (states.len(), self.units.len());
        if found != expected {
            return Err(FieldRestoreError::Units { found, expected });
        }
        let places = self.units.iter().zip(&self.elements);
        let units = states
            .into_iter()
            .zip(places)
            .map(|(state, (unit, &element))| self.restored(state, unit, element))
            .collect::<Result<Vec<Unit>, _>>()?;
        self.units = units;
        Ok(())
    }

    fn restored(&self, state: UnitState, unit: &Unit, element: usize) -> Result<Unit, FieldRestoreError> {
        let UnitState { rve, answer, iterations } = state;
        let fibers = match (rve, &unit.fibers) {
            (Some(current), Some(Fibers { model, committed, .. })) => {
                current
                    .check(self.library.models[*model].network())
                    .map_err(|reason| FieldRestoreError::Rve { element, reason })?;
                let mut committed = committed.clone();
                committed.take_equilibrium(&current);
                Some(Fibers { model: *model, current, committed, origin: Origin::Committed })
            }
            (None, None) => None,
            (saved, _) => return Err(FieldRestoreError::Fibers { element, saved: saved.is_some() }),
        };
        // Committing makes the iterations since the last commit those of the last load step.
        Ok(Unit { fibers, matrix: unit.matrix, answer, iterations, committed_iterations: iterations })
    }

    /// Without any, as at the beginning.
    pub fn clear(&mut self) {
        self.units.clear();
        self.elements.clear();
    }

    /// What the unit of a number was asked last, and answered.
    pub fn answer(&self, number: usize) -> Option<(Matrix3<f64>, Response)> {
        self.units.get(number)?.answer
    }

    /// The numbers of the units by their elements.
    #[must_use]
    pub fn by_element(&self) -> HashMap<usize, usize> {
        self.elements.iter().enumerate().map(|(number, &element)| (element, number)).collect()
    }
}

/// What became of a unit in a sweep.
struct Swept<E> {
    stats: SweepStats,
    /// Whether it was chosen; or its number, the gradient and the reason of its failure.
    outcome: Result<bool, (usize, Matrix3<f64>, E)>,
}
