//! The part of a mesh that one rank holds.

use std::collections::HashMap;
use std::sync::Arc;

use super::{Elements, Faces, Mesh, PointNumbering, Surface};

/// The division of a mesh among ranks.
///
/// Every element belongs to one rank, and every node to the lowest rank among those of its elements. Nodes that share
/// unknowns belong to one rank.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Division {
    /// The rank of each element.
    pub rank_of_element: Vec<u32>,
    /// The rank of each node.
    pub rank_of_node: Vec<u32>,
    /// The number of ranks.
    pub ranks: usize,
    /// The number of elements of each rank.
    elements_of_rank: Vec<usize>,
}

/// The place of a part of a mesh in the whole mesh.
///
/// A part has its **own** elements and nodes, and **ghosts** of others: all elements at an own node, all elements of
/// their patches, and the nodes of all these elements. Sums over the elements at an own node are therefore complete.
/// Nodes and elements of a part are in the order of the whole mesh.
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "app", derive(serde::Serialize, serde::Deserialize))]
pub struct Part {
    /// The rank that holds the part.
    pub rank: usize,
    /// The number of ranks.
    pub ranks: usize,
    /// The number in the whole mesh of each node.
    pub nodes: Vec<u32>,
    /// Whether each node is an own one.
    pub is_own_node: Vec<bool>,
    /// The number in the whole mesh of each element.
    pub elements: Arc<[u32]>,
    /// The rank that each element belongs to.
    pub rank_of_element: Vec<u32>,
    /// The number of own elements of each rank.
    pub elements_of_rank: Vec<usize>,
    /// The size of the whole mesh.
    pub whole: Sizes,
    /// The integration points of the whole mesh.
    pub whole_points: PointNumbering,
}

/// The size of a mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "app", derive(serde::Serialize, serde::Deserialize))]
pub struct Sizes {
    /// Number of nodes.
    pub nodes: usize,
    /// Number of elements.
    pub elements: usize,
    /// Number of integration points.
    pub points: usize,
}

impl Division {
    /// Divides a mesh, given the rank of each element. All nodes of a group belong to the lowest rank among them.
    ///
    /// # Panics
    /// Panics if `rank_of_element` does not have one entry per element, or a group contains an index that is not a node.
    pub fn new<'a>(
        mesh: &Mesh,
        rank_of_element: Vec<u32>,
        ranks: usize,
        groups: impl Iterator<Item = &'a [u32]>,
    ) -> Self {
        assert_eq!(rank_of_element.len(), mesh.elements.len(), "one rank per element");
        let mut rank_of_node = vec![u32::MAX; mesh.nodes.len()];
        for (nodes, &rank) in mesh.elements.iter().zip(&rank_of_element) {
            for &node in nodes {
                let of_node = &mut rank_of_node[node as usize];
                *of_node = rank.min(*of_node);
            }
        }
        for group in groups {
            let lowest = group.iter().map(|&node| rank_of_node[node as usize]).min().unwrap_or_default();
            group.iter().for_each(|&node| rank_of_node[node as usize] = lowest);
        }
        let mut elements_of_rank = vec![0; ranks];
        rank_of_element.iter().for_each(|&rank| elements_of_rank[rank as usize] += 1);
        Self { rank_of_element, rank_of_node, ranks, elements_of_rank }
    }

    /// Returns the nodes in the order of their ranks, those of one rank ascending.
    pub fn node_order(&self) -> Vec<u32> {
        let mut order: Vec<u32> = (0..self.rank_of_node.len() as u32).collect();
        order.sort_by_key(|&node| self.rank_of_node[node as usize]);
        order
    }
}

/// Returns these numbers, each once, ascending.
fn distinct(numbers: impl Iterator<Item = u32>) -> Vec<u32> {
    let mut numbers: Vec<u32> = numbers.collect();
    numbers.sort_unstable();
    numbers.dedup();
    numbers
}

