//! A node separator and its refinement by moves of single nodes.

use super::coarse::Weighted;

/// The largest fraction of the total weight on one side.
const MAX_SIDE_FRACTION: f64 = 0.65;

/// The largest number of rounds of moves.
const MAX_ROUNDS: usize = 10;

/// The number of moves without a gain after which a round ends.
const MAX_STALLED_MOVES: usize = 60;

/// The part of the partition to which a node belongs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Region {
    Left = 0,
    Right = 1,
    Separator = 2,
}

impl Region {
    pub(super) fn opposite(self) -> Self {
        if self == Self::Left { Self::Right } else { Self::Left }
    }
}

/// A separator and the two sides that it separates.
pub(super) struct Partition<'a> {
    graph: &'a Weighted,
    pub(super) regions: Vec<Region>,
    separator: Vec<u32>,
    /// The weight of the nodes on each side.
    sizes: [u32; 2],
    /// For every node, the weight of its neighbors on each side.
    neighbor_weights: Vec<[u32; 2]>,
}

impl<'a> Partition<'a> {
    pub(super) fn new(graph: &'a Weighted, regions: Vec<Region>) -> Self {
        let neighbor_weights = vec![[0; 2]; graph.nodes()];
        let mut partition = Self { graph, regions, sizes: [0; 2], separator: Vec::new(), neighbor_weights };
        partition.list_separator();
        for node in 0..graph.nodes() {
            let region = partition.regions[node];
            if region != Region::Separator {
                partition.sizes[region as usize] += graph.weights[node];
                partition.update_neighbor_weights(node, region, true);
            }
        }
        partition
    }

    fn list_separator(&mut self) {
        self.separator.clear();
        let separates = |&node: &u32| self.regions[node as usize] == Region::Separator;
        self.separator.extend((0..self.regions.len() as u32).filter(separates));
    }

    /// Updates `neighbor_weights` of the neighbors after a node joined or left a side.
    fn update_neighbor_weights(&mut self, node: usize, side: Region, joined: bool) {
        let weight = self.graph.weights[node];
        for &(other, _) in self.graph.neighbors(node) {
            let count = &mut self.neighbor_weights[other as usize][side as usize];
            *count = if joined { *count + weight } else { *count - weight };
        }
    }

    fn move_to(&mut self, node: usize, region: Region) {
        let weight = self.graph.weights[node];
        let old = std::mem::replace(&mut self.regions[node], region);
        if old != Region::Separator {
            self.sizes[old as usize] -= weight;
            self.update_neighbor_weights(node, old, false);
        }
        if region != Region::Separator {
            self.sizes[region as usize] += weight;
            self.update_neighbor_weights(node, region, true);
        }
    }

    pub(super) fn is_proper(&self) -> bool {
        self.sizes[0] > 0 && self.sizes[1] > 0
    }

    /// Returns the cost to be minimized: the weight of the separator, slightly increased if the sides differ in weight.
    pub(super) fn cost(&self) -> f64 {
        let difference = f64::from(self.sizes[0].abs_diff(self.sizes[1])) / f64::from(self.graph.total);
        let separator = self.graph.total - self.sizes[0] - self.sizes[1];
        f64::from(separator) * (1.0 + difference * difference)
    }

    /// Performs rounds of moves as long as they reduce the cost.
    pub(super) fn refine(&mut self) {
        for _ in 0..MAX_ROUNDS {
            if !self.refine_once() {
                return;
            }
        }
    }

    /// Performs one round: moves nodes out of the separator, each at most once and the best move first even if it
    /// increases the cost; then restores the best state encountered. Returns true if that state is better than the
    /// initial one.
    fn refine_once(&mut self) -> bool {
        let first = self.cost();
        let (mut best, mut best_at) = (first, 0);
        let mut moved = vec![false; self.regions.len()];
        let mut log: Vec<(u32, Region)> = Vec::new();
        let mut stalled = 0;
        while let Some((k, side)) = self.best_move(&moved) {
            let node = self.separator.swap_remove(k);
            moved[node as usize] = true;
            log.push((node, Region::Separator));
            self.move_to(node as usize, side);
            for &(other, _) in self.graph.neighbors(node as usize) {
                if self.regions[other as usize] == side.opposite() {
                    log.push((other, side.opposite()));
                    self.move_to(other as usize, Region::Separator);
                    self.separator.push(other);
                }
            }
            stalled += 1;
            if self.is_proper() && self.cost() < best {
                (best, best_at, stalled) = (self.cost(), log.len(), 0);
            } else if stalled > MAX_STALLED_MOVES {
                break;
            }
        }
        for &(node, region) in log[best_at..].iter().rev() {
            self.move_to(node as usize, region);
        }
        self.list_separator();
        best < first
    }

    /// Returns the move that shrinks the separator most; among equal moves, the one toward the smaller side.
    fn best_move(&self, moved: &[bool]) -> Option<(usize, Region)> {
        let limit = (MAX_SIDE_FRACTION * f64::from(self.graph.total)) as u32;
        let mut best: Option<(i64, u32, usize, Region)> = None;
        for (k, &node) in self.separator.iter().enumerate().filter(|&(_, &node)| !moved[node as usize]) {
            let weight = self.graph.weights[node as usize];
            for side in [Region::Left, Region::Right] {
                let pulled = self.neighbor_weights[node as usize][side.opposite() as usize];
                let (loss, size) = (i64::from(pulled) - i64::from(weight), self.sizes[side as usize]);
                let better = best.is_none_or(|(least, smaller, ..)| (loss, size) < (least, smaller));
                if size + weight <= limit && better {
                    best = Some((loss, size, k, side));
                }
            }
        }
        best.map(|(.., k, side)| (k, side))
    }
}
