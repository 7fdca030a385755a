//! The material of each integration point: a formula, an RVE, or the substitute of an RVE that is not awake.
//!
//! The material of a point changes only between two Newton solves: after every converged state, RVEs are created, woken
//! and deleted, and the body is solved again ([`PointField::evolve`](crate::fem::point_field::PointField::evolve)).
//! RVEs fall asleep when a step is committed, which changes no stress.

use std::collections::HashMap;
use std::sync::Arc;

use nalgebra::Matrix3;

use super::error::PointFailure;
use super::library::{Library, LibraryError, PointMaterial, PointNetwork};
use super::lifecycle::{LifecycleState, RveStatus, extrapolate};
use super::saved::{FieldRestoreError, SavedSites, SleepingRve};
use crate::fem::material::{Material, MaterialError, Response, SaintVenantKirchhoff};
use crate::fem::mesh::{IntegrationPoint, Mesh, PointNumbering};
use crate::fem::point_field::{POINTS_PER_CHUNK, PointResponses};
use crate::las::RealBackend;
use crate::parallel;
use crate::tissue::materials::{BeforeCreation, Formula, RveLifecycle};

/// The materials of all integration points of a body, and the statuses of the RVEs.
pub struct Sites {
    sites: Vec<Site>,
    points: PointNumbering,
    /// The linear response at rest of each model that an RVE not created yet uses.
    at_rest: Vec<Option<SaintVenantKirchhoff>>,
    /// The changes since the last commit.
    pending: RveChanges,
    /// True after a restore: the next commit puts no RVE to sleep, since no step lies before it.
    is_restored: bool,
}

/// Fraction of the RVEs over their deletion strain that one round deletes before the body is solved again. Their
/// neighbors take over the load of the deleted ones, and the others may not need to be deleted once the most strained
/// are. The number of RVEs that a step deletes thus hardly depends on the step length.
const DELETED_FRACTION: f64 = 0.1;

/// Relative tolerance within which strains count as equal: points that are equal by symmetry are deleted together,
/// and the remaining residual of Newton does not select among them.
const EQUAL_STRAINS: f64 = 1e-6;

enum Site {
    Formula(Arc<Formula>),
    Rve(RveSite),
}

/// A point with an RVE.
struct RveSite {
    region: usize,
    network: Option<PointNetwork>,
    matrix: Option<Arc<Formula>>,
    /// `None` for an RVE that is always awake.
    lifecycle: Option<Box<LifecycleState>>,
}

/// The numbers of points with an RVE at some time: all, by model, and by status.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RveCounts {
    /// All of them.
    pub rves: usize,
    /// Those that use each model of the library.
    pub per_model: Vec<usize>,
    /// Those asleep.
    pub asleep: usize,
    /// Those whose RVE is not created yet.
    pub waiting: usize,
    /// Those whose RVE was deleted.
    pub deleted: usize,
}

/// Points whose RVEs are created, deleted and woken.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(in crate::tissue) struct RveChanges {
    pub created: Vec<usize>,
    pub deleted: Vec<usize>,
    pub woken: Vec<usize>,
}

impl RveChanges {
    pub fn is_empty(&self) -> bool {
        self.created.is_empty() && self.deleted.is_empty() && self.woken.is_empty()
    }
}

impl Sites {
    /// Assigns the materials of a library to the points of a mesh.
    ///
    /// # Errors
    /// Returns [`LibraryError`] if a region of the mesh has no material.
    pub fn new<B: RealBackend>(library: &Library<B>, mesh: &Mesh) -> Result<Self, LibraryError> {
        let regions = mesh.points().spread(&library.regions_of_mesh(mesh)?);
        let mut sites = Vec::with_capacity(regions.len());
        for (point, region) in regions.into_iter().enumerate() {
            let material = library.of_point(region, mesh.points().in_whole(point));
            let material = material.ok_or_else(|| library.no_material(region, mesh.points().locate(point)))?;
            sites.push(Site::new(region, material));
        }
        let mut at_rest = vec![None; library.models().len()];
        for rve in sites.iter().filter_map(Site::rve) {
            if let (Some(PointNetwork { model, .. }), Some(lifecycle)) = (rve.network, &rve.lifecycle)
                && lifecycle.status == RveStatus::Waiting
                && lifecycle.rules.before == BeforeCreation::Linear
                && at_rest[model].is_none()
            {
                at_rest[model] = Some(library.at_rest(model)?);
            }
        }
        Ok(Self { sites, points: mesh.points().clone(), at_rest, pending: RveChanges::default(), is_restored: false })
    }

