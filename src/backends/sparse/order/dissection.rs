//! Nested dissection: a separator splits the graph into two parts; it is eliminated after both parts, which are
//! dissected recursively.
//!
//! Reference: A. George, *Nested dissection of a regular finite element mesh*, SIAM Journal on Numerical Analysis 10
//! (1973), 345-363.

use faer::sparse::FaerError;

use super::graph::Graph;
use super::partition::Region;
use super::separator::separate;
use super::{NONE, minimum_degree};

/// Returns a nested-dissection order. Parts of at most `leaf` nodes are ordered by minimum degree.
pub(super) fn nested_dissection(graph: &Graph, leaf: usize) -> Result<Vec<u32>, FaerError> {
    let names: Vec<u32> = (0..graph.nodes() as u32).collect();
    let mut dissection = Dissection { leaf, order: Vec::with_capacity(names.len()), number: vec![NONE; names.len()] };
    dissection.dissect(graph, &names)?;
    Ok(dissection.order)
}

struct Dissection {
    leaf: usize,
    /// The nodes ordered so far, first eliminated first.
    order: Vec<u32>,
    /// Scratch for the extraction of subgraphs.
    number: Vec<u32>,
}

impl Dissection {
    /// Appends the order of a subgraph; `names` maps its nodes to those of the whole graph.
    fn dissect(&mut self, part: &Graph, names: &[u32]) -> Result<(), FaerError> {
        if part.nodes() <= self.leaf {
            return self.finish(part, names);
        }
        let component = part.components();
        let count = component.iter().max().map_or(0, |&last| last as usize + 1);
        if count > 1 {
            let mut members = vec![Vec::new(); count];
            for (node, &component) in component.iter().enumerate() {
                members[component as usize].push(node as u32);
            }
            return members.iter().try_for_each(|members| self.descend(part, names, members));
        }
        let Some(regions) = separate(part) else {
            return self.finish(part, names);
        };
        let at = |region: Region| -> Vec<u32> {
            (0..part.nodes() as u32).filter(|&node| regions[node as usize] == region).collect()
        };
        self.descend(part, names, &at(Region::Left))?;
        self.descend(part, names, &at(Region::Right))?;
        let separator = at(Region::Separator);
        let graph = part.part(&separator, &mut self.number);
        self.finish(&graph, &name(&separator, names))
    }

    fn descend(&mut self, part: &Graph, names: &[u32], members: &[u32]) -> Result<(), FaerError> {
        let graph = part.part(members, &mut self.number);
        self.dissect(&graph, &name(members, names))
    }

    /// Appends a subgraph in minimum-degree order, without further dissection.
    fn finish(&mut self, part: &Graph, names: &[u32]) -> Result<(), FaerError> {
        self.order.extend(name(&minimum_degree(part)?, names));
        Ok(())
    }
}

fn name(nodes: &[u32], names: &[u32]) -> Vec<u32> {
    nodes.iter().map(|&node| names[node as usize]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backends::sparse::order::Tree;
    use crate::las::Sparsity;
    use crate::las::conformance::Random;

    /// A cube of `n` nodes per side, in which all nodes of a cell couple to each other.
    fn grid(n: i32) -> Graph {
        let at = |x: i32, y: i32, z: i32| (x * n + y) * n + z;
        let inside = move |k: &(i32, i32, i32)| k.0 + 1 < n && k.1 + 1 < n && k.2 + 1 < n;
        let cells = (0..n * n * n).map(|k| (k / (n * n), k / n % n, k % n)).filter(inside);
        let corners = cells.map(|(x, y, z)| [0, 1, 2, 3, 4, 5, 6, 7].map(|k| at(x + k / 4, y + k / 2 % 2, z + k % 2)));
        Graph::new(&Sparsity::from_elements((n * n * n) as usize, corners).unwrap())
    }

    #[test]
    fn every_node_is_eliminated_once_whatever_the_graph() {
        let mut random = Random::new(8);
        let star = Sparsity::from_elements(90, (1..90).map(|k| [0, k])).unwrap();
        let all = Sparsity::from_elements(40, [(0..40).collect::<Vec<i32>>()]).unwrap();
        let path = Sparsity::from_elements(300, (1..300).map(|k| [k - 1, k])).unwrap();
        let isolated = Sparsity::from_elements(50, [[3, 4]]).unwrap();
        let patterns = [star, all, path, isolated, Sparsity::clone(&random.elements(200))];
        let graphs = patterns.iter().map(Graph::new).chain([grid(7)]);
        for graph in graphs {
            for leaf in [0, 1, 10] {
                let mut order = nested_dissection(&graph, leaf).unwrap();
                order.sort_unstable();
                assert_eq!(order, (0..graph.nodes() as u32).collect::<Vec<_>>());
            }
        }
    }

    #[test]
    fn dissection_beats_minimum_degree_in_three_dimensions() {
        let graph = grid(13);
        let operations = |order| Tree::new(&graph, order).operations();
        let by_degree = operations(minimum_degree(&graph).unwrap());
        let by_dissection = operations(nested_dissection(&graph, 12).unwrap());
        assert!(by_dissection < 0.8 * by_degree, "{by_dissection:e} against {by_degree:e}");
    }
}
