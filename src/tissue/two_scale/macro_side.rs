//! The macro scale's side: the material of the body, whose RVEs are on other ranks.

use std::collections::HashSet;
use std::path::Path;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use nalgebra::Matrix3;

use super::TwoScaleError;
use super::micro_proxy::{BodySolve, MicroProxy};
use super::protocol::{Outcome, PieceFailure, RankTimes, RveFailure, Task, UnitReport};
use super::shard::RveUpdate;
use crate::coupling::{Scales, UnitId};
use crate::fem::mesh::{IntegrationPoint, Mesh};
use crate::fem::point_field::{PointField, PointResponses};
use crate::las::{Backend, Comm, RealBackend};
use crate::tissue::materials::Materials;
use crate::tissue::micro_scale::{
    DeformedNetwork, FailedRve, FieldRestoreError, Library, LibraryError, Piece, PieceError, PointFailure,
    PointSummary, RveStats, SavedSites, Sites, TissueFieldError, TissueMaterial, check_count,
};

/// The material of a body whose RVEs are solved by the micro scale.
pub struct ScaleField<'a, C: Comm, B: Backend> {
    micro: MicroProxy<'a, C>,
    library: Library<B>,
    sites: Sites,
    /// The rank of the program that solves the RVE of each point.
    rank_of: Vec<u32>,
    reports: Reports,
    failed_rve: Mutex<Option<FailedRve>>,
    /// The reason why other ranks do not respond or are out of step; once it is set, nothing is exchanged.
    broken: Arc<OnceLock<String>>,
}

/// The last reports of the micro scale.
#[derive(Default)]
struct Reports {
    /// One entry per point.
    units: Vec<Option<UnitReport>>,
    stats: Mutex<RveStats>,
    times: Mutex<Vec<Vec<RankTimes>>>,
    bytes: usize,
}

