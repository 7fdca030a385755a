//! A network for the tests of lanes.

use super::network::Network;
use super::portable::Portable;
use super::simd::{Simd, numbers_of_mut};
use crate::backends::networks::{LawData, LawFormula, NetworkData};

const SIDE: usize = 5;

/// Returns a grid of fibers with these moduli along edges and diagonals, 5 % longer than at rest, and the positions
/// of its interior nodes.
pub(super) fn grid(youngs_modulus: f64) -> (NetworkData, Vec<[f64; 3]>) {
    let all: Vec<[usize; 3]> = (0..SIDE.pow(3)).map(|k| [k % SIDE, k / SIDE % SIDE, k / SIDE.pow(2)]).collect();
    let is_inner = |place: &[usize; 3]| place.iter().all(|&k| k > 0 && k + 1 < SIDE);
    let (inner, outer): (Vec<[usize; 3]>, Vec<_>) = all.iter().partition(|place| is_inner(place));
    let nodes = [inner.clone(), outer.clone()].concat();
    let (mut ends, mut lengths) = (Vec::new(), Vec::new());
    for (a, from) in nodes.iter().enumerate() {
        for (b, to) in nodes.iter().enumerate().skip(a + 1) {
            let square: usize = (0..3).map(|k| from[k].abs_diff(to[k]).pow(2)).sum();
            if a < inner.len() && square <= 2 {
                ends.push([a as u32, b as u32]);
                lengths.push((square as f64).sqrt() / 1.05);
            }
        }
    }
    let position = |place: &[usize; 3]| place.map(|k| k as f64);
    let fibers = ends.len();
    let network = NetworkData {
        interior: inner.len(),
        boundary: outer.iter().map(position).collect(),
        ends,
        lengths,
        areas: vec![1e-15; fibers],
        law_of: vec![0; fibers],
        laws: vec![LawData { formula: LawFormula::Linear { youngs_modulus }, buckling: None }],
    };
    (network, inner.iter().map(position).collect())
}

/// Writes the positions, which each lane disturbs in its own way; the lane `crushed`, if there is one, has all nodes near each other.
pub(super) fn write(
    network: &Network,
    interior: &[[f64; 3]],
    crushed: Option<usize>,
    positions: &mut [<Portable as Simd>::Stored],
) {
    let in_order = network.order.iter().map(|&node| interior[node as usize]);
    let all: Vec<[f64; 3]> = in_order.chain(network.boundary.iter().copied()).collect();
    let numbers = numbers_of_mut::<Portable>(positions);
    for (entry, x) in all.as_flattened().iter().enumerate() {
        for lane in 0..Portable::LANES {
            let disturbed = x + 0.02 * ((entry * (lane + 3)) as f64).sin();
            numbers[Portable::LANES * entry + lane] = if Some(lane) == crushed { 0.2 * x } else { disturbed };
        }
    }
}
