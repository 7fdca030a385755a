//! Small node separators that split a connected graph into two parts of about the same size.
//!
//! The graph is coarsened by merging pairs of neighbors until few nodes are left (`coarse.rs`). On the coarsest graph,
//! two nodes far from each other are selected, and every node is assigned the difference of its distances to them. A
//! few sweeps of averaging over neighbors smooth this field (they are power iterations toward the eigenvector of the
//! second-smallest eigenvalue of the graph Laplacian), and its median splits the nodes; the nodes of one half that are
//! adjacent to the other half form the separator. The best of several such separators are projected back to the finer
//! graphs one by one and refined on each by moves of single nodes.
//!
//! References: G. Karypis, V. Kumar, *A fast and high quality multilevel scheme for partitioning irregular graphs*,
//! SIAM Journal on Scientific Computing 20 (1998), 359-392; for the moves, C. M. Fiduccia, R. M. Mattheyses, *A
//! linear-time heuristic for improving network partitions*, 19th Design Automation Conference (1982), 175-181, and for
//! separators of nodes, C. Ashcraft, J. W. H. Liu, *Applications of the Dulmage-Mendelsohn decomposition and network
//! flow to graph bisection improvement*, SIAM Journal on Matrix Analysis and Applications 19 (1998), 325-354.

use super::NONE;
use super::coarse::Weighted;
use super::graph::Graph;
use super::partition::{Partition, Region};

/// The number of averaging sweeps.
const SWEEPS: usize = 12;

/// The number of directions (pairs of distant nodes) tried on the coarsest graph.
const DIRECTIONS: usize = 12;

/// The number of separators of the coarsest graph that are refined up to the finest.
const CANDIDATES: usize = 8;

/// The number of nodes at or below which a graph is not coarsened further.
const COARSEST: usize = 200;

/// The largest fraction of the nodes that a coarsening step may leave; otherwise coarsening stops.
const LEAST_COARSENING: f64 = 0.9;

/// Returns the best separator found in a connected graph; `None` if no separator leaves two parts.
pub(super) fn separate(graph: &Graph) -> Option<Vec<Region>> {
    let finest = Weighted::new(graph);
    let mut coarser: Vec<Weighted> = Vec::new();
    let mut parents: Vec<Vec<u32>> = Vec::new();
    loop {
        let last = coarser.last().unwrap_or(&finest);
        if last.nodes() <= COARSEST {
            break;
        }
        let (coarse, parent) = last.coarsen();
        if coarse.nodes() as f64 > LEAST_COARSENING * last.nodes() as f64 {
            break;
        }
        coarser.push(coarse);
        parents.push(parent);
    }
    let mut candidates = first_guesses(coarser.last().unwrap_or(&finest));
    candidates.truncate(CANDIDATES);
    for (level, parent) in parents.iter().enumerate().rev() {
        let graph = if level == 0 { &finest } else { &coarser[level - 1] };
        for (_, regions) in &mut candidates {
            let fine = parent.iter().map(|&coarse| regions[coarse as usize]).collect();
            let mut partition = Partition::new(graph, fine);
            partition.refine();
            *regions = partition.regions;
        }
    }
    let proper =
        candidates.into_iter().map(|(_, regions)| Partition::new(&finest, regions)).filter(Partition::is_proper);
    proper.min_by(|a, b| a.cost().total_cmp(&b.cost())).map(|partition| partition.regions)
}

/// Returns separators of the coarsest graph by the median of several fields, the best first, each with its cost.
fn first_guesses(graph: &Weighted) -> Vec<(f64, Vec<Region>)> {
    let mut guesses = Vec::new();
    let mut nearest = vec![NONE; graph.nodes()];
    let mut start = farthest(&graph.distances(0));
    for _ in 0..DIRECTIONS {
        let from = graph.distances(start);
        let end = farthest(&from);
        let to = graph.distances(end);
        let mut field: Vec<f64> = from.iter().zip(&to).map(|(&a, &b)| f64::from(a) - f64::from(b)).collect();
        graph.smooth(&mut field, SWEEPS);
        let mut partition = Partition::new(graph, halves(graph, &field));
        partition.refine();
        if partition.is_proper() {
            guesses.push((partition.cost(), partition.regions));
        }
        // The next direction starts far from the end nodes of the previous ones.
        for (nearest, distances) in nearest.iter_mut().zip(from.iter().zip(&to)) {
            *nearest = (*nearest).min(*distances.0).min(*distances.1);
        }
        start = farthest(&nearest);
    }
    guesses.sort_by(|a, b| a.0.total_cmp(&b.0));
    guesses
}

/// Splits the nodes at the median of a field, by weight; nodes of the upper half adjacent to the lower half form the
/// separator.
fn halves(graph: &Weighted, field: &[f64]) -> Vec<Region> {
    let mut sorted: Vec<u32> = (0..graph.nodes() as u32).collect();
    sorted.sort_by(|&a, &b| field[a as usize].total_cmp(&field[b as usize]));
    let mut regions = vec![Region::Right; graph.nodes()];
    let mut weight = 0;
    for &node in &sorted {
        weight += graph.weights[node as usize];
        if 2 * weight > graph.total {
            break;
        }
        regions[node as usize] = Region::Left;
    }
    let touches = |node: usize| graph.neighbors(node).iter().any(|&(o, _)| regions[o as usize] == Region::Left);
    let between = |node: usize| regions[node] == Region::Right && touches(node);
    let separator: Vec<usize> = (0..graph.nodes()).filter(|&node| between(node)).collect();
    separator.into_iter().for_each(|node| regions[node] = Region::Separator);
    regions
}

/// Returns the first node with the largest distance.
fn farthest(distances: &[u32]) -> usize {
    let largest = distances.iter().copied().max().unwrap_or(0);
    distances.iter().position(|&distance| distance == largest).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::las::Sparsity;

    #[test]
    fn separators_separate_and_are_small() {
        // A long strip of 6 x 50 nodes: every separator has at least 6 nodes.
        let at = |x: i32, y: i32| 6 * x + y;
        let bars = (0..50).flat_map(|x| {
            (0..6).flat_map(move |y| [[at(x, y), at((x + 1).min(49), y)], [at(x, y), at(x, (y + 1).min(5))]])
        });
        let graph = Graph::new(&Sparsity::from_elements(300, bars).unwrap());
        let regions = separate(&graph).unwrap();
        let count = |region| regions.iter().filter(|&&p| p == region).count();
        assert_eq!(count(Region::Separator), 6);
        assert!(count(Region::Left).min(count(Region::Right)) > 100);
        for node in 0..300 {
            let opposite = regions[node].opposite();
            let crosses = |&other: &u32| regions[other as usize] == opposite;
            assert!(regions[node] == Region::Separator || !graph.neighbors(node).iter().any(crosses));
        }
    }

    #[test]
    fn a_graph_without_a_separator_gives_none() {
        let all = Sparsity::from_elements(30, [(0..30).collect::<Vec<i32>>()]).unwrap();
        assert_eq!(separate(&Graph::new(&all)), None);
    }
}
