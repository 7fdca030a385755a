//! The solution of one lane: its iterations, its line search, and its decision to stop.

use super::forces::Forces;
use super::simd::{Double, MOST_LANES};
use crate::backends::networks::{BatchParams, Status};
use crate::las::NewtonParams;

/// The pivot ratio below which a matrix counts as singular up to rounding.
const SINGULAR: f64 = 1e-12;

/// The most residual norms that the line search compares with.
const MEMORY: usize = 8;

/// Distances from the given equilibrium: the norm at which it is reached, and the factor by which a step must approach
/// it.
pub(super) const REACHED: (f64, f64) = (1e-10, 0.1);

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
    pub(super) apart: f64,
    pub(super) search: Search,
    pub(super) reuse: Reuse,
}

/// What a lane knows of its last factor.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reuse {
    /// The most further steps with a factor, and those taken with the last one.
    most: u32,
    taken: u32,
    /// Whether it serves further steps.
    pub(super) has_factor: bool,
    /// Whether the next step takes it, if there is one: the last step reduced the residual to [`NewtonParams::CHORD_SHARE`], and there
    /// are steps left. Also true before the first step, whose direction need not be exact in mixed precision if further
    /// ones may follow.
    pub(super) pays: bool,
    /// Whether the step that is searched takes the factor of an earlier iterate.
    is_chord: bool,
}

/// The line search of one lane.
#[derive(Clone, Copy, Debug)]
pub(super) struct Search {
    /// The step length of the positions, and the next one to try.
    at: f64,
    step: f64,
    /// The residual at the start, its limit at convergence, and the largest of the compared ones.
    residual: f64,
    limit: f64,
    largest: f64,
    /// Step lengths rejected so far; `None` if the lane does not search.
    pub(super) rejected: Option<u32>,
}

impl Search {
    const NONE: Self = Self { at: 0.0, step: 0.0, residual: 0.0, limit: 0.0, largest: 0.0, rejected: None };
}

/// The forces of one lane.
#[derive(Clone, Copy)]
pub(super) struct Found {
    residual: f64,
    scale: f64,
    largest: f64,
}

impl Found {
    fn is_finite(&self) -> bool {
        self.residual.is_finite() && self.scale.is_finite()
    }

    /// The forces of each lane.
    pub(super) fn of<S: Double>(forces: &Forces<S>) -> [Self; MOST_LANES] {
        let (residual, scale, largest) = (forces.residual.numbers(), forces.scale.numbers(), forces.largest.numbers());
        std::array::from_fn(|k| Self { residual: residual[k], scale: scale[k], largest: largest[k] })
    }
}

impl Course {
    pub(super) fn new(found: &Found, chord_steps: u32) -> Self {
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
            reuse: Reuse { most: chord_steps, taken: 0, has_factor: false, pays: chord_steps > 0, is_chord: false },
        }
    }

    pub(super) fn runs(&self) -> bool {
        self.status.is_none()
    }

    /// The residual norm at convergence.
    fn limit(&self, params: &BatchParams) -> f64 {
        (params.tolerance * self.scale).max(params.floor)
    }

    pub(super) fn has_converged(&self, params: &BatchParams, continues: bool) -> bool {
        !continues && self.residual <= self.limit(params)
    }

    /// Decides, before the factorization, whether the lane ends.
    pub(super) fn check(&mut self, params: &BatchParams, continues: bool) {
        let converged = self.has_converged(params, continues);
        // The steps with the last factor belong to the last iteration.
        if !converged && !self.takes_chord() && self.iterations == params.max_iterations {
            self.status = Some(if continues { Status::Inconclusive } else { Status::TooManyIterations });
        } else if converged {
            let is_bearable = self.largest < params.excessive_force;
            self.status = (!is_bearable).then_some(Status::ExcessiveForce);
        }
    }

    /// Decides, after the factorization, whether the lane ends, and otherwise begins the line search.
    pub(super) fn begin(
        &mut self,
        params: &BatchParams,
        continues: bool,
        positive: bool,
        pivot_ratio: f64,
        is_fixed: bool,
    ) {
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
        self.reuse = Reuse { taken: 0, has_factor: true, is_chord: false, ..self.reuse };
    }

    fn search_from(&mut self, params: &BatchParams, largest: f64) {
        let limit = self.limit(params);
        self.search = Search { at: 0.0, step: 1.0, residual: self.residual, limit, largest, rejected: Some(0) };
    }

    /// Returns true if the next step takes the factor of an earlier iterate.
    pub(super) fn takes_chord(&self) -> bool {
        self.reuse.has_factor && self.reuse.pays
    }

    /// Begins a step with the factor of an earlier iterate.
    pub(super) fn begin_chord(&mut self, params: &BatchParams) {
        self.search_from(params, self.residual);
        self.reuse = Reuse { taken: self.reuse.taken + 1, is_chord: true, ..self.reuse };
    }

    /// Returns how far the positions move along the direction, and takes the step as made.
    pub(super) fn take_step(&mut self) -> f64 {
        let search = &mut self.search;
        if search.rejected.is_none() || self.status.is_some() {
            return 0.0;
        }
        let moved = search.at - search.step;
        search.at = search.step;
        moved
    }

    /// Accepts the step of these forces, or shortens it.
    pub(super) fn judge(&mut self, found: &Found, params: &BatchParams, continues: bool) {
        let Some(rejected) = self.search.rejected.filter(|_| self.runs()) else { return };
        let Search { step, residual, limit, largest, .. } = self.search;
        let least = if continues { 0.0 } else { limit };
        let allowed = ((1.0 - params.sufficient_decrease * step) * largest).max(least);
        // A chord step that does not reduce the residual is taken back.
        let Reuse { is_chord, most, taken, .. } = self.reuse;
        let is_back = is_chord && step == 0.0;
        let takes_any = is_back || params.max_backtracks == 0 && !is_chord;
        if found.is_finite() && (found.residual <= allowed || takes_any) {
            (self.residual, self.scale, self.largest) = (found.residual, found.scale, found.largest);
            self.search.rejected = None;
            self.reuse.pays = taken < most && step == 1.0 && found.residual <= NewtonParams::CHORD_SHARE * residual;
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
    pub(super) fn approach(&mut self, distance: f64) {
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

#[cfg(test)]
mod tests {
    use super::*;

    const PARAMS: BatchParams = BatchParams {
        tolerance: 1e-10,
        floor: 0.0,
        max_iterations: 30,
        chord_steps: 0,
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
            let mut course = Course::new(&found(1.0), 2);
            assert!(!course.takes_chord());
            course.begin(&params, false, true, 1.0, false);
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
