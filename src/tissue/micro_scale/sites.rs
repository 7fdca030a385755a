//! The material of each integration point: a formula, an RVE, or the substitute of an RVE that is not awake.
//!
//! The material of a point changes only between two Newton solves: after every converged state, RVEs are created, woken
//! and deleted, and the body is solved again ([`PointField::evolve`](crate::fem::point_field::PointField::evolve)).
//! RVEs fall asleep when a step is committed, which changes no stress.

use nalgebra::Matrix3;
use serde::{Deserialize, Serialize};

use super::error::PointFailure;
use super::formula::Formula;
use super::library::{ElementMaterial, Library, LibraryError, regions_of_mesh};
use crate::app::case::{Before, Case, LifeCase, MaterialCase};
use crate::fem::material::{Material, MaterialError, Response, SaintVenantKirchhoff};
use crate::fem::mesh::Mesh;
use crate::las::{Backend, Scalar};
use crate::tensor::contract;

/// The state of an RVE in its life cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Life {
    /// Not created yet: its matrix or its linear response at rest gives the stress.
    Waiting,
    /// It is solved at every trial state.
    Awake,
    /// It exists; its stress is extrapolated from its last response.
    Asleep,
    /// Deleted: its matrix gives the stress.
    Deleted,
}

/// The materials of all integration points of a body, and the life states of the RVEs.
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
const DELETED_A_ROUND: f64 = 0.1;

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
    course: Option<Box<LifeCycle>>,
}

/// The life cycle of an RVE that is created, sleeps or is deleted.
struct LifeCycle {
    rules: LifeCase,
    life: Life,
    /// The life state at the last commit.
    committed: Life,
    /// The deformation gradient of the last trial state, and the response of the RVE there if it was solved.
    trial: (Matrix3<f64>, Option<Response>),
    /// The deformation gradient of the last converged step.
    converged: Option<Matrix3<f64>>,
    /// The deformation gradient at which it fell asleep, and its response there.
    anchor: Option<(Matrix3<f64>, Response)>,
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
    /// Assigns the materials of a case to the elements of its mesh.
    pub(in crate::tissue) fn new<B: Backend<Scalar = f64>>(
        library: &Library<B>,
        case: &Case,
        mesh: &Mesh,
    ) -> Result<Self, LibraryError>
    where
        B::Reduced: Scalar,
    {
        let regions = regions_of_mesh(case, mesh)?;
        let sites: Vec<Site> =
            regions.iter().enumerate().map(|(element, &region)| site(library, case, region, element)).collect();
        let mut at_rest = vec![None; library.models().len()];
        for point in sites.iter().filter_map(Site::point) {
            if let (Some(model), Some(course)) = (point.model, &point.course)
                && course.life == Life::Waiting
                && course.rules.before == Before::Linear
                && at_rest[model].is_none()
            {
                at_rest[model] = Some(library.at_rest(model)?);
            }
        }
        Ok(Self { sites, at_rest, pending: RveChanges::default(), is_restored: false })
    }

    /// Number of elements.
    #[must_use]
    pub fn len(&self) -> usize {
        self.sites.len()
    }

