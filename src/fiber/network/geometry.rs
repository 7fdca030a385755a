//! Construction of a checked network in the unit cube from given nodes and fibers.

use std::collections::HashSet;

use super::proximity::{Proximity, distance};
use super::{Network, NetworkError};
use crate::fiber::law::FiberMaterial;
use crate::input::MOST_SHOWN;

/// Largest distance of a coordinate from +-1/2 for a node on the boundary.
pub const BOUNDARY_TOLERANCE: f64 = 1e-8;
/// Largest relative difference of the edges of a box that counts as a cube.
pub const CUBE_TOLERANCE: f64 = 1e-6;
/// Nodes within this distance, in unit-cube units, count as having the same position. The distance is about a thousand
/// times the rounding error of a coordinate, and far below the length of the shortest fibers of published networks
/// (4e-5).
pub const SAME_PLACE: f64 = 1e-12;
/// A box within this distance of `[-1/2, 1/2]^3` counts as the unit cube, and its nodes are not moved.
const IDENTITY_TOLERANCE: f64 = 1e-12;
/// Maximum number of nodes whose unknowns can be numbered in signed 32-bit integers.
const MAX_NODES: usize = (i32::MAX / 3) as usize;

/// The cube that a network fills, in the units of its nodes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cube {
    /// The corner with the lowest coordinates.
    pub lower: [f64; 3],
    /// Edge lengths along x, y, z; equal within 1e-6 of the longest.
    pub edges: [f64; 3],
}

impl Cube {
    /// The unit cube `[-1/2, 1/2]^3`.
    pub const UNIT: Self = Self { lower: [-0.5; 3], edges: [1.0; 3] };

    /// Returns the bounding box of the nodes.
    ///
    /// # Errors
    /// Returns [`NetworkError::NotACube`] if its edges differ by more than 1e-6 of the longest, or are zero.
    pub fn around(nodes: &[[f64; 3]]) -> Result<Self, NetworkError> {
        let mut lower = [f64::INFINITY; 3];
        let mut upper = [f64::NEG_INFINITY; 3];
        for node in nodes {
            for k in 0..3 {
                lower[k] = lower[k].min(node[k]);
                upper[k] = upper[k].max(node[k]);
            }
        }
        let edges = if nodes.is_empty() { [0.0; 3] } else { [0, 1, 2].map(|k| upper[k] - lower[k]) };
        let longest = edges[0].max(edges[1]).max(edges[2]);
        let shortest = edges[0].min(edges[1]).min(edges[2]);
        // The condition is negated, so that an infinite edge or NaN is rejected too.
        if !(shortest > 0.0 && longest.is_finite() && longest - shortest <= CUBE_TOLERANCE * longest) {
            return Err(NetworkError::NotACube(edges));
        }
        Ok(Self { lower, edges })
    }

    /// Returns true if scaling would move nodes by rounding only.
    fn is_unit(&self) -> bool {
        (0..3).all(|k| {
            (self.lower[k] + 0.5).abs() <= IDENTITY_TOLERANCE
                && (self.lower[k] + self.edges[k] - 0.5).abs() <= IDENTITY_TOLERANCE
        })
    }

    /// Maps a position to unit-cube units: `(x - c)/w` with the center `c` and the edges `w`, computed such that the
    /// faces are mapped exactly to +-1/2.
    fn to_unit(self, x: [f64; 3]) -> [f64; 3] {
        [0, 1, 2].map(|k| (x[k] - self.lower[k]) / self.edges[k] - 0.5)
    }
}

impl Network {
    /// Creates a network whose cube is the bounding box of its nodes; the nodes are centered and scaled to the unit
    /// cube unless the box is already the unit cube (within 1e-12).
    ///
    /// # Errors
    /// Returns the first [`NetworkError`] found in the geometry.
    pub fn new(name: impl Into<String>, nodes: Vec<[f64; 3]>, fibers: Vec<[u32; 2]>) -> Result<Self, NetworkError> {
        check_values(&nodes)?;
        let cube = Cube::around(&nodes)?;
        Self::in_cube(name, cube, nodes, fibers)
    }

