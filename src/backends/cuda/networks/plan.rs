//! The network in the form that the kernels read, with its nodes in the order of elimination.

use std::sync::Arc;

use super::data::NetworkData;
use super::layout::{FIBER_LEN, INCIDENT_LEN};
use super::schedule::{NONE, Schedule, TileShape};
use crate::backends::sparse::Sparse;
use crate::las::{Backend, SolverParams, Sparsity, Symmetry};

/// The tiles of the factorization. Of the shapes whose sums fit into the registers, this one was the fastest on an H200;
/// `docs/cuda.md` has the measurements.
pub(super) const TILE: TileShape = TileShape { columns: 3, rows: 2 };

/// A network with its nodes in the order of elimination.
pub(super) struct Plan {
    /// By place in the order: the interior node.
    pub order: Vec<u32>,
    pub ends: Vec<u32>,
    pub sizes: Vec<f64>,
    /// The ends of the fibers, node after node, as `kernels/base.cu` stores them; those of interior nodes come first.
    pub incidents: Vec<[u32; INCIDENT_LEN]>,
    /// Ends of fibers at interior nodes.
    pub inner_ends: usize,
    /// Pairs of interior nodes that fibers connect.
    pub pairs: usize,
    pub schedule: Schedule,
}

impl Plan {
    pub fn new(network: &NetworkData, shape: TileShape) -> Self {
        let NetworkData { interior, boundary, ends, lengths, areas, law_of, laws } = network;
        let nodes = interior + boundary.len();
        assert!(ends.as_flattened().iter().all(|&node| (node as usize) < nodes), "the nodes of the fibers exist");
        assert!(law_of.iter().all(|&law| (law as usize) < laws.len()), "the laws of the fibers exist");
        let fibers = ends.len();
        assert!([lengths.len(), areas.len(), law_of.len()] == [fibers; 3], "one entry for each fiber");
        let order = elimination_order(*interior, ends);
        let mut number: Vec<u32> = (0..nodes as u32).collect();
        for (place, &node) in order.iter().enumerate() {
            number[node as usize] = place as u32;
        }
        let ends: Vec<[u32; 2]> = ends.iter().map(|ends| ends.map(|node| number[node as usize])).collect();
        let is_interior = |node: u32| (node as usize) < *interior;
        let mut pairs: Vec<[u32; 2]> = ends
            .iter()
            .filter(|[a, b]| is_interior(*a) && is_interior(*b) && a != b)
            .map(|&[a, b]| [a.min(b), a.max(b)])
            .collect();
        pairs.sort_unstable();
        pairs.dedup();
        let size = |(&length, &area): (&f64, &f64)| -> [f64; FIBER_LEN] {
            [length, 1.0 / length, area, area / length, area * length]
        };
        let incidents = incidents(nodes, &ends, &pairs);
        Self {
            inner_ends: incidents.iter().filter(|[node, ..]| is_interior(*node)).count(),
            incidents,
            sizes: lengths.iter().zip(areas).flat_map(size).collect(),
            schedule: Schedule::new(*interior, &pairs, shape),
            pairs: pairs.len(),
            ends: ends.into_flattened(),
            order,
        }
    }

    /// Returns the bytes that a factorization reads and writes.
    pub fn bytes_of_factorization(&self) -> f64 {
        let (block, diagonal, vector) = (9, 6, 3);
        let (nodes, blocks) = (self.order.len(), self.schedule.blocks());
        let read = diagonal * (nodes + self.pairs) + vector * (nodes + blocks) + block * self.schedule.reads();
        let written = block * blocks + (diagonal + vector) * nodes;
        (size_of::<f64>() * (read + written)) as f64
    }
}

/// Returns the ends of the fibers, node after node: the node, the node at the other end, the fiber, the pair of nodes to
/// which this end adds the stiffness of the fiber, whether the fiber is the first of the pair, and whether the end is the
/// last of its node.
fn incidents(nodes: usize, ends: &[[u32; 2]], pairs: &[[u32; 2]]) -> Vec<[u32; INCIDENT_LEN]> {
    let mut incidents = vec![Vec::new(); nodes];
    let mut is_known = vec![false; pairs.len()];
    for (fiber, &[a, b]) in (0..).zip(ends) {
        let pair = pairs.binary_search(&[a.min(b), a.max(b)]).ok();
        for (node, other) in [(a, b), (b, a)] {
            let adds = pair.filter(|_| node < other);
            let is_first = adds.is_some_and(|pair| !std::mem::replace(&mut is_known[pair], true));
            let pair = adds.map_or(NONE, |pair| pair as u32);
            incidents[node as usize].push([node, other, fiber, pair, u32::from(is_first), 0]);
        }
    }
    for [.., is_last] in incidents.iter_mut().filter_map(|of_node| of_node.last_mut()) {
        *is_last = 1;
    }
    incidents.concat()
}

/// Returns the order in which the backend `sparse` eliminates the nodes.
fn elimination_order(interior: usize, ends: &[[u32; 2]]) -> Vec<u32> {
    let unknowns = |node: u32| {
        let first = if (node as usize) < interior { 3 * node as i32 } else { -3 };
        [first, first + 1, first + 2].map(|unknown| unknown.max(-1))
    };
    let elements = ends.iter().map(|ends| ends.map(unknowns).concat());
    let pattern = Sparsity::from_elements(3 * interior, elements.collect::<Vec<_>>());
    let symbolic = pattern.ok().and_then(|pattern| {
        Sparse::<f64>::analyze(&(), &Arc::new(pattern), &SolverParams::new(Symmetry::Definite)).ok()
    });
    match symbolic {
        Some(symbolic) => symbolic.order().iter().step_by(3).map(|&unknown| unknown / 3).collect(),
        None => (0..interior as u32).collect(),
    }
}
