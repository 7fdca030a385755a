//! Assignment of the elements to the ranks of the macro scale.

#[cfg(feature = "metis")]
use crate::fem::element::CellType;
use crate::fem::mesh::Mesh;

/// Returns the shard of every element: `shards` shards with about as many elements each and few faces between them, the
/// same on every rank. METIS partitions if it is compiled in (cargo feature `metis`) and leaves no shard empty;
/// otherwise recursive bisection does, at medians of the element centers.
///
/// METIS takes more memory per element than the mesh does. Where shards have many elements, it gets clusters of elements,
/// which recursive bisection finds, instead of elements.
pub fn partition(mesh: &Mesh, shards: usize) -> Vec<u32> {
    if shards <= 1 {
        return vec![0; mesh.elements().len()];
    }
    #[cfg(feature = "metis")]
    if let Some(shard_of) = by_metis(mesh, shards) {
        return shard_of;
    }
    bisected(mesh, shards)
}

/// Partitions by METIS; `None` if METIS fails or leaves a shard empty, which happens if there are few elements.
#[cfg(feature = "metis")]
fn by_metis(mesh: &Mesh, shards: usize) -> Option<Vec<u32>> {
    use crate::backends::metis;

    let shard_of = match Clusters::new(mesh, shards) {
        Some(clusters) => {
            let shard_of_cluster = metis::partition_weighted(&clusters, &clusters.sizes, shards).ok()?;
            clusters.of_element.iter().map(|&cluster| shard_of_cluster[cluster as usize]).collect()
        }
        None => metis::partition(&mesh.neighbors(), shards).ok()?,
    };
    let mut counts = vec![0; shards];
    shard_of.iter().for_each(|&shard: &u32| counts[shard as usize] += 1);
    counts.iter().all(|&count| count > 0).then_some(shard_of)
}

/// Returns the shard of every element by recursive bisection.
fn bisected(mesh: &Mesh, shards: usize) -> Vec<u32> {
    let elements = mesh.elements().len();
    let centers: Vec<[f64; 3]> = (0..elements).map(|element| mesh.center(element)).collect();
    let mut shard_of = vec![0; elements];
    let mut all: Vec<u32> = (0..elements as u32).collect();
    bisect(&centers, &mut all, 0, shards, &mut shard_of);
    shard_of
}

/// Recursive bisection across the longest extent of the element centers, in proportion to the number of shards on each
/// side.
fn bisect(centers: &[[f64; 3]], elements: &mut [u32], first: usize, shards: usize, shard_of: &mut [u32]) {
    if shards == 1 {
        elements.iter().for_each(|&element| shard_of[element as usize] = first as u32);
        return;
    }
    let (mut lowest, mut highest) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for &element in &*elements {
        for (axis, x) in centers[element as usize].into_iter().enumerate() {
            (lowest[axis], highest[axis]) = (lowest[axis].min(x), highest[axis].max(x));
        }
    }
    let extent = |axis: usize| highest[axis] - lowest[axis];
    let axis = (0..3).max_by(|&a, &b| extent(a).total_cmp(&extent(b))).unwrap_or(0);
    let lower_count = shards / 2;
    let at = elements.len() * lower_count / shards;
    // Ties are broken by element number, so that every rank finds the same partition.
    let in_order = |&a: &u32, &b: &u32| centers[a as usize][axis].total_cmp(&centers[b as usize][axis]).then(a.cmp(&b));
    if at < elements.len() {
        elements.select_nth_unstable_by(at, in_order);
    }
    let (lower, upper) = elements.split_at_mut(at);
    bisect(centers, lower, first, lower_count, shard_of);
    bisect(centers, upper, first + lower_count, shards - lower_count, shard_of);
}

/// A mesh in clusters of neighboring elements, with about as many elements each. Two clusters are neighbors if they share
/// nodes; their link weighs as many.
#[cfg(feature = "metis")]
struct Clusters {
    of_element: Vec<u32>,
    /// The number of elements of each cluster.
    sizes: Vec<i32>,
    near: Vec<Vec<u32>>,
    shared: Vec<Vec<i32>>,
}

/// The number of clusters of a shard: shards differ by a few of them, that is about 1 %.
#[cfg(feature = "metis")]
const CLUSTERS_OF_SHARD: usize = 256;

#[cfg(feature = "metis")]
impl Clusters {
    /// Divides a mesh into clusters; `None` if these would be too small to be worth it.
    fn new(mesh: &Mesh, shards: usize) -> Option<Self> {
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
#[cfg(feature = "metis")]
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

#[cfg(feature = "metis")]
impl crate::backends::metis::Graph for Clusters {
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
    use super::*;
    use crate::fem::mesh::shapes::cuboid;

    #[test]
    fn every_shard_has_about_as_many_elements() {
        let mesh = cuboid([6, 3, 2], [6.0, 1.0, 1.0]).unwrap();
        for shards in [1, 2, 3, 4, 7] {
            let shard_of = partition(&mesh, shards);
            assert_eq!(shard_of, partition(&mesh, shards), "the same again");
            let mut counts = vec![0; shards];
            shard_of.iter().for_each(|&shard| counts[shard as usize] += 1);
            let even = mesh.elements().len() / shards;
            assert!(counts.iter().all(|&count| count + 3 >= even && count <= even + 3), "{counts:?}");
        }
    }

    /// Partitions by clusters are as even as a cluster allows, and cut hardly more faces than those by elements.
    #[cfg(feature = "metis")]
    #[test]
    fn shards_of_many_elements_consist_of_clusters() {
        let linear = cuboid([24, 12, 8], [3.0, 1.0, 1.0]).unwrap();
        let quadratic = linear.quadratic(crate::fem::mesh::QuadraticHexahedron::Serendipity).unwrap();
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

    #[test]
    fn a_long_body_is_cut_across() {
        let mesh = cuboid([8, 1, 1], [8.0, 1.0, 1.0]).unwrap();
        let shard_of = partition(&mesh, 2);
        let neighbors = mesh.neighbors();
        let between = (0..mesh.elements().len()).flat_map(|element| {
            let shard_of = &shard_of;
            neighbors.of(element).iter().filter(move |&&other| shard_of[other as usize] != shard_of[element])
        });
        assert!(between.count() <= 2 * 4, "few faces lie between the shards");
    }
}
