//! The elimination tree: the dependencies between the columns of the factor, and their numbers of nonzeros.

use super::NONE;
use super::graph::{BLOCK, Graph};

/// The elimination tree of an ordered graph, in postorder: the descendants of a node directly precede it.
///
/// Reference: J. W. H. Liu, *The role of elimination trees in sparse factorization*, SIAM Journal on Matrix Analysis
/// and Applications 11 (1990), 134-172.
#[derive(Clone, Debug)]
pub(in crate::backends::sparse) struct Tree {
    /// The node eliminated at each position.
    pub(in crate::backends::sparse) order: Vec<u32>,
    /// The position of each node.
    pub(in crate::backends::sparse) position: Vec<u32>,
    /// The parent of each position, which is the first row below the diagonal in its column of the factor; `NONE` for a
    /// root.
    pub(in crate::backends::sparse) parent: Vec<u32>,
    /// The number of entries (in nodes) of each column of the factor, including the diagonal.
    pub(in crate::backends::sparse) counts: Vec<u32>,
    /// The same in unknowns: the number of entries of the first scalar column of each position.
    heights: Vec<u32>,
    /// The number of unknowns of the node at each position.
    sizes: Vec<u32>,
}

impl Tree {
    /// Creates the tree for an order equivalent to the given one: postordered, with the same fill-in.
    pub(in crate::backends::sparse) fn new(graph: &Graph, order: Vec<u32>) -> Self {
        let n = graph.nodes();
        let sizes: Vec<u32> = order.iter().map(|&node| graph.size(node as usize) as u32).collect();
        let (position, heights) = (inverse(&order), sizes.clone());
        let mut tree = Self { position, order, parent: vec![NONE; n], counts: vec![1; n], heights, sizes };
        tree.compute_parents_and_counts(graph);
        let sequence = tree.postorder();
        let new_position = inverse(&sequence);
        let reorder = |values: &[u32]| sequence.iter().map(|&p| values[p as usize]).collect();
        tree.order = reorder(&tree.order);
        tree.counts = reorder(&tree.counts);
        tree.heights = reorder(&tree.heights);
        tree.sizes = reorder(&tree.sizes);
        let moved = |parent: u32| if parent == NONE { NONE } else { new_position[parent as usize] };
        tree.parent = sequence.iter().map(|&p| moved(tree.parent[p as usize])).collect();
        tree.position = inverse(&tree.order);
        tree
    }

    /// Computes parents and counts, row by row of the factor.
    fn compute_parents_and_counts(&mut self, graph: &Graph) {
        let mut seen = vec![NONE; self.order.len()];
        for row in 0..self.order.len() {
            seen[row] = row as u32;
            for &node in graph.neighbors(self.order[row] as usize) {
                let mut column = self.position[node as usize] as usize;
                while column < row && seen[column] != row as u32 {
                    seen[column] = row as u32;
                    self.counts[column] += 1;
                    self.heights[column] += self.sizes[row];
                    if self.parent[column] == NONE {
                        self.parent[column] = row as u32;
                    }
                    column = self.parent[column] as usize;
                }
            }
        }
    }

    /// Calls `visit(row, column)` for every entry of the factor below the diagonal, rows ascending.
    pub(in crate::backends::sparse) fn for_each_entry(&self, graph: &Graph, mut visit: impl FnMut(usize, usize)) {
        let mut seen = vec![NONE; self.order.len()];
        for row in 0..self.order.len() {
            seen[row] = row as u32;
            for &node in graph.neighbors(self.order[row] as usize) {
                let mut column = self.position[node as usize] as usize;
                while column < row && seen[column] != row as u32 {
                    seen[column] = row as u32;
                    visit(row, column);
                    column = self.parent[column] as usize;
                }
            }
        }
    }

    /// Returns the positions in postorder. Of siblings, the one with the most entries comes last, directly before its
    /// parent, so that both can form one supernode.
    fn postorder(&self) -> Vec<u32> {
        let n = self.order.len();
        let mut fullest_first: Vec<u32> = (0..n as u32).collect();
        fullest_first.sort_by_key(|&p| std::cmp::Reverse(self.counts[p as usize]));
        // Lists of children, fewest entries first; the roots are the children of an additional node `n`.
        let (mut head, mut next) = (vec![NONE; n + 1], vec![NONE; n]);
        for &p in &fullest_first {
            let parent = if self.parent[p as usize] == NONE { n } else { self.parent[p as usize] as usize };
            next[p as usize] = head[parent];
            head[parent] = p;
        }
        let (mut sequence, mut path) = (Vec::with_capacity(n), vec![n]);
        while let Some(&top) = path.last() {
            let child = head[top];
            if child == NONE {
                path.pop();
                if top < n {
                    sequence.push(top as u32);
                }
            } else {
                head[top] = next[child as usize];
                path.push(child as usize);
            }
        }
        sequence
    }

