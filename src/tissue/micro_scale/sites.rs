//! The material of each integration point: a formula, an RVE, or the substitute of an RVE that is not awake.
//!
//! The material of a point changes only between two Newton solves: after every converged state, RVEs are created, woken
//! and deleted, and the body is solved again ([`PointField::evolve`](crate::fem::point_field::PointField::evolve)).
//! RVEs fall asleep when a step is committed, which changes no stress.

use nalgebra::Matrix3;

use super::error::PointFailure;
use super::library::{ElementMaterial, Library, LibraryError};
use super::lifecycle::{LifecycleState, RveStatus, extrapolate};
use crate::fem::material::{Material, MaterialError, Response, SaintVenantKirchhoff};
use crate::fem::mesh::Mesh;
use crate::fem::point_field::PointResponses;
use crate::las::RealBackend;
use crate::tissue::materials::{BeforeCreation, Formula, RveLifecycle};

/// The materials of all integration points of a body, and the statuses of the RVEs.
pub struct Sites {
    sites: Vec<Site>,
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

/// Relative tolerance within which strains count as equal: elements that are equal by symmetry are deleted together,
/// and the remaining residual of Newton does not select among them.
const EQUAL_STRAINS: f64 = 1e-6;

enum Site {
    Formula(Formula),
    Rve(Point),
}

/// An element with an RVE.
struct Point {
    region: usize,
    model: Option<usize>,
    matrix: Option<Formula>,
    /// `None` for an RVE that is always awake.
    lifecycle: Option<Box<LifecycleState>>,
}

/// Elements whose RVEs are created, deleted and woken.
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
    /// Assigns the materials of a library to the elements of a mesh.
    pub(in crate::tissue) fn new<B: RealBackend>(library: &Library<B>, mesh: &Mesh) -> Result<Self, LibraryError> {
        let regions = library.regions_of_mesh(mesh)?;
        let site = |(element, region)| Site::new(region, library.of_element(region, element));
        let sites: Vec<Site> = regions.into_iter().enumerate().map(site).collect();
        let mut at_rest = vec![None; library.models().len()];
        for point in sites.iter().filter_map(Site::point) {
            if let (Some(model), Some(lifecycle)) = (point.model, &point.lifecycle)
                && lifecycle.status == RveStatus::Waiting
                && lifecycle.rules.before == BeforeCreation::Linear
                && at_rest[model].is_none()
            {
                at_rest[model] = Some(library.at_rest(model)?);
            }
        }
        Ok(Self { sites, at_rest, pending: RveChanges::default(), is_restored: false })
    }

    /// Number of elements.
    pub fn len(&self) -> usize {
        self.sites.len()
    }

    /// Returns true if there are no elements.
    pub fn is_empty(&self) -> bool {
        self.sites.is_empty()
    }

    fn points(&self) -> impl Iterator<Item = (usize, &Point)> {
        self.sites.iter().enumerate().filter_map(|(element, site)| Some((element, site.point()?)))
    }

    /// Number of elements that have an RVE at some time.
    pub fn rves(&self) -> usize {
        self.points().count()
    }

    /// Returns the elements whose RVE exists, ascending, with their regions.
    pub(in crate::tissue) fn existing(&self) -> impl Iterator<Item = (usize, usize)> {
        self.points().filter(|(_, point)| point.status().exists()).map(|(e, p)| (e, p.region))
    }

    /// Returns the model and the matrix of the RVE of an element.
    pub(in crate::tissue) fn material(&self, element: usize) -> Option<(Option<usize>, Option<Formula>)> {
        let point = self.sites.get(element)?.point()?;
        Some((point.model, point.matrix))
    }

    /// Returns true if the RVE of an element has fibers.
    pub fn has_fibers(&self, element: usize) -> bool {
        self.material(element).is_some_and(|(model, _)| model.is_some())
    }

    /// Returns the region that an element with an RVE belongs to.
    pub(in crate::tissue) fn region(&self, element: usize) -> usize {
        self.sites.get(element).and_then(Site::point).map_or(0, |point| point.region)
    }

    /// Returns, for each of `models` models, the number of elements that use it.
    pub fn rves_per_model(&self, models: usize) -> Vec<usize> {
        let mut rves = vec![0; models];
        self.points().filter_map(|(_, point)| point.model).for_each(|model| rves[model] += 1);
        rves
    }