impl Part {
    /// Returns true if an element belongs to this rank.
    pub fn is_own_element(&self, element: usize) -> bool {
        self.rank_of_element[element] as usize == self.rank
    }

    /// Returns the own elements, ascending.
    pub fn own_elements(&self) -> impl Iterator<Item = usize> {
        (0..self.rank_of_element.len()).filter(|&element| self.is_own_element(element))
    }

    /// Returns the number in this part of a node of the whole mesh; `None` if the part does not have it.
    pub fn local_node(&self, node: u32) -> Option<u32> {
        self.nodes.binary_search(&node).ok().map(|local| local as u32)
    }

    /// Returns the number in this part of an own node of the whole mesh; `None` if it belongs to another rank.
    pub fn own_node(&self, node: u32) -> Option<u32> {
        self.local_node(node).filter(|&local| self.is_own_node[local as usize])
    }

    /// Returns the faces of the whole mesh with at least one own node, by the nodes of this part, and their numbers.
    pub fn faces(&self, faces: &Faces) -> (Faces, Vec<usize>) {
        let (mut of_part, mut numbers) = (Faces::default(), Vec::new());
        for (number, (face_type, nodes)) in faces.typed().enumerate() {
            let local: Option<Vec<u32>> = nodes.iter().map(|&node| self.local_node(node)).collect();
            // All nodes of a face with an own node belong to an element at that node, and are in the part.
            let Some(local) = local else { continue };
            if local.iter().any(|&node| self.is_own_node[node as usize]) {
                of_part.push(face_type, &local);
                numbers.push(number);
            }
        }
        (of_part, numbers)
    }
}

impl Mesh {
    /// Returns the part of a rank. Regions and surfaces keep their numbers, although some may be empty here; surfaces
    /// have the faces with an own node.
    ///
    /// # Panics
    /// Panics if the division does not have one rank per element and per node.
    pub fn divided(&self, division: &Division, rank: usize) -> Self {
        let elements = self.elements_of_parts(division).swap_remove(rank);
        let part = Arc::new(self.place(division, rank, elements));
        self.restricted(&part, Arc::clone(&part), |part, faces| part.faces(faces).0)
    }

    /// Returns the elements of the part of each rank, own ones and ghosts, ascending.
    pub(super) fn elements_of_parts(&self, division: &Division) -> Vec<Vec<u32>> {
        let Division { rank_of_element, rank_of_node, ranks, .. } = division;
        let ranks_of = |element: usize| {
            let of_nodes = self.elements[element].iter().map(|&node| rank_of_node[node as usize]);
            std::iter::once(rank_of_element[element]).chain(of_nodes)
        };
        // A part has all elements of a patch, or none.
        let mut patch_of = HashMap::new();
        let mut ranks_of_patches = Vec::with_capacity(self.patches.len());
        for (number, patch) in self.patches.iter().enumerate() {
            ranks_of_patches.push(distinct(patch.iter().flat_map(|&element| ranks_of(element as usize))));
            patch_of.extend(patch.iter().map(|&element| (element as usize, number)));
        }
        let mut elements = vec![Vec::new(); *ranks];
        for (element, &rank) in rank_of_element.iter().enumerate() {
            let mut add = |rank: u32| elements[rank as usize].push(element as u32);
            match patch_of.get(&element) {
                Some(&patch) => ranks_of_patches[patch].iter().copied().for_each(add),
                // Most elements; this saves the allocation.
                None if ranks_of(element).all(|of_node| of_node == rank) => add(rank),
                None => distinct(ranks_of(element)).into_iter().for_each(add),
            }
        }
        elements
    }

