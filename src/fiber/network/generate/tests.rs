use std::collections::BTreeSet;
use std::path::Path;

use nalgebra::{DMatrix, Vector3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::clip::crossing;
use super::cloud::{Cloud, uniform};
use super::delaunay::edges;
use super::params::MAX_POINTS;
use super::voronoi::circumcenter;
use super::{Alignment, GenerateError, GeneratorParams, Kind, delaunay, delaunay_of_nodes, voronoi};
use crate::fiber::network::check::{clean, examine};
use crate::fiber::network::{Network, file};

/// Returns the Delaunay edges by their definition: those of all tetrahedra with an empty circumsphere.
fn delaunay_edges_by_definition(cloud: &[[f64; 3]]) -> BTreeSet<[usize; 2]> {
    let p: Vec<Vector3<f64>> = cloud.iter().map(|&x| Vector3::from(x)).collect();
    let n = p.len();
    let mut edges = BTreeSet::new();
    for a in 0..n {
        for b in a + 1..n {
            for c in b + 1..n {
                for d in c + 1..n {
                    let center = Vector3::from(circumcenter([a, b, c, d].map(|i| cloud[i])));
                    let radius = (p[a] - center).norm();
                    let empty = (0..n).all(|e| [a, b, c, d].contains(&e) || (p[e] - center).norm() > radius);
                    if empty {
                        edges.extend([[a, b], [a, c], [a, d], [b, c], [b, d], [c, d]]);
                    }
                }
            }
        }
    }
    edges
}

#[test]
fn edges_are_those_of_empty_circumspheres() {
    let mut random = ChaCha8Rng::seed_from_u64(5);
    let mut cloud: Vec<[f64; 3]> = (0..50).map(|_| [(); 3].map(|()| uniform(&mut random) - 0.5)).collect();
    let from_center = |x: &[f64; 3]| Vector3::from(*x).norm();
    cloud.sort_by(|a, b| from_center(a).total_cmp(&from_center(b)));
    let inner = 8;
    let expected: Vec<[usize; 2]> =
        delaunay_edges_by_definition(&cloud).into_iter().filter(|edge| edge[0] < inner).collect();
    assert_eq!(edges(&cloud, inner), expected);
}

#[test]
fn the_seeds_of_the_committed_files_give_the_same_networks() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    for seed in [1, 8] {
        let committed = file::read(&root.join(format!("examples/dogbone/networks/delaunay_{seed}.txt"))).unwrap();
        let generated = delaunay(60, seed).unwrap();
        assert_eq!(committed.network.nodes(), generated.nodes());
        assert_eq!(committed.network.fibers(), generated.fibers());
    }
    assert_ne!(delaunay(20, 1).unwrap().nodes(), delaunay(20, 2).unwrap().nodes());
}

#[test]
fn delaunay_networks_are_valid_and_clean() {
    for (points, seed) in [(1, 2), (12, 3), (60, 4), (150, 5)] {
        let network = delaunay(points, seed).unwrap();
        let report = examine(&network);
        assert_eq!(network.interior().len(), points);
        assert!(report.coordination.unwrap().min >= 4.0, "{report:?}");
        assert_eq!((report.unsupported().count(), report.boundary_fibers), (0, 0));
        let spacing = (points as f64).cbrt().recip();
        assert!(report.length.min >= 0.2 * spacing, "{} of {spacing}", report.length.min);
        assert!(clean(&network, None).unwrap().removed.is_nothing());
        // The bounding box of the nodes is still the unit cube.
        let again = Network::new(network.name(), network.nodes().to_vec(), network.fibers().to_vec()).unwrap();
        assert_eq!(again, network);
    }
}

#[test]
fn an_undeformed_delaunay_network_has_no_zero_modes() {
    let network = delaunay(60, 1).unwrap();
    let unknowns = 3 * network.interior().len();
    let mut stiffness = DMatrix::<f64>::zeros(unknowns, unknowns);
    for (&[a, b], &length) in network.fibers().iter().zip(network.lengths()) {
        let n = (Vector3::from(network.nodes()[b as usize]) - Vector3::from(network.nodes()[a as usize])) / length;
        let block = n * n.transpose() / length;
        for (p, q, sign) in [(a, a, 1.0), (b, b, 1.0), (a, b, -1.0), (b, a, -1.0)] {
            let (p, q) = (network.interior_number()[p as usize], network.interior_number()[q as usize]);
            if p >= 0 && q >= 0 {
                let mut view = stiffness.fixed_view_mut::<3, 3>(3 * p as usize, 3 * q as usize);
                view += sign * block;
            }
        }
    }
    let eigenvalues = stiffness.symmetric_eigenvalues();
    assert!(eigenvalues.min() > 0.01 * eigenvalues.max(), "{} of {}", eigenvalues.min(), eigenvalues.max());
}

#[test]
fn networks_have_the_requested_number_of_nodes() {
    for nodes in [300, 450, 600] {
        let network = delaunay_of_nodes(nodes, 3).unwrap();
        assert!(network.nodes().len().abs_diff(nodes) <= 10, "{} for {nodes}", network.nodes().len());
    }
}

