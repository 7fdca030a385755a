//! Statistics of a network.

use nalgebra::Matrix3;

use super::components::{Component, components, roots};
use crate::fiber::network::Network;
use crate::fiber::orientation::{Weighting, principal, second_order_parameter, tensor};
use crate::tensor::rows;

/// Minimum, mean, maximum and standard deviation of a sample.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "app", derive(serde::Serialize))]
pub struct SummaryStatistics {
    /// The minimum.
    pub min: f64,
    /// The mean.
    pub mean: f64,
    /// The maximum.
    pub max: f64,
    /// The standard deviation, with the number of values as divisor.
    pub deviation: f64,
}

impl SummaryStatistics {
    /// Computes the statistics of a sample; `None` for an empty sample.
    fn of(values: &[f64]) -> Option<Self> {
        let count = values.len() as f64;
        let (&first, _) = values.split_first()?;
        let mean = values.iter().sum::<f64>() / count;
        let squares: f64 = values.iter().map(|value| (value - mean) * (value - mean)).sum();
        let (min, max) = values.iter().fold((first, first), |(min, max), &value| (min.min(value), max.max(value)));
        Some(Self { min, mean, max, deviation: (squares / count).sqrt() })
    }
}

/// The result of [`examine`]. Lengths are in unit-cube units.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "app", derive(serde::Serialize))]
pub struct NetworkReport {
    /// The network's name.
    pub name: String,
    /// Number of nodes.
    pub nodes: usize,
    /// Number of fibers.
    pub fibers: usize,
    /// Number of nodes on the boundary, whose positions are prescribed.
    pub boundary_nodes: usize,
    /// Number of all other nodes.
    pub interior_nodes: usize,
    /// Number of free unknowns: three per interior node.
    pub free_dofs: usize,
    /// Maxwell's count: number of fibers with a free end minus number of free unknowns. If it is negative, the network
    /// has at least that many zero modes; if not, it may still have some.
    pub maxwell_count: i64,
    /// The connected components, ordered by their lowest node.
    pub components: Vec<Component>,
    /// Interior nodes with a single neighbor; their fibers cannot carry a load.
    pub dangling_nodes: Vec<u32>,
    /// Number of fibers that join the same two nodes as an earlier fiber.
    pub doubled_fibers: usize,
    /// Number of fibers with both ends on the boundary: they deform affinely and do not interact with the interior.
    pub boundary_fibers: usize,
    /// Length of the fibers.
    pub length: SummaryStatistics,
    /// Sum of the lengths. Since the volume of the cube is 1, this is also the density: fiber length per volume, in
    /// 1/edge^2.
    pub total_length: f64,
    /// Number of fibers at an interior node; `None` if there is no interior node.
    pub coordination: Option<SummaryStatistics>,
    /// Number of interior nodes with 0, 1, 2, ... fibers.
    pub coordination_counts: Vec<usize>,
    /// The orientation tensor `1/N sum n (x) n` over the directions `n` of the `N` fibers.
    pub orientation: [[f64; 3]; 3],
    /// The orientation tensor weighted by the fiber lengths `L`: `sum L n (x) n / sum L`.
    pub orientation_by_length: [[f64; 3]; 3],
    /// The direction along which most fibers lie: the eigenvector of `orientation` with the largest eigenvalue, signed
    /// such that its largest component is positive.
    pub principal_direction: [f64; 3],
    /// The order parameter `P2 = (3 <cos^2 theta> - 1)/2` of the angles `theta` between the fibers and the
    /// principal direction: 0 for isotropic fibers, 1 for parallel ones.
    pub order: f64,
    /// `order` with every fiber weighted by its length.
    pub order_by_length: f64,
    /// Number of materials in the network's files.
    pub materials: usize,
}

impl NetworkReport {
    /// Returns the order parameter about a unit vector: with equal weights, and weighted by length.
    pub fn order_about(&self, axis: [f64; 3]) -> [f64; 2] {
        [self.orientation, self.orientation_by_length]
            .map(|tensor| second_order_parameter(&Matrix3::from(tensor), &axis.into()))
    }

    /// Returns the components without a boundary node.
    pub fn unsupported(&self) -> impl Iterator<Item = &Component> {
        self.components.iter().filter(|part| !part.supported)
    }
}

/// Computes the statistics of a network.
pub fn examine(network: &Network) -> NetworkReport {
    let fibers = network.fibers();
    let degrees = degrees(network);
    let doubled = network.doubled();
    let mut neighbors = degrees.clone();
    for &node in doubled.iter().flat_map(|&fiber| &fibers[fiber as usize]) {
        neighbors[node as usize] -= 1;
    }
    let interior_degrees = || network.interior().iter().map(|&node| degrees[node as usize]);
    let most = interior_degrees().max().map_or(0, |most| most + 1);
    let mut coordination_counts = vec![0; most];
    for degree in interior_degrees() {
        coordination_counts[degree] += 1;
    }
    let is_boundary = |node: u32| network.interior_number()[node as usize] < 0;
    let boundary_fibers = fibers.iter().filter(|&&[a, b]| is_boundary(a) && is_boundary(b)).count();
    let free_dofs = 3 * network.interior().len();
    let roots = roots(network.nodes().len(), fibers.iter().copied());
    let [orientation, orientation_by_length] = orientations(network);
    let (principal_direction, _) = principal(&orientation);
    let coordination: Vec<f64> = interior_degrees().map(|degree| degree as f64).collect();
    NetworkReport {
        name: network.name().into(),
        nodes: network.nodes().len(),
        fibers: fibers.len(),
        boundary_nodes: network.boundary().len(),
        interior_nodes: network.interior().len(),
        free_dofs,
        maxwell_count: (fibers.len() - boundary_fibers) as i64 - free_dofs as i64,
        components: components(&roots, network.boundary(), fibers.iter().copied()),
        dangling_nodes: network.interior().iter().copied().filter(|&node| neighbors[node as usize] == 1).collect(),
        doubled_fibers: doubled.len(),
        boundary_fibers,
        length: SummaryStatistics::of(network.lengths()).unwrap_or_default(),
        total_length: network.total_length(),
        coordination: SummaryStatistics::of(&coordination),
        coordination_counts,
        orientation: rows(&orientation),
        orientation_by_length: rows(&orientation_by_length),
        principal_direction: principal_direction.into(),
        order: second_order_parameter(&orientation, &principal_direction),
        order_by_length: second_order_parameter(&orientation_by_length, &principal_direction),
        materials: network.materials().len(),
    }
}

/// Returns the number of fibers at every node.
fn degrees(network: &Network) -> Vec<usize> {
    let mut degrees = vec![0; network.nodes().len()];
    for &node in network.fibers().iter().flatten() {
        degrees[node as usize] += 1;
    }
    degrees
}

/// Returns the orientation tensors: with equal weights, and weighted by length.
fn orientations(network: &Network) -> [Matrix3<f64>; 2] {
    let directions: Vec<[f64; 3]> = (0..network.fibers().len()).map(|fiber| network.direction(fiber)).collect();
    [Weighting::Number, Weighting::Length].map(|weighting| tensor(&directions, network.lengths(), weighting))
}
