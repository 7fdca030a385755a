//! Newton's method for a group of networks, one in each lane.
//!
//! Lanes that have finished, or whose step length is accepted, stay where they are while others continue: they repeat
//! the same operations with the same results. What happens to a lane therefore does not depend on the others, and a lane
//! can pause and go on in another group.

use super::arrays::Arrays;
use super::course::{Course, Found, REACHED};
use super::forces::Evaluate;
use super::network::Network;
use super::pause;
use super::phases::{Clock, Phase};
use super::simd::{Double, Kernel, Lanes, MOST_LANES, load, numbers_of, numbers_of_mut, store};
use super::single;
use super::triangular::{SolveBoth, SolveDirection};
use crate::backends::networks::{BatchParams, Status};

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

/// A group of networks, one in each lane, at their starts or where they paused.
pub(super) struct Newton<'a, 'b, 'c, S: Double> {
    pub simd: S,
    pub network: &'a Network,
    pub arrays: &'a mut Arrays<'b, S>,
    pub params: &'a BatchParams,
    /// Whether directions come from factors of single precision.
    pub has_single: bool,
    /// The most further steps with a factor.
    pub chord_steps: u32,
    /// Whether lanes may pause.
    pub may_pause: bool,
    pub clock: &'a mut Clock<'c>,
}

impl<S: Double> Newton<'_, '_, '_, S> {
    fn evaluate(&mut self) -> [Found; MOST_LANES] {
        let found = Found::of(&self.simd.vectorize(Evaluate { network: self.network, arrays: self.arrays }));
        self.clock.end(Phase::Forces);
        found
    }

    /// Solves with tiles of `C` columns, from the starts in the arrays; `paused` has the courses of the lanes that go on.
    /// The courses of lanes that pause have no status.
    pub fn run<const C: usize>(mut self, paused: &[Option<Course>]) -> Vec<Course> {
        let mut courses = self.begin(paused);
        while self.check(&mut courses, false) {
            // Lanes in equilibrium wait for the others: a factor overwrites those that serve further steps, and in mixed
            // precision, only the last one must have double precision.
            let searches = |course: &Course| course.runs() && !course.has_converged(self.params, false);
            if courses.iter().any(|course| searches(course) && course.takes_chord()) {
                self.chord_direction::<C>(&mut courses);
                self.search_line(&mut courses, false);
                continue;
            }
            let pauses = self.may_pause && pause::pays(&courses, searches);
            if !pauses && self.has_single && courses.iter().any(searches) {
                self.single_direction::<C>(&mut courses);
                self.search_line(&mut courses, false);
                continue;
            }
            // A lane that pauses loses its factor, which may serve a further step.
            let only_converged = self.has_single || pauses && self.chord_steps > 0;
            self.direction::<C>(&mut courses, false, only_converged);
            if pauses {
                if !only_converged {
                    self.take_steps(&mut courses);
                }
                break;
            }
            self.search_line(&mut courses, false);
        }
        courses
    }

    /// Tests with tiles of `C` columns, from the starts in the arrays, whether Newton's method leads to these positions by
    /// lane, in the order of elimination.
    pub fn approach<const C: usize>(mut self, reached: &[Vec<[f64; 3]>]) -> Vec<Course> {
        let mut courses = self.begin(&vec![None; reached.len()]);
        for (lane, course) in courses.iter_mut().enumerate().filter(|(_, course)| course.runs()) {
            course.apart = self.distance(lane, &reached[lane]);
            if course.apart <= REACHED.0 {
                course.status = Some(Status::Continues);
            }
        }
        while self.check(&mut courses, true) {
            self.direction::<C>(&mut courses, true, false);
            self.search_line(&mut courses, true);
            for (lane, course) in courses.iter_mut().enumerate().filter(|(_, course)| course.runs()) {
                let distance = self.distance(lane, &reached[lane]);
                course.approach(distance);
            }
        }
        courses
    }

    /// Evaluates the starts. Lanes that go on judge the step that they took before they paused, if they took one.
    fn begin(&mut self, paused: &[Option<Course>]) -> Vec<Course> {
        let found = self.evaluate();
        let begun = |(found, paused): (&Found, &Option<Course>)| match *paused {
            Some(mut course) => {
                course.judge(found, self.params, false);
                course
            }
            None => Course::new(found, self.chord_steps),
        };
        let mut courses: Vec<Course> = found.iter().zip(paused).map(begun).collect();
        self.search_line(&mut courses, false);
        courses
    }

    /// Ends the lanes that need no factorization to end. Returns whether others run.
    fn check(&self, courses: &mut [Course], continues: bool) -> bool {
        courses.iter_mut().filter(|course| course.runs()).for_each(|course| course.check(self.params, continues));
        courses.iter().any(Course::runs)
    }

    /// Factors the stiffness, ends the lanes in equilibrium, and computes the directions of the others, unless only those
    /// in equilibrium take part. At an equilibrium, the factor shows that it is stable, and serves the tangent.
    fn direction<const C: usize>(&mut self, courses: &mut [Course], continues: bool, only_converged: bool) {
        let Self { simd, network, params, .. } = *self;
        let pivots = simd.vectorize(self.arrays.factor::<C>(network));
        self.clock.end(Phase::Factor);
        let (smallest, largest) = (pivots.smallest.numbers(), pivots.largest.numbers());
        let positive = pivots.positive.numbers();
        let takes_part =
            |course: &Course| course.runs() && (!only_converged || course.has_converged(params, continues));
        for (lane, course) in courses.iter_mut().enumerate().filter(|(_, course)| takes_part(course)) {
            let ratio = smallest[lane] / largest[lane];
            course.begin(params, continues, positive[lane] != 0.0, ratio, network.interior == 0);
        }
        if courses.iter().any(|course| course.runs() && takes_part(course)) {
            simd.vectorize(SolveDirection::<S, C> { network, arrays: self.arrays });
            // The next residual overwrites the direction.
            let entries = self.arrays.direction.len();
            self.arrays.modes[..entries].copy_from_slice(self.arrays.direction);
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
        let Self { simd, network, .. } = *self;
        if self.has_single {
            single::chord::<S, C>(simd, network, self.arrays, &residuals);
        } else {
            let Arrays { diagonal, lower, direction, modes, .. } = &mut *self.arrays;
            simd.vectorize(SolveBoth::<S, C> { schedule: &network.schedule, diagonal, lower, right: direction });
            modes[..direction.len()].copy_from_slice(direction);
        }
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
            self.take_steps(courses);
            let found = self.evaluate();
            for (course, found) in courses.iter_mut().zip(&found) {
                course.judge(found, self.params, continues);
            }
        }
    }

    /// Moves the lanes that search by their step lengths.
    fn take_steps(&mut self, courses: &mut [Course]) {
        let mut steps = [0.0; MOST_LANES];
        for (course, step) in courses.iter_mut().zip(&mut steps) {
            *step = course.take_step();
        }
        self.simd.vectorize(Move { interior: self.network.interior, arrays: self.arrays, steps: &steps });
        self.clock.end(Phase::Step);
    }

    /// The distance of a lane from positions.
    fn distance(&self, lane: usize, reached: &[[f64; 3]]) -> f64 {
        let positions = numbers_of::<S>(self.arrays.positions);
        let of = |entry: usize| positions[S::LANES * entry + lane];
        let squares = reached.as_flattened().iter().enumerate().map(|(entry, reached)| (of(entry) - reached).powi(2));
        squares.sum::<f64>().sqrt()
    }
}
