//! Numbering of the free displacement components, which are the unknowns of the linear system.

use std::sync::Arc;

use crate::fem::kinematics::{Kinematics, RigidSurface, Rows};
use crate::fem::mesh::{Division, Mesh};
use crate::las::{RankRows, Sparsity, SparsityError};

/// The equation numbers of the free displacement components: ascending by node, in mesh order or another given order,
/// then by component; last, those of the free components of rigid surfaces. Prescribed components have number -1.
#[derive(Clone, Debug, PartialEq)]
pub struct Unknowns {
    equation_numbers: Vec<i32>,
    rigid_equations: Vec<[i32; 6]>,
    kinematics: Arc<Kinematics>,
    free: usize,
}

/// Numbers of the unknowns of a whole body, rank by rank.
pub(in crate::fem) struct RankNumbers {
    /// As [`Unknowns::equation_numbers`].
    of_nodes: Vec<i32>,
    /// As [`Unknowns::rigid_equations`].
    of_surfaces: Vec<[i32; 6]>,
    /// The first number of each rank, then the number of all.
    starts: Vec<usize>,
}

/// The unknowns of a part of a body by local numbers, and the rows of its rank ([`RankRows`]). The rank that owns the nodes
/// of a rigid surface owns its unknowns; all others have them as ghosts.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "app", derive(serde::Serialize, serde::Deserialize))]
pub(in crate::fem) struct PartUnknowns {
    /// As [`Unknowns::equation_numbers`].
    of_nodes: Vec<i32>,
    /// As [`Unknowns::rigid_equations`].
    of_surfaces: Vec<[i32; 6]>,
    pub rows: RankRows,
}

impl RankNumbers {
    /// Returns the unknowns of the part of a rank, given its nodes.
    pub fn on_part(&self, rank: usize, nodes: &[u32]) -> PartUnknowns {
        let of_nodes = self.of_nodes.as_chunks::<3>().0;
        let in_part = nodes.iter().flat_map(|&node| of_nodes[node as usize]);
        let of_surfaces = self.of_surfaces.as_flattened().iter().copied();
        let own = self.starts[rank]..self.starts[rank + 1];
        let is_ghost = |&number: &i32| number >= 0 && !own.contains(&(number as usize));
        let mut ghosts: Vec<u32> =
            in_part.clone().chain(of_surfaces).filter(is_ghost).map(|number| number as u32).collect();
        ghosts.sort_unstable();
        let rows = RankRows { own, ghosts, total: self.starts[self.starts.len() - 1] };
        let local = |number: i32| {
            let row = usize::try_from(number).ok();
            row.and_then(|row| rows.local_number(row)).map_or(-1, |local| local as i32)
        };
        PartUnknowns {
            of_nodes: in_part.map(local).collect(),
            of_surfaces: self.of_surfaces.iter().map(|numbers| numbers.map(local)).collect(),
            rows,
        }
    }
}

impl PartUnknowns {
    /// Returns the unknowns, whose displacements `kinematics` maps to those of nodes. [`Unknowns::free`] counts local
    /// numbers, ghosts included.
    pub fn with_kinematics(self, kinematics: &Arc<Kinematics>) -> (Unknowns, RankRows) {
        let Self { of_nodes, of_surfaces, rows } = self;
        let unknowns = Unknowns {
            equation_numbers: of_nodes,
            rigid_equations: of_surfaces,
            kinematics: Arc::clone(kinematics),
            free: rows.local(),
        };
        (unknowns, rows)
    }
}

impl Unknowns {
    /// Numbers all components of `nodes` nodes except those for which `prescribed(node, component)` is true.
    ///
    /// # Errors
    /// Returns [`SparsityError::TooLarge`] if the number of components exceeds the range of a 32-bit index.
    pub fn new(nodes: usize, prescribed: impl Fn(usize, usize) -> bool) -> Result<Self, SparsityError> {
        Self::number(nodes, 0..nodes, prescribed)
    }

    /// Numbers the components node by node in the given order; `order` is a permutation of all nodes.
    ///
    /// # Errors
    /// As for [`Unknowns::new`].
    ///
    /// # Panics
    /// Panics if `order` contains a node index that is not below its length.
    pub fn in_order(order: &[u32], prescribed: impl Fn(usize, usize) -> bool) -> Result<Self, SparsityError> {
        Self::number(order.len(), order.iter().map(|&node| node as usize), prescribed)
    }

    fn number(
        nodes: usize,
        order: impl Iterator<Item = usize>,
        prescribed: impl Fn(usize, usize) -> bool,
    ) -> Result<Self, SparsityError> {
        if nodes > i32::MAX as usize / 3 {
            return Err(SparsityError::TooLarge(3 * nodes));
        }
        let (mut equation_numbers, mut free) = (vec![-1; 3 * nodes], 0);
        for (node, component) in order.flat_map(|node| (0..3).map(move |component| (node, component))) {
            if !prescribed(node, component) {
                equation_numbers[3 * node + component] = free;
                free += 1;
            }
        }
        Ok(Self { equation_numbers, rigid_equations: Vec::new(), kinematics: Arc::default(), free: free as usize })
    }

