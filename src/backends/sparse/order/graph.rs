//! What an ordering sees of a matrix: a graph of nodes, each with one unknown or with three.

use super::NONE;
use crate::las::Sparsity;

/// Unknowns of a node whose couplings are full blocks.
pub(in crate::backends::sparse) const BLOCK: usize = 3;

/// The couplings of the nodes of a symmetric matrix.
#[derive(Clone, Debug)]
pub(in crate::backends::sparse) struct Graph {
    /// Where the neighbours of each node start; one more than there are nodes.
    pub(super) start: Vec<u32>,
    /// The neighbours of every node, ascending, without itself.
    pub(super) neighbours: Vec<u32>,
    /// Unknowns of a node: 1 or [`BLOCK`].
    pub(in crate::backends::sparse) unknowns_per_node: usize,
}

impl Graph {
    /// The graph of a symmetric pattern: by blocks where it consists of them, else by unknowns.
    pub(in crate::backends::sparse) fn new(pattern: &Sparsity) -> Self {
        Self::of_blocks(pattern).unwrap_or_else(|| Self::of_unknowns(pattern))
    }

    /// The nodes of a pattern whose unknowns `3 k`, `3 k + 1` and `3 k + 2` couple to the same others, always to all three
    /// of another node, and to each other; `None` where a single entry differs.
    fn of_blocks(pattern: &Sparsity) -> Option<Self> {
        if !pattern.rows().is_multiple_of(BLOCK) {
            return None;
        }
        let nodes = pattern.rows() / BLOCK;
        let mut graph = Self { start: vec![0], neighbours: Vec::new(), unknowns_per_node: BLOCK };
        for node in 0..nodes {
            let [first, second, third] = [0, 1, 2].map(|i| pattern.row(BLOCK * node + i));
            let (blocks, rest) = first.as_chunks::<BLOCK>();
            if !rest.is_empty() || first != second || first != third {
                return None;
            }
            let mut has_diagonal = false;
            for &[i, j, k] in blocks {
                if !i.is_multiple_of(BLOCK as u32) || j != i + 1 || k != i + 2 {
                    return None;
                }
                let other = i / BLOCK as u32;
                has_diagonal |= other as usize == node;
                if other as usize != node {
                    graph.neighbours.push(other);
                }
            }
            if !has_diagonal {
                return None;
            }
            graph.start.push(graph.neighbours.len() as u32);
        }
        graph.is_symmetric().then_some(graph)
    }

    fn of_unknowns(pattern: &Sparsity) -> Self {
        let mut graph = Self { start: vec![0], neighbours: Vec::new(), unknowns_per_node: 1 };
        for row in 0..pattern.rows() {
            graph.neighbours.extend(pattern.row(row).iter().filter(|&&column| column as usize != row));
            graph.start.push(graph.neighbours.len() as u32);
        }
        graph
    }

    pub(in crate::backends::sparse) fn nodes(&self) -> usize {
        self.start.len() - 1
    }

    /// The neighbours of a node, ascending.
    #[inline]
    pub(in crate::backends::sparse) fn neighbours(&self, node: usize) -> &[u32] {
        &self.neighbours[self.start[node] as usize..self.start[node + 1] as usize]
    }

    fn is_symmetric(&self) -> bool {
        let mirrored = |node: usize, other: u32| self.neighbours(other as usize).binary_search(&(node as u32)).is_ok();
        (0..self.nodes()).all(|node| self.neighbours(node).iter().all(|&other| mirrored(node, other)))
    }

    /// The couplings among some of the nodes, numbered as they are listed. `number` is scratch, one entry a node, all
    /// [`NONE`](NONE), and is left so.
    pub(super) fn part(&self, nodes: &[u32], number: &mut [u32]) -> Self {
        for (k, &node) in nodes.iter().enumerate() {
            number[node as usize] = k as u32;
        }
        let mut part = Self { start: vec![0], neighbours: Vec::new(), unknowns_per_node: self.unknowns_per_node };
        for &node in nodes {
            let first = part.neighbours.len();
            let inside = self.neighbours(node as usize).iter().map(|&other| number[other as usize]);
            part.neighbours.extend(inside.filter(|&other| other != NONE));
            part.neighbours[first..].sort_unstable();
            part.start.push(part.neighbours.len() as u32);
        }
        for &node in nodes {
            number[node as usize] = NONE;
        }
        part
    }

    /// The number of its connected component, for every node.
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
                for &other in self.neighbours(node as usize) {
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

    #[test]
    fn blocks_of_three_become_nodes() {
        let graph = Graph::new(&pattern(4, &[[0, 2], [2, 1]], &[]));
        assert_eq!((graph.nodes(), graph.unknowns_per_node), (4, BLOCK));
        assert_eq!([0, 1, 2, 3].map(|node| graph.neighbours(node).to_vec()), [vec![2], vec![2], vec![0, 1], vec![]]);
        let empty = Graph::new(&pattern(0, &[], &[]));
        assert_eq!((empty.nodes(), empty.unknowns_per_node), (0, BLOCK));
    }

    #[test]
    fn a_pattern_that_is_not_made_of_full_blocks_is_not_mistaken_for_one() {
        let scalar = |pattern: &Sparsity| Graph::new(pattern).unknowns_per_node == 1;
        assert!(scalar(&pattern(4, &[[0, 2]], &[vec![0, 3]])), "one entry of a block");
        assert!(scalar(&pattern(4, &[[0, 2]], &[vec![0, 3, 4, 5]])), "one row of a block");
        assert!(scalar(&pattern(2, &[], &[vec![1, 2, 3], vec![2, 3, 4]])), "blocks beside the grid");
        assert!(scalar(&Sparsity::from_elements(6, [[0, 1], [3, 4]]).unwrap()), "nodes that do not couple within");
        assert!(scalar(&Sparsity::from_elements(7, [[0, 1, 2]]).unwrap()), "not a multiple of three");
        // Full rows of three, but from node 1 to node 0 only.
        let one_way = Sparsity::from_rows(
            6,
            vec![0, 3, 6, 9, 15, 21, 27],
            [[0, 1, 2].repeat(3), (0..6).collect::<Vec<_>>().repeat(3)].concat(),
        );
        assert!(scalar(&one_way.unwrap()));
        let off = Sparsity::from_rows(
            6,
            (0..=6).map(|r| 3 * r).collect(),
            [[3, 4, 5].repeat(3), [0, 1, 2].repeat(3)].concat(),
        );
        assert!(scalar(&off.unwrap()), "no diagonal");
    }
}
