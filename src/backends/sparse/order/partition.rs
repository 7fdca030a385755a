//! A node separator and its refinement by moves of single nodes.

use super::coarse::Weighted;

/// The largest fraction of the total weight on one side.
const LARGEST_SIDE: f64 = 0.65;

/// The largest number of rounds of moves.
const ROUNDS: usize = 10;

/// The number of moves without a gain after which a round ends.
const PATIENCE: usize = 60;

/// The part of the partition to which a node belongs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Side {
    Left = 0,
    Right = 1,
    Separator = 2,
}

impl Side {
    pub(super) fn other_side(self) -> Self {
        if self == Self::Left { Self::Right } else { Self::Left }
    }
}

/// A separator and the two sides that it separates.
pub(super) struct Partition<'a> {
    graph: &'a Weighted,
    pub(super) places: Vec<Side>,
    separator: Vec<u32>,
    /// The weight of the nodes on each side.
    sizes: [u32; 2],
    /// For every node, the weight of its neighbors on each side.
    beside: Vec<[u32; 2]>,
}

impl<'a> Partition<'a> {
    pub(super) fn new(graph: &'a Weighted, places: Vec<Side>) -> Self {
        let beside = vec![[0; 2]; graph.nodes()];
        let mut partition = Self { graph, places, sizes: [0; 2], separator: Vec::new(), beside };
        partition.list_separator();
        for node in 0..graph.nodes() {
            let place = partition.places[node];
            if place != Side::Separator {
                partition.sizes[place as usize] += graph.weights[node];
                partition.count_beside(node, place, true);
            }
        }
        partition
    }

    fn list_separator(&mut self) {
        self.separator.clear();
        let separates = |&node: &u32| self.places[node as usize] == Side::Separator;
        self.separator.extend((0..self.places.len() as u32).filter(separates));
    }

    /// Updates `beside` of the neighbors after a node joined or left a side.
    fn count_beside(&mut self, node: usize, side: Side, joined: bool) {
        let weight = self.graph.weights[node];
        for &(other, _) in self.graph.neighbors(node) {
            let count = &mut self.beside[other as usize][side as usize];
            *count = if joined { *count + weight } else { *count - weight };
        }
    }

    fn put(&mut self, node: usize, place: Side) {
        let weight = self.graph.weights[node];
        let old = std::mem::replace(&mut self.places[node], place);
        if old != Side::Separator {
            self.sizes[old as usize] -= weight;
            self.count_beside(node, old, false);
        }
        if place != Side::Separator {
            self.sizes[place as usize] += weight;
            self.count_beside(node, place, true);
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
        for _ in 0..ROUNDS {
            if !self.round() {
                return;
            }
        }
    }

    /// Performs one round: moves nodes out of the separator, each at most once and the best move first even if it
    /// increases the cost; then restores the best state encountered. Returns true if that state is better than the
    /// initial one.
    fn round(&mut self) -> bool {
        let first = self.cost();
        let (mut best, mut best_at) = (first, 0);
        let mut moved = vec![false; self.places.len()];
        let mut log: Vec<(u32, Side)> = Vec::new();
        let mut since = 0;
        while let Some((k, side)) = self.best_move(&moved) {
            let node = self.separator.swap_remove(k);
            moved[node as usize] = true;
            log.push((node, Side::Separator));
            self.put(node as usize, side);
            for &(other, _) in self.graph.neighbors(node as usize) {
                if self.places[other as usize] == side.other_side() {
                    log.push((other, side.other_side()));
                    self.put(other as usize, Side::Separator);
                    self.separator.push(other);
                }
            }
            since += 1;
            if self.is_proper() && self.cost() < best {
                (best, best_at, since) = (self.cost(), log.len(), 0);
            } else if since > PATIENCE {
                break;
            }
        }
        for &(node, place) in log[best_at..].iter().rev() {
            self.put(node as usize, place);
        }
        self.list_separator();
        best < first
    }

    /// Returns the move that shrinks the separator most; among equal moves, the one toward the smaller side.
    fn best_move(&self, moved: &[bool]) -> Option<(usize, Side)> {
        let limit = (LARGEST_SIDE * f64::from(self.graph.total)) as u32;
        let mut best: Option<(i64, u32, usize, Side)> = None;
        for (k, &node) in self.separator.iter().enumerate().filter(|&(_, &node)| !moved[node as usize]) {
            let weight = self.graph.weights[node as usize];
            for side in [Side::Left, Side::Right] {
                let pulled = self.beside[node as usize][side.other_side() as usize];
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