    /// Creates a network in a given cube, which need not be its bounding box.
    ///
    /// # Errors
    /// Returns the first [`NetworkError`] found in the geometry, including a node outside the cube by more than 1e-8 of
    /// its edge.
    pub fn in_cube(
        name: impl Into<String>,
        cube: Cube,
        nodes: Vec<[f64; 3]>,
        fibers: Vec<[u32; 2]>,
    ) -> Result<Self, NetworkError> {
        check_values(&nodes)?;
        if let Some(problem) = problems(cube, &nodes, &fibers).into_iter().next() {
            return Err(problem);
        }
        let nodes = if cube.is_unit() { nodes } else { nodes.into_iter().map(|x| cube.to_unit(x)).collect() };
        let mut boundary = Vec::new();
        let mut interior = Vec::new();
        let mut interior_number = Vec::with_capacity(nodes.len());
        for (number, node) in (0u32..).zip(&nodes) {
            if node.iter().any(|x| (x.abs() - 0.5).abs() <= BOUNDARY_TOLERANCE) {
                boundary.push(number);
                interior_number.push(-1);
            } else {
                interior_number.push(interior.len() as i32);
                interior.push(number);
            }
        }
        if boundary.is_empty() {
            return Err(NetworkError::NoBoundary(nodes.len()));
        }
        let lengths = fibers.iter().map(|&[a, b]| distance(nodes[a as usize], nodes[b as usize])).collect();
        Ok(Self {
            name: name.into(),
            material_of: vec![0; fibers.len()],
            materials: Vec::new(),
            nodes,
            fibers,
            lengths,
            boundary,
            interior,
            interior_number,
        })
    }

    /// Replaces the materials: `material_of[fiber]` is an index into `materials`.
    ///
    /// # Errors
    /// Returns [`NetworkError::MaterialCount`] unless there is one index per fiber, and
    /// [`NetworkError::NoSuchMaterial`] if an index is out of range.
    pub fn with_materials(self, materials: Vec<FiberMaterial>, material_of: Vec<u16>) -> Result<Self, NetworkError> {
        if material_of.len() != self.fibers.len() {
            return Err(NetworkError::MaterialCount { given: material_of.len(), fibers: self.fibers.len() });
        }
        if let Some(fiber) = material_of.iter().position(|&m| usize::from(m) >= materials.len()) {
            let (material, materials) = (material_of[fiber], materials.len());
            return Err(NetworkError::NoSuchMaterial { fiber, material, materials });
        }
        Ok(Self { materials, material_of, ..self })
    }

    /// Returns the fibers, ascending, that join the same two nodes as an earlier fiber, in either direction. These
    /// fibers contribute like all others: forces and stiffness add up.
    pub fn doubled(&self) -> Vec<u32> {
        doubled(&self.fibers)
    }

    /// Replaces the materials by one material for all fibers.
    #[must_use]
    pub fn of_one_material(self, material: FiberMaterial) -> Self {
        Self { materials: vec![material], material_of: vec![0; self.fibers.len()], ..self }
    }
}

/// Checks the node count and the coordinates, before the bounding box is computed.
fn check_values(nodes: &[[f64; 3]]) -> Result<(), NetworkError> {
    if nodes.len() > MAX_NODES {
        return Err(NetworkError::TooMany { what: "nodes", count: nodes.len(), most: MAX_NODES });
    }
    for (node, position) in nodes.iter().enumerate() {
        if let Some(&value) = position.iter().find(|x| !x.is_finite()) {
            return Err(NetworkError::NotFinite { node, value });
        }
    }
    Ok(())
}

/// Implements [`Network::doubled`].
pub(super) fn doubled(fibers: &[[u32; 2]]) -> Vec<u32> {
    let mut seen = HashSet::with_capacity(fibers.len());
    (0u32..).zip(fibers).filter(|(_, [a, b])| !seen.insert([a.min(b), a.max(b)])).map(|(fiber, _)| fiber).collect()
}

