//! The graph on which orders are computed: nodes with one to three unknowns each.

use super::NONE;
use crate::las::Sparsity;

/// The largest number of unknowns per node.
pub(in crate::backends::sparse) const BLOCK: usize = 3;

/// The graph of the couplings between the nodes of a symmetric matrix.
#[derive(Clone, Debug)]
pub(in crate::backends::sparse) struct Graph {
    /// For each node, the index of its first neighbor; one entry more than there are nodes.
    pub(super) start: Vec<u32>,
    /// The neighbors of every node, ascending, without the node itself.
    pub(super) neighbors: Vec<u32>,
    /// The number of unknowns of each node: 1 to [`BLOCK`].
    sizes: Vec<u8>,
}

impl Graph {
    /// Creates the graph of a symmetric pattern.
    ///
    /// Up to three consecutive unknowns that couple to each other and to the same other unknowns form one node. Since
    /// the pattern is symmetric, every other unknown couples to all of them or to none, so that nodes couple by full
    /// blocks.
    pub(in crate::backends::sparse) fn new(pattern: &Sparsity) -> Self {
        let unknowns = pattern.rows();
        let (mut sizes, mut node_of) = (Vec::new(), Vec::with_capacity(unknowns));
        while node_of.len() < unknowns {
            let first = node_of.len();
            let row = pattern.row(first);
            let limit = if row.binary_search(&(first as u32)).is_ok() { BLOCK } else { 1 };
            let alike = (first + 1..unknowns).take(limit - 1).take_while(|&other| pattern.row(other) == row);
            let size = 1 + alike.count();
            node_of.resize(first + size, sizes.len() as u32);
            sizes.push(size as u8);
        }
        let mut graph = Self { start: vec![0], neighbors: Vec::new(), sizes };
        let mut first = 0;
        for node in 0..graph.sizes.len() {
            let before = graph.neighbors.len();
            for &unknown in pattern.row(first) {
                let other = node_of[unknown as usize];
                if other as usize != node && graph.neighbors[before..].last() != Some(&other) {
                    graph.neighbors.push(other);
                }
            }
            graph.start.push(graph.neighbors.len() as u32);
            first += graph.size(node);
        }
        graph
    }

    /// Returns the first unknown of each node, followed by the number of unknowns.
    pub(in crate::backends::sparse) fn first_unknowns(&self) -> Vec<u32> {
        let mut first = Vec::with_capacity(self.nodes() + 1);
        first.push(0);
        for (node, &size) in self.sizes.iter().enumerate() {
            first.push(first[node] + u32::from(size));
        }
        first
    }

    /// Returns the number of unknowns of a node.
    #[inline]
    pub(in crate::backends::sparse) fn size(&self, node: usize) -> usize {
        self.sizes[node] as usize
    }

    pub(in crate::backends::sparse) fn nodes(&self) -> usize {
        self.start.len() - 1
    }

    /// Returns the neighbors of a node, ascending.
    #[inline]
    pub(in crate::backends::sparse) fn neighbors(&self, node: usize) -> &[u32] {
        &self.neighbors[self.start[node] as usize..self.start[node + 1] as usize]
    }

    /// Returns the subgraph of some nodes, numbered as they are listed. `number` is scratch with one entry per node;
    /// all its entries are [`NONE`](NONE) before and after the call.
    pub(super) fn part(&self, nodes: &[u32], number: &mut [u32]) -> Self {
        for (k, &node) in nodes.iter().enumerate() {
            number[node as usize] = k as u32;
        }
        let sizes = nodes.iter().map(|&node| self.sizes[node as usize]).collect();
        let mut part = Self { start: vec![0], neighbors: Vec::new(), sizes };
        for &node in nodes {
            let first = part.neighbors.len();
            let inside = self.neighbors(node as usize).iter().map(|&other| number[other as usize]);
            part.neighbors.extend(inside.filter(|&other| other != NONE));
            part.neighbors[first..].sort_unstable();
            part.start.push(part.neighbors.len() as u32);
        }
        for &node in nodes {
            number[node as usize] = NONE;
        }
        part
    }

