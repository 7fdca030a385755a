//! The RVEs of one rank: their states, costs and counters.

use std::collections::{HashMap, HashSet};
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

use nalgebra::Matrix3;
use rayon::prelude::*;

use super::activity::Activity;
use super::costs::{KeptCosts, RveCost};
use super::library::{Library, PointNetwork};
use super::pieces::{self, Piece};
use super::saved::{FieldRestoreError, UnitState};
use super::unit::{Origin, RveStats, Unit};
use super::worker::Worker;
use crate::coupling::balance::{Cost, CostHistory, Predictor, Quantity};
use crate::fem::material::Response;
use crate::fem::mesh::IntegrationPoint;
use crate::fiber::rve::{Rve, StressScale};
use crate::las::{Backend, RealBackend};
use crate::tissue::materials::Formula;
use crate::tissue::replay::RveDump;

/// The RVEs of one rank in the order of their creation, each the material of one point.
///
/// They are solved on all threads of the current rayon pool. Every RVE starts from its own last equilibrium and writes
/// its own response, so results do not depend on the number of threads or on the thread that solves an RVE.
pub(in crate::tissue) struct Units<B: Backend> {
    pub(super) library: Library<B>,
    pub(super) units: Vec<Unit>,
    /// The point of every unit.
    pub(super) points: Vec<usize>,
    /// What every unit cost in the last sweep over all units, and before.
    pub(super) costs: Vec<Cost>,
    pub(super) histories: Vec<CostHistory>,
    /// Predicts what the units will cost.
    pub(super) predictor: Predictor,
    /// The costs of every sweep, if they are part of the output.
    kept_costs: Option<KeptCosts>,
    pub(super) workers: Vec<Mutex<Worker<B>>>,
    /// Behind a lock, because observers of a run have only shared access to the units.
    pub(super) stats: Mutex<RveStats>,
    /// The last RVE that found no equilibrium.
    pub(super) failed_rve: Mutex<Option<FailedRve>>,
    /// What the threads are doing.
    pub(super) activity: Arc<Activity>,
}

/// An RVE that found no equilibrium.
#[derive(Clone, Debug)]
pub struct FailedRve {
    /// Its point.
    pub point: IntegrationPoint,
    /// The network of its point.
    pub network: PointNetwork,
    /// The data that reproduces the failure.
    pub dump: RveDump,
}

impl FailedRve {
    /// Collects the data of the RVE of a point that failed between `start` and `gradient`.
    pub(in crate::tissue) fn new<B: RealBackend>(
        library: &Library<B>,
        (point, network): (IntegrationPoint, PointNetwork),
        start: &Rve,
        gradient: &Matrix3<f64>,
    ) -> Self {
        let origin = point.to_string();
        let mut dump = RveDump::new(origin, &library.models()[network.model], (start, gradient), library.params());
        if let StressScale::FiberVolumeFraction(fraction) = &mut dump.scale {
            *fraction *= network.factor;
        }
        Self { point, network, dump }
    }
}

impl<B: RealBackend> Units<B> {
    /// Creates an empty set.
    pub fn new(library: Library<B>) -> Self {
        let models = library.models.len();
        let workers = (0..rayon::current_num_threads()).map(|_| Mutex::new(Worker::new(models))).collect();
        // The last class is that of RVEs without a network.
        let predictor = Predictor::new(Quantity::Seconds, models + 1);
        let (units, points, costs, histories, kept_costs, stats, failed_rve, activity) = Default::default();
        Self { library, units, points, costs, histories, predictor, kept_costs, workers, stats, failed_rve, activity }
    }

    /// Returns what the threads are doing.
    pub fn activity(&self) -> &Arc<Activity> {
        &self.activity
    }

    /// Solves RVEs in lanes where that is faster; see [`Library::use_lanes`].
    pub fn use_lanes(&mut self, counts: &[usize]) {
        self.library.use_lanes(counts);
    }

    /// Returns the data that all RVEs share.
    pub fn library(&self) -> &Library<B> {
        &self.library
    }

    /// Appends an RVE at rest for a point, given by its number, its position in its element, and its region.
    pub fn add(
        &mut self,
        (point, location, region): (usize, IntegrationPoint, usize),
        network: Option<PointNetwork>,
        matrix: Option<Arc<Formula>>,
    ) {
        let unit = Unit::new((location, region), network, &self.library.models, matrix);
        // RVEs of one network cost about the same.
        let class = network.map_or(self.library.models.len(), |network| network.model);
        self.append(point, unit, CostHistory::new(class as u32));
    }

