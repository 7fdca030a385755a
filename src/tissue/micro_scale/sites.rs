//! What answers at each integration point: a formula, an RVE, or what stands in for an RVE that is not there or asleep.
//!
//! Which of these it is changes only between two solutions by Newton: after every converged state, RVEs are created, woken
//! and deleted, and the body is brought to balance again ([`PointField::evolve`](crate::fem::point_field::PointField::evolve)).
//! RVEs fall asleep when a step is committed, which changes no stress.

use nalgebra::Matrix3;
use serde::{Deserialize, Serialize};

use super::error::PointFailure;
use super::formula::Formula;
use super::library::{ElementMaterial, Library, LibraryError, regions_of_mesh};
use crate::fem::material::{Material, MaterialError, Response, SaintVenantKirchhoff};
use crate::fem::mesh::Mesh;
use crate::las::{Backend, Scalar};
use crate::tissue::case::{Before, Case, LifeCase, MaterialCase};

/// Where an RVE is in its life.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Life {
    /// Not created yet: its matrix or its response at rest answers.
    Waiting,
    /// It answers.
    Awake,
    /// It exists; its last stress and tangent answer.
    Asleep,
    /// It was deleted: its matrix answers.
    Deleted,
}

/// All integration points of a body: what answers at each, and where the RVEs are in their lives.
pub struct Sites {
    sites: Vec<Site>,
    /// The linear response at rest of each model that somebody waits for.
    at_rest: Vec<Option<SaintVenantKirchhoff>>,
    /// What has changed since the last commit.
    pending: Turnover,
    /// Lives have just been restored: the next commit puts nothing to sleep, since no step lies behind it.
    is_restored: bool,
}

/// Of the RVEs that strain demands to delete, the part that is deleted before the body is brought to balance again. Their
/// neighbors take over the load of those that are gone, and may need it no more once the worst are: how many RVEs a step
/// deletes then hardly depends on its length.
const DELETED_A_ROUND: f64 = 0.1;

/// Strains that agree to this part of them are equal: elements that symmetry makes equal are deleted together, and what
/// Newton leaves of its residual does not choose among them.
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
    /// `None` for an RVE that is awake from the beginning to the end.
    course: Option<Box<Course>>,
}

/// The life of an RVE that comes, sleeps or goes.
struct Course {
    rules: LifeCase,
    life: Life,
    /// That at the last commit.
    committed: Life,
    /// The deformation gradient of the last trial state, and what the RVE answered there, if it did.
    trial: (Matrix3<f64>, Option<Response>),
    /// That of the last converged step.
    converged: Option<Matrix3<f64>>,
    /// Where it went to sleep, and its answer there.
    anchor: Option<(Matrix3<f64>, Response)>,
}

/// Elements whose RVEs are created, deleted and woken.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(in crate::tissue) struct Turnover {
    pub created: Vec<usize>,
    pub deleted: Vec<usize>,
    pub woken: Vec<usize>,
}

impl Turnover {
    pub fn is_empty(&self) -> bool {
        self.created.is_empty() && self.deleted.is_empty() && self.woken.is_empty()
    }
}

