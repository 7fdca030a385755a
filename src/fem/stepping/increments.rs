//! The lengths of the increments into which a load step is divided.

use super::StepParams;

/// How the stepper chooses the length of an increment.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum IncrementControl {
    /// A whole step, halved after a failure up to [`StepParams::max_cuts`] times, and doubled again after successes.
    #[default]
    Halving,
    /// The length follows the number of Newton iterations of the last increment.
    Adaptive(AdaptiveIncrements),
}

/// Increments that aim at a number of Newton iterations. After an increment of length `h` that took `n` iterations, the
/// next one has the length `h sqrt(target / n)`, but at most `2 h` and at least `h / 2`, and the rest of the step is
/// divided into equal increments that are not longer than this. After a failure the increment is halved. Steps still end
/// at `k / count`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AdaptiveIncrements {
    /// The number of Newton iterations to the first equilibrium of an increment at which the length stays as it is; at
    /// least 1. Default 8.
    pub target_iterations: usize,
    /// The longest increment and the first one, in steps, above 0 and at most 1. Default 1.
    pub largest: f64,
    /// The increment below which a failed one is not halved, in steps. Default 1/64.
    pub smallest: f64,
}

impl Default for AdaptiveIncrements {
    fn default() -> Self {
        Self { target_iterations: 8, largest: 1.0, smallest: 1.0 / 64.0 }
    }
}

/// A part of a step without break points of load curves inside.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Segment {
    /// Start, in steps of the run.
    pub start: f64,
    /// End, in steps of the run.
    pub end: f64,
    /// Pseudo-time at the end: exactly a break point or the end of a step.
    pub end_t: f64,
}

/// Divides step `step` of `count` at the break points (pseudo-times) that lie inside it.
pub(super) fn segments(step: usize, count: usize, break_points: &[f64]) -> Vec<Segment> {
    /// A break point so close to the end of a segment, in steps, differs from it by rounding.
    const SAME: f64 = 1e-9;
    let (whole, end) = (count as f64, step as f64);
    let mut start = end - 1.0;
    let mut segments = Vec::new();
    for &t in break_points {
        let position = t * whole;
        if position > start + SAME && position < end - SAME {
            segments.push(Segment { start, end: position, end_t: t });
            start = position;
        }
    }
    segments.push(Segment { start, end, end_t: end / whole });
    segments
}

impl Segment {
    /// Returns the pseudo-time at a position between 0 and 1 within the segment of a run of `count` steps.
    pub fn time(&self, position: f64, count: usize) -> f64 {
        if position >= 1.0 { self.end_t } else { (self.start + position * (self.end - self.start)) / count as f64 }
    }
}

/// The length of the next increment.
#[derive(Clone, Copy, Debug)]
pub(super) struct Increments {
    control: IncrementControl,
    max_cuts: u32,
    /// Number of halvings at which the next attempt starts. With adaptive increments, the number of failures since the
    /// last success.
    pub halvings: u32,
    /// Upper limit of the next adaptive increment, in steps.
    pub length: f64,
}

impl Increments {
    pub fn new(params: &StepParams) -> Self {
        let length = match params.increments {
            IncrementControl::Halving => 1.0,
            IncrementControl::Adaptive(adaptive) => adaptive.largest,
        };
        Self { control: params.increments, max_cuts: params.max_cuts.min(StepParams::MAX_CUTS), halvings: 0, length }
    }

    /// Continues with the state of a saved run, within the limits of this one.
    pub fn restore(&mut self, halvings: u32, length: f64) {
        match self.control {
            IncrementControl::Halving => self.halvings = halvings.min(self.max_cuts),
            IncrementControl::Adaptive(AdaptiveIncrements { largest, smallest, .. }) => {
                (self.halvings, self.length) = (0, length.min(largest).max(smallest));
            }
        }
    }

    /// Returns the position at the end of the increment that starts at `position`, both between 0 and 1 within the
    /// segment. With halvings, all positions are multiples of `2^-max_cuts` and exact.
    pub fn end(&self, segment: &Segment, position: f64) -> f64 {
        /// The relative excess over a whole number of increments that is due to rounding.
        const ROUNDING: f64 = 1e-9;
        match self.control {
            IncrementControl::Halving => position + self.fraction(),
            IncrementControl::Adaptive(_) => {
                let rest = (1.0 - position) * (segment.end - segment.start);
                let parts = (rest / self.length - ROUNDING).ceil();
                if parts <= 1.0 { 1.0 } else { position + (1.0 - position) / parts }
            }
        }
    }

