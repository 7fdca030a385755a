//! The macro scale's side: the material of the body, whose RVEs are on other ranks.

mod tissue_material;

use std::collections::HashMap;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use nalgebra::Matrix3;

use super::TwoScaleError;
use super::balance::{BalanceReport, When};
use super::divided::DividedBody;
use super::micro_proxy::{BodySolve, EndedIncrement, MicroProxy};
use super::progress::{ProgressChannel, ProgressReceiver};
use super::protocol::{Command, Outcome, RankTimes, RveFailure, Task};
use super::shard::RveUpdate;
use crate::coupling::{Scales, UnitId};
use crate::fem::mesh::Mesh;
use crate::fem::point_field::{PointField, PointResponses};
use crate::las::{Backend, Comm, RealBackend};
use crate::tissue::materials::Materials;
use crate::tissue::micro_scale::{
    DeformedNetwork, FailedRve, Library, LibraryError, PointFailure, PointSummary, RveCost, RveStats, Sites,
    TissueFieldError, TissueMaterial,
};

/// The material of a body whose RVEs are solved by the micro scale.
pub struct ScaleField<'a, C: Comm, B: Backend> {
    micro: MicroProxy<'a, C>,
    library: Library<B>,
    sites: Sites,
    /// The part of this rank, if the body is divided.
    divided: Option<DividedBody<C>>,
    /// The rank of the program that solves the RVE of each point.
    rank_of: Vec<u32>,
    reports: Reports,
    failed_rve: Mutex<Option<FailedRve>>,
    /// The progress of the RVEs, on a root that receives it.
    progress: Option<Arc<Mutex<ProgressReceiver<C>>>>,
    /// The reason why other ranks do not respond or are out of step; once it is set, nothing is exchanged.
    broken: Arc<OnceLock<String>>,
}

/// The last reports of the micro scale.
#[derive(Default)]
struct Reports {
    /// The fibers of each point, if it has any.
    summaries: Vec<Option<PointSummary>>,
    /// The deformed networks that are part of the output, of all points, on the root.
    networks: HashMap<UnitId, DeformedNetwork>,
    stats: Mutex<RveStats>,
    times: Mutex<Vec<Vec<RankTimes>>>,
    balance: Mutex<BalanceReport>,
    /// The costs of the RVEs per trial state, on the root.
    costs: Mutex<Vec<Vec<RveCost>>>,
    bytes: usize,
}

