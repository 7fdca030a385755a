//! The end of a group: stress, energy and tangent, and what the caller reads of each lane.

use super::arrays::Arrays;
use super::blocks::Node;
use super::course::Course;
use super::forces::EvaluateEnds;
use super::network::Network;
use super::simd::{Double, Kernel, Lanes, MOST_LANES, load, numbers_of, store};
use super::tangent::{ComputeProducts, Energy, SolveModes, Stress, strain};
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
    /// The positions of the interior nodes; empty without an equilibrium.
    pub positions: Vec<[f64; 3]>,
    /// The sensitivities, as in [`LaneStart::sensitivities`](super::LaneStart::sensitivities); empty without an
    /// equilibrium or without tangent.
    pub sensitivities: Vec<[f32; 3 * MODES]>,
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
    let mut sensitivities = vec![Vec::new(); S::LANES];
    let ended: Vec<_> = ended.collect();
    let has_state = |numbers: &[f64; RESULT_LEN]| numbers[STATUS] == Status::Converged as usize as f64;
    let with_state = || ended.iter().filter(|(_, numbers)| has_state(numbers)).map(|(lane, _)| *lane);
    if wants_tangent && with_state().next().is_some() {
        with_state().for_each(|lane| sensitivities[lane] = vec![[0.0; 3 * MODES]; network.interior]);
        simd.vectorize(ReadSensitivities { network, arrays, of_lanes: &mut sensitivities });
    }
    for (lane, numbers) in ended {
        let positions = if has_state(numbers) { read_positions::<S>(network, arrays, lane) } else { Vec::new() };
        read(lane, LaneEnd { numbers, positions, sensitivities: std::mem::take(&mut sensitivities[lane]) });
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
    simd.vectorize(EvaluateEnds { network, arrays });
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

fn read_positions<S: Double>(network: &Network, arrays: &Arrays<'_, S>, lane: usize) -> Vec<[f64; 3]> {
    let numbers = numbers_of::<S>(arrays.positions);
    let of_place = |place: u32| std::array::from_fn(|k| numbers[(3 * place as usize + k) * S::LANES + lane]);
    network.places.iter().map(|&place| of_place(place)).collect()
}

/// Reads the sensitivities of the lanes for which there is room, minus those of the affine motion.
struct ReadSensitivities<'a, 'b, S: Double> {
    network: &'a Network,
    arrays: &'a Arrays<'b, S>,
    of_lanes: &'a mut [Vec<[f32; 3 * MODES]>],
}

impl<S: Double> Kernel<S> for ReadSensitivities<'_, '_, S> {
    type Output = ();

    #[inline(always)]
    fn run(self, simd: S) {
        let Self { network, arrays: Arrays { positions, modes, .. }, of_lanes } = self;
        let mut of_node = [<S::Stored as bytemuck::Zeroable>::zeroed(); 3 * MODES];
        for (node, &place) in network.places.iter().enumerate() {
            let place = place as usize;
            let x: Node<S> = load(simd, positions, place);
            for mode in 0..MODES {
                let (affine, v): (_, Node<S>) = (strain(mode, &x), load(simd, modes, MODES * place + mode));
                store(&[v[0] - affine[0], v[1] - affine[1], v[2] - affine[2]], &mut of_node, mode);
            }
            let numbers = numbers_of::<S>(&of_node);
            for (lane, of_lane) in of_lanes.iter_mut().enumerate() {
                let Some(of_lane) = of_lane.get_mut(node) else { continue };
                for (k, number) in of_lane.iter_mut().enumerate() {
                    *number = numbers[k * S::LANES + lane] as f32;
                }
            }
        }
    }
}
