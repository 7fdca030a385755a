//! Clusters of elements, from which METIS makes shards.

use super::bisected;
use crate::backends::metis::Graph;
use crate::fem::element::CellType;
use crate::fem::mesh::Mesh;

/// A mesh in clusters of neighboring elements, with about as many elements each. Two clusters are neighbors if they share
/// corners of elements; their edge weighs as many.
pub(super) struct Clusters {
    /// The cluster of each element.
    pub of_element: Vec<u32>,
    /// The number of elements of each cluster.
    pub sizes: Vec<i32>,
    near: Vec<Vec<u32>>,
    /// The number of corners that a cluster shares with each of its neighbors.
    shared: Vec<Vec<i32>>,
}

/// The number of clusters of a shard: shards differ by a few of them, that is about 1 %.
const CLUSTERS_OF_SHARD: usize = 256;

impl Clusters {
    /// Divides a mesh into clusters; `None` if these would be too small to be worth it.
    pub fn new(mesh: &Mesh, shards: usize) -> Option<Self> {
        const FEWEST_ELEMENTS: usize = 4;
        let clusters = CLUSTERS_OF_SHARD * shards;
        if mesh.elements().len() < FEWEST_ELEMENTS * clusters {
            return None;
        }
        let of_element = bisected(mesh, clusters);
        let mut sizes = vec![0; clusters];
        of_element.iter().for_each(|&cluster| sizes[cluster as usize] += 1);
        let (mut near, mut shared) = (vec![Vec::new(); clusters], vec![Vec::new(); clusters]);
        for pairs in shared_nodes(mesh, &of_element).chunk_by(|a, b| a == b) {
            let [a, b] = pairs[0].map(|cluster| cluster as usize);
            for (cluster, neighbor) in [(a, b), (b, a)] {
                near[cluster].push(neighbor as u32);
                shared[cluster].push(pairs.len() as i32);
            }
        }
        Some(Self { of_element, sizes, near, shared })
    }
}

/// Returns the pairs of clusters at each corner of the mesh, sorted: a pair as often as it shares corners.
fn shared_nodes(mesh: &Mesh, of_element: &[u32]) -> Vec<[u32; 2]> {
    let corners = |element: usize| {
        let corners = mesh.elements().cell_type(element).corners();
        mesh.elements()[element][..corners].iter().map(|&node| node as usize)
    };
    let mut first = vec![0; mesh.nodes().len() + 1];
    (0..of_element.len()).flat_map(corners).for_each(|node| first[node + 1] += 1);
    (0..mesh.nodes().len()).for_each(|node| first[node + 1] += first[node]);
    let (mut clusters, mut next) = (vec![0; first[mesh.nodes().len()]], first.clone());
    for (element, &cluster) in of_element.iter().enumerate() {
        for node in corners(element) {
            clusters[next[node]] = cluster;
            next[node] += 1;
        }
    }
    let mut pairs = Vec::new();
    for of_node in first.windows(2) {
        let at_node = &mut clusters[of_node[0]..of_node[1]];
        at_node.sort_unstable();
        let mut distinct = at_node.chunk_by(|a, b| a == b).map(|same| same[0]);
        while let Some(a) = distinct.next() {
            pairs.extend(distinct.clone().map(|b| [a, b]));
        }
    }
    pairs.sort_unstable();
    pairs
}

impl Graph for Clusters {
    fn nodes(&self) -> usize {
        self.near.len()
    }

    fn near(&self, cluster: usize) -> &[u32] {
        &self.near[cluster]
    }

    fn edge_weights(&self, cluster: usize) -> &[i32] {
        &self.shared[cluster]
    }
}

#[cfg(test)]
mod tests {
    use super::super::partition;
    use super::*;
    use crate::fem::mesh::QuadraticHexahedron;
    use crate::fem::mesh::shapes::cuboid;

    /// Partitions by clusters are as even as a cluster allows, and cut hardly more faces than those by elements.
    #[test]
    fn shards_of_many_elements_consist_of_clusters() {
        let linear = cuboid([24, 12, 8], [3.0, 1.0, 1.0]).unwrap();
        let quadratic = linear.quadratic(QuadraticHexahedron::Serendipity).unwrap();
        for (mesh, shards) in [(&linear, 2), (&linear, 7), (&linear, 12), (&quadratic, 7)] {
            let elements = mesh.elements().len();
            let neighbors = mesh.neighbors();
            let cut = |shard_of: &[u32]| {
                let between = |element: usize| {
                    let near = neighbors.of(element).iter();
                    near.filter(|&&other| shard_of[other as usize] != shard_of[element]).count()
                };
                (0..elements).map(between).sum::<usize>() / 2
            };
            let clusters = Clusters::new(mesh, shards).unwrap();
            let most = clusters.sizes.iter().max().copied().unwrap_or_default() as usize;
            assert_eq!(clusters.sizes.iter().sum::<i32>() as usize, elements);
            assert!(clusters.sizes.iter().all(|&size| size as usize + 1 >= most), "of one size");
            let shard_of = partition(mesh, shards);
            assert_eq!(shard_of, partition(mesh, shards), "the same again");
            assert_eq!(shard_of, partition(&linear, shards), "nodes on edges change nothing");
            let together = |of: &[usize]| of.iter().all(|&element| shard_of[element] == shard_of[of[0]]);
            let mut of_cluster = vec![Vec::new(); clusters.sizes.len()];
            (0..elements).for_each(|element| of_cluster[clusters.of_element[element] as usize].push(element));
            assert!(of_cluster.iter().all(|of| together(of)));
            let mut counts = vec![0; shards];
            shard_of.iter().for_each(|&shard| counts[shard as usize] += 1);
            let even = elements as f64 / shards as f64;
            assert!(counts.iter().all(|&count| (f64::from(count) - even).abs() < 0.02 * even), "{counts:?}");
            let by_elements = crate::backends::metis::partition(&neighbors, shards).unwrap();
            let (cut, of_elements) = (cut(&shard_of), cut(&by_elements));
            assert!(2 * cut <= 3 * of_elements, "{shards} shards: {cut} faces, by elements {of_elements}");
        }
        assert!(Clusters::new(&linear, 14).is_none(), "shards of few elements");
    }
}
