//! The network that the lanes of a group share.

use super::laws::Law;
use crate::backends::networks::{NetworkData, Plan, Schedule, TileShape};

/// The index of a pair that does not exist.
pub(super) const NO_PAIR: u32 = u32::MAX;

/// A fiber.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fiber {
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
    /// Pairs of interior nodes that fibers connect.
    pub pairs: usize,
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
            let (ends, length, area) = (plan.ends[number], network.lengths[number], network.areas[number]);
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
        Self {
            interior: network.interior,
            nodes: network.interior + network.boundary.len(),
            pairs: plan.pairs.len(),
            fibers: (0..plan.ends.len()).map(fiber).collect(),
            laws: network.laws.iter().map(Law::new).collect(),
            boundary: network.boundary.clone(),
            order: plan.order,
            schedule: plan.schedule,
        }
    }
}