#[test]
fn invalid_sizes_and_lengths_are_errors() {
    let most = MAX_POINTS;
    assert_eq!(delaunay(0, 1).unwrap_err(), GenerateError::Points { points: 0, most });
    assert_eq!(delaunay(most + 1, 1).unwrap_err(), GenerateError::Points { points: most + 1, most });
    assert!(matches!(delaunay_of_nodes(3, 1).unwrap_err(), GenerateError::Nodes { nodes: 3, .. }));
    let crowded = GeneratorParams { min_distance: 2.0, ..GeneratorParams::new(Kind::Delaunay, 1) };
    assert!(matches!(crowded.of_points(30).unwrap_err(), GenerateError::NoRoom { .. }));
    let params = GeneratorParams::new(Kind::Voronoi, 1);
    for density in [0.0, -3.0, 0.5, 1e9, f64::NAN, f64::INFINITY] {
        let error = params.of_density(density).unwrap_err();
        assert!(matches!(error, GenerateError::Density { .. }), "{density}: {error}");
    }
    for merge_length in [-0.1, 1.0, f64::NAN] {
        let error = GeneratorParams { merge_length, ..params }.of_points(9).unwrap_err();
        assert!(matches!(error, GenerateError::Merge(_)), "{error}");
    }
    let stubs = GeneratorParams { min_length: Some(0.9), ..params };
    assert!(matches!(stubs.of_points(40).unwrap_err(), GenerateError::Network(_) | GenerateError::OpenFace { .. }));
}

#[test]
fn edges_are_cut_exactly_at_the_first_face_that_they_cross() {
    assert_eq!(crossing([0.0, 0.1, 0.2], [1.0, 0.1, 0.2]), [0.5, 0.1, 0.2]);
    let cut = crossing([0.1, 0.2, 0.3], [-2.0, 3.0, 0.9]);
    let t = 0.3 / 2.8;
    assert_eq!(cut[1], 0.5);
    assert!((cut[0] - (0.1 - 2.1 * t)).abs() < 1e-15 && (cut[2] - (0.3 + 0.6 * t)).abs() < 1e-15, "{cut:?}");
}

/// The four points of a vertex are the points nearest to it, all at the same distance.
#[test]
fn voronoi_vertices_are_centers_of_empty_spheres() {
    let alignment = Some(Alignment::new([1.0, 1.0, 0.0], 0.3).unwrap());
    for params in [
        GeneratorParams::new(Kind::Voronoi, 5),
        GeneratorParams { alignment, ..GeneratorParams::new(Kind::Voronoi, 6) },
    ] {
        let cloud = Cloud::place(&params, 30).unwrap();
        let graph = super::voronoi::graph(&cloud);
        assert!(graph.inner > 150, "{}", graph.inner);
        for &place in &graph.places[..graph.inner] {
            let mut distances: Vec<f64> = cloud.places.iter().map(|&p| cloud.stretch.distance(place, p)).collect();
            distances.sort_by(f64::total_cmp);
            assert!(distances[3] - distances[0] < 1e-10, "{:?}", &distances[..5]);
            assert!(distances[4] > distances[3], "{:?}", &distances[..5]);
        }
        // Four edges meet at every vertex in the cube, and none is missing.
        let mut degree = vec![0; graph.places.len()];
        graph.edges.iter().flatten().for_each(|&node| degree[node] += 1);
        assert!(degree[..graph.inner].iter().all(|&degree| degree == 4));
        assert!(graph.edges.iter().all(|edge| edge[0] < edge[1] && edge[0] < graph.inner));
    }
}

/// Meijering 1953: the Voronoi cells of a Poisson process have 13.54 edges per point, and for one point per unit volume
/// their total length per volume is 5.83. A minimum distance of the points would change these values slightly.
#[test]
fn the_density_of_voronoi_networks_agrees_with_theory() {
    let params = GeneratorParams { min_distance: 0.0, merge_length: 0.0, ..GeneratorParams::new(Kind::Voronoi, 3) };
    let points = 3000;
    let network = params.of_points(points).unwrap().network;
    let coefficient = network.total_length() / (points as f64).powf(2.0 / 3.0);
    assert!((coefficient / 5.832 - 1.0).abs() < 0.01, "{coefficient}");
    let vertices = network.interior().len() as f64 / points as f64;
    assert!((vertices / 6.768 - 1.0).abs() < 0.01, "{vertices}");
}