    /// Returns the place of these elements, ascending, and their nodes, held by a rank, in this mesh.
    pub(super) fn place(&self, division: &Division, rank: usize, elements: Vec<u32>) -> Part {
        let Division { rank_of_element, rank_of_node, ranks, .. } = division;
        let nodes = self.nodes_of(&elements);
        Part {
            rank,
            ranks: *ranks,
            is_own_node: nodes.iter().map(|&node| rank_of_node[node as usize] == rank as u32).collect(),
            rank_of_element: elements.iter().map(|&element| rank_of_element[element as usize]).collect(),
            elements_of_rank: division.elements_of_rank.clone(),
            nodes,
            elements: elements.into(),
            whole: self.sizes(),
            whole_points: self.points.clone(),
        }
    }

    /// Returns the nodes of these elements, ascending.
    pub(super) fn nodes_of(&self, elements: &[u32]) -> Vec<u32> {
        let mut is_found = vec![false; self.nodes.len()];
        let of_elements = elements.iter().flat_map(|&element| &self.elements[element as usize]).copied();
        let mut nodes: Vec<u32> =
            of_elements.filter(|&node| !std::mem::replace(&mut is_found[node as usize], true)).collect();
        nodes.sort_unstable();
        nodes
    }

    /// Returns the numbers of nodes, elements and points.
    pub(super) fn sizes(&self) -> Sizes {
        Sizes { nodes: self.nodes.len(), elements: self.elements.len(), points: self.points.len() }
    }

    /// Returns the elements of a part, given its place in this mesh and in the whole one, which are the same unless this
    /// mesh is a part itself. `faces` returns the faces of a surface by the nodes of the part.
    pub(super) fn restricted(&self, here: &Part, in_whole: Arc<Part>, faces: impl Fn(&Part, &Faces) -> Faces) -> Self {
        let mut local = vec![0; self.nodes.len()];
        (0..).zip(&here.nodes).for_each(|(number, &node)| local[node as usize] = number);
        let held = here.elements.iter().filter_map(|&element| self.elements.get(element as usize));
        let elements = held.collect::<Elements>().map(|node| local[node as usize]);
        let surface = |surface: &Surface| Surface { name: surface.name.clone(), faces: faces(here, &surface.faces) };
        let local_element = |element: &u32| here.elements.binary_search(element).ok().map(|local| local as u32);
        // Either all elements of a patch are held, or the part does not have the patch.
        let patches = self.patches.iter().filter_map(|patch| patch.iter().map(local_element).collect());
        let first_point = |element: &u32| self.points.in_whole(self.points.of_element(*element as usize).start) as u32;
        let first_points: Arc<[u32]> = here.elements.iter().map(first_point).collect();
        Self {
            nodes: here.nodes.iter().map(|&node| self.nodes[node as usize]).collect(),
            points: PointNumbering::of_part(&elements, &in_whole.elements, first_points),
            elements,
            region_of: here.elements.iter().map(|&element| self.region_of[element as usize]).collect(),
            regions: self.regions.clone(),
            surfaces: self.surfaces.iter().map(surface).collect(),
            patches: patches.collect(),
            part: Some(in_whole),
        }
    }

    /// Returns the place of this mesh in a whole one, if it is a part.
    pub fn part(&self) -> Option<&Arc<Part>> {
        self.part.as_ref()
    }

    /// Returns the size of the whole mesh.
    pub fn whole(&self) -> Sizes {
        self.part.as_ref().map_or_else(|| self.sizes(), |part| part.whole)
    }

    /// Returns the integration points of the whole mesh.
    pub fn whole_points(&self) -> &PointNumbering {
        self.part.as_ref().map_or(&self.points, |part| &part.whole_points)
    }

    /// Returns the number in this mesh of a node of the whole mesh; `None` if this mesh does not have it.
    pub fn local_node(&self, node: u32) -> Option<u32> {
        match &self.part {
            Some(part) => part.local_node(node),
            None => ((node as usize) < self.nodes.len()).then_some(node),
        }
    }

    /// Returns true if a node belongs to this rank; all nodes of a mesh that is not divided do.
    pub fn is_own_node(&self, node: u32) -> bool {
        self.part.as_ref().is_none_or(|part| part.is_own_node[node as usize])
    }