    /// Returns the numbering of the points.
    pub fn points(&self) -> &PointNumbering {
        &self.points
    }

    /// Returns the element of a point, and the position of the point within it.
    pub(in crate::tissue) fn locate(&self, point: usize) -> IntegrationPoint {
        self.points.locate(point)
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.sites.len()
    }

    /// Returns true if there are no points.
    pub fn is_empty(&self) -> bool {
        self.sites.is_empty()
    }

    fn rve_sites(&self) -> impl Iterator<Item = (usize, &RveSite)> {
        self.sites.iter().enumerate().filter_map(|(point, site)| Some((point, site.rve()?)))
    }

    /// Number of points that have an RVE at some time.
    pub fn rves(&self) -> usize {
        self.rve_sites().count()
    }

    /// Returns the points whose RVE exists, ascending, with their regions.
    pub(in crate::tissue) fn existing(&self) -> impl Iterator<Item = (usize, usize)> {
        self.rve_sites().filter(|(_, rve)| rve.status().exists()).map(|(point, rve)| (point, rve.region))
    }

    /// Returns the model of every RVE that exists or may still be created; `None` for one without a network.
    pub(super) fn by_model(&self) -> impl Iterator<Item = Option<usize>> {
        self.rve_sites()
            .filter(|(_, rve)| rve.status() != RveStatus::Deleted)
            .map(|(_, rve)| rve.network.map(|network| network.model))
    }

    /// Creates all RVEs that wait for it.
    pub(super) fn create_waiting(&mut self) {
        for (_, lifecycle) in lifecycles(&mut self.sites) {
            if lifecycle.status == RveStatus::Waiting {
                (lifecycle.status, lifecycle.committed) = (RveStatus::Awake, RveStatus::Awake);
            }
        }
    }

    /// Returns the network and the matrix of the RVE of a point.
    pub(in crate::tissue) fn material(&self, point: usize) -> Option<(Option<PointNetwork>, Option<Arc<Formula>>)> {
        let rve = self.sites.get(point)?.rve()?;
        Some((rve.network, rve.matrix.clone()))
    }

    /// Returns true if the RVE of a point has fibers.
    pub fn has_fibers(&self, point: usize) -> bool {
        self.material(point).is_some_and(|(network, _)| network.is_some())
    }

    /// Returns the region that a point with an RVE belongs to.
    pub(in crate::tissue) fn region(&self, point: usize) -> usize {
        self.sites.get(point).and_then(Site::rve).map_or(0, |rve| rve.region)
    }

    /// Returns the status of the RVE of a point; `None` if the point never has one.
    pub fn status(&self, point: usize) -> Option<RveStatus> {
        self.sites.get(point)?.rve().map(RveSite::status)
    }

    pub(in crate::tissue) fn is_awake(&self, point: usize) -> bool {
        self.status(point) == Some(RveStatus::Awake)
    }