impl<'a, C: Comm, B: RealBackend> ScaleField<'a, C, B> {
    /// Sets up the materials of a mesh; also returns the warnings of the network reader. Does not communicate.
    ///
    /// # Errors
    /// Returns [`LibraryError`] if a network cannot be read or used, or a region of the mesh has no material.
    pub fn new(
        (scales, body_solve): (&'a Scales<C>, BodySolve),
        context: B::Context,
        materials: Materials,
        mesh: &Mesh,
    ) -> Result<(Self, Vec<String>), LibraryError> {
        let (library, warnings) = Library::read(context, materials)?;
        let sites = Sites::new(&library, mesh)?;
        let shard_of = super::partition::partition(mesh, scales.comm().size());
        let points = sites.len();
        let field = Self {
            micro: MicroProxy::new(scales, body_solve, shard_of),
            library,
            sites,
            rank_of: vec![scales.world().rank() as u32; points],
            reports: Reports { units: (0..points).map(|_| None).collect(), ..Reports::default() },
            failed_rve: Mutex::new(None),
            broken: Arc::default(),
        };
        Ok((field, warnings))
    }

    /// The reason why other ranks do not respond or are out of step, which ends the run; for callers that do not hold
    /// the field.
    pub fn broken(&self) -> Arc<OnceLock<String>> {
        Arc::clone(&self.broken)
    }

    /// Records an error in `broken`.
    fn record_error<T>(&self, outcome: Result<T, TwoScaleError>) -> Result<T, TwoScaleError> {
        outcome.inspect_err(|error| {
            self.broken.get_or_init(|| error.to_string());
        })
    }

    /// Couples the scales and creates the initial RVEs. From then on the other ranks carry out commands of this one,
    /// until it is dropped.
    ///
    /// # Errors
    /// Returns [`TwoScaleError`] if communication fails.
    pub fn couple(&mut self) -> Result<(), TwoScaleError> {
        self.micro.couple()?;
        let created = self.sites.existing().map(|(point, region)| self.new_rve(point, region));
        let update = RveUpdate { deleted: Vec::new(), created: created.collect() };
        self.exchange_update(&update)
    }

    /// Returns the entry of [`RveUpdate::created`] for a point.
    fn new_rve(&self, point: usize, region: usize) -> (UnitId, usize, IntegrationPoint) {
        (point as u64, region, self.sites.locate(point))
    }

    /// Deletes and creates RVEs on both scales.
    fn exchange_update(&mut self, update: &RveUpdate) -> Result<(), TwoScaleError> {
        update.deleted.iter().for_each(|&unit| self.reports.units[unit as usize] = None);
        self.micro.update_rves(update)
    }

    /// Deletes and creates the RVEs of these points, if there are any.
    fn update_rves(&mut self, deleted: &[usize], created: &[usize]) -> Result<(), TissueFieldError> {
        if deleted.is_empty() && created.is_empty() {
            return Ok(());
        }
        let deleted = deleted.iter().map(|&point| point as u64).collect();
        let created = created.iter().map(|&point| self.new_rve(point, self.sites.region(point))).collect();
        let updated = self.exchange_update(&RveUpdate { deleted, created });
        Ok(self.record_error(updated)?)
    }

    /// Sends a task to all awake RVEs and stores their responses; returns true if verification replaced any.
    fn evaluate(
        &mut self,
        task: Task,
        gradients: &[Matrix3<f64>],
        out: &mut PointResponses,
    ) -> Result<bool, TissueFieldError> {
        let responses = self.micro.evaluate(task, gradients, &self.sites);
        let mut responses = self.record_error(responses)?;
        responses.retain(|response| self.sites.is_awake(response.point as usize));
        if responses.iter().any(|response| response.outcome == Outcome::Failed as u64) {
            let failure = self.explain();
            let failure = self.record_error(failure)?;
            self.micro.restart_clock();
            return Err(failure.into());
        }
        for response in &responses {
            self.sites.set_response(response.point as usize, &response.response(), out);
        }
        self.micro.restart_clock();
        Ok(responses.iter().any(|response| response.outcome == Outcome::Replaced as u64))
    }

    /// Asks why the last trial state has no response; keeps the data that reproduces the failure.
    fn explain(&mut self) -> Result<PointFailure, TwoScaleError> {
        let RveFailure { failure, start } = self.micro.explain()?;
        if let Some((model, state, gradient)) = start
            && let Some(rve) = state.rve
        {
            let gradient = Matrix3::from_column_slice(&gradient);
            *self.failed_rve.get_mut().unwrap_or_else(PoisonError::into_inner) =
                Some(FailedRve::new(&self.library, (failure.point, model), &rve, &gradient));
        }
        Ok(failure)
    }

    /// Ends a step on the micro scale and stores its reports.
    fn end_step(&mut self, converged: bool) -> Result<(), TwoScaleError> {
        let (reports, iterations) = self.micro.end_step(converged)?;
        let mut stats = RveStats::default();
        self.reports.bytes = reports.iter().map(|report| report.bytes).sum();
        for (report, &rank) in reports.into_iter().zip(self.micro.ranks()) {
            stats = stats.merge(report.stats);
            for unit in report.units {
                let point = unit.point as usize;
                self.rank_of[point] = rank as u32;
                self.reports.units[point] = Some(unit);
            }
        }
        let reports = self.reports.stats.get_mut().unwrap_or_else(PoisonError::into_inner);
        *reports = reports.merge(stats);
        self.reports.times.get_mut().unwrap_or_else(PoisonError::into_inner).extend(iterations);
        self.micro.restart_clock();
        Ok(())
    }
}

/// Ends the loops of the other ranks however a run ends, except after a broken exchange or in a panic, which ends them.
impl<C: Comm, B: Backend> Drop for ScaleField<'_, C, B> {
    fn drop(&mut self) {
        if self.micro.is_coupled() && self.broken.get().is_none() && !std::thread::panicking() {
            // An error here means that the other ranks have ended.
            let _ = self.micro.complete();
        }
    }
}

impl<C: Comm, B: RealBackend> PointField for ScaleField<'_, C, B> {
    type Error = TissueFieldError;

    fn update(&mut self, gradients: &[Matrix3<f64>], out: &mut PointResponses) -> Result<(), Self::Error> {
        // Points that need no RVE come first: an inverted point there fails before any RVE is solved.
        self.sites.evaluate(gradients, out)?;
        self.evaluate(Task::Solve, gradients, out)?;
        Ok(())
    }

    fn verify(&mut self, gradients: &[Matrix3<f64>], out: &mut PointResponses) -> Result<bool, Self::Error> {
        self.evaluate(Task::Verify, gradients, out)
    }

    fn evolve(&mut self) -> Result<bool, Self::Error> {
        let changes = self.sites.evolve();
        // Deleted RVEs are kept until the commit, because the step may still fail.
        self.update_rves(&[], &changes.created)?;
        Ok(!changes.is_empty())
    }

    fn is_cheap(&self) -> bool {
        self.sites.rves() == 0
    }

    fn commit(&mut self) -> Result<(), Self::Error> {
        let ended = self.end_step(true);
        self.record_error(ended)?;
        let deleted = self.sites.commit();
        self.update_rves(&deleted, &[])
    }

    fn revert(&mut self) -> Result<(), Self::Error> {
        if let Some(reason) = self.broken.get() {
            return Err(TissueFieldError::Ranks(reason.clone()));
        }
        let ended = self.end_step(false);
        self.record_error(ended)?;
        let created = self.sites.revert();
        self.update_rves(&created, &[])
    }

    fn is_final(error: &Self::Error) -> bool {
        matches!(error, TissueFieldError::Ranks(_))
    }
}

