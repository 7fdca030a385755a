//! Nested-dissection orders by METIS.
//!
//! Reference: G. Karypis, V. Kumar, *A fast and high quality multilevel scheme for partitioning irregular graphs*, SIAM
//! Journal on Scientific Computing 20 (1998), 359-392.
#![allow(unsafe_code)]

use std::convert::Infallible;
use std::ptr::null_mut;
use std::sync::PoisonError;

use metis_sys::{METIS_NodeND, idx_t, rstatus_et_METIS_OK};

use super::graph::Graph;
use crate::backends::metis::ONE_AT_A_TIME;
use crate::las::SolveError;

/// Returns a nested-dissection order computed by METIS.
pub(super) fn nested_dissection(graph: &Graph) -> Result<Vec<u32>, SolveError<Infallible>> {
    let n = graph.nodes();
    // METIS rejects a graph without edges; any order of such a graph is equally good.
    if graph.neighbors.is_empty() {
        return Ok((0..n as u32).collect());
    }
    let mut nodes = n as idx_t;
    let mut start: Vec<idx_t> = graph.start.iter().map(|&k| k as idx_t).collect();
    let mut neighbors: Vec<idx_t> = graph.neighbors.iter().map(|&k| k as idx_t).collect();
    let (mut order, mut position): (Vec<idx_t>, Vec<idx_t>) = (vec![0; n], vec![0; n]);
    let guard = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
    // SAFETY: `start` and `neighbors` are the compressed rows of a symmetric graph of `nodes` nodes without loops, as
    // METIS requires; both results have one entry per node. Null selects unit weights and the default options.
    let status = unsafe {
        METIS_NodeND(
            &raw mut nodes,
            start.as_mut_ptr(),
            neighbors.as_mut_ptr(),
            null_mut(),
            null_mut(),
            order.as_mut_ptr(),
            position.as_mut_ptr(),
        )
    };
    drop(guard);
    if status == rstatus_et_METIS_OK {
        Ok(order.into_iter().map(|node| node as u32).collect())
    } else {
        Err(SolveError::Library { library: "METIS", reason: format!("status {status} instead of an order") })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::las::conformance::Random;

    #[test]
    fn every_node_is_eliminated_once() {
        for nodes in [1, 2, 50, 300] {
            let graph = Graph::new(&Random::new(nodes as u64).elements(nodes));
            let mut order = nested_dissection(&graph).unwrap();
            assert_eq!(order, nested_dissection(&graph).unwrap(), "the same order again");
            order.sort_unstable();
            // Consecutive unknowns with the same couplings form one node.
            assert_eq!(order, (0..graph.nodes() as u32).collect::<Vec<_>>());
        }
    }
}
