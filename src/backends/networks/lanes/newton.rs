//! Newton's method for a group of networks, one in each lane.
//!
//! Lanes that have finished, or whose step length is accepted, stay where they are while others continue: they repeat
//! the same operations with the same results. What happens to a lane therefore does not depend on the others.

use super::arrays::Arrays;
use super::forces::{Evaluate, Forces};
use super::network::Network;
use super::phases::{Clock, Phase};
use super::simd::{Double, Kernel, Lanes, MOST_LANES, load, numbers_of, numbers_of_mut, store};
use super::single;
use super::triangular::SolveDirection;
use crate::backends::networks::{BatchParams, Status};

/// The pivot ratio below which a matrix counts as singular up to rounding.
const SINGULAR: f64 = 1e-12;

/// The most residual norms that the line search compares with.
const MEMORY: usize = 8;

/// Distances from the given equilibrium: the norm at which it is reached, and the factor by which a step must approach
/// it.
const REACHED: (f64, f64) = (1e-10, 0.1);

/// The solution of one lane.
#[derive(Clone, Copy, Debug)]
pub(super) struct Course {
    /// `None` while it runs.
    pub status: Option<Status>,
    pub iterations: u32,
    pub backtracks: u32,
    pub pivot_ratio: f64,
    pub residual: f64,
    pub scale: f64,
    largest: f64,
    /// Residual norms of the last iterates.
    recent: [f64; MEMORY],
    /// The distance from the given equilibrium.
    apart: f64,
    search: Search,
    reuse: Reuse,
}

/// What a lane knows of its last factor of single precision.
#[derive(Clone, Copy, Debug)]
struct Reuse {
    /// Whether factors serve more than one step.
    is_possible: bool,
    /// Whether it has one.
    has_factor: bool,
    /// Whether the last step reduced the residual to [`SHARE`], so that the next one takes the same factor. Also true
    /// before the first step, whose direction need not be exact either.
    pays: bool,
    /// Whether the step that is searched takes the factor of an earlier iterate.
    is_chord: bool,
}

/// The share of the residual to which a step must reduce it so that its factor serves the next one (a chord step).
const SHARE: f64 = 0.1;

/// The line search of one lane.
#[derive(Clone, Copy, Debug)]
struct Search {
    /// The step length of the positions, and the next one to try.
    at: f64,
    step: f64,
    /// The residual at the start, its limit at convergence, and the largest of the compared ones.
    residual: f64,
    limit: f64,
    largest: f64,
    /// Step lengths rejected so far; `None` if the lane does not search.
    rejected: Option<u32>,
}

impl Search {
    const NONE: Self = Self { at: 0.0, step: 0.0, residual: 0.0, limit: 0.0, largest: 0.0, rejected: None };
}

/// The forces of one lane.
#[derive(Clone, Copy)]
struct Found {
    residual: f64,
    scale: f64,
    largest: f64,
}

impl Found {
    fn is_finite(&self) -> bool {
        self.residual.is_finite() && self.scale.is_finite()
    }

    /// The forces of each lane.
    fn of<S: Double>(forces: &Forces<S>) -> [Self; MOST_LANES] {
        let (residual, scale, largest) = (forces.residual.numbers(), forces.scale.numbers(), forces.largest.numbers());
        std::array::from_fn(|k| Self { residual: residual[k], scale: scale[k], largest: largest[k] })
    }
}

impl Course {
    fn new(found: &Found, has_chords: bool) -> Self {
        let &Found { residual, scale, largest } = found;
        Self {
            status: (!found.is_finite()).then_some(Status::NotFinite),
            iterations: 0,
            backtracks: 0,
            pivot_ratio: 1.0,
            residual,
            scale,
            largest,
            recent: [0.0; MEMORY],
            apart: 0.0,
            search: Search::NONE,
            reuse: Reuse { is_possible: has_chords, has_factor: false, pays: has_chords, is_chord: false },
        }
    }

    fn runs(&self) -> bool {
        self.status.is_none()
    }

    /// The residual norm at convergence.
    fn limit(&self, params: &BatchParams) -> f64 {
        (params.tolerance * self.scale).max(params.floor)
    }

    fn has_converged(&self, params: &BatchParams, continues: bool) -> bool {
        !continues && self.residual <= self.limit(params)
    }

    /// Decides, before the factorization, whether the lane ends.
    fn check(&mut self, params: &BatchParams, continues: bool) {
        let converged = self.has_converged(params, continues);
        if !converged && self.iterations == params.max_iterations {
            self.status = Some(if continues { Status::Inconclusive } else { Status::TooManyIterations });
        } else if converged {
            let is_bearable = self.largest < params.excessive_force;
            self.status = (!is_bearable).then_some(Status::ExcessiveForce);
        }
    }