    /// Appends the free unknowns of the rigid surfaces, of which `prescribed` has one entry each. The components of
    /// nodes with frames are those along the frames; all components of the nodes of rigid surfaces must be prescribed.
    ///
    /// # Errors
    /// Returns [`SparsityError::TooLarge`] if the number of unknowns exceeds the range of a 32-bit index.
    pub fn with_kinematics(
        mut self,
        kinematics: &Arc<Kinematics>,
        prescribed: &[[bool; 6]],
    ) -> Result<Self, SparsityError> {
        self.kinematics = Arc::clone(kinematics);
        for prescribed in prescribed {
            let mut equations = [-1; 6];
            for (equation, _) in equations.iter_mut().zip(prescribed).filter(|(_, prescribed)| !**prescribed) {
                *equation = i32::try_from(self.free).map_err(|_| SparsityError::TooLarge(self.free))?;
                self.free += 1;
            }
            self.rigid_equations.push(equations);
        }
        Ok(self)
    }

    /// Numbers the unknowns of the ranks one after the other: of each, those of its nodes, ascending, then those of its
    /// rigid surfaces.
    pub(in crate::fem) fn by_rank(&self, division: &Division) -> RankNumbers {
        let rank_of_surface =
            |surface: &RigidSurface| surface.nodes.first().map_or(0, |&node| division.rank_of_node[node as usize]);
        let rank_of_surface: Vec<u32> = self.kinematics.rigid_surfaces().iter().map(rank_of_surface).collect();
        let (mut of_nodes, mut of_surfaces) =
            (vec![-1; self.equation_numbers.len()], vec![[-1; 6]; rank_of_surface.len()]);
        let (mut next, mut starts) = (0, vec![0]);
        let mut number = |to: &mut [i32], from: &[i32]| {
            for (to, _) in to.iter_mut().zip(from).filter(|(_, from)| **from >= 0) {
                *to = next;
                next += 1;
            }
            next as usize
        };
        let order = division.node_order();
        let mut nodes = order.iter().map(|&node| node as usize).peekable();
        for rank in 0..division.ranks as u32 {
            let mut end = starts[rank as usize];
            while let Some(node) = nodes.next_if(|&node| division.rank_of_node[node] == rank) {
                let place = 3 * node..3 * node + 3;
                end = number(&mut of_nodes[place.clone()], &self.equation_numbers[place]);
            }
            for (surface, _) in rank_of_surface.iter().enumerate().filter(|(_, of)| **of == rank) {
                end = number(&mut of_surfaces[surface], &self.rigid_equations[surface]);
            }
            starts.push(end);
        }
        RankNumbers { of_nodes, of_surfaces, starts }
    }

    /// Returns the equation number of component `c` of node `a` at `3 * a + c`; -1 if the component is prescribed.
    pub fn equation_numbers(&self) -> &[i32] {
        &self.equation_numbers
    }

    /// Returns the equation numbers of the six unknowns of each rigid surface; -1 if prescribed.
    pub fn rigid_equations(&self) -> &[[i32; 6]] {
        &self.rigid_equations
    }

    /// Returns the map from unknowns to displacements.
    pub fn kinematics(&self) -> &Arc<Kinematics> {
        &self.kinematics
    }

    /// Returns the number of free components.
    pub fn free(&self) -> usize {
        self.free
    }

    /// Returns the sparsity pattern of the stiffness of `mesh`: each element couples its nodes, and each patch of
    /// elements ([`Mesh::patches`]) all nodes of its elements.
    ///
    /// # Errors
    /// Returns [`SparsityError::TooLarge`] if the pattern exceeds the range of a 32-bit index.
    pub fn pattern(&self, mesh: &Mesh) -> Result<Sparsity, SparsityError> {
        self.node_pattern(mesh)?.expanded()
    }

    /// Returns the pattern of the stiffness by nodes, which takes a ninth of the memory of [`Unknowns::pattern`].
    ///
    /// # Errors
    /// As for [`Unknowns::pattern`].
    pub fn node_pattern(&self, mesh: &Mesh) -> Result<NodePattern, SparsityError> {
        if self.rigid_equations.is_empty() {
            return self.pattern_of_nodes(mesh);
        }
        let of_node = |node: u32| &self.equation_numbers[3 * node as usize..][..3];
        let equations = |nodes: &[u32]| -> Vec<i32> {
            if self.kinematics.are_plain(nodes) {
                return nodes.iter().flat_map(|&node| of_node(node)).copied().collect();
            }
            let rows = self.kinematics.rows(nodes).into_iter().flat_map(|rows| match rows {
                Rows::Node(node) => of_node(node),
                Rows::RigidSurface(surface) => &self.rigid_equations[surface],
            });
            rows.copied().collect()
        };
        let of_patches = coupled_patches(mesh).map(|nodes| equations(&nodes));
        let nodes = Sparsity::from_elements(self.free, mesh.elements().iter().map(equations).chain(of_patches))?;
        Ok(NodePattern { nodes, first: (0..=self.free as u32).collect() })
    }