impl<C: Comm, B: RealBackend> TissueMaterial for ScaleField<'_, C, B> {
    type Micro = B;

    fn library(&self) -> &Library<B> {
        &self.library
    }

    fn sites(&self) -> &Sites {
        &self.sites
    }

    fn rve_bytes(&self) -> usize {
        self.reports.bytes
    }

    fn take_stats(&self) -> RveStats {
        std::mem::take(&mut self.reports.stats.lock().unwrap_or_else(PoisonError::into_inner))
    }

    fn take_times(&self) -> Vec<Vec<RankTimes>> {
        std::mem::take(&mut self.reports.times.lock().unwrap_or_else(PoisonError::into_inner))
    }

    fn take_failed_rve(&self) -> Option<FailedRve> {
        self.failed_rve.lock().unwrap_or_else(PoisonError::into_inner).take()
    }

    fn summaries(&self) -> Vec<Option<PointSummary>> {
        self.reports.units.iter().map(|unit| unit.as_ref().and_then(|unit| unit.summary.clone())).collect()
    }

    fn deformed_network(&self, point: usize) -> Option<DeformedNetwork> {
        self.reports.units.get(point)?.as_ref()?.network.clone()
    }

    fn ranks(&self) -> [usize; 2] {
        [self.micro.scales.comm().size(), self.micro.ranks().len()]
    }

    fn shards(&self) -> Option<(&[u32], usize)> {
        let shards = self.micro.scales.comm().size();
        (shards > 1).then_some((&*self.micro.shard_of, shards))
    }

    /// Orders the nodes by rank if all ranks solve: the rows of a rank are then mostly those of its own elements.
    fn node_order(&self, mesh: &Mesh) -> Vec<u32> {
        let mut order: Vec<u32> = (0..mesh.nodes().len() as u32).collect();
        if self.micro.body_solve == BodySolve::Distributed {
            let mut rank_of_node = vec![u32::MAX; order.len()];
            for (nodes, &rank) in mesh.elements().iter().zip(&self.micro.shard_of) {
                nodes.iter().for_each(|&node| rank_of_node[node as usize] = rank_of_node[node as usize].min(rank));
            }
            order.sort_by_key(|&node| rank_of_node[node as usize]);
        }
        order
    }

    fn rank_of(&self, point: usize) -> usize {
        self.rank_of[point] as usize
    }

    fn save_units(&self, folder: &Path, stem: &str) -> Result<Vec<Piece>, PieceError> {
        let saved = self.on_pieces(folder, |micro| micro.save(folder, stem))?;
        Ok(saved.into_iter().flatten().collect())
    }

    fn verify_pieces(&self, folder: &Path, pieces: &[Piece]) -> Result<(), PieceError> {
        self.on_pieces(folder, |micro| micro.verify(folder, pieces)).map(drop)
    }

    fn restore_units(&mut self, sites: &SavedSites, folder: &Path, pieces: &[Piece]) -> Result<(), FieldRestoreError> {
        let before: HashSet<usize> = self.sites.existing().map(|(point, _)| point).collect();
        self.sites.restore(sites)?;
        check_count(&self.sites, pieces)?;
        let existing: Vec<(usize, usize)> = self.sites.existing().collect();
        let now: HashSet<usize> = existing.iter().map(|&(point, _)| point).collect();
        let mut deleted: Vec<u64> = before.difference(&now).map(|&point| point as u64).collect();
        deleted.sort_unstable();
        let created = existing.iter().filter(|(point, _)| !before.contains(point));
        let created = created.map(|&(point, region)| self.new_rve(point, region)).collect();
        let updated = self.exchange_update(&RveUpdate { deleted, created });
        let restored = updated.and_then(|()| self.micro.restore(folder, pieces));
        let restored = self.record_error(restored).map_err(|error| FieldRestoreError::Ranks(error.to_string()))?;
        restored.into_iter().collect::<Result<(), String>>().map_err(FieldRestoreError::Ranks)
    }
}

impl<C: Comm, B: RealBackend> ScaleField<'_, C, B> {
    /// Makes the ranks of the micro scale write or verify pieces; returns the values of all ranks, or the error of the
    /// first rank that has one.
    fn on_pieces<T>(
        &self,
        folder: &Path,
        command: impl FnOnce(&MicroProxy<'_, C>) -> Result<Vec<Result<T, PieceFailure>>, TwoScaleError>,
    ) -> Result<Vec<T>, PieceError> {
        if let Some(reason) = self.broken.get() {
            return Err(PieceError::Ranks(reason.clone()));
        }
        let answers = self.record_error(command(&self.micro));
        let answers = answers.map_err(|error| PieceError::Ranks(error.to_string()))?;
        answers.into_iter().collect::<Result<_, _>>().map_err(|failure: PieceFailure| failure.in_folder(folder))
    }
}
