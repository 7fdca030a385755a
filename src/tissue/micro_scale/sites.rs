//! What answers at each integration point: a formula, an RVE, or what stands in for an RVE that is not there or asleep.
//!
//! Which of these, is decided after every converged step and stays until the next: Newton never sees it change.

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
    /// Lives have just been decided or taken back: the next commit only tells what the new materials answer.
    is_decided: bool,
}

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
    /// The deformation gradient of the last trial state, and what the RVE answered there, if it did.
    trial: (Matrix3<f64>, Option<Response>),
    /// That of the last converged step.
    converged: Option<Matrix3<f64>>,
    /// Where it went to sleep, and its answer there.
    anchor: Option<(Matrix3<f64>, Response)>,
}

/// RVEs that come and go after a step.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(in crate::tissue) struct Turnover {
    pub created: Vec<usize>,
    pub deleted: Vec<usize>,
    /// Those that sleep no more.
    pub woken: Vec<usize>,
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
        Ok(Self { sites, at_rest, is_decided: false })
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

    /// Decides after a converged step, whose gradients were asked for last, which RVEs come, go, sleep and wake.
    pub(in crate::tissue) fn decide(&mut self) -> Turnover {
        let mut turnover = Turnover::default();
        if std::mem::take(&mut self.is_decided) {
            return turnover;
        }
        for (element, site) in self.sites.iter_mut().enumerate() {
            let Site::Rve(Point { course: Some(course), .. }) = site else { continue };
            let before = course.life;
            course.decide();
            match (before, course.life) {
                (Life::Waiting, Life::Awake) => turnover.created.push(element),
                (Life::Awake | Life::Asleep, Life::Deleted) => turnover.deleted.push(element),
                (Life::Asleep, Life::Awake) => turnover.woken.push(element),
                _ => {}
            }
        }
        self.is_decided = turnover != Turnover::default();
        turnover
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
            course.life = life;
            course.anchor = answer(element);
            course.converged = course.anchor.as_ref().map(|(gradient, _)| *gradient);
        }
        self.is_decided = true;
    }
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
        Self { rules, life, trial: (Matrix3::identity(), None), converged: None, anchor: None }
    }

    fn decide(&mut self) {
        let (f, answer) = self.trial;
        let strain = ((f.transpose() * f - Matrix3::identity()) * 0.5).norm();
        let exists = matches!(self.life, Life::Awake | Life::Asleep);
        if exists && strain > self.rules.deleted_at {
            self.life = Life::Deleted;
        } else if self.life == Life::Waiting && strain > self.rules.created_at {
            self.life = Life::Awake;
        } else if self.life == Life::Awake {
            let still = self.converged.is_some_and(|before| (f - before).amax() < self.rules.asleep_below);
            if let (true, Some(answer)) = (still, answer) {
                (self.life, self.anchor) = (Life::Asleep, Some((f, answer)));
            }
        } else if self.life == Life::Asleep
            && self.anchor.as_ref().is_none_or(|(from, _)| (f - from).amax() > self.rules.asleep_below)
        {
            self.life = Life::Awake;
        }
        self.converged = Some(f);
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
mod tests {
    use super::*;
    use crate::fem::material::NeoHookean;

    fn stretched(by: f64) -> Matrix3<f64> {
        Matrix3::from_diagonal(&[1.0 + by, 1.0, 1.0].into())
    }

    /// One element whose matrix is all it has, with rules.
    fn sites(rules: LifeCase) -> Sites {
        let matrix = Some(Formula::NeoHookean(NeoHookean { mu: 1.0, lambda: 2.0 }));
        let course = Some(Box::new(Course::new(rules)));
        Sites {
            sites: vec![Site::Rve(Point { region: 0, model: None, matrix, course })],
            at_rest: Vec::new(),
            is_decided: false,
        }
    }

    /// Converges at a stretch; the RVE, where it is asked, answers ten times its matrix.
    fn converge(sites: &mut Sites, by: f64) -> (Response, Turnover) {
        let f = stretched(by);
        let answer = match sites.respond(0, &f).unwrap() {
            Some(answer) => answer,
            None => {
                let answer = NeoHookean { mu: 10.0, lambda: 20.0 }.respond(&f).unwrap();
                sites.answered(0, &answer);
                answer
            }
        };
        let turnover = sites.decide();
        if sites.is_decided {
            assert_eq!(sites.decide(), Turnover::default(), "once only");
        }
        (answer, turnover)
    }

    #[test]
    fn an_rve_comes_when_strain_passes_a_threshold_and_goes_when_it_passes_another() {
        let rules = LifeCase { created_at: 0.05, before: Before::Matrix, deleted_at: 0.2, ..LifeCase::default() };
        let mut sites = sites(rules);
        assert_eq!((sites.life(0), sites.existing().count()), (Some(Life::Waiting), 0));
        let (answer, turnover) = converge(&mut sites, 0.04);
        assert_eq!(answer, NeoHookean { mu: 1.0, lambda: 2.0 }.respond(&stretched(0.04)).unwrap());
        assert_eq!(turnover, Turnover::default());
        let (_, turnover) = converge(&mut sites, 0.06);
        assert_eq!((turnover.created, sites.life(0)), (vec![0], Some(Life::Awake)));
        let (answer, _) = converge(&mut sites, 0.1);
        assert_eq!(answer, NeoHookean { mu: 10.0, lambda: 20.0 }.respond(&stretched(0.1)).unwrap());
        let (_, turnover) = converge(&mut sites, 0.3);
        assert_eq!((turnover.deleted, sites.life(0)), (vec![0], Some(Life::Deleted)));
        let (answer, _) = converge(&mut sites, 0.01);
        assert_eq!(answer, NeoHookean { mu: 1.0, lambda: 2.0 }.respond(&stretched(0.01)).unwrap());
    }

    #[test]
    fn an_rve_sleeps_while_little_changes_and_wakes_when_that_adds_up() {
        let mut sites = sites(LifeCase { asleep_below: 0.01, ..LifeCase::default() });
        converge(&mut sites, 0.1);
        assert_eq!(sites.life(0), Some(Life::Awake), "one state is no change");
        let (anchor, _) = converge(&mut sites, 0.105);
        assert_eq!(sites.life(0), Some(Life::Asleep));
        let (answer, _) = converge(&mut sites, 0.11);
        assert_eq!((answer.tangent, sites.life(0)), (anchor.tangent, Some(Life::Asleep)));
        let expected = anchor.pk1[(0, 0)] + 0.005 * anchor.tangent[(0, 0)];
        assert!((answer.pk1[(0, 0)] - expected).abs() < 1e-14);
        converge(&mut sites, 0.117);
        assert_eq!(sites.life(0), Some(Life::Awake), "0.012 from where it fell asleep");
    }

    /// The stress of a sleeping RVE is the derivative of its energy.
    #[test]
    fn what_a_sleeping_rve_answers_has_an_energy() {
        let from = Matrix3::new(1.1, 0.1, 0.0, 0.0, 0.9, 0.0, 0.2, 0.0, 1.0);
        let answer = NeoHookean { mu: 3.0, lambda: 5.0 }.respond(&from).unwrap();
        let f = from + Matrix3::new(0.01, -0.02, 0.03, 0.0, 0.01, 0.0, 0.02, 0.0, -0.01);
        let (h, here) = (1e-5, extrapolate(&from, &answer, &f));
        for k in 0..9 {
            let moved = |by: f64| {
                let mut f = f;
                f[(k / 3, k % 3)] += by;
                extrapolate(&from, &answer, &f).energy
            };
            assert!(((moved(h) - moved(-h)) / (2.0 * h) - here.pk1[(k / 3, k % 3)]).abs() < 1e-8, "component {k}");
        }
    }
}