    /// Writes the responses of all points without an awake RVE to `out`, on all threads of the current rayon pool. The
    /// error is that of the first point that has one.
    pub(in crate::tissue) fn evaluate(
        &mut self,
        gradients: &[Matrix3<f64>],
        out: &mut PointResponses,
    ) -> Result<(), PointFailure> {
        out.resize(gradients.len());
        let Self { sites, points, at_rest, .. } = self;
        let inputs = sites.chunks_mut(POINTS_PER_CHUNK).zip(gradients.chunks(POINTS_PER_CHUNK));
        let chunks = inputs.zip(out.chunks_mut(POINTS_PER_CHUNK)).enumerate();
        parallel::try_each(chunks, |(number, ((sites, gradients), mut out))| {
            for (k, (site, f)) in sites.iter_mut().zip(gradients).enumerate() {
                let locate = || points.locate(number * POINTS_PER_CHUNK + k);
                let response = site.respond(f, at_rest);
                if let Some(response) = response.map_err(|reason| PointFailure::of_formula(locate(), &reason))? {
                    out.set(k, &response);
                }
            }
            Ok(())
        })
    }

    /// Writes the response of the RVE of a point to `out`, and stores it: it belongs to the gradient of the last
    /// [`Sites::evaluate`].
    pub(in crate::tissue) fn set_response(&mut self, point: usize, response: &Response, out: &mut PointResponses) {
        write(out, point, response);
        self.store_response(point, response);
    }

    fn store_response(&mut self, point: usize, response: &Response) {
        if let Site::Rve(RveSite { lifecycle: Some(lifecycle), .. }) = &mut self.sites[point] {
            lifecycle.trial.1 = Some(*response);
        }
    }

    /// Creates, wakes and deletes RVEs as the converged state of the last gradients demands; of those over their
    /// deletion strain, it deletes a fraction ([`DELETED_FRACTION`]), the most strained first.
    pub(in crate::tissue) fn evolve(&mut self) -> RveChanges {
        let overstrains = self.overstrains(|_| true);
        self.evolve_among(overstrains)
    }

    /// Does the same if these are only some of the points; `overstrains` are those of all ([`Sites::overstrains`]).
    pub(in crate::tissue) fn evolve_among(&mut self, overstrains: Vec<f64>) -> RveChanges {
        let mut changes = RveChanges::default();
        let limit = overstrain_limit(overstrains);
        for (point, lifecycle) in lifecycles(&mut self.sites) {
            if lifecycle.overstrain().is_some_and(|overstrain| overstrain >= limit) {
                lifecycle.status = RveStatus::Deleted;
                changes.deleted.push(point);
            } else if lifecycle.must_be_created() {
                lifecycle.status = RveStatus::Awake;
                changes.created.push(point);
            } else if lifecycle.has_moved_in_sleep() {
                lifecycle.status = RveStatus::Awake;
                changes.woken.push(point);
            }
        }
        self.pending.created.extend(&changes.created);
        self.pending.deleted.extend(&changes.deleted);
        changes
    }

    /// Returns the overstrains of all points with RVEs over their deletion strain for which `is_counted` returns true.
    pub(in crate::tissue) fn overstrains(&self, is_counted: impl Fn(usize) -> bool) -> Vec<f64> {
        let counted = self.rve_sites().filter(|(point, _)| is_counted(*point));
        counted.filter_map(|(_, rve)| rve.lifecycle.as_ref()?.overstrain()).collect()
    }

    /// Counts the RVEs of the points for which `is_counted` returns true, for this number of models.
    pub(in crate::tissue) fn counts(&self, models: usize, is_counted: impl Fn(usize) -> bool) -> RveCounts {
        let mut counts = RveCounts { per_model: vec![0; models], ..RveCounts::default() };
        for (_, rve) in self.rve_sites().filter(|(point, _)| is_counted(*point)) {
            counts.rves += 1;
            if let Some(network) = rve.network {
                counts.per_model[network.model] += 1;
            }
            match rve.status() {
                RveStatus::Awake => {}
                RveStatus::Asleep => counts.asleep += 1,
                RveStatus::Waiting => counts.waiting += 1,
                RveStatus::Deleted => counts.deleted += 1,
            }
        }
        counts
    }

