//! The part of a rank with more elements, on which boundary conditions are resolved.

use std::sync::Arc;

use super::{Division, Faces, Mesh, Part};

/// The part of a mesh that one rank holds, with all surfaces of the mesh complete: what a rank needs to resolve the
/// boundary conditions of the body on its part without the rest of the mesh. Of a mesh that is divided in three dimensions,
/// surfaces are a small part.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "app", derive(serde::Serialize, serde::Deserialize))]
pub struct Excerpt {
    mesh: Mesh,
    /// Whether each element belongs to the part, as own element or as ghost.
    is_held: Vec<bool>,
}

/// The elements of the excerpts of all ranks.
pub struct ExcerptElements {
    /// The elements of the part of each rank.
    of_parts: Vec<Vec<u32>>,
    /// The elements that all excerpts have.
    common: Vec<u32>,
}

impl ExcerptElements {
    /// Divides the elements of a mesh; those at its surfaces and at the given nodes belong to all excerpts.
    ///
    /// # Panics
    /// Panics if the division is not one of the mesh.
    pub fn new(mesh: &Mesh, division: &Division, nodes: impl Iterator<Item = u32>) -> Self {
        let (mut on_surface, mut is_chosen) = (vec![false; mesh.nodes().len()], vec![false; mesh.nodes().len()]);
        for &node in mesh.surfaces().iter().flat_map(|surface| surface.faces.iter().flatten()) {
            on_surface[node as usize] = true;
        }
        nodes.for_each(|node| is_chosen[node as usize] = true);
        let is_common = |nodes: &[u32]| {
            // Three corners of every face lie on the surface; some elements without a face there come along.
            nodes.iter().filter(|&&node| on_surface[node as usize]).count() >= 3
                || nodes.iter().any(|&node| is_chosen[node as usize])
        };
        let common = (0..).zip(mesh.elements().iter()).filter(|(_, nodes)| is_common(nodes));
        Self { of_parts: mesh.elements_of_parts(division), common: common.map(|(element, _)| element).collect() }
    }

    /// Returns the elements of the part of a rank, ascending.
    ///
    /// # Panics
    /// Panics if there is no such rank.
    pub fn of_part(&self, rank: usize) -> &[u32] {
        &self.of_parts[rank]
    }
}

impl Excerpt {
    /// Returns the excerpt of a rank.
    ///
    /// # Panics
    /// Panics if the division or the elements are not those of the mesh, or there is no such rank.
    pub fn new(mesh: &Mesh, division: &Division, rank: usize, elements: &ExcerptElements) -> Self {
        let of_part = &elements.of_parts[rank];
        let mut of_excerpt = [of_part.as_slice(), &elements.common].concat();
        // The stable sort merges the two ascending lists.
        of_excerpt.sort();
        of_excerpt.dedup();
        let mut held = of_part.iter().peekable();
        let is_held = of_excerpt.iter().map(|element| held.next_if_eq(&element).is_some()).collect();
        let place = Arc::new(mesh.place(division, rank, of_excerpt));
        let all_faces = |place: &Part, faces: &Faces| faces.map(|node| place.local_node(node).unwrap_or_default());
        Self { mesh: mesh.restricted(&place, Arc::clone(&place), all_faces), is_held }
    }

    /// The elements of the part, by their numbers in the excerpt.
    fn held(&self) -> Vec<u32> {
        (0..).zip(&self.is_held).filter(|(_, is_held)| **is_held).map(|(element, _)| element).collect()
    }

    /// Returns the mesh: the part with further ghosts.
    pub fn mesh(&self) -> &Mesh {
        &self.mesh
    }

    /// Returns the numbers in the whole mesh of the nodes of the part, ascending.
    pub fn part_nodes(&self) -> Vec<u32> {
        let nodes = self.mesh.nodes_of(&self.held());
        self.mesh
            .part()
            .map_or_else(|| nodes.clone(), |place| nodes.iter().map(|&node| place.nodes[node as usize]).collect())
    }

