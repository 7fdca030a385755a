//! A network with its nodes in the order of elimination.

use std::sync::Arc;

use super::data::NetworkData;
use super::schedule::{self, Schedule, TileShape};
use crate::backends::sparse::Sparse;
use crate::las::{Backend, SolverParams, Sparsity, Symmetry};

/// A network with its nodes in the order of elimination, in which boundary nodes follow the interior ones.
pub(in crate::backends) struct Plan {
    /// By place in the order: the interior node.
    pub order: Vec<u32>,
    /// The two nodes of each fiber.
    pub ends: Vec<[u32; 2]>,
    /// Pairs of interior nodes that fibers connect, the lower node first, ascending.
    pub pairs: Vec<[u32; 2]>,
    pub schedule: Schedule,
}

impl Plan {
    /// Orders a network; the factorization has tiles of this shape.
    ///
    /// # Panics
    /// Panics if the lists of the network have different lengths, or if a fiber has a node or a law that does not exist.
    pub fn new(network: &NetworkData, shape: TileShape) -> Self {
        let Ordered { order, ends, pairs } = Ordered::new(network);
        Self { schedule: Schedule::new(network.interior, &pairs, shape), pairs, ends, order }
    }

    /// Returns the floating-point operations of one factorization, without its schedule, which takes much memory for a
    /// large network.
    ///
    /// # Panics
    /// As for [`Plan::new`].
    pub fn operations(network: &NetworkData) -> f64 {
        schedule::operations(network.interior, &Ordered::new(network).pairs)
    }

    /// Returns the index of the pair of interior nodes that a fiber connects; `None` for any other fiber.
    pub fn pair_of(&self, [a, b]: [u32; 2]) -> Option<usize> {
        self.pairs.binary_search(&[a.min(b), a.max(b)]).ok()
    }

    /// Returns the bytes that a factorization reads and writes.
    #[cfg(feature = "cuda")]
    pub fn bytes_of_factorization(&self) -> f64 {
        let (block, diagonal, vector) = (9, 6, 3);
        let (nodes, blocks) = (self.order.len(), self.schedule.blocks());
        let read = diagonal * (nodes + self.pairs.len()) + vector * (nodes + blocks) + block * self.schedule.reads();
        let written = block * blocks + (diagonal + vector) * nodes;
        (size_of::<f64>() * (read + written)) as f64
    }
}

/// The parts of a [`Plan`] without the schedule.
struct Ordered {
    order: Vec<u32>,
    ends: Vec<[u32; 2]>,
    pairs: Vec<[u32; 2]>,
}

impl Ordered {
    fn new(network: &NetworkData) -> Self {
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
        Self { order, ends, pairs }
    }
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