impl<'a, C: Comm, B: RealBackend> ScaleField<'a, C, B> {
    /// Sets up the materials of a mesh; also returns the warnings of the network reader. If the micro scale balances its
    /// load, `balances` is the time of its migrations, as [`run_micro`](super::run_micro) has it. Does not communicate.
    ///
    /// # Errors
    /// Returns [`LibraryError`] if a network cannot be read or used, or a region of the mesh has no material.
    pub fn new(
        (scales, body_solve, balances): (&'a Scales<C>, BodySolve, Option<When>),
        context: B::Context,
        materials: Materials,
        mesh: &Mesh,
    ) -> Result<(Self, Vec<String>), LibraryError> {
        let (library, warnings) = Library::read(context, materials)?;
        let sites = Sites::new(&library, mesh)?;
        let divided = mesh.part().map(|part| DividedBody::new(scales.comm(), mesh, part));
        let shard_of = mesh.part().is_none().then(|| super::partition::partition(mesh, scales.comm().size()));
        let points = sites.len();
        let field = Self {
            micro: MicroProxy::new(scales, body_solve, balances, shard_of),
            library,
            sites,
            divided,
            rank_of: vec![scales.world().rank() as u32; points],
            reports: Reports { summaries: vec![None; points], ..Reports::default() },
            failed_rve: Mutex::new(None),
            progress: None,
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

    /// Receives the progress of the RVEs on the root of the macro scale, which the ranks of the micro scale send if
    /// [`run_micro`](super::run_micro) gets the same channel.
    ///
    /// # Errors
    /// Returns [`TwoScaleError::Scale`] if there is no micro scale.
    pub fn receive_progress(&mut self, channel: &ProgressChannel<C>) -> Result<(), TwoScaleError> {
        if self.micro.scales.comm().rank() == 0 {
            self.progress = Some(Arc::new(Mutex::new(ProgressReceiver::new(channel, self.micro.scales)?)));
        }
        Ok(())
    }

    /// Couples the scales and creates the initial RVEs. From then on the other ranks carry out commands of this one,
    /// until it is dropped.
    ///
    /// # Errors
    /// Returns [`TwoScaleError`] if communication fails.
    pub fn couple(&mut self) -> Result<(), TwoScaleError> {
        let coupled = self.couple_scales();
        self.record_error(coupled)
    }

    fn couple_scales(&mut self) -> Result<(), TwoScaleError> {
        self.micro.couple()?;
        if let Some(divided) = &mut self.divided {
            divided.couple(&self.sites)?;
        }
        self.count_rves()?;
        self.micro.send_counts(&self.rve_counts().per_model)?;
        let created: Vec<usize> = self.sites.existing().map(|(point, _)| point).collect();
        self.exchange_update(&[], &created)
    }

    /// Counts the RVEs of a divided body.
    fn count_rves(&mut self) -> Result<(), TwoScaleError> {
        let models = self.library.models().len();
        self.divided.as_mut().map_or(Ok(()), |divided| divided.count(&self.sites, models))
    }

    /// Returns true if a point belongs to this rank, or the body is not divided.
    fn is_own(&self, point: usize) -> bool {
        self.divided.as_ref().is_none_or(|divided| divided.is_own(point))
    }

    /// Returns the unit of a point: its number in the whole mesh.
    fn unit(&self, point: usize) -> UnitId {
        self.sites.points().in_whole(point) as UnitId
    }

    /// Returns the point of a unit; `None` if it belongs to the part of another rank.
    fn point_of(&self, unit: UnitId) -> Option<usize> {
        self.divided.as_ref().map_or(Some(unit as usize), |divided| divided.point_of(unit))
    }

    /// Returns true if a condition holds on any rank of a divided body.
    fn any<const N: usize>(&self, mut conditions: [bool; N]) -> Result<[bool; N], TwoScaleError> {
        self.divided.as_ref().map_or(Ok(()), |divided| divided.any(&mut conditions))?;
        Ok(conditions)
    }

    /// Deletes and creates the RVEs of these points on both scales.
    fn exchange_update(&mut self, deleted: &[usize], created: &[usize]) -> Result<(), TwoScaleError> {
        for &point in deleted {
            self.reports.summaries[point] = None;
        }
        let own =
            |points: &[usize]| -> Vec<usize> { points.iter().copied().filter(|&point| self.is_own(point)).collect() };
        let created = own(created).into_iter().filter_map(|point| {
            let material = self.library.material_to_send(&self.sites, point)?;
            Some((self.unit(point), self.sites.locate(point), material))
        });
        let created = created.collect();
        let deleted: Vec<UnitId> = own(deleted).into_iter().map(|point| self.unit(point)).collect();
        let of_all_ranks = self.divided.as_ref().map(|divided| divided.gather(&deleted)).transpose()?;
        for unit in of_all_ranks.as_ref().unwrap_or(&deleted) {
            self.reports.networks.remove(unit);
        }
        let sends_matrices = self.library.sends_matrices();
        self.micro.update_rves(RveUpdate { deleted, created, sends_matrices })
    }

    /// Deletes and creates the RVEs of these points, if there are any.
    fn update_rves(&mut self, deleted: &[usize], created: &[usize]) -> Result<(), TissueFieldError> {
        let changes = self.any([!deleted.is_empty() || !created.is_empty()]);
        let [changes] = self.record_error(changes)?;
        if !changes {
            return Ok(());
        }
        let updated = self.exchange_update(deleted, created);
        Ok(self.record_error(updated)?)
    }

    /// Sends a task to all awake RVEs and stores their responses; returns true if verification replaced any.
    fn evaluate(
        &mut self,
        task: Task,
        gradients: &[Matrix3<f64>],
        out: &mut PointResponses,
    ) -> Result<bool, TissueFieldError> {
        let Self { micro, sites, divided, .. } = self;
        let divided = divided.as_ref();
        // The units of this rank are points that it has created.
        let point_of = |unit| divided.map_or(unit as usize, |divided| divided.point_of(unit).unwrap_or_default());
        let responses = micro.evaluate(task, gradients, sites, point_of);
        let mut responses = self.record_error(responses)?;
        responses.retain(|response| self.point_of(response.point).is_some_and(|point| self.sites.is_awake(point)));
        let has = |outcome: Outcome| responses.iter().any(|response| response.outcome == outcome as u64);
        let found = self.any([has(Outcome::Failed), has(Outcome::Replaced)]);
        let [failed, replaced] = self.record_error(found)?;
        if failed {
            let failure = self.explain();
            let failure = self.record_error(failure)?;
            self.micro.restart_clock();
            return Err(failure.into());
        }
        let exchanged = self
            .divided
            .as_ref()
            .map_or(Ok(()), |divided| divided.exchange_ghosts(&mut responses, |response| response.point));
        self.record_error(exchanged)?;
        for response in &responses {
            if let Some(point) = self.point_of(response.point) {
                self.sites.set_response(point, &response.response(), out);
            }
        }
        self.micro.restart_clock();
        Ok(replaced)
    }

    /// Asks why the last trial state has no response; keeps the data that reproduces the failure.
    fn explain(&mut self) -> Result<PointFailure, TwoScaleError> {
        let RveFailure { failure, start } = self.micro.explain()?;
        if let Some((network, state, gradient)) = start
            && let Some(rve) = state.rve
        {
            let gradient = Matrix3::from_column_slice(&gradient);
            *self.failed_rve.get_mut().unwrap_or_else(PoisonError::into_inner) =
                Some(FailedRve::new(&self.library, (failure.point, network), &rve, &gradient));
        }
        Ok(failure)
    }

    /// Forgets the RVE that made an earlier evaluation fail, from which the caller may have recovered.
    fn forget_failed_rve(&mut self) {
        *self.failed_rve.get_mut().unwrap_or_else(PoisonError::into_inner) = None;
    }

    /// Ends an increment on the micro scale and stores its reports.
    fn end_increment(&mut self, command: Command) -> Result<(), TwoScaleError> {
        let EndedIncrement { mut summaries, reports, iterations } = self.micro.end_increment(&command)?;
        if let Some(divided) = self.divided.as_ref().filter(|_| matches!(command, Command::Commit(_))) {
            divided.exchange_ghosts(&mut summaries, |summary| summary.point)?;
        }
        for summary in summaries {
            if let Some(point) = self.point_of(summary.point) {
                self.rank_of[point] = summary.rank as u32;
                self.reports.summaries[point] = summary.summary();
            }
        }
        let is_root = self.micro.scales.comm().rank() == 0;
        let mut stats = RveStats::default();
        self.reports.bytes = reports.iter().map(|report| report.bytes).sum();
        let balance = self.reports.balance.get_mut().unwrap_or_else(PoisonError::into_inner);
        balance.skill = reports.first().and_then(|report| report.skill);
        let migrations = self.micro.take_migrations();
        if is_root {
            balance.migrations.extend(migrations);
        }
        let mut costs = Vec::new();
        for report in reports {
            costs.resize_with(report.costs.len(), Vec::new);
            costs.iter_mut().zip(report.costs).for_each(|(all, of_rank)| all.extend(of_rank));
            stats = stats.merge(report.stats);
            // The root writes the networks.
            let networks = report.networks.into_iter().filter_map(|(point, network)| Some((point, network?)));
            self.reports.networks.extend(networks.filter(|_| is_root));
        }
        let reports = self.reports.stats.get_mut().unwrap_or_else(PoisonError::into_inner);
        *reports = reports.merge(stats);
        if is_root {
            self.reports.times.get_mut().unwrap_or_else(PoisonError::into_inner).extend(iterations);
            self.reports.costs.get_mut().unwrap_or_else(PoisonError::into_inner).extend(costs);
        }
        self.micro.restart_clock();
        Ok(())
    }
}

/// Ends the loops of the other ranks however a run ends, except after a broken exchange or in a panic, which ends them.
impl<C: Comm, B: Backend> Drop for ScaleField<'_, C, B> {
    fn drop(&mut self) {
        if self.micro.is_coupled() && self.broken.get().is_none() && !std::thread::panicking() {
            // An error here means that the other ranks have ended.
            let completed = self.micro.complete();
            if let (Ok(()), Some(progress)) = (completed, &self.progress) {
                let _ = progress.lock().unwrap_or_else(PoisonError::into_inner).receive_all();
            }
        }
    }
}

impl<C: Comm, B: RealBackend> PointField for ScaleField<'_, C, B> {
    type Error = TissueFieldError;

    fn update(&mut self, gradients: &[Matrix3<f64>], out: &mut PointResponses) -> Result<(), Self::Error> {
        self.forget_failed_rve();
        // Points that need no RVE come first: an inverted point there fails before any RVE is solved.
        let evaluated = self.sites.evaluate(gradients, out);
        match &self.divided {
            None => evaluated?,
            Some(divided) => {
                let failure = divided.first_failure(evaluated.err());
                self.record_error(failure)?.map_or(Ok(()), Err)?;
            }
        }
        self.evaluate(Task::Solve, gradients, out)?;
        Ok(())
    }

    fn verify(&mut self, gradients: &[Matrix3<f64>], out: &mut PointResponses) -> Result<bool, Self::Error> {
        self.forget_failed_rve();
        self.evaluate(Task::Verify, gradients, out)
    }

    fn evolve(&mut self) -> Result<bool, Self::Error> {
        let changes = match &self.divided {
            None => self.sites.evolve(),
            Some(divided) => {
                let overstrains = divided.gather(&self.sites.overstrains(|point| divided.is_own(point)));
                let overstrains = self.record_error(overstrains)?;
                self.sites.evolve_among(overstrains)
            }
        };
        // Deleted RVEs are kept until the commit, because the step may still fail.
        self.update_rves(&[], &changes.created)?;
        let changed = self.any([!changes.is_empty()]);
        let [changed] = self.record_error(changed)?;
        Ok(changed)
    }

    fn is_cheap(&self) -> bool {
        self.rve_counts().rves == 0
    }

    fn commit(&mut self, ends_step: bool) -> Result<(), Self::Error> {
        let ended = self.end_increment(Command::Commit(ends_step));
        self.record_error(ended)?;
        let deleted = self.sites.commit(ends_step);
        let counted = self.count_rves();
        self.record_error(counted)?;
        self.update_rves(&deleted, &[])
    }

    fn revert(&mut self) -> Result<(), Self::Error> {
        if let Some(reason) = self.broken.get() {
            return Err(TissueFieldError::Ranks(reason.clone()));
        }
        let ended = self.end_increment(Command::Revert);
        self.record_error(ended)?;
        let created = self.sites.revert();
        self.update_rves(&created, &[])
    }

    fn is_final(error: &Self::Error) -> bool {
        error.is_final()
    }
}
