//! Merging of nodes that short fibers join.
//!
//! The stiffness of a fiber is inversely proportional to its length: a fiber a hundred times shorter than the others
//! acts as a rigid link and makes the stiffness matrix ill-conditioned. Its ends are therefore merged into one node
//! with all their other fibers.

use super::alignment::Stretch;
use super::clip::Clipped;

impl Clipped {
    /// Merges the ends of all fibers shorter than `shortest`, measured in the isotropic space, shortest first, until no
    /// such fiber is left. Nodes that are merged form a cluster. A cluster without a boundary node becomes a node at
    /// the mean position of its nodes; a cluster with a boundary node becomes that node, which may then have several
    /// fibers. No cluster has two boundary nodes. Fibers between two boundary nodes are dropped: they would deform
    /// affinely and not interact with the interior.
    pub(super) fn merge_short_fibers(self, shortest: f64, stretch: Stretch) -> Self {
        let mut weights = vec![1.0; self.nodes.len()];
        let mut network = self;
        loop {
            let short = network.fibers_shorter_than(shortest, stretch);
            if short.is_empty() {
                return network;
            }
            let roots = network.clusters(&short);
            network = network.contract(&roots, &mut weights);
        }
    }

    /// Returns the fibers shorter than `shortest`, ordered by length.
    fn fibers_shorter_than(&self, shortest: f64, stretch: Stretch) -> Vec<usize> {
        let length = |fiber: usize| {
            let [a, b] = self.fibers[fiber].map(|node| self.nodes[node as usize]);
            stretch.distance(a, b)
        };
        let mut short: Vec<(f64, usize)> = (0..self.fibers.len())
            .map(|fiber| (length(fiber), fiber))
            .filter(|&(length, _)| length < shortest)
            .collect();
        short.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        short.into_iter().map(|(_, fiber)| fiber).collect()
    }

    /// Returns for every node the lowest node of its cluster.
    fn clusters(&self, short: &[usize]) -> Vec<u32> {
        let mut parent: Vec<u32> = (0..self.nodes.len() as u32).collect();
        let mut on_face = self.on_face.clone();
        let root = |parent: &[u32], mut node: u32| {
            while parent[node as usize] != node {
                node = parent[node as usize];
            }
            node
        };
        for &fiber in short {
            let [a, b] = self.fibers[fiber].map(|node| root(&parent, node));
            if a != b && !(on_face[a as usize] && on_face[b as usize]) {
                let (low, high) = (a.min(b), a.max(b));
                parent[high as usize] = low;
                on_face[low as usize] |= on_face[high as usize];
            }
        }
        (0..self.nodes.len() as u32).map(|node| root(&parent, node)).collect()
    }

    /// Contracts each cluster to one node; `weights` contains the number of original nodes merged into each node.
    fn contract(self, roots: &[u32], weights: &mut Vec<f64>) -> Self {
        let mut number = vec![u32::MAX; self.nodes.len()];
        let mut merged = Self { nodes: Vec::new(), fibers: Vec::new(), on_face: Vec::new() };
        let mut sums: Vec<([f64; 3], f64)> = Vec::new();
        for (node, &root) in roots.iter().enumerate() {
            if root as usize == node {
                number[node] = sums.len() as u32;
                sums.push(([0.0; 3], 0.0));
                merged.on_face.push(false);
                merged.nodes.push([0.0; 3]);
            }
            let cluster = number[root as usize] as usize;
            number[node] = cluster as u32;
            let weight = weights[node];
            let (sum, total) = &mut sums[cluster];
            *total += weight;
            (0..3).for_each(|k| sum[k] += weight * self.nodes[node][k]);
            if self.on_face[node] {
                merged.on_face[cluster] = true;
                merged.nodes[cluster] = self.nodes[node];
            } else if !merged.on_face[cluster] {
                // A node that is not merged keeps its position bitwise.
                let alone = weight == *total;
                merged.nodes[cluster] = if alone { self.nodes[node] } else { sum.map(|x| x / *total) };
            }
        }
        *weights = sums.into_iter().map(|(_, total)| total).collect();
        let mut seen = std::collections::HashSet::with_capacity(self.fibers.len());
        for ends in self.fibers {
            let [a, b] = ends.map(|node| number[node as usize]);
            let between_faces = merged.on_face[a as usize] && merged.on_face[b as usize];
            if a != b && !between_faces && seen.insert([a.min(b), a.max(b)]) {
                merged.fibers.push([a, b]);
            }
        }
        merged.without_unused_nodes(weights)
    }

