//! The parts of a mesh as read from a file, corrected where that is unambiguous.

use super::gmsh::MeshFile;
use super::measure::signed_volume;
use super::{Elements, Mesh, MeshError, Surface};
use crate::fem::element::{ElementType, FaceType};

/// Types and nodes of faces, each with the index of its cell in the file.
pub(crate) type GroupFaces = Vec<(FaceType, Vec<u32>, usize)>;

/// The parts of a mesh, with nodes that may belong to no element.
pub(crate) struct Parts {
    pub nodes: Vec<[f64; 3]>,
    pub elements: Elements,
    /// The region of each element.
    pub region_of: Vec<u32>,
    pub regions: Vec<String>,
    /// The surfaces.
    pub groups: Vec<(String, GroupFaces)>,
}

/// Reverses an element of negative volume; returns true if it did.
pub(crate) fn make_upright(element_type: ElementType, nodes: &mut Vec<u32>, positions: &[[f64; 3]]) -> bool {
    let of_element: Vec<_> = nodes.iter().map(|&node| positions[node as usize]).collect();
    let is_reversed = signed_volume(element_type, &of_element) < 0.0;
    if is_reversed {
        *nodes = element_type.mirrored().iter().map(|&node| nodes[node]).collect();
    }
    is_reversed
}

/// Returns the warning of elements that were reversed, for the readers of meshes.
#[cfg(feature = "app")]
pub(crate) fn reversed_warning(count: usize) -> Option<String> {
    match count {
        0 => None,
        1 => Some("1 element had a negative volume and has been reversed".into()),
        _ => Some(format!("{count} elements had a negative volume and have been reversed")),
    }
}

impl Parts {
    /// Creates the mesh without the nodes that belong to no element, and appends to the warnings.
    pub fn into_mesh<E>(
        mut self,
        mut warnings: Vec<String>,
        explain: impl Fn(&MeshError, &[(String, GroupFaces)]) -> E,
    ) -> Result<MeshFile, E> {
        let dropped = self.drop_unused_nodes().map_err(|error| explain(&error, &self.groups))?;
        if dropped > 0 {
            warnings.push(match dropped {
                1 => "1 node belongs to no element and is left out".into(),
                _ => format!("{dropped} nodes belong to no element and are left out"),
            });
        }
        let coincident = coincident(&self.nodes);
        if coincident > 0 {
            let nodes = if coincident == 1 { "1 node has".to_owned() } else { format!("{coincident} nodes have") };
            warnings.push(format!(
                "{nodes} exactly the position of another node: parts of the body may not be connected there"
            ));
        }
        let surfaces = self.groups.iter().map(|(name, group)| {
            let faces = group.iter().map(|(face_type, nodes, _)| (*face_type, nodes.as_slice())).collect();
            Surface { name: name.clone(), faces }
        });
        let mesh = Mesh::new(self.nodes, self.elements, self.region_of, self.regions, surfaces.collect())
            .map_err(|error| explain(&error, &self.groups))?;
        Ok(MeshFile { mesh, warnings })
    }

    /// Removes the nodes without elements, renumbers the others, and returns the number of removed nodes.
    ///
    /// # Errors
    /// Returns [`MeshError::NotAFace`] if a face contains a node without elements.
    fn drop_unused_nodes(&mut self) -> Result<usize, MeshError> {
        const UNUSED: u32 = u32::MAX;
        let mut index = vec![UNUSED; self.nodes.len()];
        for &node in self.elements.iter().flatten() {
            index[node as usize] = 0;
        }
        for (surface, group) in &self.groups {
            let is_loose = |(_, nodes, _): &(_, Vec<u32>, _)| nodes.iter().any(|&node| index[node as usize] == UNUSED);
            if let Some(face) = group.iter().position(is_loose) {
                let nodes = group[face].1.clone();
                return Err(MeshError::NotAFace { surface: surface.clone(), face, nodes });
            }
        }
        for (index, next) in index.iter_mut().filter(|index| **index != UNUSED).zip(0..) {
            *index = next;
        }
        let before = self.nodes.len();
        let mut used = index.iter().map(|&index| index != UNUSED);
        self.nodes.retain(|_| used.next().unwrap_or(true));
        self.elements = self.elements.map(|node| index[node as usize]);
        let faces = self.groups.iter_mut().flat_map(|(_, group)| group);
        faces.flat_map(|(_, nodes, _)| nodes).for_each(|node| *node = index[*node as usize]);
        Ok(before - self.nodes.len())
    }
}

/// Returns the number of nodes that coincide exactly with another node.
fn coincident(nodes: &[[f64; 3]]) -> usize {
    // Adding zero turns -0 into +0.
    let mut positions: Vec<[u64; 3]> = nodes.iter().map(|node| node.map(|x| (x + 0.0).to_bits())).collect();
    positions.sort_unstable();
    positions.windows(2).filter(|pair| pair[0] == pair[1]).count()
}
