//! Taking out of a network what carries no load.

use std::collections::HashSet;

use super::components::roots;
use crate::fiber::network::{BOUNDARY_TOLERANCE, Cube, Network, NetworkError};

/// A cleaned network, with what was taken out.
#[derive(Clone, Debug, PartialEq)]
pub struct Cleaned {
    /// What is left, with its materials.
    pub network: Network,
    /// The nodes that are left, by their former numbers.
    pub kept_nodes: Vec<u32>,
    /// The fibers that are left, by their former numbers.
    pub kept_fibers: Vec<u32>,
    /// What was taken out.
    pub removed: Removed,
}

/// How much was taken out, each thing counted once, by the first reason that held.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "app", derive(serde::Serialize))]
pub struct Removed {
    /// Fibers shorter than asked for.
    pub short_fibers: usize,
    /// Fibers that end at an interior node alone, or beside others from the same node; those included that do so after
    /// others were taken out.
    pub dangling_fibers: usize,
    /// Fibers of parts that are not tied to the boundary.
    pub untied_fibers: usize,
    /// Nodes that no fiber was left at.
    pub nodes: usize,
}

impl Removed {
    /// Whether there was nothing to take out.
    #[must_use]
    pub fn is_nothing(&self) -> bool {
        *self == Self::default()
    }
}

/// Takes out, in this order, fibers shorter than a length (in unit-cube units), dangling fibers until none is left,
/// parts not tied to the boundary, and nodes without fibers. Where a face would be left without a node, its first one
/// stays, so that the box remains what it is.
///
/// # Errors
/// [`NetworkError::NoFibers`] if nothing would be left.
pub fn clean(network: &Network, shorter_than: Option<f64>) -> Result<Cleaned, NetworkError> {
    let mut removed = Removed::default();
    let mut keep = vec![true; network.fibers().len()];
    if let Some(least) = shorter_than {
        for (keep, &length) in keep.iter_mut().zip(network.lengths()) {
            *keep = length >= least;
        }
        removed.short_fibers = keep.iter().filter(|&&keep| !keep).count();
    }
    removed.dangling_fibers = drop_dangling(network, &mut keep);
    removed.untied_fibers = drop_untied(network, &mut keep);
    let kept_fibers: Vec<u32> = (0u32..).zip(&keep).filter_map(|(fiber, &keep)| keep.then_some(fiber)).collect();
    let used = used_nodes(network, &kept_fibers);
    let kept_nodes: Vec<u32> = (0u32..).zip(&used).filter_map(|(node, &used)| used.then_some(node)).collect();
    removed.nodes = network.nodes().len() - kept_nodes.len();
    Ok(Cleaned { network: restrict(network, &kept_nodes, &kept_fibers)?, kept_nodes, kept_fibers, removed })
}

/// Which nodes have fibers, or hold a face of the cube that no other node is left on.
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

/// Takes out fibers at interior nodes with a single neighbor until there are none; returns how many.
fn drop_dangling(network: &Network, keep: &mut [bool]) -> usize {
    let mut fibers_at: Vec<Vec<u32>> = vec![Vec::new(); network.nodes().len()];
    // Neighbors, not fibers: several fibers to one node hold no better than one.
    let mut degree = vec![0usize; network.nodes().len()];
    let mut pairs = HashSet::new();
    for (fiber, ends) in (0u32..).zip(network.fibers()).filter(|(fiber, _)| keep[*fiber as usize]) {
        let is_new = pairs.insert([ends[0].min(ends[1]), ends[0].max(ends[1])]);
        for &node in ends {
            fibers_at[node as usize].push(fiber);
            degree[node as usize] += usize::from(is_new);
        }
    }
    let held = |node: u32| network.interior_number()[node as usize] < 0;
    let mut loose: Vec<u32> = network.interior().iter().copied().filter(|&node| degree[node as usize] == 1).collect();
    let mut dropped = 0;
    while let Some(node) = loose.pop() {
        for &fiber in &fibers_at[node as usize] {
            // It may be gone already, taken out from its other end.
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
                if degree[end as usize] == 1 && !held(end) {
                    loose.push(end);
                }
            }
        }
    }
    dropped
}

/// Takes out the fibers of parts without a boundary node; returns how many.
fn drop_untied(network: &Network, keep: &mut [bool]) -> usize {
    let left = network.fibers().iter().zip(keep.iter()).filter_map(|(&ends, &keep)| keep.then_some(ends));
    let roots = roots(network.nodes().len(), left);
    let mut tied = vec![false; network.nodes().len()];
    for &node in network.boundary() {
        tied[roots[node as usize] as usize] = true;
    }
    let mut dropped = 0;
    for (keep, [a, _]) in keep.iter_mut().zip(network.fibers()) {
        if *keep && !tied[roots[*a as usize] as usize] {
            *keep = false;
            dropped += 1;
        }
    }
    dropped
}

/// The network of some of its nodes and fibers, renumbered, in the same cube.
fn restrict(network: &Network, nodes: &[u32], fibers: &[u32]) -> Result<Network, NetworkError> {
    let mut number = vec![0u32; network.nodes().len()];
    for (new, &old) in (0u32..).zip(nodes) {
        number[old as usize] = new;
    }
    let positions = nodes.iter().map(|&node| network.nodes()[node as usize]).collect();
    let ends = fibers.iter().map(|&fiber| network.fibers()[fiber as usize].map(|node| number[node as usize])).collect();
    let restricted = Network::in_cube(network.name(), Cube::UNIT, positions, ends)?;
    if network.materials().is_empty() {
        return Ok(restricted);
    }
    let material_of = fibers.iter().map(|&fiber| network.reaction_of()[fiber as usize]).collect();
    restricted.with_materials(network.materials().to_vec(), material_of)
}
