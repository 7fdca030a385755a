//! Networks whose solution pauses, to go on in another group beside others that take longer as well.
//!
//! While a lane in equilibrium waits for the others, it repeats their iterations in vain. Once most lanes of a group are in
//! equilibrium, the others can pause: the group ends, and each of them goes on in another group, from where it was. Its
//! iterates, and their bits, are the same.

use super::arrays::Arrays;
use super::course::Course;
use super::network::Network;
use super::simd::{Double, numbers_of, numbers_of_mut};
use crate::backends::networks::Status;

/// The share of lanes in equilibrium, in eighths, from which it pays that the others pause: no lane then repeats an
/// iteration, but those that pause have no tangent to compute and, if factors serve further steps, leave theirs behind.
/// `docs/kernel.md` has the measurements.
const LEAST_EIGHTHS: usize = 5;

/// A network between two groups.
#[derive(Clone, Debug)]
pub struct Paused {
    pub(super) course: Course,
    /// The positions of the interior nodes, in the order of elimination, and the direction of the step that led there, if
    /// this is yet to be judged.
    positions: Vec<[f64; 3]>,
    direction: Vec<[f64; 3]>,
}

impl Paused {
    /// Reads a lane. The first numbers of the sensitivities still hold the directions.
    pub(super) fn read<S: Double>(course: Course, network: &Network, arrays: &Arrays<'_, S>, lane: usize) -> Self {
        let read = |numbers: &[f64]| {
            let of_node = |node: usize| std::array::from_fn(|k| numbers[(3 * node + k) * S::LANES + lane]);
            (0..network.interior).map(of_node).collect()
        };
        let (positions, modes) = (numbers_of::<S>(arrays.positions), numbers_of::<S>(arrays.modes));
        Self { course, positions: read(positions), direction: read(modes) }
    }

    /// Writes the network into a lane.
    pub(super) fn write<S: Double>(&self, arrays: &mut Arrays<'_, S>, lane: usize) {
        let (positions, modes) = (numbers_of_mut::<S>(arrays.positions), numbers_of_mut::<S>(arrays.modes));
        for (of_lanes, values) in [(positions, &self.positions), (modes, &self.direction)] {
            let of_lane = of_lanes.chunks_exact_mut(S::LANES).map(|entry| &mut entry[lane]);
            of_lane.zip(values.as_flattened()).for_each(|(to, &value)| *to = value);
        }
    }

    /// The number of interior nodes.
    pub(super) fn interior(&self) -> usize {
        self.positions.len()
    }

    /// Newton iterations so far.
    pub fn iterations(&self) -> usize {
        self.course.iterations as usize
    }
}

/// Returns whether it pays that the lanes of a group that still search for their equilibrium pause.
pub(super) fn pays(courses: &[Course], searches: impl Fn(&Course) -> bool) -> bool {
    let searching = courses.iter().filter(|course| searches(course)).count();
    let is_done = |course: &&Course| match course.status {
        Some(status) => status == Status::Converged,
        None => !searches(course),
    };
    let done = courses.iter().filter(is_done).count();
    searching > 0 && 8 * done >= LEAST_EIGHTHS * (done + searching)
}