impl Sites {
    /// What a case makes of the elements of its mesh.
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
        Ok(Self { sites, at_rest, pending: Turnover::default(), is_restored: false })
    }

    /// How many elements there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.sites.len()
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.sites.is_empty()
    }

    fn points(&self) -> impl Iterator<Item = (usize, &Point)> {
        self.sites.iter().enumerate().filter_map(|(element, site)| Some((element, site.point()?)))
    }

    /// How many elements have an RVE at some time.
    #[must_use]
    pub fn rves(&self) -> usize {
        self.points().count()
    }

    /// Elements whose RVE exists, ascending, with their regions of the case.
    pub(in crate::tissue) fn existing(&self) -> impl Iterator<Item = (usize, usize)> {
        self.points()
            .filter(|(_, point)| matches!(point.life(), Life::Awake | Life::Asleep))
            .map(|(e, p)| (e, p.region))
    }

    /// What the RVE of an element is made of: its model and its matrix.
    pub(in crate::tissue) fn material(&self, element: usize) -> Option<(Option<usize>, Option<Formula>)> {
        let point = self.sites.get(element)?.point()?;
        Some((point.model, point.matrix))
    }

    /// Whether there are fibers in an element.
    #[must_use]
    pub fn has_fibers(&self, element: usize) -> bool {
        self.material(element).is_some_and(|(model, _)| model.is_some())
    }

    /// The region of the case that an element with an RVE lies in.
    pub(in crate::tissue) fn region(&self, element: usize) -> usize {
        self.sites.get(element).and_then(Site::point).map_or(0, |point| point.region)
    }

    /// For each of so many models the number of elements that use it.
    #[must_use]
    pub fn users(&self, models: usize) -> Vec<usize> {
        let mut users = vec![0; models];
        self.points().filter_map(|(_, point)| point.model).for_each(|model| users[model] += 1);
        users
    }

    /// Where the RVE of an element is in its life; `None` where there is none at any time.
    #[must_use]
    pub fn life(&self, element: usize) -> Option<Life> {
        self.sites.get(element)?.point().map(Point::life)
    }

    pub(in crate::tissue) fn is_awake(&self, element: usize) -> bool {
        self.life(element) == Some(Life::Awake)
    }

    /// The answer of an element that no RVE is to be asked for.
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

    /// What the RVE of an element has answered at the gradient that [`Sites::respond`] was asked for.
    pub(in crate::tissue) fn answered(&mut self, element: usize, answer: &Response) {
        if let Site::Rve(Point { course: Some(course), .. }) = &mut self.sites[element] {
            course.trial.1 = Some(*answer);
        }
    }

    /// Creates, wakes and deletes RVEs as the converged state demands whose gradients were asked for last; of those to be
    /// deleted the most strained first, a part of them ([`DELETED_A_ROUND`]).
    pub(in crate::tissue) fn evolve(&mut self) -> Turnover {
        let mut turnover = Turnover::default();
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

    /// The overstrain from which on RVEs are deleted in this round.
    fn overstrain_limit(&self) -> f64 {
        let courses = self.points().filter_map(|(_, point)| point.course.as_ref());
        let mut overstrains: Vec<f64> = courses.filter_map(|course| course.overstrain()).collect();
        overstrains.sort_by(|a, b| b.total_cmp(a));
        let part = (DELETED_A_ROUND * overstrains.len() as f64).ceil() as usize;
        let last = part.checked_sub(1).and_then(|last| overstrains.get(last));
        last.map_or(f64::INFINITY, |overstrain| overstrain * (1.0 - EQUAL_STRAINS))
    }

    /// The step is over at the gradients that were asked for last: RVEs that hardly moved in it fall asleep. Returns the
    /// elements whose RVEs are gone for good.
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

    /// The step has failed: all lives are those of the last commit again. Returns the elements whose RVEs were created
    /// since.
    pub(in crate::tissue) fn revert(&mut self) -> Vec<usize> {
        for (_, course) in courses(&mut self.sites) {
            course.life = course.committed;
        }
        std::mem::take(&mut self.pending).created
    }

    /// What a sleeping RVE answers from.
    pub(in crate::tissue) fn anchor(&self, element: usize) -> Option<(Matrix3<f64>, Response)> {
        let course = self.sites.get(element)?.point()?.course.as_ref()?;
        course.anchor.filter(|_| course.life == Life::Asleep)
    }

    /// The lives of all elements, [`Life::Awake`] where there is no RVE.
    #[must_use]
    pub fn lives(&self) -> Vec<Life> {
        (0..self.len()).map(|element| self.life(element).unwrap_or(Life::Awake)).collect()
    }

    /// Takes all lives back; `answer` gives what the RVE of an element answered last.
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
        self.pending = Turnover::default();
        self.is_restored = true;
    }
}

