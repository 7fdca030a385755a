//! The zero modes of networks, and the nodes that they move.

use biotissue::backends::dense::Dense;
use biotissue::backends::sparse::Sparse;
use biotissue::fiber::network::Network;
use biotissue::fiber::network::check::{Rigidity, rigidity, zero_modes};
use nalgebra::{DMatrix, SymmetricEigen, Vector3};

use crate::support;

/// Returns the corners of the cube with straight chains of three fibers along the first `diagonals` of its four
/// diagonals.
fn chains(diagonals: usize) -> Network {
    let corner = |k: usize| [k & 1, k >> 1 & 1, k >> 2].map(|x| x as f64 - 0.5);
    let mut nodes: Vec<[f64; 3]> = (0..8).map(corner).collect();
    let mut fibers = Vec::new();
    for k in 0..diagonals {
        let (from, to) = (corner(k), corner(7 - k));
        let at = |part: f64| [0, 1, 2].map(|i| from[i] + (to[i] - from[i]) * part);
        let first = nodes.len() as u32;
        let shift = 0.01 * k as f64;
        nodes.extend([at(0.3 + shift), at(0.7 + shift)]);
        fibers.extend([[k as u32, first], [first, first + 1], [first + 1, 7 - k as u32]]);
    }
    Network::new("chains", nodes, fibers).unwrap()
}

/// Returns the number of zero modes and the mobility of every interior node, from the eigenvectors of the stiffness.
fn by_eigenvectors(network: &Network) -> (usize, Vec<f64>) {
    let unknowns = 3 * network.interior().len();
    let mut stiffness = DMatrix::<f64>::zeros(unknowns, unknowns);
    for (fiber, &[a, b]) in network.fibers().iter().enumerate() {
        let n = Vector3::from(network.direction(fiber));
        for (p, q, sign) in [(a, a, 1.0), (b, b, 1.0), (a, b, -1.0), (b, a, -1.0)] {
            let (p, q) = (network.interior_number()[p as usize], network.interior_number()[q as usize]);
            if p >= 0 && q >= 0 {
                let mut view = stiffness.fixed_view_mut::<3, 3>(3 * p as usize, 3 * q as usize);
                view += sign * n * n.transpose();
            }
        }
    }
    let eigen = SymmetricEigen::new(stiffness);
    let zero: Vec<usize> = (0..unknowns).filter(|&k| eigen.eigenvalues[k] < 1e-8).collect();
    let square = |row: usize| zero.iter().map(|&k| eigen.eigenvectors[(row, k)].powi(2)).sum::<f64>();
    let mobility = (0..unknowns / 3).map(|node| (0..3).map(|k| square(3 * node + k)).sum()).collect();
    (zero.len(), mobility)
}

fn assert_agrees_with_eigenvectors(network: &Network, tolerance: f64) -> Rigidity {
    let found = rigidity::<Sparse>(&(), network).unwrap();
    let (count, mobility) = by_eigenvectors(network);
    assert_eq!((found.zero_modes, zero_modes::<Dense>(&(), network).unwrap()), (count, count));
    assert_eq!(found.mobile_nodes, mobility.iter().filter(|&&m| m > 1e-6).count());
    for node in &found.most_mobile {
        let exact = mobility[network.interior_number()[node.node as usize] as usize];
        assert!((node.mobility - exact).abs() <= tolerance * exact, "{node:?}: {exact}");
    }
    assert!(found.single_node_modes <= found.zero_modes);
    found
}

#[test]
fn a_straight_chain_has_lateral_zero_modes() {
    let network = chains(4);
    let found = assert_agrees_with_eigenvectors(&network, 1e-6);
    // Each of the eight nodes has two lateral motions; each chain has one state of self stress.
    assert_eq!((found.unknowns, found.zero_modes, found.self_stresses), (24, 16, 4));
    assert_eq!((found.single_node_modes, found.few_fibers, found.coplanar_fibers), (16, 8, 0));
    assert_eq!((found.mobile_nodes, found.estimated), (8, false));
    assert!(found.most_mobile.iter().all(|node| (node.mobility - 2.0).abs() < 1e-9), "{:?}", found.most_mobile);
    let dense = rigidity::<Dense>(&(), &network).unwrap();
    assert_eq!(dense.zero_modes, 16);
}