    /// Returns for every node the number of its connected component.
    pub(super) fn components(&self) -> Vec<u32> {
        let mut component = vec![NONE; self.nodes()];
        let (mut count, mut stack) = (0, Vec::new());
        for start in 0..self.nodes() {
            if component[start] != NONE {
                continue;
            }
            component[start] = count;
            stack.push(start as u32);
            while let Some(node) = stack.pop() {
                for &other in self.neighbors(node as usize) {
                    if component[other as usize] == NONE {
                        component[other as usize] = count;
                        stack.push(other);
                    }
                }
            }
            count += 1;
        }
        component
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pattern(nodes: i32, bars: &[[i32; 2]], extra: &[Vec<i32>]) -> Sparsity {
        let three = |k: i32| [3 * k, 3 * k + 1, 3 * k + 2];
        let own = (0..nodes).map(|k| three(k).to_vec());
        let bars = bars.iter().map(|&[a, b]| [three(a), three(b)].concat());
        Sparsity::from_elements(3 * nodes as usize, own.chain(bars).chain(extra.iter().cloned())).unwrap()
    }

    fn sizes(pattern: &Sparsity) -> Vec<u8> {
        Graph::new(pattern).sizes
    }

    #[test]
    fn blocks_of_three_become_nodes() {
        let graph = Graph::new(&pattern(4, &[[0, 2], [2, 1]], &[]));
        assert_eq!(graph.sizes, [3; 4]);
        assert_eq!([0, 1, 2, 3].map(|node| graph.neighbors(node).to_vec()), [vec![2], vec![2], vec![0, 1], vec![]]);
        assert_eq!(Graph::new(&pattern(0, &[], &[])).nodes(), 0);
    }

    /// Nodes of a body, some of whose displacements are prescribed.
    #[test]
    fn nodes_with_fewer_unknowns_are_found_between_those_with_three() {
        let nodes: [&[i32]; 5] = [&[0, 1, 2], &[3], &[4, 5], &[6, 7, 8], &[9, 10]];
        let bars = [[0, 1], [1, 2], [2, 3], [3, 4], [0, 3]].map(|[a, b]| [nodes[a], nodes[b]].concat());
        let graph = Graph::new(&Sparsity::from_elements(11, bars).unwrap());
        assert_eq!(graph.sizes, [3, 1, 2, 3, 2]);
        assert_eq!(graph.first_unknowns(), [0, 3, 4, 6, 9, 11]);
        let neighbors = [vec![1, 3], vec![0, 2], vec![1, 3], vec![0, 2, 4], vec![3]];
        assert_eq!([0, 1, 2, 3, 4].map(|node| graph.neighbors(node).to_vec()), neighbors);
    }

    #[test]
    fn nodes_are_split_where_couplings_differ() {
        assert_eq!(sizes(&pattern(4, &[[0, 2]], &[vec![0, 3]])), [1, 2, 1, 2, 3, 3], "one entry of a block");
        assert_eq!(sizes(&pattern(4, &[[0, 2]], &[vec![0, 3, 4, 5]])), [1, 2, 3, 3, 3], "one row of a block");
        assert_eq!(sizes(&pattern(2, &[], &[vec![1, 2, 3], vec![2, 3, 4]])), [1; 6], "blocks beside the grid");
        let within = Sparsity::from_elements(6, [[0, 1], [3, 4]]).unwrap();
        assert_eq!(sizes(&within), [2, 1, 2, 1], "unknowns that do not couple at all");
        assert_eq!(sizes(&Sparsity::from_elements(8, [(0..8).collect::<Vec<_>>()]).unwrap()), [3, 3, 2], "a clique");
        let off = Sparsity::from_rows(
            6,
            (0..=6).map(|r| 3 * r).collect(),
            [[3, 4, 5].repeat(3), [0, 1, 2].repeat(3)].concat(),
        );
        assert_eq!(sizes(&off.unwrap()), [1; 6], "no diagonal");
    }
}
