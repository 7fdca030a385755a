//! METIS: graph partitioning, and nested-dissection orders for the backend `sparse`.
//!
//! Reference: G. Karypis, V. Kumar, *A fast and high quality multilevel scheme for partitioning irregular graphs*, SIAM
//! Journal on Scientific Computing 20 (1998), 359-392.
#![allow(unsafe_code, reason = "the interface to a C library")]

use std::ffi::c_int;
use std::ptr::null_mut;
use std::sync::{Mutex, PoisonError};

use metis_sys::{METIS_NodeND, METIS_PartGraphRecursive, idx_t, real_t, rstatus_et_METIS_OK};

/// METIS uses the random numbers of the C library, which are one sequence per process. The lock admits one caller at a
/// time, so that results do not depend on other threads.
static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());

/// A graph: the neighbors of its nodes, each of which has the node as a neighbor. Any sequence of lists is one.
pub trait Graph {
    /// The number of nodes.
    fn nodes(&self) -> usize;

    /// The neighbors of a node.
    fn near(&self, node: usize) -> &[u32];

    /// The weights of the edges to these neighbors, the same at both nodes of an edge; nothing if all have the same.
    fn edge_weights(&self, _node: usize) -> &[i32] {
        &[]
    }
}

impl<T: AsRef<[Vec<u32>]> + ?Sized> Graph for T {
    fn nodes(&self) -> usize {
        self.as_ref().len()
    }

    fn near(&self, node: usize) -> &[u32] {
        &self.as_ref()[node]
    }
}

/// Partitions a graph into `parts` parts with about equal numbers of nodes and few edges between them; returns the part
/// of every node.
///
/// # Errors
/// Returns a message if a neighbor is out of range or METIS fails (with its status).
pub fn partition(graph: &(impl Graph + ?Sized), parts: usize) -> Result<Vec<u32>, String> {
    partition_weighted(graph, &[], parts)
}

/// Partitions a graph as [`partition`] does, into parts of about equal weight: `weights` contains the weight of every
/// node, at least zero, or nothing if all have the same. Their sum must be below 2^31.
///
/// # Errors
/// Returns the errors of [`partition`], and a message if the number of weights, a weight, or their sum is out of range.
pub fn partition_weighted(graph: &(impl Graph + ?Sized), weights: &[i32], parts: usize) -> Result<Vec<u32>, String> {
    let nodes = graph.nodes();
    let sum: i64 = weights.iter().map(|&weight| i64::from(weight)).sum();
    let fits = weights.is_empty() || weights.len() == nodes;
    if !fits || weights.iter().any(|&weight| weight < 0) || sum > i64::from(i32::MAX) {
        return Err(format!("{} weights with the sum {sum} for {nodes} nodes", weights.len()));
    }
    if (0..nodes).flat_map(|node| graph.near(node)).any(|&node| node as usize >= nodes) {
        return Err(format!("a neighbor beyond the last of {nodes} nodes"));
    }
    let mut bisection = Bisection { graph, weights, part_of: vec![0; nodes], number_of: vec![NONE; nodes] };
    bisection.divide((0..nodes as u32).collect(), 0, parts)?;
    Ok(bisection.part_of)
}

/// Recursive bisection of a graph, as METIS does it in one call. There METIS prints to the standard output of the
/// program if a part of a bisection, which is to be divided further, has no node; here this part gets as many parts as
/// it has nodes.
struct Bisection<'a, G: ?Sized> {
    graph: &'a G,
    /// Empty if all nodes have the same weight.
    weights: &'a [i32],
    part_of: Vec<u32>,
    /// The number of each node among those to be bisected; [`NONE`] for all others.
    number_of: Vec<u32>,
}

/// The number of a node that is not to be bisected.
const NONE: u32 = u32::MAX;