#[test]
fn voronoi_networks_are_valid_and_clean() {
    for (points, seed) in [(12, 3), (60, 4), (300, 5)] {
        let plain = GeneratorParams { merge_length: 0.0, ..GeneratorParams::new(Kind::Voronoi, seed) }
            .of_points(points)
            .unwrap();
        let report = examine(&plain.network);
        let coordination = report.coordination.unwrap();
        assert_eq!((coordination.min, coordination.max), (4.0, 4.0));
        assert_eq!((report.unsupported().count(), report.boundary_fibers), (0, 0));
        assert!(plain.removed.is_nothing());
        let merged = voronoi(points, seed).unwrap();
        let report = examine(&merged);
        assert!(report.length.min >= 0.05 * (points as f64).cbrt().recip(), "{report:?}");
        assert!(report.coordination.unwrap().mean > 4.1 && report.coordination.unwrap().mean < 4.7, "{report:?}");
        assert_eq!((report.unsupported().count(), report.boundary_fibers, report.dangling_nodes.len()), (0, 0, 0));
        assert!(clean(&merged, None).unwrap().removed.is_nothing());
        let again = Network::new(merged.name(), merged.nodes().to_vec(), merged.fibers().to_vec()).unwrap();
        assert_eq!(again, merged);
        assert_eq!(voronoi(points, seed).unwrap(), merged);
    }
}

/// Returns a hash of the coordinates and fibers of a network, which changes with the last bit of any coordinate.
fn fingerprint(network: &Network) -> u64 {
    let numbers = network.nodes().iter().flatten().map(|x| x.to_bits());
    let ends = network.fibers().iter().flatten().map(|&node| u64::from(node));
    numbers.chain(ends).fold(0xcbf2_9ce4_8422_2325, |hash, bits| (hash ^ bits).wrapping_mul(0x100_0000_01b3))
}

#[test]
fn generated_networks_are_bitwise_unchanged() {
    let aligned = |kind| GeneratorParams {
        alignment: Some(Alignment::new([1.0, 2.0, 3.0], 0.5).unwrap()),
        ..GeneratorParams::new(kind, 9)
    };
    let fingerprints = [GeneratorParams::new(Kind::Voronoi, 9), aligned(Kind::Voronoi), aligned(Kind::Delaunay)]
        .map(|params| fingerprint(&params.of_points(50).unwrap().network));
    assert_eq!(fingerprints, [15_232_947_016_528_114_425, 11_747_062_243_976_168_669, 4_256_549_998_530_621_710]);
}

#[test]
fn an_alignment_of_zero_strength_has_no_effect() {
    for kind in Kind::ALL {
        let params = GeneratorParams::new(kind, 4);
        let alignment = Some(Alignment::new([0.3, -0.2, 0.9], 0.0).unwrap());
        assert_eq!(GeneratorParams { alignment, ..params }.of_points(25).unwrap(), params.of_points(25).unwrap());
    }
}

/// Returns the order parameter of the network that extends beyond the cube: a cut fiber counts half. Fibers along the
/// axis are longer and cut more often, so that with equal weights the order would be too high.
fn order_without_surface(network: &Network, axis: [f64; 3]) -> f64 {
    let (mut sum, mut total) = (0.0, 0.0);
    for (&[a, b], &length) in network.fibers().iter().zip(network.lengths()) {
        let cut = [a, b].iter().any(|&node| network.interior_number()[node as usize] < 0);
        let weight = if cut { 0.5 } else { 1.0 };
        let [a, b] = [a, b].map(|node| Vector3::from(network.nodes()[node as usize]));
        let cosine = (b - a).dot(&Vector3::from(axis)) / length;
        sum += weight * cosine * cosine;
        total += weight;
    }
    1.5 * sum / total - 0.5
}

#[test]
fn aligned_networks_have_the_requested_order() {
    for kind in Kind::ALL {
        for (direction, strength) in [([1.0, 0.0, 0.0], 0.3), ([1.0, 1.0, 1.0], 0.6), ([0.0, -1.0, 0.5], 0.8)] {
            let alignment = Alignment::new(direction, strength).unwrap();
            let params = GeneratorParams { alignment: Some(alignment), ..GeneratorParams::new(kind, 2) };
            let network = params.of_points(1500).unwrap().network;
            let order = order_without_surface(&network, alignment.axis());
            assert!((order - strength).abs() < 0.015, "{kind:?} {direction:?}: {order} for {strength}");
            assert_eq!(examine(&network).unsupported().count(), 0);
        }
    }
}

#[test]
fn networks_have_the_requested_density() {
    for (kind, density) in [(Kind::Delaunay, 200.0), (Kind::Voronoi, 150.0), (Kind::Voronoi, 60.0)] {
        let made = GeneratorParams::new(kind, 3).of_density(density).unwrap();
        let found = made.network.total_length();
        assert!((found / density - 1.0).abs() < 0.02, "{kind:?}: {found} for {density}");
    }
    let made = GeneratorParams::new(Kind::Voronoi, 3).of_nodes(700).unwrap();
    assert!(made.network.nodes().len().abs_diff(700) <= 10, "{}", made.network.nodes().len());
}

#[test]
fn short_fibers_are_removed_with_those_that_then_dangle() {
    let params = GeneratorParams { min_length: Some(0.08), ..GeneratorParams::new(Kind::Voronoi, 2) };
    let made = params.of_points(60).unwrap();
    assert!(made.removed.short_fibers > 0, "{:?}", made.removed);
    let report = examine(&made.network);
    assert!(report.length.min >= 0.08 && report.dangling_nodes.is_empty() && report.unsupported().count() == 0);
}
