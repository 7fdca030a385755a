//! Patches of elements that share one dilatation, against volumetric locking.
//!
//! Linear elements lock in nearly incompressible materials: they have more volume constraints, one per integration
//! point, than their displacements can satisfy. The F-bar method imposes one constraint per patch instead; see
//! [`assembly`](crate::fem::assembly#f-bar).
//!
//! A linear hexahedron is a patch of its own (E. A. de Souza Neto, D. Peric, M. Dutko, D. R. J. Owen, Int. J. Solids
//! Struct. 33 (1996) 3277-3296). Linear tetrahedra form patches of several elements (E. A. de Souza Neto, F. M. Andrade
//! Pires, D. R. J. Owen, Int. J. Numer. Methods Eng. 62 (2005) 353-383): those around a common longest edge, which for
//! a cell of six tetrahedra is its diagonal. There are then about as many patches as nodes, as in a good mixed element.
//! Wedges get no patches, because one dilatation per wedge leaves too many constraints; quadratic elements need none.

use std::collections::HashMap;

use super::Mesh;
use super::measure::{difference, dot};
use crate::fem::element::ElementType;

/// The smallest number of tetrahedra around an edge that form a patch; fewer join a neighboring patch.
const FEWEST: usize = 4;

impl Mesh {
    /// Returns the mesh with patches of the linear hexahedra and tetrahedra of the regions for which `in_region` returns
    /// true; earlier patches are removed. All elements of a patch lie in one region.
    pub fn with_patches(mut self, in_region: impl Fn(u32) -> bool) -> Self {
        let mut patches = Vec::new();
        for region in (0..self.regions.len() as u32).filter(|&region| in_region(region)) {
            let of_type = |wanted| -> Vec<u32> {
                let elements = self.elements_in(region).filter(|&element| self.elements.cell_type(element) == wanted);
                elements.map(|element| element as u32).collect()
            };
            patches.extend(of_type(ElementType::Hex8).into_iter().map(|element| vec![element]));
            patches.extend(tetrahedron_patches(&self, of_type(ElementType::Tet4)));
        }
        self.patches = patches;
        self
    }

    /// Returns the elements of each patch, whose points share one dilatation; empty unless
    /// [`Mesh::with_patches`] made patches. Elements of no patch are plain displacement elements.
    pub fn patches(&self) -> &[Vec<u32>] {
        &self.patches
    }
}

/// Divides tetrahedra into patches: longest edges first, all free tetrahedra around an edge if they are at least
/// [`FEWEST`]. The others join the smallest patch that shares a face with them.
fn tetrahedron_patches(mesh: &Mesh, tetrahedra: Vec<u32>) -> Vec<Vec<u32>> {
    let mut patch_of: HashMap<u32, usize> = HashMap::new();
    let mut patches: Vec<Vec<u32>> = Vec::new();
    for around in tetrahedra_by_edge(mesh, &tetrahedra) {
        let free: Vec<u32> = around.into_iter().filter(|element| !patch_of.contains_key(element)).collect();
        if free.len() >= FEWEST {
            patch_of.extend(free.iter().map(|&element| (element, patches.len())));
            patches.push(free);
        }
    }
    let mut left: Vec<u32> = tetrahedra.into_iter().filter(|element| !patch_of.contains_key(element)).collect();
    let neighbors = (!left.is_empty()).then(|| mesh.neighbors());
    let near = |element: u32| neighbors.as_ref().map_or(&[][..], |neighbors| neighbors.of(element as usize));
    while !left.is_empty() {
        let before = left.len();
        left.retain(|&element| {
            let beside = near(element).iter().filter_map(|neighbor| patch_of.get(neighbor).copied());
            let Some(patch) = beside.min_by_key(|&patch| (patches[patch].len(), patch)) else { return true };
            patch_of.insert(element, patch);
            patches[patch].push(element);
            false
        });
        if left.len() == before {
            // No patch is near: the first starts one, which the others may join.
            let first = left.remove(0);
            patch_of.insert(first, patches.len());
            patches.push(vec![first]);
        }
    }
    patches.iter_mut().for_each(|patch| patch.sort_unstable());
    patches
}

/// Returns the tetrahedra around every edge, longest edges first. Lengths that agree to eight digits count as equal, so
/// that rounding does not decide; equal edges are in the order of their nodes.
fn tetrahedra_by_edge(mesh: &Mesh, tetrahedra: &[u32]) -> Vec<Vec<u32>> {
    let mut around: HashMap<[u32; 2], Vec<u32>> = HashMap::new();
    for &element in tetrahedra {
        let nodes = &mesh.elements[element as usize];
        for edge in ElementType::Tet4.edges() {
            let [a, b] = edge.map(|corner| nodes[corner]);
            around.entry([a.min(b), a.max(b)]).or_default().push(element);
        }
    }
    let length = |[a, b]: [u32; 2]| {
        let edge = difference(mesh.nodes[b as usize], mesh.nodes[a as usize]);
        dot(edge, edge).sqrt()
    };
    let longest = around.keys().map(|&edge| length(edge)).fold(0.0, f64::max);
    let rounded = |edge| (length(edge) / longest * 1e8).round() as i64;
    let mut edges: Vec<_> = around.into_iter().map(|(edge, around)| (-rounded(edge), edge, around)).collect();
    edges.sort_unstable_by_key(|&(length, edge, _)| (length, edge));
    edges.into_iter().map(|(_, _, around)| around).collect()
}

#[cfg(test)]
mod tests {
    use crate::fem::mesh::shapes;

    #[test]
    fn the_six_tetrahedra_of_a_cell_are_a_patch() {
        let mesh = shapes::cuboid([3, 2, 2], [1.0, 0.8, 0.5]).unwrap().with_patches(|_| true);
        assert_eq!(mesh.patches().len(), 12);
        for patch in mesh.patches() {
            assert_eq!(patch.len(), 6);
            assert!(patch.iter().all(|element| element / 6 == patch[0] / 6), "{patch:?}");
        }
        assert!(mesh.with_patches(|_| false).patches().is_empty());
    }

    #[test]
    fn every_tetrahedron_of_an_irregular_mesh_is_in_one_patch() {
        let mesh = shapes::dogbone(&shapes::DogboneShape::default(), 3e-3).unwrap().with_patches(|_| true);
        let mut elements: Vec<u32> = mesh.patches().concat();
        elements.sort_unstable();
        assert_eq!(elements, (0..mesh.elements().len() as u32).collect::<Vec<_>>());
        let mean = elements.len() as f64 / mesh.patches().len() as f64;
        assert!((4.0..10.0).contains(&mean), "{mean} tetrahedra in a patch");
        let region = |element: u32| mesh.region_of()[element as usize];
        assert!(mesh.patches().iter().all(|patch| patch.iter().all(|&element| region(element) == region(patch[0]))));
    }
}