    /// Decides, after the factorization, whether the lane ends, and otherwise begins the line search.
    fn begin(&mut self, params: &BatchParams, continues: bool, positive: bool, pivot_ratio: f64, is_fixed: bool) {
        let converged = self.has_converged(params, continues);
        self.pivot_ratio = pivot_ratio;
        if !positive || !(is_fixed || pivot_ratio >= SINGULAR) {
            self.status = Some(Status::Indefinite);
            return;
        }
        if converged {
            self.status = Some(Status::Converged);
            return;
        }
        let residual = self.residual;
        let mut largest = residual;
        if !continues {
            let kept = params.memory - 1;
            let held = self.iterations.min(kept) as usize;
            largest = self.recent[..held].iter().fold(largest, |largest, &recent| largest.max(recent));
            if kept > 0 {
                self.recent[(self.iterations % kept) as usize] = residual;
            }
        }
        self.iterations += 1;
        self.search_from(params, largest);
        self.reuse.is_chord = false;
    }

    fn search_from(&mut self, params: &BatchParams, largest: f64) {
        let limit = self.limit(params);
        self.search = Search { at: 0.0, step: 1.0, residual: self.residual, limit, largest, rejected: Some(0) };
    }

    /// Returns true if the next step takes the factor of an earlier iterate.
    fn takes_chord(&self) -> bool {
        self.reuse.has_factor && self.reuse.pays
    }

    /// Begins a step with the factor of an earlier iterate.
    fn begin_chord(&mut self, params: &BatchParams) {
        self.search_from(params, self.residual);
        self.reuse.is_chord = true;
    }

    /// Returns how far the positions move along the direction, and takes the step as made.
    fn take_step(&mut self) -> f64 {
        let search = &mut self.search;
        if search.rejected.is_none() || self.status.is_some() {
            return 0.0;
        }
        let moved = search.at - search.step;
        search.at = search.step;
        moved
    }

    /// Accepts the step of these forces, or shortens it.
    fn judge(&mut self, found: &Found, params: &BatchParams, continues: bool) {
        let Some(rejected) = self.search.rejected.filter(|_| self.runs()) else { return };
        let Search { step, residual, limit, largest, .. } = self.search;
        let least = if continues { 0.0 } else { limit };
        let allowed = ((1.0 - params.sufficient_decrease * step) * largest).max(least);
        // A chord step that does not reduce the residual is taken back.
        let Reuse { is_chord, .. } = self.reuse;
        let is_back = is_chord && step == 0.0;
        let takes_any = is_back || params.max_backtracks == 0 && !is_chord;
        if found.is_finite() && (found.residual <= allowed || takes_any) {
            (self.residual, self.scale, self.largest) = (found.residual, found.scale, found.largest);
            self.search.rejected = None;
            self.reuse.pays = self.reuse.is_possible && step == 1.0 && found.residual <= SHARE * residual;
        } else if is_back {
            self.status = Some(Status::LineSearch);
        } else if is_chord {
            self.search.step = 0.0;
        } else if continues {
            self.status = Some(Status::Inconclusive);
        } else if rejected == params.max_backtracks {
            self.status = Some(Status::LineSearch);
        } else {
            let (before, after) = (residual * residual, found.residual * found.residual);
            let best = before * step / (after - before + 2.0 * before * step);
            self.search.step *= if found.is_finite() { best.clamp(0.1, 0.5) } else { 0.5 };
            self.search.rejected = Some(rejected + 1);
            self.backtracks += 1;
        }
    }

    /// Decides, after an accepted step, by the distance from the given equilibrium.
    fn approach(&mut self, distance: f64) {
        if !self.runs() {
            return;
        }
        if !distance.is_finite() {
            self.status = Some(Status::Inconclusive);
        } else if distance <= (REACHED.1 * self.apart).max(REACHED.0) {
            self.status = Some(Status::Continues);
        }
        self.apart = distance;
    }
}

/// Adds `steps` times the direction to the positions of interior nodes.
struct Move<'a, 'b, S: Double> {
    interior: usize,
    arrays: &'a mut Arrays<'b, S>,
    steps: &'a [f64; MOST_LANES],
}

impl<S: Double> Kernel<S> for Move<'_, '_, S> {
    type Output = ();

    #[inline(always)]
    fn run(self, simd: S) {
        let steps = Lanes::of_numbers(simd, self.steps);
        let zero = Lanes::splat(simd, 0.0);
        let moves = steps.less(zero);
        let moves_back = zero.less(steps);
        for node in 0..self.interior {
            let mut x: [Lanes<S>; 3] = load(simd, self.arrays.positions, node);
            // Of the array of sensitivities, which is free until the end, the first numbers hold the direction.
            let d: [Lanes<S>; 3] = load(simd, self.arrays.modes, node);
            for k in 0..3 {
                // A lane that stays has the same bits, whatever its direction is.
                let moved = steps.mul_add(d[k], x[k]);
                x[k] = moved.where_or(moves, moved.where_or(moves_back, x[k]));
            }
            store(&x, self.arrays.positions, node);
        }
    }
}

