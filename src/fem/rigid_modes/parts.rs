//! Connected parts of a mesh.

use std::collections::BTreeMap;

use crate::fem::kinematics::RigidSurface;
use crate::fem::mesh::Mesh;

/// A connected part of the mesh.
pub(super) struct Part {
    /// The nodes of the part, ascending.
    pub(super) nodes: Vec<u32>,
    elements: Vec<u32>,
}

impl Part {
    /// Describes the part by its number of elements, position and regions.
    pub(super) fn name(&self, mesh: &Mesh) -> String {
        let mut regions: Vec<u32> = self.elements.iter().map(|&element| mesh.region_of()[element as usize]).collect();
        regions.sort_unstable();
        regions.dedup();
        let named: Vec<String> = regions.iter().map(|&k| format!("`{}`", mesh.regions()[k as usize])).collect();
        let word = if named.len() == 1 { "region" } else { "regions" };
        let [x, y, z] = mesh.nodes()[self.nodes[0] as usize];
        let count = self.elements.len();
        format!("the unconnected part of {count} elements at ({x}, {y}, {z}), {word} {},", named.join(", "))
    }
}

/// Returns the parts, which rigid surfaces connect, by ascending lowest node.
pub(super) fn parts(mesh: &Mesh, rigid: &[RigidSurface]) -> Vec<Part> {
    let mut parent: Vec<u32> = (0..mesh.nodes().len() as u32).collect();
    let surfaces = rigid.iter().map(|surface| &surface.nodes[..]).filter(|nodes| !nodes.is_empty());
    for nodes in mesh.elements().iter().chain(surfaces) {
        for &node in &nodes[1..] {
            let (a, b) = (root(&mut parent, nodes[0]), root(&mut parent, node));
            parent[a.max(b) as usize] = a.min(b);
        }
    }
    let mut parts: BTreeMap<u32, Part> = BTreeMap::new();
    for node in 0..mesh.nodes().len() as u32 {
        let part = parts.entry(root(&mut parent, node));
        part.or_insert_with(|| Part { nodes: Vec::new(), elements: Vec::new() }).nodes.push(node);
    }
    for (element, nodes) in (0..).zip(mesh.elements()) {
        if let Some(part) = parts.get_mut(&root(&mut parent, nodes[0])) {
            part.elements.push(element);
        }
    }
    parts.into_values().collect()
}

/// Returns the root of a node in the union-find forest, the lowest node of its set; halves the path on the way.
fn root(parent: &mut [u32], mut node: u32) -> u32 {
    while parent[node as usize] != node {
        parent[node as usize] = parent[parent[node as usize] as usize];
        node = parent[node as usize];
    }
    node
}
