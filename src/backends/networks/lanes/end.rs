//! The end of a group: stress, energy and tangent, and what the caller reads of each lane.

use super::arrays::Arrays;
use super::blocks::Node;
use super::check::CheckModes;
use super::course::Course;
use super::forces::EvaluateEnds;
use super::network::Network;
use super::response::{Energy, Stress};
use super::simd::{Double, Kernel, Lanes, MOST_LANES, load, numbers_of, numbers_of_mut, store};
use super::tangent::{SolveModes, strain};
use crate::backends::networks::result::{
    BACKTRACKS, ENERGY, FORM, IMBALANCE, ITERATIONS, PIVOT_RATIO, RESIDUAL, SCALE, STATUS, STRESS,
};
use crate::backends::networks::{MODES, NetworkResult, RESULT_LEN, Status};

/// Interior force sensitivities, relative to all of them, at which the sensitivities are accurate.
const ACCURATE: f64 = 1e-8;
/// The largest accepted error of the condensed stiffness, [`Errors::of_stiffness`](super::check::Errors).
const STIFFNESS_ERROR: f64 = 1e-10;

/// The outcome of a network, with its new state if it is in equilibrium.
#[derive(Debug)]
pub struct LaneEnd<'a> {
    numbers: &'a [f64],
    /// The positions of the interior nodes; empty without an equilibrium.
    pub positions: &'a [[f64; 3]],
    /// The sensitivities, as in [`LaneStart::sensitivities`](super::LaneStart::sensitivities); empty without an
    /// equilibrium or without tangent.
    pub sensitivities: &'a [[f32; 3 * MODES]],
}

impl LaneEnd<'_> {
    /// Stress, energy, tangent and counters.
    pub fn result(&self) -> NetworkResult<'_> {
        NetworkResult::new(self.numbers)
    }
}

/// Returns true if the network has an equilibrium.
fn has_state(numbers: &[f64; RESULT_LEN]) -> bool {
    numbers[STATUS] == Status::Converged as usize as f64
}

