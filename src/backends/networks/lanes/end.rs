//! The end of a group: stress, energy and tangent, and what the caller reads of each lane.

use super::arrays::Arrays;
use super::course::Course;
use super::network::Network;
use super::simd::{Double, Lanes, MOST_LANES, numbers_of};
use super::tangent::{ComputeProducts, Energy, SolveModes, Stress};
use crate::backends::networks::result::{
    BACKTRACKS, ENERGY, FORM, IMBALANCE, ITERATIONS, PIVOT_RATIO, RESIDUAL, SCALE, STATUS, STRESS,
};
use crate::backends::networks::{MODES, NetworkResult, RESULT_LEN, Status};

/// Interior force sensitivities, relative to all of them, at which the sensitivities are accurate.
const ACCURATE: f64 = 1e-8;

/// The outcome of a network, with its new state if it is in equilibrium.
#[derive(Debug)]
pub struct LaneEnd<'a> {
    numbers: &'a [f64],
    /// The positions of the interior nodes.
    pub positions: &'a [[f64; 3]],
    /// The sensitivities, as in [`LaneStart::sensitivities`](super::LaneStart::sensitivities); empty without tangent.
    pub sensitivities: &'a [[f32; 3 * MODES]],
}

impl LaneEnd<'_> {
    /// Stress, energy, tangent and counters.
    pub fn result(&self) -> NetworkResult<'_> {
        NetworkResult::new(self.numbers)
    }
}

/// Calls `read` with the outcomes of these lanes.
pub(super) fn read_ends<'a, S: Double>(
    simd: S,
    network: &Network,
    arrays: &Arrays<'_, S>,
    wants_tangent: bool,
    ended: impl Iterator<Item = (usize, &'a [f64; RESULT_LEN])>,
    mut read: impl FnMut(usize, LaneEnd<'_>),
) {
    let (mut positions, mut sensitivities) = (vec![[0.0; 3]; network.interior], Vec::new());
    for (lane, numbers) in ended {
        if numbers[STATUS] == Status::Converged as usize as f64 {
            read_positions::<S>(network, arrays, lane, &mut positions);
            if wants_tangent {
                sensitivities.resize(network.interior, [0.0; 3 * MODES]);
                read_sensitivities(simd, network, arrays, lane, &mut sensitivities);
            }
        }
        read(lane, LaneEnd { numbers, positions: &positions, sensitivities: &sensitivities });
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
    if wants_tangent {
        simd.vectorize(SolveModes::<S, C> { network, arrays });
        let products = simd.vectorize(ComputeProducts { network, arrays });
        products.form.as_flattened().iter().enumerate().for_each(|(k, &product)| write(FORM + k, product));
        write(IMBALANCE, products.imbalance);
    }
    let stress = simd.vectorize(Stress { network, arrays });
    stress.into_iter().enumerate().for_each(|(k, stress)| write(STRESS + k, stress));
    let mut counts = [0.0; MOST_LANES];
    for (counts, numbers) in counts.iter_mut().zip(&*results) {
        *counts = f64::from(u8::from(numbers[STATUS] == Status::Converged as usize as f64));
    }
    let counts = Lanes::of_numbers(simd, &counts);
    let energy = simd.vectorize(Energy { network, arrays, counts });
    results.iter_mut().zip(energy.numbers()).for_each(|(numbers, energy)| numbers[ENERGY] = energy);
    for numbers in results.iter_mut().filter(|numbers| numbers[STATUS] == Status::Converged as usize as f64) {
        let is_accurate = numbers[IMBALANCE] <= ACCURATE;
        if !is_accurate {
            numbers[STATUS] = Status::InaccurateTangent as usize as f64;
        }
    }
}

fn read_positions<S: Double>(network: &Network, arrays: &Arrays<'_, S>, lane: usize, positions: &mut [[f64; 3]]) {
    let numbers = numbers_of::<S>(arrays.positions);
    for (place, &node) in network.order.iter().enumerate() {
        positions[node as usize] = std::array::from_fn(|k| numbers[(3 * place + k) * S::LANES + lane]);
    }
}

/// Reads the sensitivities of a lane, minus those of the affine motion.
fn read_sensitivities<S: Double>(
    _: S,
    network: &Network,
    arrays: &Arrays<'_, S>,
    lane: usize,
    sensitivities: &mut [[f32; 3 * MODES]],
) {
    let (positions, modes) = (numbers_of::<S>(arrays.positions), numbers_of::<S>(arrays.modes));
    for (place, &node) in network.order.iter().enumerate() {
        let x: [f64; 3] = std::array::from_fn(|k| positions[(3 * place + k) * S::LANES + lane]);
        let of_node = &mut sensitivities[node as usize];
        for mode in 0..MODES {
            let affine = strain_of(mode, &x);
            for k in 0..3 {
                let sensitivity = modes[(3 * (MODES * place + mode) + k) * S::LANES + lane];
                of_node[3 * mode + k] = (sensitivity - affine[k]) as f32;
            }
        }
    }
}

/// Applies the `k`-th unit strain, as `tangent::strain` does for lanes.
fn strain_of(k: usize, x: &[f64; 3]) -> [f64; 3] {
    match k {
        0 => [x[0], 0.0, 0.0],
        1 => [0.0, x[1], 0.0],
        2 => [0.0, 0.0, x[2]],
        3 => [0.0, x[2], x[1]],
        4 => [x[2], 0.0, x[0]],
        _ => [x[1], x[0], 0.0],
    }
}
