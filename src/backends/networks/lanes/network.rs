//! The network that the lanes of a group share.

use super::laws::Law;
use crate::backends::networks::{NetworkData, Plan, Schedule, TileShape};

/// The index of a pair that does not exist.
pub(super) const NO_PAIR: u32 = u32::MAX;

/// A fiber.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fiber {
    /// Its nodes, the one that is eliminated first before the other.
    pub ends: [u32; 2],
    /// The pair of interior nodes that it connects, or [`NO_PAIR`].
    pub pair: u32,
    pub law: u32,
    pub length: f64,
    pub inverse_length: f64,
    pub area: f64,
    /// Area over length.
    pub area_over_length: f64,
    pub volume: f64,
}

/// A network with its nodes in the order of elimination.
#[derive(Debug)]
pub(super) struct Network {
    pub interior: usize,
    pub nodes: usize,
    /// Pairs of interior nodes that fibers connect, the one that is eliminated first before the other.
    pub pair_ends: Vec<[u32; 2]>,
    /// The typical stiffness of a fiber: the largest modulus times the mean of area over length.
    pub stiffness: f64,
    pub fibers: Vec<Fiber>,
    pub laws: Vec<Law>,
    /// Reference positions of the boundary nodes.
    pub boundary: Vec<[f64; 3]>,
    /// By place in the order: the interior node.
    pub order: Vec<u32>,
    pub schedule: Schedule,
}

impl Network {
    pub fn new(network: &NetworkData, tile: TileShape) -> Self {
        let plan = Plan::new(network, tile);
        let fiber = |number: usize| {
            let ([a, b], length, area) = (plan.ends[number], network.lengths[number], network.areas[number]);
            let ends = [a.min(b), a.max(b)];
            Fiber {
                ends,
                pair: plan.pair_of(ends).map_or(NO_PAIR, |pair| pair as u32),
                law: network.law_of[number],
                length,
                inverse_length: 1.0 / length,
                area,
                area_over_length: area / length,
                volume: area * length,
            }
        };
        let mut fibers: Vec<Fiber> = (0..plan.ends.len()).map(fiber).collect();
        // Consecutive fibers share a node, whose sums are then still in the cache.
        fibers.sort_by_key(|fiber| fiber.ends);
        Self {
            interior: network.interior,
            nodes: network.interior + network.boundary.len(),
            pair_ends: plan.pairs,
            stiffness: typical_stiffness(network),
            fibers,
            laws: network.laws.iter().map(Law::new).collect(),
            boundary: network.boundary.clone(),
            order: plan.order,
            schedule: plan.schedule,
        }
    }
}

/// Returns the typical stiffness of a fiber; 1 if it is zero or not finite.
fn typical_stiffness(network: &NetworkData) -> f64 {
    let ratios = network.areas.iter().zip(&network.lengths).map(|(area, length)| area / length);
    let modulus = network.laws.iter().map(|law| law.numbers()[1]).fold(0.0, f64::max);
    let typical = modulus * ratios.sum::<f64>() / network.lengths.len().max(1) as f64;
    if typical > 0.0 && typical.is_finite() { typical } else { 1.0 }
}