    /// Returns true if there are no elements.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.sites.is_empty()
    }

    fn points(&self) -> impl Iterator<Item = (usize, &Point)> {
        self.sites.iter().enumerate().filter_map(|(element, site)| Some((element, site.point()?)))
    }

    /// Number of elements that have an RVE at some time.
    #[must_use]
    pub fn rves(&self) -> usize {
        self.points().count()
    }

    /// Returns the elements whose RVE exists, ascending, with their regions of the case.
    pub(in crate::tissue) fn existing(&self) -> impl Iterator<Item = (usize, usize)> {
        self.points()
            .filter(|(_, point)| matches!(point.life(), Life::Awake | Life::Asleep))
            .map(|(e, p)| (e, p.region))
    }

    /// Returns the model and the matrix of the RVE of an element.
    pub(in crate::tissue) fn material(&self, element: usize) -> Option<(Option<usize>, Option<Formula>)> {
        let point = self.sites.get(element)?.point()?;
        Some((point.model, point.matrix))
    }

    /// Returns true if the RVE of an element has fibers.
    #[must_use]
    pub fn has_fibers(&self, element: usize) -> bool {
        self.material(element).is_some_and(|(model, _)| model.is_some())
    }

    /// Returns the region of the case that an element with an RVE belongs to.
    pub(in crate::tissue) fn region(&self, element: usize) -> usize {
        self.sites.get(element).and_then(Site::point).map_or(0, |point| point.region)
    }

    /// Returns, for each of `models` models, the number of elements that use it.
    #[must_use]
    pub fn users(&self, models: usize) -> Vec<usize> {
        let mut users = vec![0; models];
        self.points().filter_map(|(_, point)| point.model).for_each(|model| users[model] += 1);
        users
    }

    /// Returns the life state of the RVE of an element; `None` if the element never has one.
    #[must_use]
    pub fn life(&self, element: usize) -> Option<Life> {
        self.sites.get(element)?.point().map(Point::life)
    }

    pub(in crate::tissue) fn is_awake(&self, element: usize) -> bool {
        self.life(element) == Some(Life::Awake)
    }

    /// Returns the response of an element without an awake RVE; `None` if its RVE has to be solved.
    pub(in crate::tissue) fn respond(
        &mut self,
        element: usize,
        f: &Matrix3<f64>,
    ) -> Result<Option<Response>, PointFailure> {
        let point = match &mut self.sites[element] {
            Site::Formula(formula) => return respond(formula, element, f).map(Some),
            Site::Rve(point) => point,
        };
        let Some(course) = &mut point.course else { return Ok(None) };
        course.trial = (*f, None);
        let rest = point.model.and_then(|model| self.at_rest[model].as_ref());
        let answer = match course.life {
            Life::Awake => return Ok(None),
            Life::Asleep => {
                upright(f).map(|()| course.anchor.as_ref().map(|(from, answer)| extrapolate(from, answer, f)))
            }
            Life::Waiting if course.rules.before == Before::Linear => linear(rest, point.matrix.as_ref(), f).map(Some),
            Life::Waiting | Life::Deleted => {
                point.matrix.map(|matrix| upright(f).and_then(|()| matrix.respond(f))).transpose()
            }
        };
        answer.map_err(|reason| PointFailure::of_formula(element, &reason))
    }

    /// Stores the response of the RVE of an element at the gradient of the last [`Sites::respond`].
    pub(in crate::tissue) fn answered(&mut self, element: usize, answer: &Response) {
        if let Site::Rve(Point { course: Some(course), .. }) = &mut self.sites[element] {
            course.trial.1 = Some(*answer);
        }
    }

    /// Creates, wakes and deletes RVEs as the converged state of the last gradients demands; of those over their
    /// deletion strain, it deletes a fraction ([`DELETED_A_ROUND`]), the most strained first.
    pub(in crate::tissue) fn evolve(&mut self) -> RveChanges {
        let mut turnover = RveChanges::default();
        let limit = self.overstrain_limit();
        for (element, course) in courses(&mut self.sites) {
            if course.overstrain().is_some_and(|overstrain| overstrain >= limit) {
                course.life = Life::Deleted;
                turnover.deleted.push(element);
            } else if course.is_due() {
                course.life = Life::Awake;
                turnover.created.push(element);
            } else if course.has_moved_in_sleep() {
                course.life = Life::Awake;
                turnover.woken.push(element);
            }
        }
        self.pending.created.extend(&turnover.created);
        self.pending.deleted.extend(&turnover.deleted);
        turnover
    }

    /// The least overstrain at which RVEs are deleted in this round.
    fn overstrain_limit(&self) -> f64 {
        let courses = self.points().filter_map(|(_, point)| point.course.as_ref());
        let mut overstrains: Vec<f64> = courses.filter_map(|course| course.overstrain()).collect();
        overstrains.sort_by(|a, b| b.total_cmp(a));
        let part = (DELETED_A_ROUND * overstrains.len() as f64).ceil() as usize;
        let last = part.checked_sub(1).and_then(|last| overstrains.get(last));
        last.map_or(f64::INFINITY, |overstrain| overstrain * (1.0 - EQUAL_STRAINS))
    }

    /// Commits the step at the last gradients; RVEs that hardly moved in it fall asleep. Returns the elements whose
    /// RVEs are deleted for good.
    pub(in crate::tissue) fn commit(&mut self) -> Vec<usize> {
        let is_step = !std::mem::take(&mut self.is_restored);
        for (_, course) in courses(&mut self.sites) {
            if is_step {
                course.fall_asleep();
            }
            course.converged = Some(course.trial.0);
            course.committed = course.life;
        }
        std::mem::take(&mut self.pending).deleted
    }

    /// Reverts the step: all life states are those of the last commit. Returns the elements whose RVEs were created
    /// since.
    pub(in crate::tissue) fn revert(&mut self) -> Vec<usize> {
        for (_, course) in courses(&mut self.sites) {
            course.life = course.committed;
        }
        std::mem::take(&mut self.pending).created
    }

    /// The gradient and the response from which a sleeping RVE extrapolates.
    pub(in crate::tissue) fn anchor(&self, element: usize) -> Option<(Matrix3<f64>, Response)> {
        let course = self.sites.get(element)?.point()?.course.as_ref()?;
        course.anchor.filter(|_| course.life == Life::Asleep)
    }

    /// Returns the life states of all elements, [`Life::Awake`] for one without an RVE.
    #[must_use]
    pub fn lives(&self) -> Vec<Life> {
        (0..self.len()).map(|element| self.life(element).unwrap_or(Life::Awake)).collect()
    }

    /// Restores all life states; `answer` returns the last gradient of the RVE of an element and its response there.
    pub(in crate::tissue) fn restore(
        &mut self,
        lives: &[Life],
        answer: impl Fn(usize) -> Option<(Matrix3<f64>, Response)>,
    ) {
        for (element, (site, &life)) in self.sites.iter_mut().zip(lives).enumerate() {
            let Site::Rve(Point { course: Some(course), .. }) = site else { continue };
            (course.life, course.committed) = (life, life);
            course.anchor = answer(element);
            course.converged = course.anchor.as_ref().map(|(gradient, _)| *gradient);
        }
        self.pending = RveChanges::default();
        self.is_restored = true;
    }
}

