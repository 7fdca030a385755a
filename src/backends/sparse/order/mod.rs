//! The elimination order.
//!
//! The order determines the fill-in of the factor. It is computed on the graph of the nodes: if each node has three
//! unknowns, this graph gives the same fill-in as the graph of the unknowns with a ninth of its entries.

mod coarse;
mod dissection;
mod graph;
mod partition;
mod separator;
mod tree;

use std::convert::Infallible;

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::linalg::amd;
use faer::sparse::{FaerError, SymbolicSparseColMatRef};

use super::analysis::failed;
use crate::las::{Ordering, SolveError};
pub(super) use graph::{BLOCK, Graph};
pub(super) use tree::{Tree, inverse};

/// Marks a missing node or position.
pub(super) const NONE: u32 = u32::MAX;

/// The largest size of the parts that nested dissection orders by minimum degree.
const LEAF_SIZE: usize = 12;

/// The ratio of operations below which an order is preferred to minimum degree, whose long chains give better
/// supernodes.
const PREFERENCE_RATIO: f64 = 0.95;

/// The number of nodes up to which only minimum degree is tried, because no other order is noticeably better.
const SMALL_GRAPH: usize = 40;

/// Returns the elimination tree of the graph in the requested order.
///
/// # Errors
/// Returns [`SolveError::Library`] if the order is not compiled in or the library that computes it fails.
pub(super) fn eliminate(graph: &Graph, ordering: Ordering) -> Result<Tree, SolveError<Infallible>> {
    let by_degree = || Ok(Tree::new(graph, minimum_degree(graph).map_err(failed)?));
    let by_dissection = || Ok(Tree::new(graph, dissection::nested_dissection(graph, LEAF_SIZE).map_err(failed)?));
    match ordering {
        Ordering::MinimumDegree => by_degree(),
        Ordering::NestedDissection => by_dissection(),
        Ordering::Metis => Ok(Tree::new(graph, metis(graph)?)),
        Ordering::Auto => {
            let first = by_degree()?;
            if graph.nodes() <= SMALL_GRAPH {
                return Ok(first);
            }
            let mut best = by_dissection()?;
            if cfg!(feature = "metis") {
                let other = Tree::new(graph, metis(graph)?);
                best = if other.operations() < best.operations() { other } else { best };
            }
            Ok(if best.operations() < PREFERENCE_RATIO * first.operations() { best } else { first })
        }
    }
}

#[cfg(feature = "metis")]
fn metis(graph: &Graph) -> Result<Vec<u32>, SolveError<Infallible>> {
    crate::backends::metis::nested_dissection(&graph.start, &graph.neighbors)
        .map_err(|reason| SolveError::Library { library: "METIS", reason })
}

#[cfg(not(feature = "metis"))]
fn metis(_: &Graph) -> Result<Vec<u32>, SolveError<Infallible>> {
    let reason = "it is not compiled in; build with `--features metis`, or ask for another ordering".to_owned();
    Err(SolveError::Library { library: "METIS", reason })
}

/// Returns the approximate minimum degree order, which always eliminates a node of (about) the smallest degree next.
///
/// Reference: P. R. Amestoy, T. A. Davis, I. S. Duff, *An approximate minimum degree ordering algorithm*, SIAM Journal
/// on Matrix Analysis and Applications 17 (1996), 886-905.
fn minimum_degree(graph: &Graph) -> Result<Vec<u32>, FaerError> {
    let n = graph.nodes();
    let matrix = SymbolicSparseColMatRef::new_checked(n, n, &graph.start, None, &graph.neighbors);
    let (mut order, mut position) = (vec![0; n], vec![0; n]);
    let mut memory = MemBuffer::new(amd::order_scratch::<u32>(n, graph.neighbors.len()));
    amd::order(&mut order, &mut position, matrix, amd::Control::default(), MemStack::new(&mut memory))?;
    Ok(order)
}

#[cfg(all(test, feature = "metis"))]
mod tests {
    use super::*;
    use crate::las::conformance::Random;

    #[test]
    fn every_node_is_eliminated_once() {
        for nodes in [1, 2, 50, 300] {
            let graph = Graph::new(&Random::new(nodes as u64).elements(nodes));
            let mut order = metis(&graph).unwrap();
            assert_eq!(order, metis(&graph).unwrap(), "the same order again");
            order.sort_unstable();
            // Consecutive unknowns with the same couplings form one node.
            assert_eq!(order, (0..graph.nodes() as u32).collect::<Vec<_>>());
        }
    }
}
