//! The network that the lanes of a group share.

use super::laws::Law;
use crate::backends::networks::{NetworkData, Plan, Schedule, TileShape};

/// A fiber.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fiber {
    /// Its nodes, the one that is eliminated first before the other.
    pub ends: [u32; 2],
    /// The connection to which it belongs.
    pub connection: u32,
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
    /// The pairs of nodes that fibers connect, the one that is eliminated first before the other. Those of interior nodes
    /// come first, in the order of the edges of the schedule. Parallel fibers have one connection, with one stiffness.
    pub connections: Vec<[u32; 2]>,
    /// The connections of interior nodes.
    pub pairs: usize,
    /// The typical stiffness of a fiber: the largest modulus times the mean of area over length.
    pub stiffness: f64,
    /// The fibers, in the order of their connections.
    pub fibers: Vec<Fiber>,
    pub laws: Vec<Law>,
    /// Reference positions of the boundary nodes.
    pub boundary: Vec<[f64; 3]>,
    /// By place in the order: the interior node.
    pub order: Vec<u32>,
    /// By interior node: its place in the order.
    pub places: Vec<u32>,
    pub schedule: Schedule,
}

impl Network {
    pub fn new(network: &NetworkData, tile: TileShape) -> Self {
        let plan = Plan::new(network, tile);
        let sorted = |number: usize| {
            let [a, b] = plan.ends[number];
            [a.min(b), a.max(b)]
        };
        // Consecutive fibers share a node, whose sums are then still in the cache.
        let mut numbers: Vec<usize> = (0..plan.ends.len()).collect();
        numbers.sort_by_key(|&number| (plan.pair_of(sorted(number)).is_none(), sorted(number)));
        let mut connections: Vec<[u32; 2]> = Vec::new();
        let fiber = |number: usize| {
            let (ends, length, area) = (sorted(number), network.lengths[number], network.areas[number]);
            if connections.last() != Some(&ends) {
                connections.push(ends);
            }
            Fiber {
                ends,
                connection: connections.len() as u32 - 1,
                law: network.law_of[number],
                length,
                inverse_length: 1.0 / length,
                area,
                area_over_length: area / length,
                volume: area * length,
            }
        };
        let fibers = numbers.into_iter().map(fiber).collect();
        Self {
            interior: network.interior,
            nodes: network.interior + network.boundary.len(),
            pairs: plan.pairs.len(),
            connections,
            stiffness: typical_stiffness(network),
            fibers,
            laws: network.laws.iter().map(Law::new).collect(),
            boundary: network.boundary.clone(),
            places: places_of(&plan.order),
            order: plan.order,
            schedule: plan.schedule,
        }
    }
}

/// Returns the place of each node in an order.
fn places_of(order: &[u32]) -> Vec<u32> {
    let mut places = vec![0; order.len()];
    (0..).zip(order).for_each(|(place, &node)| places[node as usize] = place);
    places
}

/// Returns the typical stiffness of a fiber; 1 if it is zero or not finite.
fn typical_stiffness(network: &NetworkData) -> f64 {
    let ratios = network.areas.iter().zip(&network.lengths).map(|(area, length)| area / length);
    let modulus = network.laws.iter().map(|law| law.numbers()[1]).fold(0.0, f64::max);
    let typical = modulus * ratios.sum::<f64>() / network.lengths.len().max(1) as f64;
    if typical > 0.0 && typical.is_finite() { typical } else { 1.0 }
}
