//! Assignment of the elements to the ranks of the macro scale.

#[cfg(feature = "metis")]
mod clusters;

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

    let shard_of = match clusters::Clusters::new(mesh, shards) {
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
