//! The connected components of a network.

use std::collections::BTreeMap;

/// A connected component of a network. A node without fibers is a component.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "app", derive(serde::Serialize))]
pub struct Component {
    /// The lowest node of the component.
    pub first_node: u32,
    /// Number of nodes.
    pub nodes: usize,
    /// Number of fibers.
    pub fibers: usize,
    /// True if a node of the component lies on the boundary; otherwise the component is unsupported and carries no
    /// load.
    pub supported: bool,
}

/// Returns for every node the lowest node of its component.
pub(super) fn roots(nodes: usize, fibers: impl Iterator<Item = [u32; 2]>) -> Vec<u32> {
    let mut parent: Vec<u32> = (0..nodes as u32).collect();
    for [a, b] in fibers {
        let (a, b) = (root(&mut parent, a), root(&mut parent, b));
        parent[a.max(b) as usize] = a.min(b);
    }
    (0..nodes as u32).map(|node| root(&mut parent, node)).collect()
}

/// Returns the root of the tree of a node in a union-find structure, and halves the path to the root.
fn root(parent: &mut [u32], mut node: u32) -> u32 {
    while parent[node as usize] != node {
        parent[node as usize] = parent[parent[node as usize] as usize];
        node = parent[node as usize];
    }
    node
}

/// Returns the components ordered by their lowest node, given the root of every node.
pub(super) fn components(roots: &[u32], boundary: &[u32], fibers: impl Iterator<Item = [u32; 2]>) -> Vec<Component> {
    let mut parts: BTreeMap<u32, Component> = BTreeMap::new();
    for &root in roots {
        let part = parts.entry(root).or_insert(Component { first_node: root, ..Component::default() });
        part.nodes += 1;
    }
    for &node in boundary {
        parts.entry(roots[node as usize]).or_default().supported = true;
    }
    for [a, _] in fibers {
        parts.entry(roots[a as usize]).or_default().fibers += 1;
    }
    parts.into_values().collect()
}