    /// Commits the step at the last gradients; RVEs that hardly moved in it fall asleep. Returns the points whose
    /// RVEs are deleted for good.
    pub(in crate::tissue) fn commit(&mut self, ends_step: bool) -> Vec<usize> {
        let is_step = ends_step && !std::mem::take(&mut self.is_restored);
        for (_, lifecycle) in lifecycles(&mut self.sites) {
            if is_step {
                lifecycle.fall_asleep();
            }
            if ends_step {
                lifecycle.converged = Some(lifecycle.trial.0);
            }
            lifecycle.committed = lifecycle.status;
        }
        std::mem::take(&mut self.pending).deleted
    }

    /// Reverts the step: all statuses are those of the last commit. Returns the points whose RVEs were created
    /// since.
    pub(in crate::tissue) fn revert(&mut self) -> Vec<usize> {
        for (_, lifecycle) in lifecycles(&mut self.sites) {
            lifecycle.status = lifecycle.committed;
        }
        std::mem::take(&mut self.pending).created
    }

    /// The gradient and the response from which a sleeping RVE extrapolates.
    fn extrapolation_point(&self, point: usize) -> Option<(Matrix3<f64>, Response)> {
        let lifecycle = self.sites.get(point)?.rve()?.lifecycle.as_ref()?;
        lifecycle.extrapolation_point.filter(|_| lifecycle.status == RveStatus::Asleep)
    }

    /// Returns the state of all life cycles.
    pub fn saved(&self) -> SavedSites {
        let statuses = (0..self.len()).map(|point| self.status(point).unwrap_or(RveStatus::Awake)).collect();
        let asleep = (0..self.len())
            .filter_map(|point| Some(SleepingRve { point, extrapolation_point: self.extrapolation_point(point)? }));
        SavedSites { statuses, asleep: asleep.collect() }
    }

    /// Restores all life cycles.
    ///
    /// # Errors
    /// Returns [`FieldRestoreError`] if the state does not match the points; nothing is changed then.
    pub(in crate::tissue) fn restore(&mut self, saved: &SavedSites) -> Result<(), FieldRestoreError> {
        let SavedSites { statuses, asleep } = saved;
        let (found, expected) = (statuses.len(), self.len());
        if found != expected {
            return Err(FieldRestoreError::Points { found, expected });
        }
        let asleep: HashMap<usize, _> = asleep.iter().map(|rve| (rve.point, rve.extrapolation_point)).collect();
        let sleeps = |&point: &usize| {
            let has_life_cycle = self.sites[point].rve().is_some_and(|rve| rve.lifecycle.is_some());
            has_life_cycle && statuses[point] == RveStatus::Asleep
        };
        let wrong = (0..expected).find(|point| sleeps(point) != asleep.contains_key(point));
        if let Some(point) = wrong {
            return Err(FieldRestoreError::Asleep(self.locate(point)));
        }
        for (point, (site, &status)) in self.sites.iter_mut().zip(statuses).enumerate() {
            let Site::Rve(RveSite { lifecycle: Some(lifecycle), .. }) = site else { continue };
            (lifecycle.status, lifecycle.committed) = (status, status);
            lifecycle.extrapolation_point = asleep.get(&point).copied();
            // The commit after a restore sets it.
            lifecycle.converged = None;
        }
        self.pending = RveChanges::default();
        self.is_restored = true;
        Ok(())
    }
}

/// Returns the least overstrain at which RVEs are deleted in this round, given the overstrains of all points.
fn overstrain_limit(mut overstrains: Vec<f64>) -> f64 {
    overstrains.sort_by(|a, b| b.total_cmp(a));
    let part = (DELETED_FRACTION * overstrains.len() as f64).ceil() as usize;
    let last = part.checked_sub(1).and_then(|last| overstrains.get(last));
    last.map_or(f64::INFINITY, |overstrain| overstrain * (1.0 - EQUAL_STRAINS))
}