/// The lives of RVEs that come, sleep or go, by element.
fn courses(sites: &mut [Site]) -> impl Iterator<Item = (usize, &mut Course)> {
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

impl Course {
    fn new(rules: LifeCase) -> Self {
        let life = if rules.created_at > 0.0 { Life::Waiting } else { Life::Awake };
        Self { rules, life, committed: life, trial: (Matrix3::identity(), None), converged: None, anchor: None }
    }

    /// The norm of the Green-Lagrange strain.
    fn strain(&self) -> f64 {
        let f = &self.trial.0;
        ((f.transpose() * f - Matrix3::identity()) * 0.5).norm()
    }

    /// The strain over that at which the RVE is deleted, where it exceeds it.
    fn overstrain(&self) -> Option<f64> {
        let exists = matches!(self.life, Life::Awake | Life::Asleep);
        let overstrain = self.strain() / self.rules.deleted_at;
        (exists && overstrain > 1.0).then_some(overstrain)
    }

    /// Whether the RVE is to be created.
    fn is_due(&self) -> bool {
        self.life == Life::Waiting && self.strain() > self.rules.created_at
    }

    /// Whether the RVE sleeps and has to wake.
    fn has_moved_in_sleep(&self) -> bool {
        let moved = |(from, _): &(Matrix3<f64>, Response)| (self.trial.0 - from).amax() > self.rules.asleep_below;
        self.life == Life::Asleep && self.anchor.as_ref().is_none_or(moved)
    }

    /// Falls asleep if it has hardly moved since the last converged step.
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
            let course = (rules != LifeCase::default()).then(|| Box::new(Course::new(rules)));
            Site::Rve(Point { region, model, matrix, course })
        }
    }
}

/// Small-strain formulas have an answer at any gradient, but a body that is inside out is none.
fn upright(f: &Matrix3<f64>) -> Result<(), MaterialError> {
    let determinant = f.determinant();
    if determinant > 0.0 { Ok(()) } else { Err(MaterialError::Inverted { determinant }) }
}

fn respond(formula: &Formula, element: usize, f: &Matrix3<f64>) -> Result<Response, PointFailure> {
    let answer = upright(f).and_then(|()| formula.respond(f));
    answer.map_err(|reason| PointFailure::of_formula(element, &reason))
}

/// A network's response at rest, and the matrix beside it.
fn linear(
    rest: Option<&SaintVenantKirchhoff>,
    matrix: Option<&Formula>,
    f: &Matrix3<f64>,
) -> Result<Response, MaterialError> {
    upright(f)?;
    let mut sum = Response { energy: 0.0, pk1: Matrix3::zeros(), tangent: nalgebra::SMatrix::zeros() };
    let parts = [rest.map(|rest| rest.respond(f)), matrix.map(|matrix| matrix.respond(f))];
    for part in parts.into_iter().flatten() {
        let part = part?;
        sum.energy += part.energy;
        sum.pk1 += part.pk1;
        sum.tangent += part.tangent;
    }
    Ok(sum)
}

/// The answer at `f` to first order from that at `from`: stress by the tangent, and the energy that belongs to it.
fn extrapolate(from: &Matrix3<f64>, answer: &Response, f: &Matrix3<f64>) -> Response {
    let moved = f - from;
    let by_rows = |m: &Matrix3<f64>| nalgebra::SVector::<f64, 9>::from_fn(|k, _| m[(k / 3, k % 3)]);
    let change = answer.tangent * by_rows(&moved);
    let pk1 = answer.pk1 + Matrix3::from_fn(|i, j| change[3 * i + j]);
    let energy = answer.energy + 0.5 * (answer.pk1 + pk1).dot(&moved);
    Response { energy, pk1, tangent: answer.tangent }
}

#[cfg(test)]
mod tests;