    /// Returns the pattern of a mesh without rigid surfaces: the free components of a node are consecutive unknowns.
    fn pattern_of_nodes(&self, mesh: &Mesh) -> Result<NodePattern, SparsityError> {
        // The nodes with free components in the order of their unknowns, by their first unknown.
        let (components, _) = self.equation_numbers.as_chunks::<3>();
        let free = |numbers: &[i32; 3]| numbers.iter().filter(|&&number| number >= 0).count() as u32;
        let first_unknown = |numbers: &[i32; 3]| numbers.iter().copied().find(|&number| number >= 0);
        let mut first: Vec<u32> = components.iter().filter_map(first_unknown).map(|number| number as u32).collect();
        first.sort_unstable();
        let position = |numbers: &[i32; 3]| -> i32 {
            let number = first_unknown(numbers);
            number.map_or(-1, |number| first.partition_point(|&other| other < number as u32) as i32)
        };
        let position_of: Vec<i32> = components.iter().map(position).collect();
        debug_assert_eq!(components.iter().map(free).sum::<u32>() as usize, self.free, "the components of the nodes");
        let positions = |nodes: &[u32]| -> Vec<i32> { nodes.iter().map(|&node| position_of[node as usize]).collect() };
        let elements = mesh.elements().iter().map(positions);
        let patches = coupled_patches(mesh).map(|nodes| positions(&nodes));
        let nodes = Sparsity::from_elements(first.len(), elements.chain(patches))?;
        first.push(self.free as u32);
        Ok(NodePattern { nodes, first })
    }
}

/// The pattern of the stiffness by nodes with free components; with rigid surfaces, by unknowns.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NodePattern {
    /// The pairs of coupled nodes.
    pub nodes: Sparsity,
    /// The first unknown of each node, followed by the number of unknowns.
    pub first: Vec<u32>,
}

impl NodePattern {
    /// Returns the pattern of the unknowns.
    ///
    /// # Errors
    /// Returns [`SparsityError::TooLarge`] if it exceeds the range of a 32-bit index.
    pub fn expanded(&self) -> Result<Sparsity, SparsityError> {
        self.nodes.expanded(&self.first)
    }
}

/// Returns the nodes of each patch that couples several elements, ascending.
fn coupled_patches(mesh: &Mesh) -> impl Iterator<Item = Vec<u32>> {
    let patches = mesh.patches().iter().filter(|patch| patch.len() > 1);
    patches.map(|patch| {
        let mut nodes: Vec<u32> = patch.iter().flat_map(|&e| &mesh.elements()[e as usize]).copied().collect();
        nodes.sort_unstable();
        nodes.dedup();
        nodes
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fem::mesh::shapes;

    /// Rollers leave nodes with one, two or three components.
    #[test]
    fn the_pattern_by_nodes_is_that_by_unknowns() {
        let mesh = shapes::cuboid([3, 2, 2], [1.0; 3]).unwrap();
        let mut order: Vec<u32> = (0..mesh.nodes().len() as u32).collect();
        order.reverse();
        order.swap(3, 9);
        let held = |node: usize, component: usize| mesh.nodes()[node][component] == 0.0 || node == 7;
        let unknowns = Unknowns::in_order(&order, held).unwrap();
        let elements = mesh.elements().iter().map(|nodes| -> Vec<i32> {
            nodes.iter().flat_map(|&node| &unknowns.equation_numbers()[3 * node as usize..][..3]).copied().collect()
        });
        let expected = Sparsity::from_elements(unknowns.free(), elements).unwrap();
        assert_eq!(unknowns.pattern(&mesh).unwrap(), expected);
    }

    #[test]
    fn free_components_are_numbered_in_order() {
        let unknowns = Unknowns::new(2, |node, component| node == 0 && component != 1).unwrap();
        assert_eq!(unknowns.equation_numbers(), [-1, 0, -1, 1, 2, 3]);
        assert_eq!(unknowns.free(), 4);
        let reversed = Unknowns::in_order(&[1, 0], |node, component| node == 0 && component != 1).unwrap();
        assert_eq!(reversed.equation_numbers(), [-1, 3, -1, 0, 1, 2]);
        assert!(matches!(Unknowns::new(800_000_000, |_, _| true), Err(SparsityError::TooLarge(2_400_000_000))));
    }
}