    pub(super) fn append(&mut self, point: usize, unit: Unit, history: CostHistory) {
        self.units.push(unit);
        self.points.push(point);
        self.costs.push(Cost::default());
        self.histories.push(history);
    }

    /// Removes the RVEs of these points; the order of the others does not change.
    pub fn remove(&mut self, points: &HashSet<usize>) {
        let keep: Vec<bool> = self.points.iter().map(|point| !points.contains(point)).collect();
        self.retain(&keep);
    }

    /// Keeps the marked RVEs, in their order.
    pub(super) fn retain(&mut self, keep: &[bool]) {
        fn retain<T>(values: &mut Vec<T>, keep: &[bool]) {
            let mut keep = keep.iter();
            values.retain(|_| keep.next().is_none_or(|&keep| keep));
        }
        retain(&mut self.units, keep);
        retain(&mut self.points, keep);
        retain(&mut self.costs, keep);
        retain(&mut self.histories, keep);
    }

    /// Returns what each RVE cost in the last [`Units::solve`] or [`Units::verify`]; zero for one that was not solved, and
    /// the former costs after a failure.
    pub fn costs(&self) -> &[Cost] {
        &self.costs
    }

    /// Keeps the costs of every sweep from now on, for [`Units::take_costs`].
    pub fn keep_costs(&mut self) {
        self.kept_costs.get_or_insert_default();
    }

    /// Returns the costs of the sweeps since the last call, those of verifications included; empty if they are not kept.
    /// A sweep in which an RVE failed has those of the points up to the failed one.
    pub fn take_costs(&self) -> Vec<Vec<RveCost>> {
        self.kept_costs.as_ref().map(KeptCosts::take).unwrap_or_default()
    }

    pub(super) fn keep_sweep(&mut self, lowest_failed: usize) {
        let Some(kept) = &mut self.kept_costs else { return };
        let costs = self.points.iter().zip(&self.units).zip(&self.costs);
        let counted = costs.filter(|((point, _), _)| **point <= lowest_failed);
        let of_unit = |((&point, unit), cost): ((&usize, &Unit), &Cost)| {
            RveCost::new(point, unit.fibers.as_ref().map(|fibers| fibers.model), cost)
        };
        kept.push(counted.map(of_unit).collect());
    }

    /// Learns from the costs of the last [`Units::solve`] and appends them to the histories.
    pub fn record_costs(&mut self) {
        self.learn_costs();
        self.histories.iter_mut().zip(&self.costs).for_each(|(history, cost)| history.record(cost));
    }

    /// Returns what each RVE has cost so far, and the costs of the last solve, which are to be recorded.
    pub fn histories(&mut self) -> (&mut [CostHistory], &[Cost]) {
        (&mut self.histories, &self.costs)
    }

    /// Number of RVEs.
    pub fn len(&self) -> usize {
        self.units.len()
    }

    /// Returns the position of the point of an RVE in its element.
    ///
    /// # Panics
    /// Panics if the RVE does not exist.
    pub fn location(&self, number: usize) -> IntegrationPoint {
        self.units[number].location
    }

    /// Returns the point of each RVE.
    pub fn points(&self) -> &[usize] {
        &self.points
    }

    pub(super) fn unit(&self, number: usize) -> Option<&Unit> {
        self.units.get(number)
    }

    /// Returns an RVE and what it has cost so far.
    ///
    /// # Panics
    /// Panics if the RVE does not exist.
    pub(super) fn parts(&self, number: usize) -> (&Unit, &CostHistory) {
        (&self.units[number], &self.histories[number])
    }

    /// Returns the point and the last response of each RVE.
    pub fn responses(&self) -> impl Iterator<Item = (usize, Option<&Response>)> {
        let responses = self.units.iter().map(|unit| unit.response.as_ref().map(|(_, response)| response));
        self.points.iter().copied().zip(responses)
    }

    /// Bytes that all RVEs own in a run: states, last responses, and the start values of the next solves.
    pub fn bytes(&self) -> usize {
        let of_costs = size_of::<Cost>() + size_of::<CostHistory>();
        self.units.iter().map(|unit| unit.bytes(self.library.predict) + of_costs).sum()
    }