impl<G: Graph + ?Sized> Bisection<'_, G> {
    /// Divides nodes into so many parts from number `first`. Every part gets a node if there are enough of them.
    fn divide(&mut self, nodes: Vec<u32>, first: u32, parts: usize) -> Result<(), String> {
        if parts <= 1 || nodes.len() <= parts {
            let last = parts.saturating_sub(1) as u32;
            (0..).zip(&nodes).for_each(|(k, &node)| self.part_of[node as usize] = first + last.min(k));
            return Ok(());
        }
        let below = parts / 2;
        let is_below = self.bisect(&nodes, below as f64 / parts as f64)?;
        let mut is_below = is_below.into_iter();
        let (lower, upper): (Vec<u32>, Vec<u32>) = nodes.into_iter().partition(|_| is_below.next().unwrap_or(false));
        let below = below.clamp(parts.saturating_sub(upper.len()), lower.len());
        self.divide(lower, first, below)?;
        self.divide(upper, first + below as u32, parts - below)
    }

    /// Returns for each of at least three nodes whether it belongs to the first of two sets, which has about `share` of
    /// the weight. None of the sets is empty.
    fn bisect(&mut self, nodes: &[u32], share: f64) -> Result<Vec<bool>, String> {
        (0..).zip(nodes).for_each(|(number, &node)| self.number_of[node as usize] = number);
        let mut rows = Rows { start: vec![0], neighbors: Vec::new(), of_edges: Vec::new() };
        for &node in nodes {
            let (near, weights) = (self.graph.near(node as usize), self.graph.edge_weights(node as usize));
            for (k, &near) in near.iter().enumerate() {
                let number = self.number_of[near as usize];
                if number != NONE {
                    rows.neighbors.push(number as idx_t);
                    rows.of_edges.extend(weights.get(k).map(|&weight| weight as idx_t));
                }
            }
            rows.start.push(rows.neighbors.len() as idx_t);
        }
        nodes.iter().for_each(|&node| self.number_of[node as usize] = NONE);
        let weights: Vec<idx_t> =
            nodes.iter().map(|&node| self.weights.get(node as usize).map_or(1, |&weight| weight as idx_t)).collect();
        // METIS rejects a graph without edges.
        if !rows.neighbors.is_empty() && weights.iter().any(|&weight| weight > 0) {
            let is_first = bisect_by_metis(rows, weights.clone(), share)?;
            if is_first.contains(&true) && is_first.contains(&false) {
                return Ok(is_first);
            }
        }
        Ok(bisect_in_order(&weights, share))
    }
}

/// Bisects a sequence of at least two nodes into two intervals, the first of about `share` of the weight.
fn bisect_in_order(weights: &[idx_t], share: f64) -> Vec<bool> {
    let sum: f64 = weights.iter().map(|&weight| f64::from(weight)).sum();
    let weight_of = |weight: idx_t| if sum > 0.0 { f64::from(weight) } else { 1.0 };
    let all = if sum > 0.0 { sum } else { weights.len() as f64 };
    let (mut before, last) = (0.0, weights.len() - 1);
    let is_first = |(number, &weight): (usize, &idx_t)| {
        before += weight_of(weight);
        number == 0 || (number < last && before - 0.5 * weight_of(weight) < share * all)
    };
    weights.iter().enumerate().map(is_first).collect()
}

/// The compressed rows of a graph.
struct Rows {
    start: Vec<idx_t>,
    neighbors: Vec<idx_t>,
    /// The weight of the edge to each neighbor; of fewer neighbors if all have the same.
    of_edges: Vec<idx_t>,
}