/// Returns up to [`MOST_SHOWN`] problems of fibers and then of nodes in their cube; the coordinates are finite.
pub(super) fn problems(cube: Cube, nodes: &[[f64; 3]], fibers: &[[u32; 2]]) -> Vec<NetworkError> {
    if fibers.is_empty() {
        return vec![NetworkError::NoFibers];
    }
    if fibers.len() > u32::MAX as usize {
        return vec![NetworkError::TooMany { what: "fibers", count: fibers.len(), most: u32::MAX as usize }];
    }
    let unit: Vec<[f64; 3]> = nodes.iter().map(|&x| cube.to_unit(x)).collect();
    let mut found: Vec<NetworkError> = bad_fibers(&unit, fibers).take(MOST_SHOWN).collect();
    found.extend(bad_nodes(&unit, nodes, &found).into_iter().take(MOST_SHOWN));
    found.truncate(MOST_SHOWN);
    found
}

/// Finds fibers with nodes that do not exist, with two equal ends, or of zero length.
fn bad_fibers(unit: &[[f64; 3]], fibers: &[[u32; 2]]) -> impl Iterator<Item = NetworkError> {
    fibers.iter().enumerate().filter_map(move |(fiber, &[a, b])| {
        if let Some(index) = [a, b].into_iter().find(|&index| index as usize >= unit.len()) {
            return Some(NetworkError::NoSuchNode { fiber, index, nodes: unit.len() });
        }
        if a == b {
            return Some(NetworkError::Loop { fiber, node: a });
        }
        let length = distance(unit[a as usize], unit[b as usize]);
        (length <= SAME_PLACE).then_some(NetworkError::ZeroLength { fiber, ends: [a, b], length })
    })
}

