//! Removal of the parts of a network that carry no load.

use std::collections::HashSet;

use super::components::roots;
use super::merge::{Merged, merge_doubled};
use crate::fiber::network::{BOUNDARY_TOLERANCE, Cube, Network, NetworkError};

/// A cleaned network and the counts of the removed parts.
#[derive(Clone, Debug, PartialEq)]
pub struct Cleaned {
    /// The remaining network, with its materials.
    pub network: Network,
    /// The remaining nodes, by their former numbers.
    pub kept_nodes: Vec<u32>,
    /// The remaining fibers, by their former numbers; of merged fibers the first.
    pub kept_fibers: Vec<u32>,
    /// Number of remaining fibers that join the same two nodes as an earlier one, because their laws differ or the
    /// network has no laws.
    pub kept_doubled_fibers: usize,
    /// The counts of removed fibers and nodes.
    pub removed: Removed,
}

/// The counts of removed fibers and nodes; each fiber is counted once, under the first reason that applies.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "app", derive(serde::Serialize))]
pub struct Removed {
    /// Number of fibers shorter than the given length.
    pub short_fibers: usize,
    /// Number of dangling fibers: those at an interior node with a single neighbor, including nodes that lose all but
    /// one neighbor when other fibers are removed.
    pub dangling_fibers: usize,
    /// Number of fibers of components that are not connected to the boundary.
    pub unsupported_fibers: usize,
    /// Number of fibers merged into an earlier fiber with the same two nodes and the same law.
    pub merged_fibers: usize,
    /// Number of nodes removed because no fiber is left at them.
    pub nodes: usize,
}

impl Removed {
    /// Returns true if nothing was removed.
    pub fn is_nothing(&self) -> bool {
        *self == Self::default()
    }
}

/// Removes, in this order, fibers shorter than `min_length` (in unit-cube units), dangling fibers until none is left,
/// components not connected to the boundary, and nodes without fibers. If a face would lose its last node, the first
/// node of the face is kept, so that the bounding box does not change.
///
/// Fibers that join the same two nodes and have the same law are merged into one with the sum of their cross-sectional
/// areas, which responds as all of them together. For merged fibers, the materials of the network get new entries, with
/// the radii of the sums; all fibers keep their response. A law that later replaces all materials loses these sums.
/// Fibers of different laws, and those of a network without laws, are not merged.
///
/// # Errors
/// Returns [`NetworkError::NoFibers`] if no fiber would be left, and [`NetworkError::TooMany`] if the merged fibers
/// would need more than 65535 materials.
pub fn clean(network: &Network, min_length: Option<f64>) -> Result<Cleaned, NetworkError> {
    let mut removed = Removed::default();
    let mut keep = vec![true; network.fibers().len()];
    if let Some(min_length) = min_length {
        for (keep, &length) in keep.iter_mut().zip(network.lengths()) {
            *keep = length >= min_length;
        }
        removed.short_fibers = keep.iter().filter(|&&keep| !keep).count();
    }
    removed.dangling_fibers = drop_dangling(network, &mut keep);
    removed.unsupported_fibers = drop_unsupported(network, &mut keep);
    let kept_fibers: Vec<u32> = (0u32..).zip(&keep).filter_map(|(fiber, &keep)| keep.then_some(fiber)).collect();
    let Merged { fibers: kept_fibers, materials, material_of, count, doubled } = merge_doubled(network, &kept_fibers)?;
    removed.merged_fibers = count;
    let used = used_nodes(network, &kept_fibers);
    let kept_nodes: Vec<u32> = (0u32..).zip(&used).filter_map(|(node, &used)| used.then_some(node)).collect();
    removed.nodes = network.nodes().len() - kept_nodes.len();
    let mut restricted = restrict(network, &kept_nodes, &kept_fibers)?;
    if !materials.is_empty() {
        restricted = restricted.with_materials(materials, material_of)?;
    }
    Ok(Cleaned { network: restricted, kept_nodes, kept_fibers, kept_doubled_fibers: doubled, removed })
}

