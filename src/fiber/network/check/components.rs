//! The connected parts of a network.

use std::collections::BTreeMap;

/// A connected part of a network. A node without fibers is a part of its own.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "app", derive(serde::Serialize))]
pub struct Component {
    /// The lowest of its nodes.
    pub first_node: u32,
    /// How many nodes it has.
    pub nodes: usize,
    /// How many fibers it has.
    pub fibers: usize,
    /// Whether one of its nodes lies on the boundary: otherwise nothing holds it, and it carries no load.
    pub tied: bool,
}

/// The lowest node that every node is connected with.
pub(super) fn roots(nodes: usize, fibers: impl Iterator<Item = [u32; 2]>) -> Vec<u32> {
    let mut parent: Vec<u32> = (0..nodes as u32).collect();
    for [a, b] in fibers {
        let (a, b) = (root(&mut parent, a), root(&mut parent, b));
        parent[a.max(b) as usize] = a.min(b);
    }
    (0..nodes as u32).map(|node| root(&mut parent, node)).collect()
}

/// The root of a node's tree; the path to it is halved on the way.
fn root(parent: &mut [u32], mut node: u32) -> u32 {
    while parent[node as usize] != node {
        parent[node as usize] = parent[parent[node as usize] as usize];
        node = parent[node as usize];
    }
    node
}

/// The components by their lowest node, ascending, given every node's root.
pub(super) fn components(roots: &[u32], boundary: &[u32], fibers: impl Iterator<Item = [u32; 2]>) -> Vec<Component> {
    let mut parts: BTreeMap<u32, Component> = BTreeMap::new();
    for &root in roots {
        let part = parts.entry(root).or_insert(Component { first_node: root, ..Component::default() });
        part.nodes += 1;
    }
    for &node in boundary {
        parts.entry(roots[node as usize]).or_default().tied = true;
    }
    for [a, _] in fibers {
        parts.entry(roots[a as usize]).or_default().fibers += 1;
    }
    parts.into_values().collect()
}