    /// Returns, for each integration point, whether its element belongs to this rank.
    pub fn own_points(&self) -> Vec<bool> {
        let own: Vec<bool> = (0..self.elements.len()).map(|element| self.is_own_element(element)).collect();
        self.points.spread(&own)
    }

    /// Returns true if an element belongs to this rank; all elements of a mesh that is not divided do.
    pub fn is_own_element(&self, element: usize) -> bool {
        self.part.as_ref().is_none_or(|part| part.is_own_element(element))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fem::mesh::shapes;

    fn divided(mesh: &Mesh, ranks: usize) -> Vec<Mesh> {
        let elements = mesh.elements().len();
        let rank_of: Vec<u32> = (0..elements).map(|element| (element * ranks / elements) as u32).collect();
        let division = Division::new(mesh, rank_of, ranks, std::iter::empty());
        (0..ranks).map(|rank| mesh.divided(&division, rank)).collect()
    }

    #[test]
    fn every_node_and_element_belongs_to_one_rank() {
        let mesh = shapes::cuboid([3, 2, 9], [3.0, 2.0, 9.0]).unwrap();
        let parts = divided(&mesh, 3);
        let (mut nodes, mut elements) = (vec![0; mesh.nodes().len()], vec![0; mesh.elements().len()]);
        for part in &parts {
            let place = part.part().unwrap();
            for (local, &node) in (0..).zip(&place.nodes) {
                assert_eq!(part.nodes()[local as usize], mesh.nodes()[node as usize]);
                nodes[node as usize] += usize::from(part.is_own_node(local));
            }
            for (local, &element) in place.elements.iter().enumerate() {
                let of_whole: Vec<u32> = part.elements()[local].iter().map(|&n| place.nodes[n as usize]).collect();
                assert_eq!(of_whole, mesh.elements()[element as usize]);
                elements[element as usize] += usize::from(part.is_own_element(local));
                assert_eq!(part.points().locate(part.points().of_element(local).start).element, element);
            }
            assert_eq!(part.whole(), mesh.whole());
        }
        assert!(nodes.iter().chain(&elements).all(|&count| count == 1));
        assert!(parts.iter().all(|part| part.elements().len() < mesh.elements().len()));
    }

    /// Forces at own nodes, and the patches that elements belong to, need all elements there.
    #[test]
    fn a_part_has_all_elements_at_its_own_nodes_and_whole_patches() {
        let mesh = shapes::cuboid([4, 3, 2], [4.0, 3.0, 2.0]).unwrap().with_patches(|_| true);
        let at = |mesh: &Mesh, node: u32| mesh.elements().iter().filter(|nodes| nodes.contains(&node)).count();
        let mut patches = 0;
        for part in divided(&mesh, 4) {
            let place = part.part().unwrap();
            for (local, &node) in (0..).zip(&place.nodes).filter(|&(local, _)| part.is_own_node(local)) {
                assert_eq!(at(&part, local), at(&mesh, node));
            }
            for patch in part.patches() {
                let whole: Vec<u32> = patch.iter().map(|&element| place.elements[element as usize]).collect();
                assert!(mesh.patches().contains(&whole));
            }
            patches += part.patches().len();
        }
        assert!(patches > mesh.patches().len(), "ghost patches");
    }

    #[test]
    fn surfaces_have_the_faces_at_own_nodes() {
        let mesh = shapes::cuboid([4, 2, 2], [4.0, 2.0, 2.0]).unwrap();
        for part in divided(&mesh, 3) {
            let place = part.part().unwrap();
            for (surface, whole) in part.surfaces().iter().zip(mesh.surfaces()) {
                let has_own = |nodes: &&[u32]| nodes.iter().any(|&node| place.own_node(node).is_some());
                assert_eq!(surface.faces.len(), whole.faces.iter().filter(has_own).count());
            }
        }
    }
}