/// Returns, for every node, whether it has one of the fibers, or is kept as the only node of a face.
fn used_nodes(network: &Network, fibers: &[u32]) -> Vec<bool> {
    let mut used = vec![false; network.nodes().len()];
    for &fiber in fibers {
        for node in network.fibers()[fiber as usize] {
            used[node as usize] = true;
        }
    }
    for (axis, side) in [0, 1, 2].into_iter().flat_map(|axis| [(axis, -0.5), (axis, 0.5)]) {
        let on_face = |&node: &u32| {
            let x: f64 = network.nodes()[node as usize][axis];
            (x - side).abs() <= BOUNDARY_TOLERANCE
        };
        let mut nodes = network.boundary().iter().copied().filter(on_face).peekable();
        let first = nodes.peek().copied();
        if let Some(first) = first
            && !nodes.any(|node| used[node as usize])
        {
            used[first as usize] = true;
        }
    }
    used
}

/// Removes fibers at interior nodes with a single neighbor until there are none; returns the number of removed fibers.
fn drop_dangling(network: &Network, keep: &mut [bool]) -> usize {
    let mut fibers_at: Vec<Vec<u32>> = vec![Vec::new(); network.nodes().len()];
    // The degree counts neighbors, not fibers: several fibers to the same node support a node no better than one.
    let mut degree = vec![0usize; network.nodes().len()];
    let mut pairs = HashSet::new();
    for (fiber, ends) in (0u32..).zip(network.fibers()).filter(|(fiber, _)| keep[*fiber as usize]) {
        let is_new = pairs.insert([ends[0].min(ends[1]), ends[0].max(ends[1])]);
        for &node in ends {
            fibers_at[node as usize].push(fiber);
            degree[node as usize] += usize::from(is_new);
        }
    }
    let is_boundary = |node: u32| network.interior_number()[node as usize] < 0;
    let mut dangling: Vec<u32> =
        network.interior().iter().copied().filter(|&node| degree[node as usize] == 1).collect();
    let mut dropped = 0;
    while let Some(node) = dangling.pop() {
        for &fiber in &fibers_at[node as usize] {
            // The fiber may already have been removed from its other end.
            if !std::mem::replace(&mut keep[fiber as usize], false) {
                continue;
            }
            dropped += 1;
            let [a, b] = network.fibers()[fiber as usize];
            if !pairs.remove(&[a.min(b), a.max(b)]) {
                continue;
            }
            for end in [a, b] {
                degree[end as usize] -= 1;
                if degree[end as usize] == 1 && !is_boundary(end) {
                    dangling.push(end);
                }
            }
        }
    }
    dropped
}

/// Removes the fibers of components without a boundary node; returns the number of removed fibers.
fn drop_unsupported(network: &Network, keep: &mut [bool]) -> usize {
    let left = network.fibers().iter().zip(keep.iter()).filter_map(|(&ends, &keep)| keep.then_some(ends));
    let roots = roots(network.nodes().len(), left);
    let mut supported = vec![false; network.nodes().len()];
    for &node in network.boundary() {
        supported[roots[node as usize] as usize] = true;
    }
    let mut dropped = 0;
    for (keep, [a, _]) in keep.iter_mut().zip(network.fibers()) {
        if *keep && !supported[roots[*a as usize] as usize] {
            *keep = false;
            dropped += 1;
        }
    }
    dropped
}

/// Creates the network of the given nodes and fibers without materials, with the nodes renumbered, in the same cube.
fn restrict(network: &Network, nodes: &[u32], fibers: &[u32]) -> Result<Network, NetworkError> {
    let mut number = vec![0u32; network.nodes().len()];
    for (new, &old) in (0u32..).zip(nodes) {
        number[old as usize] = new;
    }
    let positions = nodes.iter().map(|&node| network.nodes()[node as usize]).collect();
    let ends = fibers.iter().map(|&fiber| network.fibers()[fiber as usize].map(|node| number[node as usize])).collect();
    Network::in_cube(network.name(), Cube::UNIT, positions, ends)
}