/// Finds nodes outside the cube and nodes at the same position, except for pairs that a fiber of zero length in `known`
/// already reports.
fn bad_nodes(unit: &[[f64; 3]], nodes: &[[f64; 3]], known: &[NetworkError]) -> Vec<NetworkError> {
    let mut found = Vec::new();
    let mut places = Proximity::new(SAME_PLACE);
    for (node, &position) in unit.iter().enumerate() {
        if position.iter().any(|x| x.abs() > 0.5 + BOUNDARY_TOLERANCE) {
            found.push(NetworkError::Outside { node, position });
        }
        if let Some(first) = places.near(position) {
            let named = known.iter().any(|problem| {
                matches!(problem, NetworkError::ZeroLength { ends: [a, b], .. }
                    if [*a as usize, *b as usize] == [first, node] || [*b as usize, *a as usize] == [first, node])
            });
            if !named {
                found.push(NetworkError::CoincidentNodes { first, second: node, position: nodes[node] });
            }
        }
        places.insert(node, position);
        if found.len() >= MOST_SHOWN {
            break;
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fiber::law::Law;

    /// Returns the corners of a cube, a point inside, and fibers from that point to the corners.
    fn star(lower: [f64; 3], edges: [f64; 3]) -> (Vec<[f64; 3]>, Vec<[u32; 2]>) {
        let corner = |c: u32| [0, 1, 2].map(|k| lower[k] + f64::from(c >> k & 1) * edges[k]);
        let mut nodes: Vec<[f64; 3]> = (0..8).map(corner).collect();
        nodes.push([0, 1, 2].map(|k| lower[k] + 0.3 * edges[k]));
        (nodes, (0..8).map(|c| [8, c]).collect())
    }

    #[test]
    fn any_cube_is_mapped_exactly_to_the_unit_cube() {
        for (lower, edge) in [(0.1, 0.3), (-2.5, 5.0), (1e3, 1.0 / 3.0), (-1e-7, 7e-8), (1e-320, 1e9)] {
            let (nodes, fibers) = star([lower, 2.0 * lower, -lower], [edge; 3]);
            let network = Network::new("star", nodes, fibers).unwrap();
            assert_eq!((network.boundary().len(), network.interior()), (8, &[8][..]));
            assert_eq!((network.interior_number()[0], network.interior_number()[8]), (-1, 0));
            for corner in &network.nodes()[..8] {
                assert!(corner.iter().all(|x| x.abs() == 0.5), "{corner:?}");
            }
            assert!(network.nodes()[8].iter().all(|x| (x + 0.2).abs() < 1e-12));
        }
    }

    #[test]
    fn nodes_of_a_unit_cube_are_not_moved() {
        let (mut nodes, fibers) = star([-0.5; 3], [1.0; 3]);
        nodes[0][0] -= 5e-13;
        nodes[8] = [0.1, -0.2, 0.3];
        let network = Network::new("star", nodes.clone(), fibers).unwrap();
        assert_eq!(network.nodes(), nodes);
        assert_eq!(network.boundary().len(), 8);
    }

    #[test]
    fn a_box_is_a_cube_if_its_edges_differ_by_at_most_one_millionth() {
        let (nodes, fibers) = star([0.0; 3], [1.0, 1.0, 1.0 + 0.9e-6]);
        let network = Network::new("star", nodes, fibers).unwrap();
        assert_eq!(network.boundary().len(), 8, "every face keeps its nodes");
        let (nodes, fibers) = star([0.0; 3], [1.0, 1.0, 1.0 + 1.1e-6]);
        let error = Network::new("star", nodes, fibers).unwrap_err();
        assert!(matches!(error, NetworkError::NotACube(_)), "{error}");
    }

    #[test]
    fn every_kind_of_invalid_geometry_has_its_error() {
        type Change<'a> = &'a dyn Fn(&mut Vec<[f64; 3]>, &mut Vec<[u32; 2]>);
        let broken = |change: Change<'_>| {
            let (mut nodes, mut fibers) = star([-0.5; 3], [1.0; 3]);
            change(&mut nodes, &mut fibers);
            Network::new("star", nodes, fibers).unwrap_err()
        };
        assert!(matches!(broken(&|nodes, _| nodes[3][1] = f64::NAN), NetworkError::NotFinite { node: 3, .. }));
        assert_eq!(broken(&|_, fibers| fibers.clear()), NetworkError::NoFibers);
        assert_eq!(broken(&|_, fibers| fibers[2] = [1, 9]), NetworkError::NoSuchNode { fiber: 2, index: 9, nodes: 9 });
        assert_eq!(broken(&|_, fibers| fibers[2] = [5, 5]), NetworkError::Loop { fiber: 2, node: 5 });
        assert_eq!(
            broken(&|nodes, _| nodes[8] = nodes[4]),
            NetworkError::ZeroLength { fiber: 4, ends: [8, 4], length: 0.0 }
        );
        assert_eq!(
            broken(&|nodes, _| nodes.push([0.5 - 1e-13; 3])),
            NetworkError::CoincidentNodes { first: 7, second: 9, position: [0.5 - 1e-13; 3] }
        );
        let (nodes, fibers) = star([-0.4; 3], [0.8; 3]);
        let inside = Network::in_cube("star", Cube::UNIT, nodes.clone(), fibers.clone());
        assert_eq!(inside.unwrap_err(), NetworkError::NoBoundary(9));
        let small = Cube { lower: [-0.3; 3], edges: [0.6; 3] };
        assert!(matches!(
            Network::in_cube("star", small, nodes, fibers).unwrap_err(),
            NetworkError::Outside { node: 0, .. }
        ));
    }

    #[test]
    fn fibers_that_join_the_same_nodes_are_found_and_kept() {
        let (nodes, mut fibers) = star([-0.5; 3], [1.0; 3]);
        fibers.extend([[1, 8], [2, 0], [8, 1], [0, 2]]);
        let network = Network::new("star", nodes, fibers.clone()).unwrap();
        assert_eq!(network.fibers(), fibers);
        assert_eq!(network.doubled(), [8, 10, 11]);
    }

    #[test]
    fn materials_must_match_the_fibers() {
        let (nodes, fibers) = star([-0.5; 3], [1.0; 3]);
        let network = Network::new("star", nodes, fibers).unwrap();
        let material = FiberMaterial { law: Law::Linear { youngs_modulus: 1.0 }, radius: 1.0, density: None };
        let few = network.clone().with_materials(vec![material.clone()], vec![0; 7]);
        assert_eq!(few.unwrap_err(), NetworkError::MaterialCount { given: 7, fibers: 8 });
        let absent = network.clone().with_materials(vec![material.clone()], vec![0, 0, 0, 1, 0, 0, 0, 0]);
        assert_eq!(absent.unwrap_err(), NetworkError::NoSuchMaterial { fiber: 3, material: 1, materials: 1 });
        assert_eq!(network.of_one_material(material).material_of(), [0; 8]);
    }
}
