//! The fibers in the form that the kernels read.

use super::layout::{FIBER_LEN, INCIDENT_LEN};
use crate::backends::networks::{NONE, NetworkData, Plan};

/// Returns the sizes of the fibers, as `kernels/base.cu` stores them.
pub(super) fn sizes(network: &NetworkData) -> Vec<f64> {
    let size = |(&length, &area): (&f64, &f64)| -> [f64; FIBER_LEN] {
        [length, 1.0 / length, area, area / length, area * length]
    };
    network.lengths.iter().zip(&network.areas).flat_map(size).collect()
}

/// Returns the ends of the fibers, node after node: the node, the node at the other end, the fiber, the pair of nodes to
/// which this end adds the stiffness of the fiber, whether the fiber is the first of the pair, and whether the end is the
/// last of its node.
pub(super) fn incidents(plan: &Plan, nodes: usize) -> Vec<[u32; INCIDENT_LEN]> {
    let mut incidents = vec![Vec::new(); nodes];
    let mut is_known = vec![false; plan.pairs.len()];
    for (fiber, &[a, b]) in (0..).zip(&plan.ends) {
        let pair = plan.pair_of([a, b]);
        for (node, other) in [(a, b), (b, a)] {
            let adds = pair.filter(|_| node < other);
            let is_first = adds.is_some_and(|pair| !std::mem::replace(&mut is_known[pair], true));
            let pair = adds.map_or(NONE, |pair| pair as u32);
            incidents[node as usize].push([node, other, fiber, pair, u32::from(is_first), 0]);
        }
    }
    for [.., is_last] in incidents.iter_mut().filter_map(|of_node| of_node.last_mut()) {
        *is_last = 1;
    }
    incidents.concat()
}