    fn fraction(&self) -> f64 {
        0.5_f64.powi(self.halvings as i32)
    }

    /// Chooses the next length after an increment of `taken` steps that ended at `position` and took this number of
    /// Newton iterations to its first equilibrium.
    pub fn succeeded(&mut self, position: f64, taken: f64, iterations: usize) {
        match self.control {
            IncrementControl::Halving => {
                if self.halvings > 0 && position % (2.0 * self.fraction()) == 0.0 {
                    self.halvings -= 1;
                }
            }
            IncrementControl::Adaptive(AdaptiveIncrements { target_iterations, largest, smallest }) => {
                self.halvings = 0;
                let factor = (target_iterations as f64 / iterations.max(1) as f64).sqrt().clamp(0.5, 2.0);
                // An increment that a break point or the end of the step shortened does not limit the next one.
                let next = if factor < 1.0 { factor * taken } else { (factor * taken).max(self.length) };
                self.length = next.min(largest).max(smallest);
            }
        }
    }

    /// Halves the increment after a failure over `taken` steps. Returns false if it is the shortest one already.
    pub fn halve(&mut self, taken: f64) -> bool {
        match self.control {
            IncrementControl::Halving if self.halvings == self.max_cuts => false,
            IncrementControl::Halving => {
                self.halvings += 1;
                true
            }
            IncrementControl::Adaptive(AdaptiveIncrements { smallest, .. }) => {
                self.length = 0.5 * taken;
                self.halvings += 1;
                self.length >= smallest
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn increments(control: IncrementControl) -> Increments {
        Increments::new(&StepParams { increments: control, max_cuts: 2, ..StepParams::default() })
    }

    #[test]
    fn a_step_is_divided_at_the_break_points_inside_it() {
        let ends = |step| segments(step, 4, &[0.25, 0.3, 0.4, 0.5 + 1e-14, 1.0]).into_iter().map(|part| part.end_t);
        assert_eq!(ends(1).collect::<Vec<_>>(), [0.25]);
        assert_eq!(ends(2).collect::<Vec<_>>(), [0.3, 0.4, 0.5]);
        assert_eq!(ends(3).collect::<Vec<_>>(), [0.75]);
        let parts = segments(2, 4, &[0.3]);
        assert_eq!((parts[1].time(1.0, 4), parts[0].time(1.0, 4)), (0.5, 0.3));
        assert!((parts[1].time(0.5, 4) - 0.4).abs() < 1e-15);
    }

    #[test]
    fn halvings_are_exact_and_grow_back() {
        let mut increments = increments(IncrementControl::Halving);
        let segment = segments(1, 1, &[])[0];
        assert_eq!(increments.end(&segment, 0.0), 1.0);
        assert!(increments.halve(1.0) && increments.halve(0.5) && !increments.halve(0.25));
        let mut ends = vec![0.0];
        while *ends.last().unwrap() < 1.0 {
            let end = increments.end(&segment, *ends.last().unwrap());
            increments.succeeded(end, 0.0, 5);
            ends.push(end);
        }
        assert_eq!(ends, [0.0, 0.25, 0.5, 1.0]);
    }

    #[test]
    fn adaptive_increments_follow_the_iterations() {
        let adaptive = AdaptiveIncrements { target_iterations: 4, largest: 0.5, smallest: 0.1 };
        let mut increments = increments(IncrementControl::Adaptive(adaptive));
        let segment = segments(1, 1, &[])[0];
        assert_eq!(increments.end(&segment, 0.0), 0.5);
        increments.succeeded(0.5, 0.5, 16);
        assert_eq!((increments.length, increments.end(&segment, 0.5)), (0.25, 0.75));
        increments.succeeded(0.75, 0.25, 1);
        assert_eq!((increments.length, increments.end(&segment, 0.75)), (0.5, 1.0), "doubled");
        increments.succeeded(1.0, 0.25, 4);
        assert_eq!(increments.length, 0.5, "the end of the step shortened the increment");
        assert!(increments.halve(0.5) && (increments.length - 0.25).abs() < 1e-15);
        assert!(!increments.halve(0.15), "0.075 is below the smallest");
        increments.restore(3, 7.0);
        assert_eq!((increments.halvings, increments.length), (0, 0.5));
    }
}