/// Bisects the graph with these compressed rows and weights of nodes.
fn bisect_by_metis(rows: Rows, mut weights: Vec<idx_t>, share: f64) -> Result<Vec<bool>, String> {
    let Rows { mut start, mut neighbors, mut of_edges } = rows;
    let of_edges = if of_edges.len() == neighbors.len() { of_edges.as_mut_ptr() } else { null_mut() };
    let (mut nodes, mut constraints, mut count, mut cut) = (weights.len() as idx_t, 1, 2, 0);
    let mut shares = [share as real_t, (1.0 - share) as real_t];
    let mut part_of: Vec<idx_t> = vec![0; weights.len()];
    // SAFETY: `start` and `neighbors` are the compressed rows of a graph of `nodes` nodes, whose neighbors are all below
    // `nodes`. The weights and the result have one entry per node, the shares one per part. `of_edges` is null or has one
    // entry per neighbor. Null selects equal sizes and weights of edges, and the default options.
    let call = || unsafe {
        METIS_PartGraphRecursive(
            &raw mut nodes,
            &raw mut constraints,
            start.as_mut_ptr(),
            neighbors.as_mut_ptr(),
            weights.as_mut_ptr(),
            null_mut(),
            of_edges,
            &raw mut count,
            shares.as_mut_ptr(),
            null_mut(),
            null_mut(),
            &raw mut cut,
            part_of.as_mut_ptr(),
        )
    };
    locked(call).map_err(|status| format!("METIS: status {status} instead of a partition"))?;
    Ok(part_of.into_iter().map(|part| part == 0).collect())
}