/// Calls `read` with the outcomes of these lanes.
pub(super) fn read_ends<'a, S: Double>(
    simd: S,
    network: &Network,
    arrays: &mut Arrays<'_, S>,
    wants_tangent: bool,
    ended: impl Iterator<Item = (usize, &'a [f64; RESULT_LEN])>,
    mut read: impl FnMut(usize, LaneEnd<'_>),
) {
    let interior = network.interior;
    let Arrays { positions, modes, direction, loads, .. } = arrays;
    // These arrays are free now. They take the states of the lanes, one after the other.
    let (states, sensitivities) = (numbers_of_mut::<S>(direction), numbers_of_mut::<S>(loads));
    let states: &mut [[f64; 3]] = bytemuck::cast_slice_mut(states);
    let (sensitivities, _) = bytemuck::cast_slice_mut(sensitivities).as_chunks_mut::<{ 3 * MODES }>();
    let ended: Vec<_> = ended.collect();
    if ended.iter().any(|(_, numbers)| has_state(numbers)) {
        simd.vectorize(ReadStates { network, positions, modes, states, sensitivities, wants_tangent });
    }
    for (lane, numbers) in ended {
        let of_lane = lane * interior..(lane + 1) * interior;
        let none = 0..0;
        let of_state = if has_state(numbers) { of_lane } else { none.clone() };
        let of_tangent = if wants_tangent { of_state.clone() } else { none };
        read(lane, LaneEnd { numbers, positions: &states[of_state], sensitivities: &sensitivities[of_tangent] });
    }
}

pub(super) fn write_course(course: &Course) -> [f64; RESULT_LEN] {
    let mut numbers = [0.0; RESULT_LEN];
    numbers[STATUS] = course.status.unwrap_or(Status::NotFinite) as usize as f64;
    numbers[ITERATIONS] = f64::from(course.iterations);
    numbers[BACKTRACKS] = f64::from(course.backtracks);
    numbers[RESIDUAL] = course.residual;
    numbers[SCALE] = course.scale;
    numbers[PIVOT_RATIO] = course.pivot_ratio;
    numbers
}

/// Computes stress, energy and tangent of the lanes that have converged.
pub(super) fn condense<S: Double, const C: usize>(
    simd: S,
    network: &Network,
    arrays: &mut Arrays<'_, S>,
    wants_tangent: bool,
    results: &mut [[f64; RESULT_LEN]],
) {
    let mut write = |at: usize, lanes: Lanes<S>| {
        results.iter_mut().zip(lanes.numbers()).for_each(|(numbers, value)| numbers[at] = value);
    };
    let mut of_stiffness = [0.0; MOST_LANES];
    simd.vectorize(EvaluateEnds { network, arrays });
    if wants_tangent {
        let condensed = simd.vectorize(SolveModes::<S, C> { network, arrays });
        condensed.form.as_flattened().iter().enumerate().for_each(|(k, &product)| write(FORM + k, product));
        let errors = simd.vectorize(CheckModes { network, arrays, condensed: &condensed });
        write(IMBALANCE, errors.imbalance);
        of_stiffness = errors.of_stiffness.numbers();
    }
    let stress = simd.vectorize(Stress { network, arrays });
    stress.into_iter().enumerate().for_each(|(k, stress)| write(STRESS + k, stress));
    let mut counts = [0.0; MOST_LANES];
    for (counts, numbers) in counts.iter_mut().zip(&*results) {
        *counts = f64::from(u8::from(has_state(numbers)));
    }
    let counts = Lanes::of_numbers(simd, &counts);
    let energy = simd.vectorize(Energy { network, arrays, counts });
    results.iter_mut().zip(energy.numbers()).for_each(|(numbers, energy)| numbers[ENERGY] = energy);
    for (numbers, of_stiffness) in results.iter_mut().zip(of_stiffness).filter(|(numbers, _)| has_state(numbers)) {
        let is_accurate = numbers[IMBALANCE] <= ACCURATE && of_stiffness <= STIFFNESS_ERROR;
        if !is_accurate {
            numbers[STATUS] = Status::InaccurateTangent as usize as f64;
        }
    }
}

/// Reads the positions of interior nodes, lane after lane, and their sensitivities, minus those of the affine motion.
struct ReadStates<'a, S: Double> {
    network: &'a Network,
    positions: &'a [S::Stored],
    modes: &'a [S::Stored],
    states: &'a mut [[f64; 3]],
    sensitivities: &'a mut [[f32; 3 * MODES]],
    wants_tangent: bool,
}

impl<S: Double> Kernel<S> for ReadStates<'_, S> {
    type Output = ();

    #[inline(always)]
    fn run(self, simd: S) {
        let Self { network, positions, modes, states, sensitivities, wants_tangent } = self;
        let interior = network.interior;
        let mut of_node = [<S::Stored as bytemuck::Zeroable>::zeroed(); 3 * MODES];
        for (node, &place) in network.places.iter().enumerate() {
            let place = place as usize;
            let numbers = numbers_of::<S>(positions);
            for lane in 0..S::LANES {
                let state = &mut states[lane * interior + node];
                for k in 0..3 {
                    state[k] = numbers[(3 * place + k) * S::LANES + lane];
                }
            }
            if !wants_tangent {
                continue;
            }
            let x: Node<S> = load(simd, positions, place);
            for mode in 0..MODES {
                let (affine, v): (_, Node<S>) = (strain(mode, &x), load(simd, modes, MODES * place + mode));
                store(&[v[0] - affine[0], v[1] - affine[1], v[2] - affine[2]], &mut of_node, mode);
            }
            let numbers = numbers_of::<S>(&of_node);
            for lane in 0..S::LANES {
                let of_lane = &mut sensitivities[lane * interior + node];
                for k in 0..3 * MODES {
                    of_lane[k] = numbers[k * S::LANES + lane] as f32;
                }
            }
        }
    }
}
