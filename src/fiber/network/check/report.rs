//! The figures of a network.

use super::components::{Component, components, roots};
use crate::fiber::network::Network;

/// Least, mean and greatest of some numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "app", derive(serde::Serialize))]
pub struct Spread {
    /// The least.
    pub min: f64,
    /// The mean.
    pub mean: f64,
    /// The greatest.
    pub max: f64,
}

impl Spread {
    /// `None` for no numbers.
    fn of(values: impl Iterator<Item = f64>) -> Option<Self> {
        let (mut count, mut sum, mut min, mut max) = (0usize, 0.0, f64::INFINITY, f64::NEG_INFINITY);
        for value in values {
            count += 1;
            sum += value;
            min = min.min(value);
            max = max.max(value);
        }
        (count > 0).then(|| Self { min, mean: sum / count as f64, max })
    }
}

/// What [`examine`] finds. Lengths are in unit-cube units.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "app", derive(serde::Serialize))]
pub struct NetworkReport {
    /// The network's name.
    pub name: String,
    /// Number of nodes.
    pub nodes: usize,
    /// Number of fibers.
    pub fibers: usize,
    /// Nodes on the boundary, which are held.
    pub boundary_nodes: usize,
    /// The other nodes.
    pub interior_nodes: usize,
    /// Three unknowns an interior node.
    pub free_dofs: usize,
    /// Maxwell's count: fibers with a free end, less free unknowns. Below zero the network has that many floppy modes
    /// at least; above it may have some.
    pub maxwell_count: i64,
    /// The connected parts, by their lowest node.
    pub components: Vec<Component>,
    /// Interior nodes that end a single fiber; it cannot carry a load.
    pub dangling_nodes: Vec<u32>,
    /// Fibers with both ends on the boundary: they follow the deformation and meet nothing else at rest.
    pub boundary_fibers: usize,
    /// Of the fibers.
    pub length: Spread,
    /// Sum of the lengths.
    pub total_length: f64,
    /// Fibers that meet at an interior node; absent where there is none.
    pub coordination: Option<Spread>,
    /// How many interior nodes have 0, 1, 2, ... fibers.
    pub coordination_counts: Vec<usize>,
    /// `1/N sum n (x) n` over the fibers' directions.
    pub orientation: [[f64; 3]; 3],
    /// `sum L n (x) n / sum L`.
    pub orientation_by_length: [[f64; 3]; 3],
    /// Number of materials that the network's files give.
    pub materials: usize,
}

impl NetworkReport {
    /// The parts that nothing holds.
    pub fn untied(&self) -> impl Iterator<Item = &Component> {
        self.components.iter().filter(|part| !part.tied)
    }
}

/// Examines a network.
#[must_use]
pub fn examine(network: &Network) -> NetworkReport {
    let fibers = network.fibers();
    let degrees = degrees(network);
    let interior_degrees = || network.interior().iter().map(|&node| degrees[node as usize]);
    let most = interior_degrees().max().map_or(0, |most| most + 1);
    let mut coordination_counts = vec![0; most];
    for degree in interior_degrees() {
        coordination_counts[degree] += 1;
    }
    let held = |node: u32| network.interior_number()[node as usize] < 0;
    let boundary_fibers = fibers.iter().filter(|&&[a, b]| held(a) && held(b)).count();
    let free_dofs = 3 * network.interior().len();
    let roots = roots(network.nodes().len(), fibers.iter().copied());
    let (orientation, orientation_by_length) = orientations(network);
    NetworkReport {
        name: network.name().into(),
        nodes: network.nodes().len(),
        fibers: fibers.len(),
        boundary_nodes: network.boundary().len(),
        interior_nodes: network.interior().len(),
        free_dofs,
        maxwell_count: (fibers.len() - boundary_fibers) as i64 - free_dofs as i64,
        components: components(&roots, network.boundary(), fibers.iter().copied()),
        dangling_nodes: network.interior().iter().copied().filter(|&node| degrees[node as usize] == 1).collect(),
        boundary_fibers,
        length: Spread::of(network.lengths().iter().copied()).unwrap_or(Spread { min: 0.0, mean: 0.0, max: 0.0 }),
        total_length: network.total_length(),
        coordination: Spread::of(interior_degrees().map(|degree| degree as f64)),
        coordination_counts,
        orientation,
        orientation_by_length,
        materials: network.materials().len(),
    }
}

/// Fibers at every node.
fn degrees(network: &Network) -> Vec<usize> {
    let mut degrees = vec![0; network.nodes().len()];
    for &node in network.fibers().iter().flatten() {
        degrees[node as usize] += 1;
    }
    degrees
}

/// The orientation tensor, every fiber counted once and every fiber counted by its length.
fn orientations(network: &Network) -> ([[f64; 3]; 3], [[f64; 3]; 3]) {
    let (mut plain, mut weighted) = ([[0.0; 3]; 3], [[0.0; 3]; 3]);
    for (&[a, b], &length) in network.fibers().iter().zip(network.lengths()) {
        let (a, b) = (network.nodes()[a as usize], network.nodes()[b as usize]);
        let n = [0, 1, 2].map(|k| (b[k] - a[k]) / length);
        for i in 0..3 {
            for j in 0..3 {
                plain[i][j] += n[i] * n[j] / network.lengths().len() as f64;
                weighted[i][j] += length * n[i] * n[j];
            }
        }
    }
    let total = network.total_length();
    (plain, weighted.map(|row| row.map(|x| x / total)))
}
