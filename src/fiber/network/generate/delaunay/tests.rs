use std::collections::BTreeSet;
use std::path::Path;

use nalgebra::{DMatrix, Matrix3, Vector3};

use super::*;
use crate::fiber::network::check::{clean, examine};
use crate::fiber::network::file;

/// Centre of the sphere through four points.
fn circumcentre(p: [Vector3<f64>; 4]) -> Option<Vector3<f64>> {
    let rows = Matrix3::from_rows(&[(p[1] - p[0]).transpose(), (p[2] - p[0]).transpose(), (p[3] - p[0]).transpose()]);
    let squares =
        Vector3::new((p[1] - p[0]).norm_squared(), (p[2] - p[0]).norm_squared(), (p[3] - p[0]).norm_squared());
    rows.try_inverse().map(|inverse| p[0] + inverse * squares * 0.5)
}

/// The definition itself: all tetrahedra whose circumsphere holds no point.
fn delaunay_edges_by_definition(cloud: &[[f64; 3]]) -> BTreeSet<[usize; 2]> {
    let p: Vec<Vector3<f64>> = cloud.iter().map(|&x| Vector3::from(x)).collect();
    let n = p.len();
    let mut edges = BTreeSet::new();
    for a in 0..n {
        for b in a + 1..n {
            for c in b + 1..n {
                for d in c + 1..n {
                    let Some(centre) = circumcentre([p[a], p[b], p[c], p[d]]) else { continue };
                    let radius = (p[a] - centre).norm();
                    let empty = (0..n).all(|e| [a, b, c, d].contains(&e) || (p[e] - centre).norm() > radius);
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
    let from_centre = |x: &[f64; 3]| Vector3::from(*x).norm();
    cloud.sort_by(|a, b| from_centre(a).total_cmp(&from_centre(b)));
    let inner = 8;
    let expected: Vec<[usize; 2]> =
        delaunay_edges_by_definition(&cloud).into_iter().filter(|edge| edge[0] < inner).collect();
    assert_eq!(edges(&cloud, inner), expected);
}

#[test]
fn the_same_seed_gives_the_committed_files() {
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
fn networks_are_well_made() {
    for (points, seed) in [(1, 2), (12, 3), (60, 4), (150, 5)] {
        let network = delaunay(points, seed).unwrap();
        let report = examine(&network);
        assert_eq!(network.interior().len(), points);
        assert!(report.coordination.unwrap().min >= 4.0, "{report:?}");
        assert_eq!((report.untied().count(), report.boundary_fibers), (0, 0));
        let spacing = (points as f64).cbrt().recip();
        assert!(report.length.min >= 0.2 * spacing, "{} of {spacing}", report.length.min);
        assert!(clean(&network, None).unwrap().removed.is_nothing());
        // Written and read again, the bounding box is still the unit cube.
        let again = Network::new(network.name(), network.nodes().to_vec(), network.fibers().to_vec()).unwrap();
        assert_eq!(again, network);
    }
}

#[test]
fn an_unstretched_network_has_no_floppy_modes() {
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
fn a_number_of_nodes_can_be_asked_for() {
    for nodes in [300, 450, 600] {
        let network = delaunay_of_nodes(nodes, 3).unwrap();
        assert!(network.nodes().len().abs_diff(nodes) <= 10, "{} for {nodes}", network.nodes().len());
    }
}

#[test]
fn what_cannot_be_placed_is_an_error() {
    let most = MOST_POINTS;
    assert_eq!(delaunay(0, 1).unwrap_err(), GenerateError::Points { points: 0, most });
    assert_eq!(delaunay(most + 1, 1).unwrap_err(), GenerateError::Points { points: most + 1, most });
    assert!(matches!(delaunay_of_nodes(3, 1).unwrap_err(), GenerateError::Nodes { nodes: 3, .. }));
    let crowded = Delaunay { shortest: 2.0, ..Delaunay::new(30, 1) };
    assert!(matches!(crowded.generate().unwrap_err(), GenerateError::NoRoom { .. }));
}

#[test]
fn edges_are_cut_exactly_on_the_first_face_they_meet() {
    assert_eq!(crossing([0.0, 0.1, 0.2], [1.0, 0.1, 0.2]), [0.5, 0.1, 0.2]);
    let cut = crossing([0.1, 0.2, 0.3], [-2.0, 3.0, 0.9]);
    let t = 0.3 / 2.8;
    assert_eq!(cut[1], 0.5);
    assert!((cut[0] - (0.1 - 2.1 * t)).abs() < 1e-15 && (cut[2] - (0.3 + 0.6 * t)).abs() < 1e-15, "{cut:?}");
}