/// A group of networks in `lanes` lanes at their starts.
pub(super) struct Newton<'a, 'b, 'c, S: Double> {
    pub simd: S,
    pub network: &'a Network,
    pub arrays: &'a mut Arrays<'b, S>,
    pub params: &'a BatchParams,
    /// The lanes that have a network.
    pub lanes: usize,
    /// Whether directions come from factors of single precision, and whether one of these may serve several steps.
    pub has_single: bool,
    pub has_chords: bool,
    pub clock: &'a mut Clock<'c>,
}

impl<S: Double> Newton<'_, '_, '_, S> {
    fn evaluate(&mut self) -> [Found; MOST_LANES] {
        let found = Found::of(&self.simd.vectorize(Evaluate { network: self.network, arrays: self.arrays }));
        self.clock.end(Phase::Forces);
        found
    }

    /// Solves with tiles of `C` columns, from the start in the arrays. With `reached`, positions by lane in
    /// the order of elimination, tests instead whether Newton's method leads there.
    pub fn run<const C: usize>(mut self, reached: Option<&[Vec<[f64; 3]>]>) -> Vec<Course> {
        let continues = reached.is_some();
        let Self { simd, network, params, lanes, has_chords, .. } = self;
        let found = self.evaluate();
        let mut courses: Vec<Course> = found[..lanes].iter().map(|found| Course::new(found, has_chords)).collect();
        if let Some(reached) = reached {
            for (lane, course) in courses.iter_mut().enumerate().filter(|(_, course)| course.runs()) {
                course.apart = self.distance(lane, &reached[lane]);
                if course.apart <= REACHED.0 {
                    course.status = Some(Status::Continues);
                }
            }
        }
        loop {
            courses.iter_mut().filter(|course| course.runs()).for_each(|course| course.check(params, continues));
            if !courses.iter().any(Course::runs) {
                return courses;
            }
            // Lanes in equilibrium wait for the others, because only their last factor must have double precision.
            let searches = |course: &Course| course.runs() && !course.has_converged(params, continues);
            if self.has_single && courses.iter().any(searches) {
                if courses.iter().any(|course| searches(course) && course.takes_chord()) {
                    self.chord_direction::<C>(&mut courses);
                } else {
                    self.single_direction::<C>(&mut courses);
                }
                self.search_line(&mut courses, continues);
                continue;
            }
            // At an equilibrium, the factor shows that it is stable, and serves the tangent.
            let pivots = simd.vectorize(self.arrays.factor::<C>(network));
            self.clock.end(Phase::Factor);
            let (smallest, largest) = (pivots.smallest.numbers(), pivots.largest.numbers());
            let positive = pivots.positive.numbers();
            for (lane, course) in courses.iter_mut().enumerate().filter(|(_, course)| course.runs()) {
                let ratio = smallest[lane] / largest[lane];
                course.begin(params, continues, positive[lane] != 0.0, ratio, network.interior == 0);
            }
            if !courses.iter().any(Course::runs) {
                return courses;
            }
            simd.vectorize(SolveDirection::<S, C> { network, arrays: self.arrays });
            // The next residual overwrites the direction.
            let entries = self.arrays.direction.len();
            self.arrays.modes[..entries].copy_from_slice(self.arrays.direction);
            self.search_line(&mut courses, continues);
            if let Some(reached) = reached {
                for (lane, course) in courses.iter_mut().enumerate().filter(|(_, course)| course.runs()) {
                    let distance = self.distance(lane, &reached[lane]);
                    course.approach(distance);
                }
            }
        }
    }

    /// Computes the directions of the lanes that are not in equilibrium, with factors of single precision where these
    /// serve.
    fn single_direction<const C: usize>(&mut self, courses: &mut [Course]) {
        let (mut residuals, mut rough) = ([None; MOST_LANES], [false; MOST_LANES]);
        for (lane, course) in courses.iter().enumerate() {
            let searches = course.runs() && !course.has_converged(self.params, false);
            residuals[lane] = searches.then_some(course.residual);
            rough[lane] = course.reuse.pays;
        }
        let found = single::direction::<S, C>(self.simd, self.network, self.arrays, &residuals, &rough);
        let fails = |lane: usize| residuals[lane].is_some() && !found.is_accurate[lane];
        let failed: [bool; MOST_LANES] = std::array::from_fn(fails);
        let double = failed.contains(&true).then(|| self.double_direction::<C>(failed));
        self.clock.end(Phase::Factor);
        for (lane, course) in courses.iter_mut().enumerate().filter(|(lane, _)| residuals[*lane].is_some()) {
            let (positive, ratio) = match &double {
                Some((positive, ratios)) if failed[lane] => (positive[lane], ratios[lane]),
                _ => (true, found.ratios[lane]),
            };
            course.begin(self.params, false, positive, ratio, false);
            course.reuse.has_factor = found.is_accurate[lane];
        }
    }

    /// Computes the directions of the lanes whose last step pays, with the factors that they have. The others wait.
    fn chord_direction<const C: usize>(&mut self, courses: &mut [Course]) {
        let mut residuals = [None; MOST_LANES];
        for (course, residual) in courses.iter_mut().zip(&mut residuals) {
            if course.runs() && !course.has_converged(self.params, false) && course.takes_chord() {
                *residual = Some(course.residual);
                course.begin_chord(self.params);
            }
        }
        single::chord::<S, C>(self.simd, self.network, self.arrays, &residuals);
        self.clock.end(Phase::Factor);
    }

    /// Computes the directions of these lanes with factors of double precision, and keeps those of the others. Returns
    /// whether the pivots of each lane are positive, and the ratio of the smallest to the largest.
    fn double_direction<const C: usize>(
        &mut self,
        of_lanes: [bool; MOST_LANES],
    ) -> ([bool; MOST_LANES], [f64; MOST_LANES]) {
        let Self { simd, network, .. } = *self;
        let pivots = simd.vectorize(self.arrays.factor::<C>(network));
        simd.vectorize(SolveDirection::<S, C> { network, arrays: self.arrays });
        let entries = self.arrays.direction.len();
        let (found, direction) = (numbers_of_mut::<S>(&mut self.arrays.modes[..entries]), &*self.arrays.direction);
        let lanes = found.chunks_exact_mut(S::LANES).zip(numbers_of::<S>(direction).chunks_exact(S::LANES));
        for (found, direction) in lanes {
            for lane in (0..S::LANES).filter(|&lane| of_lanes[lane]) {
                found[lane] = direction[lane];
            }
        }
        let (smallest, largest) = (pivots.smallest.numbers(), pivots.largest.numbers());
        let positive = pivots.positive.numbers().map(|positive| positive != 0.0);
        (positive, std::array::from_fn(|lane| smallest[lane] / largest[lane]))
    }

    /// Moves the lanes along their directions, by step lengths that their line searches accept.
    fn search_line(&mut self, courses: &mut [Course], continues: bool) {
        while courses.iter().any(|course| course.runs() && course.search.rejected.is_some()) {
            let mut steps = [0.0; MOST_LANES];
            for (course, step) in courses.iter_mut().zip(&mut steps) {
                *step = course.take_step();
            }
            self.simd.vectorize(Move { interior: self.network.interior, arrays: self.arrays, steps: &steps });
            self.clock.end(Phase::Step);
            let found = self.evaluate();
            for (course, found) in courses.iter_mut().zip(&found) {
                course.judge(found, self.params, continues);
            }
        }
    }

    /// The distance of a lane from positions.
    fn distance(&self, lane: usize, reached: &[[f64; 3]]) -> f64 {
        let positions = numbers_of::<S>(self.arrays.positions);
        let of = |entry: usize| positions[S::LANES * entry + lane];
        let squares = reached.as_flattened().iter().enumerate().map(|(entry, reached)| (of(entry) - reached).powi(2));
        squares.sum::<f64>().sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PARAMS: BatchParams = BatchParams {
        tolerance: 1e-10,
        floor: 0.0,
        max_iterations: 30,
        max_backtracks: 10,
        sufficient_decrease: 1e-4,
        memory: 6,
        excessive_force: 1e12,
        wants_tangent: true,
    };

    fn found(residual: f64) -> Found {
        Found { residual, scale: 1.0, largest: 0.0 }
    }

    /// A factor serves the next step if the last one left a tenth of the residual. A step that increases the residual
    /// is taken back, and the next one needs a new factor.
    #[test]
    fn a_chord_that_does_not_pay_is_taken_back() {
        for max_backtracks in [0, 10] {
            let params = BatchParams { max_backtracks, ..PARAMS };
            let mut course = Course::new(&found(1.0), true);
            assert!(!course.takes_chord());
            course.begin(&params, false, true, 1.0, false);
            course.reuse.has_factor = true;
            assert_eq!(course.take_step(), -1.0);
            course.judge(&found(0.05), &params, false);
            assert!(course.takes_chord());
            course.begin_chord(&params);
            assert_eq!(course.take_step(), -1.0);
            course.judge(&found(0.06), &params, false);
            assert_eq!(course.take_step(), 1.0);
            course.judge(&found(0.05), &params, false);
            assert!(course.runs() && course.search.rejected.is_none() && !course.takes_chord());
            assert_eq!((course.residual, course.iterations, course.backtracks), (0.05, 1, 0));
        }
    }
}