    /// Returns the status of the RVE of an element; `None` if the element never has one.
    pub fn status(&self, element: usize) -> Option<RveStatus> {
        self.sites.get(element)?.point().map(Point::status)
    }

    pub(in crate::tissue) fn is_awake(&self, element: usize) -> bool {
        self.status(element) == Some(RveStatus::Awake)
    }

    /// Writes the responses of all elements without an awake RVE to `out`.
    pub(in crate::tissue) fn evaluate(
        &mut self,
        gradients: &[Matrix3<f64>],
        out: &mut PointResponses,
    ) -> Result<(), PointFailure> {
        out.resize(gradients.len());
        for (element, f) in gradients.iter().enumerate() {
            let response = self.respond(element, f).map_err(|reason| PointFailure::of_formula(element, &reason))?;
            if let Some(response) = response {
                write(out, element, &response);
            }
        }
        Ok(())
    }

    /// Returns the response of an element without an awake RVE; `None` if its RVE has to be solved.
    fn respond(&mut self, element: usize, f: &Matrix3<f64>) -> Result<Option<Response>, MaterialError> {
        let point = match &mut self.sites[element] {
            Site::Formula(formula) => return check_orientation(f).and_then(|()| formula.respond(f)).map(Some),
            Site::Rve(point) => point,
        };
        let Some(lifecycle) = &mut point.lifecycle else { return Ok(None) };
        lifecycle.trial = (*f, None);
        let rest = point.model.and_then(|model| self.at_rest[model].as_ref());
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
                linear(rest, point.matrix.as_ref(), f).map(Some)
            }
            RveStatus::Waiting | RveStatus::Deleted => point.matrix.map(|matrix| matrix.respond(f)).transpose(),
        }
    }

    /// Writes the response of the RVE of an element to `out`, and stores it: it belongs to the gradient of the last
    /// [`Sites::evaluate`].
    pub(in crate::tissue) fn set_response(&mut self, element: usize, response: &Response, out: &mut PointResponses) {
        write(out, element, response);
        self.store_response(element, response);
    }

    fn store_response(&mut self, element: usize, response: &Response) {
        if let Site::Rve(Point { lifecycle: Some(lifecycle), .. }) = &mut self.sites[element] {
            lifecycle.trial.1 = Some(*response);
        }
    }

    /// Creates, wakes and deletes RVEs as the converged state of the last gradients demands; of those over their
    /// deletion strain, it deletes a fraction ([`DELETED_FRACTION`]), the most strained first.
    pub(in crate::tissue) fn evolve(&mut self) -> RveChanges {
        let mut changes = RveChanges::default();
        let limit = self.overstrain_limit();
        for (element, lifecycle) in lifecycles(&mut self.sites) {
            if lifecycle.overstrain().is_some_and(|overstrain| overstrain >= limit) {
                lifecycle.status = RveStatus::Deleted;
                changes.deleted.push(element);
            } else if lifecycle.must_be_created() {
                lifecycle.status = RveStatus::Awake;
                changes.created.push(element);
            } else if lifecycle.has_moved_in_sleep() {
                lifecycle.status = RveStatus::Awake;
                changes.woken.push(element);
            }
        }
        self.pending.created.extend(&changes.created);
        self.pending.deleted.extend(&changes.deleted);
        changes
    }

    /// The least overstrain at which RVEs are deleted in this round.
    fn overstrain_limit(&self) -> f64 {
        let lifecycles = self.points().filter_map(|(_, point)| point.lifecycle.as_ref());
        let mut overstrains: Vec<f64> = lifecycles.filter_map(|lifecycle| lifecycle.overstrain()).collect();
        overstrains.sort_by(|a, b| b.total_cmp(a));
        let part = (DELETED_FRACTION * overstrains.len() as f64).ceil() as usize;
        let last = part.checked_sub(1).and_then(|last| overstrains.get(last));
        last.map_or(f64::INFINITY, |overstrain| overstrain * (1.0 - EQUAL_STRAINS))
    }

    /// Commits the step at the last gradients; RVEs that hardly moved in it fall asleep. Returns the elements whose
    /// RVEs are deleted for good.
    pub(in crate::tissue) fn commit(&mut self) -> Vec<usize> {
        let is_step = !std::mem::take(&mut self.is_restored);
        for (_, lifecycle) in lifecycles(&mut self.sites) {
            if is_step {
                lifecycle.fall_asleep();
            }
            lifecycle.converged = Some(lifecycle.trial.0);
            lifecycle.committed = lifecycle.status;
        }
        std::mem::take(&mut self.pending).deleted
    }

    /// Reverts the step: all statuses are those of the last commit. Returns the elements whose RVEs were created
    /// since.
    pub(in crate::tissue) fn revert(&mut self) -> Vec<usize> {
        for (_, lifecycle) in lifecycles(&mut self.sites) {
            lifecycle.status = lifecycle.committed;
        }
        std::mem::take(&mut self.pending).created
    }

    /// The gradient and the response from which a sleeping RVE extrapolates.
    pub(in crate::tissue) fn extrapolation_point(&self, element: usize) -> Option<(Matrix3<f64>, Response)> {
        let lifecycle = self.sites.get(element)?.point()?.lifecycle.as_ref()?;
        lifecycle.extrapolation_point.filter(|_| lifecycle.status == RveStatus::Asleep)
    }

    /// Returns the statuses of all elements, [`RveStatus::Awake`] for one without an RVE.
    pub fn statuses(&self) -> Vec<RveStatus> {
        (0..self.len()).map(|element| self.status(element).unwrap_or(RveStatus::Awake)).collect()
    }

    /// Restores all statuses; `response` returns the last gradient of the RVE of an element and its response there.
    pub(in crate::tissue) fn restore(
        &mut self,
        statuses: &[RveStatus],
        response: impl Fn(usize) -> Option<(Matrix3<f64>, Response)>,
    ) {
        for (element, (site, &status)) in self.sites.iter_mut().zip(statuses).enumerate() {
            let Site::Rve(Point { lifecycle: Some(lifecycle), .. }) = site else { continue };
            (lifecycle.status, lifecycle.committed) = (status, status);
            lifecycle.extrapolation_point = response(element);
            lifecycle.converged = lifecycle.extrapolation_point.as_ref().map(|(gradient, _)| *gradient);
        }
        self.pending = RveChanges::default();
        self.is_restored = true;
    }
}

