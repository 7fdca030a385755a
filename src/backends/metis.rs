//! METIS: graph partitioning, and nested-dissection orders for the backend `sparse`.
//!
//! Reference: G. Karypis, V. Kumar, *A fast and high quality multilevel scheme for partitioning irregular graphs*, SIAM
//! Journal on Scientific Computing 20 (1998), 359-392.
#![allow(unsafe_code, reason = "the interface to a C library")]

use std::ffi::c_int;
use std::ptr::null_mut;
use std::sync::{Mutex, PoisonError};

use metis_sys::{METIS_NodeND, METIS_PartGraphRecursive, idx_t, rstatus_et_METIS_OK};

/// METIS uses the random numbers of the C library, which are one sequence per process. The lock admits one caller at a
/// time, so that results do not depend on other threads.
static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());

/// Partitions a graph into `parts` parts with about equal numbers of nodes and few edges between them; returns the part
/// of every node. `near[node]` lists the neighbors of a node, each of which must also list that node.
///
/// # Errors
/// Returns a message if a neighbor is out of range or METIS fails (with its status).
pub fn partition(near: &[Vec<u32>], parts: usize) -> Result<Vec<u32>, String> {
    partition_weighted(near, &[], parts)
}

/// Partitions a graph as [`partition`] does, into parts of about equal weight: `weights` contains the weight of every
/// node, at least zero, or nothing if all have the same. Their sum must be below 2^31.
///
/// # Errors
/// Returns the errors of [`partition`], and a message if the number of weights, a weight, or their sum is out of range.
pub fn partition_weighted(near: &[Vec<u32>], weights: &[i32], parts: usize) -> Result<Vec<u32>, String> {
    let sum: i64 = weights.iter().map(|&weight| i64::from(weight)).sum();
    let fits = weights.is_empty() || weights.len() == near.len();
    if !fits || weights.iter().any(|&weight| weight < 0) || sum > i64::from(i32::MAX) {
        return Err(format!("{} weights with the sum {sum} for {} nodes", weights.len(), near.len()));
    }
    if near.iter().flatten().any(|&node| node as usize >= near.len()) {
        return Err(format!("a neighbor beyond the last of {} nodes", near.len()));
    }
    // METIS rejects graphs without edges, and partitions into a single part.
    if parts <= 1 || near.iter().all(Vec::is_empty) {
        return Ok((0..near.len()).map(|node| (node * parts.max(1) / near.len().max(1)) as u32).collect());
    }
    let mut start: Vec<idx_t> = vec![0];
    let mut neighbors: Vec<idx_t> = Vec::new();
    for near in near {
        neighbors.extend(near.iter().map(|&node| node as idx_t));
        start.push(neighbors.len() as idx_t);
    }
    let (mut nodes, mut constraints, mut count, mut cut) = (near.len() as idx_t, 1, parts as idx_t, 0);
    let mut part_of: Vec<idx_t> = vec![0; near.len()];
    let mut weights: Vec<idx_t> = weights.iter().map(|&weight| weight as idx_t).collect();
    let weights_or_null = if weights.is_empty() { null_mut() } else { weights.as_mut_ptr() };
    // SAFETY: `start` and `neighbors` are the compressed rows of a graph of `nodes` nodes, checked above; the result
    // has one entry per node, and so have the weights, which live as long as the call. Null selects unit weights, equal
    // parts and the default options.
    let call = || unsafe {
        METIS_PartGraphRecursive(
            &raw mut nodes,
            &raw mut constraints,
            start.as_mut_ptr(),
            neighbors.as_mut_ptr(),
            weights_or_null,
            null_mut(),
            null_mut(),
            &raw mut count,
            null_mut(),
            null_mut(),
            null_mut(),
            &raw mut cut,
            part_of.as_mut_ptr(),
        )
    };
    locked(call).map_err(|status| format!("METIS: status {status} instead of a partition"))?;
    Ok(part_of.into_iter().map(|part| part as u32).collect())
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
    // SAFETY: `start` and `neighbors` are compressed rows of a graph of `nodes` nodes, checked above; `Graph`
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

    #[test]
    fn graphs_without_edges_are_accepted_and_invalid_ones_rejected() {
        assert_eq!(partition(&[vec![], vec![], vec![], vec![]], 2), Ok(vec![0, 0, 1, 1]));
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
