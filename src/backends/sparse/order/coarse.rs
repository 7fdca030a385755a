//! Coarsened graphs.

use super::NONE;
use super::graph::Graph;

/// A graph whose nodes and edges each represent several nodes and edges of a finer graph.
pub(super) struct Weighted {
    start: Vec<u32>,
    /// The neighbors of every node with the weight of the edge to each.
    neighbors: Vec<(u32, u32)>,
    pub(super) weights: Vec<u32>,
    /// The weight of all nodes.
    pub(super) total: u32,
}

impl Weighted {
    pub(super) fn new(graph: &Graph) -> Self {
        Self {
            start: graph.start.clone(),
            neighbors: graph.neighbors.iter().map(|&other| (other, 1)).collect(),
            weights: vec![1; graph.nodes()],
            total: graph.nodes() as u32,
        }
    }

    pub(super) fn nodes(&self) -> usize {
        self.weights.len()
    }

    pub(super) fn neighbors(&self, node: usize) -> &[(u32, u32)] {
        &self.neighbors[self.start[node] as usize..self.start[node + 1] as usize]
    }

    /// Merges pairs of neighbors (heavy-edge matching, visiting nodes by ascending degree). Returns the coarser graph
    /// and, for every node, its node in the coarser graph.
    pub(super) fn coarsen(&self) -> (Self, Vec<u32>) {
        let mut by_degree: Vec<u32> = (0..self.nodes() as u32).collect();
        by_degree.sort_by_key(|&node| self.neighbors(node as usize).len());
        let mut parent = vec![NONE; self.nodes()];
        let mut pairs: Vec<[u32; 2]> = Vec::new();
        for &node in &by_degree {
            if parent[node as usize] != NONE {
                continue;
            }
            let free = self.neighbors(node as usize).iter().filter(|&&(other, _)| parent[other as usize] == NONE);
            let mate = free.max_by_key(|&&(other, edge)| (edge, std::cmp::Reverse(self.weights[other as usize])));
            let mate = mate.map_or(node, |&(other, _)| other);
            parent[node as usize] = pairs.len() as u32;
            parent[mate as usize] = pairs.len() as u32;
            pairs.push([node, mate]);
        }
        let mut coarse = Self { start: vec![0], neighbors: Vec::new(), weights: Vec::new(), total: self.total };
        let mut edge_to = vec![NONE; pairs.len()];
        for (number, &[node, mate]) in pairs.iter().enumerate() {
            let first = coarse.neighbors.len();
            let members = if node == mate { &[node][..] } else { &[node, mate] };
            for &member in members {
                for &(other, edge) in self.neighbors(member as usize) {
                    let other = parent[other as usize];
                    match coarse.neighbors.get_mut(edge_to[other as usize] as usize) {
                        _ if other as usize == number => {}
                        Some((_, sum)) => *sum += edge,
                        None => {
                            edge_to[other as usize] = coarse.neighbors.len() as u32;
                            coarse.neighbors.push((other, edge));
                        }
                    }
                }
            }
            coarse.neighbors[first..].iter().for_each(|&(other, _)| edge_to[other as usize] = NONE);
            coarse.start.push(coarse.neighbors.len() as u32);
            coarse.weights.push(members.iter().map(|&member| self.weights[member as usize]).sum());
        }
        (coarse, parent)
    }

    /// Returns the graph distance from `start` to every node of a connected graph.
    pub(super) fn distances(&self, start: usize) -> Vec<u32> {
        let mut distances = vec![NONE; self.nodes()];
        distances[start] = 0;
        let mut queue = vec![start as u32];
        let mut head = 0;
        while let Some(&node) = queue.get(head) {
            head += 1;
            for &(other, _) in self.neighbors(node as usize) {
                if distances[other as usize] == NONE {
                    distances[other as usize] = distances[node as usize] + 1;
                    queue.push(other);
                }
            }
        }
        distances
    }

    /// Replaces, `sweeps` times, every value by the mean of itself and the weighted mean of its neighbors.
    pub(super) fn smooth(&self, field: &mut Vec<f64>, sweeps: usize) {
        let mut next = vec![0.0; field.len()];
        for _ in 0..sweeps {
            for (node, next) in next.iter_mut().enumerate() {
                let (mut sum, mut weight) = (0.0, 0.0);
                for &(other, edge) in self.neighbors(node) {
                    sum += f64::from(edge) * field[other as usize];
                    weight += f64::from(edge);
                }
                *next = if weight > 0.0 { 0.5 * (field[node] + sum / weight) } else { field[node] };
            }
            std::mem::swap(field, &mut next);
        }
    }
}