    /// Returns the entries of the factor: the sum of the column counts.
    pub(in crate::backends::sparse) fn entries(&self) -> f64 {
        let of_node = |(&height, &size): (&u32, &u32)| (0..size).map(|k| f64::from(height - k)).sum::<f64>();
        self.heights.iter().zip(&self.sizes).map(of_node).sum()
    }

    /// Returns the floating-point operations of a factorization: the sum of the squares of the column counts.
    pub(in crate::backends::sparse) fn operations(&self) -> f64 {
        let nodes = self.heights.iter().zip(&self.sizes);
        nodes.map(|(&height, &size)| operations_of_node(height, size)).sum()
    }

    /// Returns the operations of a factorization in which every node is padded to [`BLOCK`] unknowns.
    pub(in crate::backends::sparse) fn padded_operations(&self) -> f64 {
        self.counts.iter().map(|&count| operations_of_node(BLOCK as u32 * count, BLOCK as u32)).sum()
    }
}

/// Returns the operations of `size` columns, of which the first has `height` entries, the next one fewer, and so on.
fn operations_of_node(height: u32, size: u32) -> f64 {
    (0..size).map(|k| f64::from(height - k)).map(|entries| entries * entries).sum()
}

/// Returns the inverse permutation: `inverse[order[k]] = k`.
pub(in crate::backends::sparse) fn inverse(order: &[u32]) -> Vec<u32> {
    let mut inverse = vec![0; order.len()];
    for (k, &node) in order.iter().enumerate() {
        inverse[node as usize] = k as u32;
    }
    inverse
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::las::conformance::Random;

    /// Elimination by its definition: every node couples its later neighbors to each other.
    fn eliminate(graph: &Graph, tree: &Tree) -> Vec<Vec<u32>> {
        let n = graph.nodes();
        let mut full = vec![vec![false; n]; n];
        for (row, full) in full.iter_mut().enumerate() {
            for &node in graph.neighbors(tree.order[row] as usize) {
                full[tree.position[node as usize] as usize] = true;
            }
        }
        for column in 0..n {
            let below: Vec<usize> = (column + 1..n).filter(|&row| full[row][column]).collect();
            for &i in &below {
                for &j in &below {
                    full[i][j] = true;
                }
            }
        }
        (0..n).map(|column| (column + 1..n).filter(|&row| full[row][column]).map(|row| row as u32).collect()).collect()
    }

    #[test]
    fn the_tree_predicts_the_fill_in() {
        for seed in 0..30 {
            let mut random = Random::new(seed);
            let graph = Graph::new(&random.elements(1 + seed as usize));
            let mut order: Vec<u32> = (0..graph.nodes() as u32).collect();
            for k in (1..order.len()).rev() {
                order.swap(k, random.below(k + 1));
            }
            let tree = Tree::new(&graph, order);
            let columns = eliminate(&graph, &tree);
            let mut found = vec![Vec::new(); graph.nodes()];
            tree.for_each_entry(&graph, |row, column| found[column].push(row as u32));
            assert_eq!(found, columns);
            for (column, rows) in columns.iter().enumerate() {
                assert_eq!(tree.counts[column] as usize, rows.len() + 1);
                assert_eq!(tree.parent[column], rows.first().copied().unwrap_or(NONE));
            }
            let size = |position: usize| graph.size(tree.order[position] as usize);
            let of_column = |(column, rows): (usize, &Vec<u32>)| {
                size(column) * (size(column) + 1) / 2
                    + size(column) * rows.iter().map(|&row| size(row as usize)).sum::<usize>()
            };
            assert_eq!(tree.entries(), columns.iter().enumerate().map(of_column).sum::<usize>() as f64);
            // In postorder, the subtree of a position ends at that position, so its size determines its start.
            let mut first: Vec<u32> = (0..graph.nodes() as u32).collect();
            for position in 0..graph.nodes() {
                if let Some(of_parent) = first.get_mut(tree.parent[position] as usize) {
                    *of_parent = (*of_parent).min(position as u32);
                }
                let inside = |p: u32| tree.parent[p as usize] <= position as u32;
                let mut start = position as u32;
                while start > 0 && inside(start - 1) {
                    start -= 1;
                }
                assert!(start <= first[position]);
            }
        }
    }
}