    /// Drops nodes without fibers.
    fn without_unused_nodes(self, weights: &mut Vec<f64>) -> Self {
        let mut used = vec![false; self.nodes.len()];
        self.fibers.iter().flatten().for_each(|&node| used[node as usize] = true);
        let mut number = vec![0; self.nodes.len()];
        let mut kept = Self { nodes: Vec::new(), fibers: self.fibers, on_face: Vec::new() };
        let mut kept_weights = Vec::new();
        for node in (0..used.len()).filter(|&node| used[node]) {
            number[node] = kept.nodes.len() as u32;
            kept.nodes.push(self.nodes[node]);
            kept.on_face.push(self.on_face[node]);
            kept_weights.push(weights[node]);
        }
        kept.fibers.iter_mut().flatten().for_each(|node| *node = number[*node as usize]);
        *weights = kept_weights;
        kept
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NONE: Option<&super::super::Alignment> = None;

    /// Returns boundary nodes 0 and 1, a short fiber 2-3 whose ends have the common neighbor 4, and a node 5 close to
    /// node 1.
    fn network() -> Clipped {
        Clipped {
            nodes: vec![
                [-0.5, 0.0, 0.0],
                [0.5, 0.0, 0.0],
                [0.0, 0.0, 0.0],
                [0.02, 0.0, 0.0],
                [0.0, 0.3, 0.0],
                [0.49, 0.0, 0.0],
            ],
            fibers: vec![[0, 2], [2, 3], [2, 4], [3, 4], [3, 5], [5, 1], [4, 5], [5, 0]],
            on_face: vec![true, true, false, false, false, false],
        }
    }

    #[test]
    fn the_ends_of_short_fibers_are_merged() {
        let merged = network().merge_short_fibers(0.05, Stretch::of(NONE));
        // Nodes 2 and 3 merge halfway; node 5 merges into node 1, and its fiber to node 0 is dropped.
        assert_eq!(merged.nodes, [[-0.5, 0.0, 0.0], [0.5, 0.0, 0.0], [0.01, 0.0, 0.0], [0.0, 0.3, 0.0]]);
        assert_eq!(merged.on_face, [true, true, false, false]);
        assert_eq!(merged.fibers, [[0, 2], [2, 3], [2, 1], [3, 1]]);
    }

    #[test]
    fn a_network_without_short_fibers_is_unchanged() {
        let (before, after) = (network(), network().merge_short_fibers(0.005, Stretch::of(NONE)));
        assert_eq!((after.nodes, after.fibers, after.on_face), (before.nodes, before.fibers, before.on_face));
    }

    #[test]
    fn two_boundary_nodes_never_merge() {
        let nodes = vec![[-0.5, 0.49, 0.0], [-0.49, 0.5, 0.0], [-0.49, 0.49, 0.0], [0.0; 3], [0.0, 0.0, 0.5]];
        let fibers = vec![[0, 2], [1, 2], [2, 3], [3, 4]];
        let merged = Clipped { nodes, fibers, on_face: vec![true, true, false, false, true] }
            .merge_short_fibers(0.1, Stretch::of(NONE));
        // Node 2 merges into boundary node 0; boundary node 1, then joined to node 0 only, is dropped.
        assert_eq!(merged.nodes, [[-0.5, 0.49, 0.0], [0.0; 3], [0.0, 0.0, 0.5]]);
        assert_eq!(merged.fibers, [[0, 1], [1, 2]]);
    }
}