/// Returns a nested-dissection order of the nodes of a symmetric graph without loops, given by compressed rows.
///
/// # Errors
/// Returns a message if the arrays are not compressed rows or METIS fails.
pub(super) fn nested_dissection(start: &[u32], neighbors: &[u32]) -> Result<Vec<u32>, String> {
    let n = start.len().saturating_sub(1);
    let are_rows = start.is_sorted() && start.first() == Some(&0) && start.last() == Some(&(neighbors.len() as u32));
    if !are_rows || neighbors.iter().any(|&node| node as usize >= n) {
        return Err(format!("no compressed rows of a graph of {n} nodes"));
    }
    // METIS rejects a graph without edges; any order of such a graph is equally good.
    if neighbors.is_empty() {
        return Ok((0..n as u32).collect());
    }
    let mut nodes = n as idx_t;
    let mut start: Vec<idx_t> = start.iter().map(|&k| k as idx_t).collect();
    let mut neighbors: Vec<idx_t> = neighbors.iter().map(|&k| k as idx_t).collect();
    let (mut order, mut position): (Vec<idx_t>, Vec<idx_t>) = (vec![0; n], vec![0; n]);
    // SAFETY: `start` and `neighbors` are compressed rows of a graph of `nodes` nodes, checked above; `sparse::order::graph::Graph`
    // guarantees that it is symmetric and has no loops. Both results have one entry per node. Null selects unit weights
    // and the default options.
    let call = || unsafe {
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
    locked(call).map_err(|status| format!("status {status} instead of an order"))?;
    Ok(order.into_iter().map(|node| node as u32).collect())
}

/// Makes a call of METIS under the lock; returns the status if it failed.
fn locked(call: impl FnOnce() -> c_int) -> Result<(), c_int> {
    let _alone = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
    let status = call();
    if status == rstatus_et_METIS_OK { Ok(()) } else { Err(status) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ring_is_partitioned_into_arcs() {
        let near: Vec<Vec<u32>> = (0..60_u32).map(|k| vec![(k + 59) % 60, (k + 1) % 60]).collect();
        let part_of = partition(&near, 3).unwrap();
        assert_eq!(part_of, partition(&near, 3).unwrap(), "the same again");
        let between = (0..60).filter(|&k| part_of[k] != part_of[(k + 1) % 60]).count();
        assert_eq!(between, 3);
        assert!((0..3).all(|part| part_of.iter().filter(|&&p| p == part).count() >= 17), "{part_of:?}");
    }

    #[test]
    fn parts_of_a_chain_have_equal_weight() {
        let near: Vec<Vec<u32>> =
            (0..40_u32).map(|k| (k.max(1) - 1..(k + 2).min(40)).filter(|&n| n != k).collect()).collect();
        let weights: Vec<i32> = (0..40).map(|k| if k < 10 { 3 } else { 1 }).collect();
        let part_of = partition_weighted(&near, &weights, 2).unwrap();
        let first: i32 = (0..40).filter(|&k| part_of[k] == part_of[0]).map(|k| weights[k]).sum();
        assert!((27..=33).contains(&first), "{part_of:?}");
    }

    /// A ring of two heavy and two light edges is cut at the light ones.
    #[test]
    fn heavy_edges_are_not_cut() {
        struct Ring([[i32; 2]; 4]);
        const NEAR: [[u32; 2]; 4] = [[3, 1], [0, 2], [1, 3], [2, 0]];
        impl Graph for Ring {
            fn nodes(&self) -> usize {
                4
            }
            fn near(&self, node: usize) -> &[u32] {
                &NEAR[node]
            }
            fn edge_weights(&self, node: usize) -> &[i32] {
                &self.0[node]
            }
        }
        let of = |[a, b]: [i32; 2]| partition(&Ring([[b, a], [a, b], [b, a], [a, b]]), 2).unwrap();
        let (one, other) = (of([9, 1]), of([1, 9]));
        assert!(one[0] == one[1] && one[2] == one[3] && one[0] != one[2], "{one:?}");
        assert!(other[1] == other[2] && other[3] == other[0] && other[0] != other[1], "{other:?}");
    }

    /// Every part has a node if there are enough, and METIS, which prints when it divides nothing, never does. The prints
    /// of C are not captured by the test harness, so that the partitions are made in a process of their own.
    #[test]
    fn few_or_heavy_nodes_are_partitioned_in_silence() {
        let name = "few_or_heavy_nodes_are_partitioned_in_silence";
        if std::env::var_os("BIOTISSUE_PARTITION").is_none() {
            let mut own = std::process::Command::new(std::env::current_exe().unwrap());
            own.args([name, "--nocapture"]).env("BIOTISSUE_PARTITION", "1");
            let own = own.output().unwrap();
            let text = String::from_utf8(own.stdout).unwrap();
            assert!(own.status.success() && text.contains("1 passed"), "{text}");
            assert!(!text.contains("***"), "{text}");
            return;
        }
        let chain = |nodes: u32| -> Vec<Vec<u32>> {
            (0..nodes).map(|k| (k.max(1) - 1..(k + 2).min(nodes)).filter(|&n| n != k).collect()).collect()
        };
        let heavy = |nodes: u32, count: u32| -> Vec<i32> {
            (0..nodes).map(|k| if k < count { 100_000 } else { k as i32 % 2 }).collect()
        };
        for (nodes, count, parts) in [(2, 0, 8), (3, 1, 8), (8, 1, 8), (9, 9, 8), (40, 1, 16), (40, 3, 7), (200, 5, 64)]
        {
            let part_of = partition_weighted(&chain(nodes), &heavy(nodes, count), parts).unwrap();
            let filled = (0..parts as u32).filter(|part| part_of.contains(part)).count();
            assert_eq!(filled, parts.min(nodes as usize), "{nodes} nodes, {parts} parts: {part_of:?}");
            assert!(partition(&chain(nodes), parts).unwrap().iter().all(|&part| (part as usize) < parts));
        }
    }

    #[test]
    fn graphs_without_edges_are_accepted_and_invalid_ones_rejected() {
        let free = [vec![], vec![], vec![], vec![]];
        assert_eq!(partition(&free, 2), Ok(vec![0, 0, 1, 1]));
        assert_eq!(partition_weighted(&free, &[9, 1, 1, 1], 2), Ok(vec![0, 1, 1, 1]));
        assert_eq!(partition_weighted(&free, &[0; 4], 2), Ok(vec![0, 0, 1, 1]));
        assert_eq!((partition(&free, 0), partition(&[], 3)), (Ok(vec![0; 4]), Ok(vec![])));
        assert!(partition(&[vec![1]], 2).is_err());
        let pair = [vec![1], vec![0]];
        assert!(
            [&[1][..], &[-1, 2], &[i32::MAX, 1]].iter().all(|weights| partition_weighted(&pair, weights, 2).is_err())
        );
        assert!(nested_dissection(&[0, 1, 2], &[1, 2]).is_err(), "a neighbor beyond the last node");
        assert!(nested_dissection(&[0, 1, 3], &[1, 0]).is_err(), "offsets beyond the neighbors");
        assert!(nested_dissection(&[], &[]).is_err());
    }
}
