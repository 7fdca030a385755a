//! The network that the lanes of a group share.

use std::ops::Range;

use super::laws::Law;
use crate::backends::networks::{NetworkData, Plan, Schedule, TileShape};

/// A fiber.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fiber {
    /// Its nodes, the one that is eliminated first before the other.
    pub ends: [u32; 2],
    /// The connection to which it belongs, if it is no end fiber.
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
    /// The pairs of nodes that fibers connect, the one that is eliminated first before the other, without those of end
    /// fibers. Those of interior nodes come first, in the order of the edges of the schedule. Parallel fibers have one
    /// connection, with one stiffness.
    pub connections: Vec<[u32; 2]>,
    /// The connections of interior nodes.
    pub pairs: usize,
    /// The typical stiffness of a fiber: the largest modulus times the mean of area over length.
    pub stiffness: f64,
    /// The fibers, in the order of their connections. The last ones are the [end fibers](Network::end_fibers).
    pub fibers: Vec<Fiber>,
    /// By interior node, the index in `end_fibers` of its first one; the last entry is their number.
    pub first_end_fibers: Vec<u32>,
    pub laws: Vec<Law>,
    /// Reference positions of the boundary nodes; those of the end fibers come last, in the order of these.
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
        let Numbering { ends, boundary, is_end } = Numbering::new(network, &plan);
        // Consecutive fibers share a node, whose sums are then still in the cache.
        let mut numbers: Vec<usize> = (0..ends.len()).collect();
        numbers.sort_by_key(|&number| (is_end[number], plan.pair_of(ends[number]).is_none(), ends[number]));
        let mut connections: Vec<[u32; 2]> = Vec::new();
        let fiber = |&number: &usize| {
            let (ends, length, area) = (ends[number], network.lengths[number], network.areas[number]);
            if !is_end[number] && connections.last() != Some(&ends) {
                connections.push(ends);
            }
            Fiber {
                ends,
                connection: connections.len().saturating_sub(1) as u32,
                law: network.law_of[number],
                length,
                inverse_length: 1.0 / length,
                area,
                area_over_length: area / length,
                volume: area * length,
            }
        };
        let fibers: Vec<Fiber> = numbers.iter().map(fiber).collect();
        let mut first_end_fibers = vec![0; network.interior + 1];
        numbers
            .iter()
            .filter(|&&number| is_end[number])
            .for_each(|&number| first_end_fibers[ends[number][0] as usize + 1] += 1);
        (0..network.interior).for_each(|node| first_end_fibers[node + 1] += first_end_fibers[node]);
        Self {
            interior: network.interior,
            nodes: network.interior + network.boundary.len(),
            pairs: plan.pairs.len(),
            connections,
            stiffness: typical_stiffness(network),
            fibers,
            first_end_fibers,
            laws: network.laws.iter().map(Law::new).collect(),
            boundary,
            places: places_of(&plan.order),
            order: plan.order,
            schedule: plan.schedule,
        }
    }

    /// The number of end fibers.
    fn end_fiber_count(&self) -> usize {
        self.first_end_fibers.last().map_or(0, |&count| count as usize)
    }

    /// Fibers from an interior node to a boundary node without another fiber, sorted by both nodes.
    pub fn end_fibers(&self) -> &[Fiber] {
        &self.fibers[self.fibers.len() - self.end_fiber_count()..]
    }

    /// The end fibers of an interior node, among all end fibers.
    pub fn end_fibers_of(&self, node: usize) -> Range<usize> {
        self.first_end_fibers[node] as usize..self.first_end_fibers[node + 1] as usize
    }

    /// The fibers that are no end fibers.
    pub fn other_fibers(&self) -> &[Fiber] {
        &self.fibers[..self.fibers.len() - self.end_fiber_count()]
    }

    /// The first boundary node at an end fiber; the number of nodes if there is none.
    pub fn first_end_node(&self) -> usize {
        self.nodes - self.end_fiber_count()
    }
}

/// The numbers of the nodes in lanes.
struct Numbering {
    /// The ends of each fiber, the smaller number before the larger.
    ends: Vec<[u32; 2]>,
    /// Reference positions of the boundary nodes.
    boundary: Vec<[f64; 3]>,
    /// Whether a fiber is an end fiber.
    is_end: Vec<bool>,
}

impl Numbering {
    fn new(network: &NetworkData, plan: &Plan) -> Self {
        let interior = network.interior as u32;
        let mut fibers_at = vec![0; network.interior + network.boundary.len()];
        plan.ends.as_flattened().iter().for_each(|&node| fibers_at[node as usize] += 1);
        let sorted: Vec<[u32; 2]> = plan.ends.iter().map(|&[a, b]| [a.min(b), a.max(b)]).collect();
        let is_end: Vec<bool> =
            sorted.iter().map(|&[a, b]| a < interior && b >= interior && fibers_at[b as usize] == 1).collect();
        let mut end_fibers: Vec<usize> = (0..sorted.len()).filter(|&number| is_end[number]).collect();
        end_fibers.sort_by_key(|&number| sorted[number]);
        let mut is_of_end = vec![false; fibers_at.len()];
        end_fibers.iter().for_each(|&number| is_of_end[sorted[number][1] as usize] = true);
        let others = (interior..fibers_at.len() as u32).filter(|&node| !is_of_end[node as usize]);
        let boundary: Vec<u32> = others.chain(end_fibers.iter().map(|&number| sorted[number][1])).collect();
        let mut new_number: Vec<u32> = (0..fibers_at.len() as u32).collect();
        (interior..).zip(&boundary).for_each(|(place, &node)| new_number[node as usize] = place);
        let renumbered = |ends: &[u32; 2]| {
            let [a, b] = ends.map(|node| new_number[node as usize]);
            [a.min(b), a.max(b)]
        };
        Self {
            ends: sorted.iter().map(renumbered).collect(),
            boundary: boundary.iter().map(|&node| network.boundary[(node - interior) as usize]).collect(),
            is_end,
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