/// The life cycles of RVEs that are created, sleep or are deleted, with their elements.
fn courses(sites: &mut [Site]) -> impl Iterator<Item = (usize, &mut LifeCycle)> {
    sites.iter_mut().enumerate().filter_map(|(element, site)| match site {
        Site::Rve(Point { course: Some(course), .. }) => Some((element, &mut **course)),
        _ => None,
    })
}

impl Site {
    fn point(&self) -> Option<&Point> {
        match self {
            Self::Formula(_) => None,
            Self::Rve(point) => Some(point),
        }
    }
}

impl Point {
    fn life(&self) -> Life {
        self.course.as_ref().map_or(Life::Awake, |course| course.life)
    }
}

impl LifeCycle {
    fn new(rules: LifeCase) -> Self {
        let life = if rules.created_at > 0.0 { Life::Waiting } else { Life::Awake };
        Self { rules, life, committed: life, trial: (Matrix3::identity(), None), converged: None, anchor: None }
    }

    /// The norm of the Green-Lagrange strain.
    fn strain(&self) -> f64 {
        let f = &self.trial.0;
        ((f.transpose() * f - Matrix3::identity()) * 0.5).norm()
    }

    /// The ratio of strain to deletion strain if it exceeds 1.
    fn overstrain(&self) -> Option<f64> {
        let exists = matches!(self.life, Life::Awake | Life::Asleep);
        let overstrain = self.strain() / self.rules.deleted_at;
        (exists && overstrain > 1.0).then_some(overstrain)
    }

    /// Returns true if the RVE has to be created.
    fn is_due(&self) -> bool {
        self.life == Life::Waiting && self.strain() > self.rules.created_at
    }

    /// Returns true if the RVE sleeps and has to wake.
    fn has_moved_in_sleep(&self) -> bool {
        let moved = |(from, _): &(Matrix3<f64>, Response)| (self.trial.0 - from).amax() > self.rules.asleep_below;
        self.life == Life::Asleep && self.anchor.as_ref().is_none_or(moved)
    }

    /// Puts the RVE to sleep if it has hardly moved since the last converged step.
    fn fall_asleep(&mut self) {
        let (f, answer) = self.trial;
        let is_still = self.converged.is_some_and(|before| (f - before).amax() < self.rules.asleep_below);
        if let (Life::Awake, true, Some(answer)) = (self.life, is_still, answer) {
            (self.life, self.anchor) = (Life::Asleep, Some((f, answer)));
        }
    }
}

fn site<B: Backend<Scalar = f64>>(library: &Library<B>, case: &Case, region: usize, element: usize) -> Site {
    match library.of_element(region, element) {
        ElementMaterial::Formula(formula) => Site::Formula(formula),
        ElementMaterial::Rve { model, matrix } => {
            let rules = match &case.regions[region].material {
                MaterialCase::FiberRve(rve) => rve.life,
                MaterialCase::Formula(_) => LifeCase::default(),
            };
            let course = (rules != LifeCase::default()).then(|| Box::new(LifeCycle::new(rules)));
            Site::Rve(Point { region, model, matrix, course })
        }
    }
}

/// Rejects an inverted element: small-strain formulas have a response at any gradient.
fn upright(f: &Matrix3<f64>) -> Result<(), MaterialError> {
    let determinant = f.determinant();
    if determinant > 0.0 { Ok(()) } else { Err(MaterialError::Inverted { determinant }) }
}

fn respond(formula: &Formula, element: usize, f: &Matrix3<f64>) -> Result<Response, PointFailure> {
    let answer = upright(f).and_then(|()| formula.respond(f));
    answer.map_err(|reason| PointFailure::of_formula(element, &reason))
}

/// The sum of a network's linear response at rest and that of the matrix in parallel.
fn linear(
    rest: Option<&SaintVenantKirchhoff>,
    matrix: Option<&Formula>,
    f: &Matrix3<f64>,
) -> Result<Response, MaterialError> {
    upright(f)?;
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

/// Extrapolates the response from `from` to `f`: stress to first order by the tangent, and the matching energy.
fn extrapolate(from: &Matrix3<f64>, answer: &Response, f: &Matrix3<f64>) -> Response {
    let moved = f - from;
    let pk1 = answer.pk1 + contract(&answer.tangent, &moved);
    let energy = answer.energy + 0.5 * (answer.pk1 + pk1).dot(&moved);
    Response { energy, pk1, tangent: answer.tangent }
}

#[cfg(test)]
mod tests;