#[test]
fn a_node_with_coplanar_fibers_moves_out_of_their_plane() {
    let mut nodes: Vec<[f64; 3]> = (0..8).map(|k| [k & 1, k >> 1 & 1, k >> 2].map(f64::from)).collect();
    // A node with four fibers to corners of the cube, all in the plane z = x.
    nodes.push([0.5, 0.3, 0.5]);
    let network = Network::new("plane", nodes, vec![[8, 0], [8, 2], [8, 5], [8, 7], [0, 1]]).unwrap();
    let found = assert_agrees_with_eigenvectors(&network, 1e-9);
    assert_eq!((found.zero_modes, found.self_stresses), (1, 2));
    assert_eq!((found.single_node_modes, found.few_fibers, found.coplanar_fibers), (1, 0, 1));
    assert_eq!((found.most_mobile[0].node, found.most_mobile[0].position), (8, [0.0, -0.2, 0.0]));
}

#[test]
fn the_rigidity_of_the_frozen_network_agrees_with_its_eigenvalues() {
    let found = assert_agrees_with_eigenvectors(&support::frozen(), 1e-6);
    assert_eq!((found.zero_modes, found.self_stresses), (0, 151 - 36));
}

#[cfg(feature = "generate")]
#[test]
fn voronoi_networks_are_floppy_and_delaunay_networks_rigid() {
    use biotissue::fiber::network::generate::{Alignment, GeneratorParams, Kind, delaunay, voronoi};
    let found = assert_agrees_with_eigenvectors(&voronoi(25, 1).unwrap(), 1e-6);
    assert!(found.zero_modes > 20 && !found.estimated && found.single_node_modes == 0, "{found:?}");
    let alignment = Some(Alignment::new([1.0, 0.5, 0.0], 0.6).unwrap());
    for merge_length in [0.0, 0.2] {
        let aligned = GeneratorParams { alignment, merge_length, ..GeneratorParams::new(Kind::Voronoi, 2) }
            .of_points(25)
            .unwrap();
        assert_agrees_with_eigenvectors(&aligned.network, 1e-6);
    }
    let network = delaunay(60, 1).unwrap();
    let found = rigidity::<Sparse>(&(), &network).unwrap();
    assert_eq!((found.zero_modes, found.mobile_nodes, found.most_mobile.len()), (0, 0, 0));
    assert_eq!(zero_modes::<Dense>(&(), &network).unwrap(), 0);
    assert!(found.self_stresses > 100);
}

#[cfg(feature = "generate")]
#[test]
fn mobilities_of_many_modes_are_estimated() {
    use biotissue::fiber::network::generate::voronoi;
    let network = voronoi(140, 1).unwrap();
    let found = rigidity::<Sparse>(&(), &network).unwrap();
    assert!(found.zero_modes > 400 && found.estimated, "{}", found.zero_modes);
    assert!(found.mobile_nodes > 600 && found.most_mobile.len() == 10);
    assert!(found.most_mobile.iter().all(|node| node.mobility > 0.5 && node.mobility < 3.5), "{found:?}");
}

#[test]
fn published_networks_are_rigid() {
    for (name, self_stresses) in [("Network_2_7.txt", 635 - 225), ("del_4450seedL5_new_1.txt", 25_050)] {
        let Some(network) = support::published(name) else { return };
        let found = rigidity::<Sparse>(&(), &network).unwrap();
        assert_eq!((found.zero_modes, found.self_stresses, found.single_node_modes), (0, self_stresses, 0), "{name}");
    }
}