    /// Returns the part, as [`Mesh::divided`] returns it, and its place in the excerpt.
    pub fn part(&self) -> (Mesh, Part) {
        let mesh = &self.mesh;
        let place = mesh.part().cloned().unwrap_or_else(|| Arc::new(undivided(mesh)));
        let elements = self.held();
        let nodes = mesh.nodes_of(&elements);
        let here = Part {
            rank: place.rank,
            ranks: place.ranks,
            is_own_node: nodes.iter().map(|&node| place.is_own_node[node as usize]).collect(),
            rank_of_element: elements.iter().map(|&element| place.rank_of_element[element as usize]).collect(),
            elements_of_rank: place.elements_of_rank.clone(),
            nodes,
            elements: elements.into(),
            whole: mesh.sizes(),
            whole_points: mesh.points().clone(),
        };
        let in_whole = Part {
            nodes: here.nodes.iter().map(|&node| place.nodes[node as usize]).collect(),
            elements: here.elements.iter().map(|&element| place.elements[element as usize]).collect(),
            whole: place.whole,
            whole_points: place.whole_points.clone(),
            ..here.clone()
        };
        (mesh.restricted(&here, Arc::new(in_whole), |part, faces| part.faces(faces).0), here)
    }
}

/// Returns the place of a mesh in itself.
fn undivided(mesh: &Mesh) -> Part {
    let (nodes, elements) = (mesh.nodes().len(), mesh.elements().len());
    Part {
        rank: 0,
        ranks: 1,
        nodes: (0..nodes as u32).collect(),
        is_own_node: vec![true; nodes],
        elements: (0..elements as u32).collect(),
        rank_of_element: vec![0; elements],
        elements_of_rank: vec![elements],
        whole: mesh.sizes(),
        whole_points: mesh.points().clone(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fem::element::ElementType;
    use crate::fem::mesh::shapes;

    /// A part that a rank takes out of its excerpt is the one that it would take out of the whole mesh.
    #[test]
    fn the_part_of_an_excerpt_is_that_of_the_whole_mesh() {
        let cube = |element_type| shapes::cuboid_of(element_type, [5, 3, 4], [5.0, 3.0, 4.0]).unwrap();
        let patches = |mesh: Mesh| mesh.with_patches(|_| true);
        let dogbone = shapes::dogbone(&shapes::DogboneShape::default(), 1.5e-3).unwrap();
        let meshes =
            [patches(cube(ElementType::Tet4)), patches(cube(ElementType::Hex8)), cube(ElementType::Tet10), dogbone];
        for mesh in meshes {
            let elements = mesh.elements().len();
            for ranks in [1, 2, 5] {
                let rank_of: Vec<u32> = (0..elements).map(|element| (element * ranks / elements) as u32).collect();
                let group: Vec<u32> = mesh.surfaces()[0].nodes();
                let division = Division::new(&mesh, rank_of, ranks, std::iter::once(group.as_slice()));
                let elements = ExcerptElements::new(&mesh, &division, std::iter::once(3));
                for rank in 0..ranks {
                    let excerpt = Excerpt::new(&mesh, &division, rank, &elements);
                    let (part, here) = excerpt.part();
                    assert_eq!(part, mesh.divided(&division, rank), "rank {rank} of {ranks}");
                    assert_eq!(excerpt.part_nodes(), part.part().unwrap().nodes);
                    for (&node, x) in here.nodes.iter().zip(part.nodes()) {
                        assert_eq!(excerpt.mesh().nodes()[node as usize], *x);
                    }
                    assert!(excerpt.mesh().local_node(3).is_some());
                    for (surface, whole) in excerpt.mesh().surfaces().iter().zip(mesh.surfaces()) {
                        let place = excerpt.mesh().part().unwrap();
                        assert_eq!(surface.faces.map(|node| place.nodes[node as usize]), whole.faces);
                    }
                }
            }
        }
    }
}