/// The life cycles of RVEs that are created, sleep or are deleted, with their points.
fn lifecycles(sites: &mut [Site]) -> impl Iterator<Item = (usize, &mut LifecycleState)> {
    sites.iter_mut().enumerate().filter_map(|(point, site)| match site {
        Site::Rve(RveSite { lifecycle: Some(lifecycle), .. }) => Some((point, &mut **lifecycle)),
        _ => None,
    })
}

impl Site {
    fn new(region: usize, material: PointMaterial) -> Self {
        match material {
            PointMaterial::Formula(formula) => Self::Formula(formula),
            PointMaterial::Rve { network, matrix, lifecycle: rules } => {
                let lifecycle = (rules != RveLifecycle::default()).then(|| Box::new(LifecycleState::new(rules)));
                Self::Rve(RveSite { region, network, matrix, lifecycle })
            }
        }
    }

    fn rve(&self) -> Option<&RveSite> {
        match self {
            Self::Formula(_) => None,
            Self::Rve(rve) => Some(rve),
        }
    }

    /// Returns the response of a point without an awake RVE; `None` if its RVE has to be solved. `at_rest` has the
    /// linear response at rest of each model that an RVE not created yet uses.
    fn respond(
        &mut self,
        f: &Matrix3<f64>,
        at_rest: &[Option<SaintVenantKirchhoff>],
    ) -> Result<Option<Response>, MaterialError> {
        let rve = match self {
            Self::Formula(formula) => return check_orientation(f).and_then(|()| formula.respond(f)).map(Some),
            Self::Rve(rve) => rve,
        };
        let Some(lifecycle) = &mut rve.lifecycle else { return Ok(None) };
        lifecycle.trial = (*f, None);
        let rest = rve.network.and_then(|network| Some((at_rest[network.model].as_ref()?, network.factor)));
        if lifecycle.status == RveStatus::Awake {
            return Ok(None);
        }
        check_orientation(f)?;
        match lifecycle.status {
            RveStatus::Awake => Ok(None),
            RveStatus::Asleep => {
                Ok(lifecycle.extrapolation_point.as_ref().map(|(from, response)| extrapolate(from, response, f)))
            }
            RveStatus::Waiting if lifecycle.rules.before == BeforeCreation::Linear => {
                linear(rest, rve.matrix.as_deref(), f).map(Some)
            }
            RveStatus::Waiting | RveStatus::Deleted => rve.matrix.as_ref().map(|matrix| matrix.respond(f)).transpose(),
        }
    }
}

impl RveSite {
    fn status(&self) -> RveStatus {
        self.lifecycle.as_ref().map_or(RveStatus::Awake, |lifecycle| lifecycle.status)
    }
}

/// Rejects an inverted point: small-strain formulas have a response at any gradient.
fn check_orientation(f: &Matrix3<f64>) -> Result<(), MaterialError> {
    let determinant = f.determinant();
    if determinant > 0.0 { Ok(()) } else { Err(MaterialError::Inverted(determinant)) }
}

fn write(out: &mut PointResponses, point: usize, response: &Response) {
    out.energy[point] = response.energy;
    out.pk1[point] = response.pk1;
    out.tangent[point] = response.tangent;
}

/// The sum of a network's linear response at rest, times its factor, and that of the matrix in parallel.
fn linear(
    rest: Option<(&SaintVenantKirchhoff, f64)>,
    matrix: Option<&Formula>,
    f: &Matrix3<f64>,
) -> Result<Response, MaterialError> {
    let mut sum = Response { energy: 0.0, pk1: Matrix3::zeros(), tangent: nalgebra::SMatrix::zeros() };
    let of_network = |(rest, factor): (&SaintVenantKirchhoff, f64)| Ok(rest.evaluate(f)?.scaled(factor));
    let parts = [rest.map(of_network), matrix.map(|matrix| matrix.respond(f))];
    for part in parts.into_iter().flatten() {
        let part = part?;
        sum.energy += part.energy;
        sum.pk1 += part.pk1;
        sum.tangent += part.tangent;
    }
    Ok(sum)
}

#[cfg(test)]
mod tests;