/// The life cycles of RVEs that are created, sleep or are deleted, with their elements.
fn lifecycles(sites: &mut [Site]) -> impl Iterator<Item = (usize, &mut LifecycleState)> {
    sites.iter_mut().enumerate().filter_map(|(element, site)| match site {
        Site::Rve(Point { lifecycle: Some(lifecycle), .. }) => Some((element, &mut **lifecycle)),
        _ => None,
    })
}

impl Site {
    fn new(region: usize, material: ElementMaterial) -> Self {
        match material {
            ElementMaterial::Formula(formula) => Self::Formula(formula),
            ElementMaterial::Rve { model, matrix, lifecycle: rules } => {
                let lifecycle = (rules != RveLifecycle::default()).then(|| Box::new(LifecycleState::new(rules)));
                Self::Rve(Point { region, model, matrix, lifecycle })
            }
        }
    }

    fn point(&self) -> Option<&Point> {
        match self {
            Self::Formula(_) => None,
            Self::Rve(point) => Some(point),
        }
    }
}

impl Point {
    fn status(&self) -> RveStatus {
        self.lifecycle.as_ref().map_or(RveStatus::Awake, |lifecycle| lifecycle.status)
    }
}

/// Rejects an inverted element: small-strain formulas have a response at any gradient.
fn check_orientation(f: &Matrix3<f64>) -> Result<(), MaterialError> {
    let determinant = f.determinant();
    if determinant > 0.0 { Ok(()) } else { Err(MaterialError::Inverted(determinant)) }
}

fn write(out: &mut PointResponses, element: usize, response: &Response) {
    out.energy[element] = response.energy;
    out.pk1[element] = response.pk1;
    out.tangent[element] = response.tangent;
}

/// The sum of a network's linear response at rest and that of the matrix in parallel.
fn linear(
    rest: Option<&SaintVenantKirchhoff>,
    matrix: Option<&Formula>,
    f: &Matrix3<f64>,
) -> Result<Response, MaterialError> {
    let mut sum = Response { energy: 0.0, pk1: Matrix3::zeros(), tangent: nalgebra::SMatrix::zeros() };
    let parts = [rest.map(|rest| rest.evaluate(f)), matrix.map(|matrix| matrix.respond(f))];
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