    /// Bytes that RVEs of these models will own, as [`Units::bytes`] counts them.
    pub(super) fn bytes_of_new(&self, models: impl Iterator<Item = Option<usize>>) -> usize {
        let mut counts: HashMap<Option<usize>, usize> = HashMap::new();
        models.for_each(|model| *counts.entry(model).or_default() += 1);
        let of_costs = size_of::<Cost>() + size_of::<CostHistory>();
        let of_model = |model: Option<usize>| {
            let location = IntegrationPoint { element: 0, point: 0, points: 1 };
            let network = model.map(|model| PointNetwork { model, factor: 1.0 });
            Unit::new((location, 0), network, &self.library.models, None).bytes(self.library.predict) + of_costs
        };
        counts.into_iter().map(|(model, count)| count * of_model(model)).sum()
    }

    /// Returns the counters of the RVEs since the last call.
    pub fn take_stats(&self) -> RveStats {
        std::mem::take(&mut self.stats.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// Returns the RVE that made the last solve fail; a second call returns `None`.
    pub fn take_failed_rve(&self) -> Option<FailedRve> {
        self.failed_rve.lock().unwrap_or_else(PoisonError::into_inner).take()
    }

    /// Forgets the RVE that made an earlier solve fail, from which the caller may have recovered.
    pub fn forget_failed_rve(&mut self) {
        *self.failed_rve.get_mut().unwrap_or_else(PoisonError::into_inner) = None;
    }

    /// Makes the current equilibria the start of the next increment, and of the next load step if `ends_step` is true.
    pub fn commit(&mut self, ends_step: bool) {
        self.units.par_iter_mut().for_each(|unit| unit.commit(ends_step));
    }

    /// Reverts to the last [`Units::commit`].
    pub fn revert(&mut self) {
        self.units.par_iter_mut().for_each(Unit::revert);
    }

    /// Returns the state of one RVE. Right after a commit, the states of all RVEs are all that the next load step
    /// depends on.
    pub fn state(&self, number: usize) -> UnitState {
        let unit = &self.units[number];
        UnitState {
            // Right after a commit this is the committed state, with the prediction that goes with it.
            rve: unit.fibers.as_ref().map(|f| f.current.clone()),
            response: unit.response,
            iterations: unit.committed_iterations,
        }
    }

    /// Restores all RVEs of this rank from the pieces of a checkpoint, which were verified.
    ///
    /// # Errors
    /// Returns [`FieldRestoreError`] if a state does not match its RVE or is in none of the pieces; some RVEs are then
    /// restored and others are not.
    pub fn restore(&mut self, folder: &Path, saved: &[Piece]) -> Result<(), FieldRestoreError> {
        let number_of: HashMap<u64, usize> =
            self.points.iter().enumerate().map(|(number, &point)| (point as u64, number)).collect();
        let mut is_restored = vec![false; self.units.len()];
        for piece in saved {
            let is_own = |point| number_of.contains_key(&point);
            pieces::read(folder, piece, is_own, |point, state| {
                let Some(&number) = number_of.get(&point) else { return Ok(()) };
                is_restored[number] = true;
                self.restore_one(number, state)
            })?;
        }
        match is_restored.iter().position(|&restored| !restored) {
            Some(number) => Err(FieldRestoreError::NotInPieces(self.units[number].location)),
            None => Ok(()),
        }
    }

    fn restore_one(&mut self, number: usize, state: UnitState) -> Result<(), FieldRestoreError> {
        let unit = &mut self.units[number];
        let network = unit.fibers.as_ref().map(|fibers| &**self.library.models[fibers.model].network());
        state.check(unit.location, network)?;
        let UnitState { rve, response, iterations } = state;
        if let Some((current, fibers)) = rve.zip(unit.fibers.as_mut()) {
            fibers.committed.copy_equilibrium_from(&current);
            (fibers.current, fibers.origin) = (current, Origin::Committed);
        }
        // `Unit::commit` copies `iterations` to `committed_iterations`: a commit after the restore keeps the count.
        (unit.response, unit.iterations, unit.committed_iterations) = (response, iterations, iterations);
        Ok(())
    }

    /// Removes all RVEs.
    pub fn clear(&mut self) {
        self.retain(&vec![false; self.units.len()]);
    }

    /// Returns the last deformation gradient of an RVE and its response there.
    pub fn response(&self, number: usize) -> Option<(Matrix3<f64>, Response)> {
        self.units.get(number)?.response
    }

    /// Returns the index of the unit of each point.
    pub fn by_point(&self) -> HashMap<usize, usize> {
        self.points.iter().enumerate().map(|(number, &point)| (point, number)).collect()
    }
}
