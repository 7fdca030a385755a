//! The passes over the fibers of a truss are compared with formulas that are evaluated fiber by fiber.
use std::sync::Arc;

use biotissue::fiber::law::{FiberLaw, FiberMaterial, Law};
use biotissue::fiber::network::Network;
use biotissue::fiber::network::generate::delaunay;
use biotissue::fiber::truss::{FiberStates, Truss};

const E: f64 = 1.0e8;

fn materials() -> [FiberMaterial; 3] {
    [
        (Law::Exponential { youngs_modulus: E, nonlinearity: 1.2 }, 5e-8),
        (Law::Linear { youngs_modulus: 0.1 * E }, 1e-7),
        (Law::ExponentialStretch { youngs_modulus: E, nonlinearity: 2.0, transition: 1.05 }, 3e-8),
    ]
    .map(|(law, radius)| FiberMaterial { law, radius, density: None })
}

/// Returns a network with three types of fibers, with more fibers of each type than one batch contains.
fn network() -> Arc<Network> {
    let types = materials().into_iter().zip([0.5, 0.3, 0.2]).map(|(material, part)| (part, material)).collect();
    Arc::new(delaunay(120, 3).unwrap().with_random_types(types, 5).unwrap())
}

fn moved(network: &Network) -> Vec<[f64; 3]> {
    network.nodes().iter().map(|&[x, y, z]| [1.1 * x + 0.02 * (9.0 * y).sin(), 0.97 * y + 0.1 * x, z * z + z]).collect()
}

#[test]
fn every_fiber_is_evaluated_with_its_own_law() {
    let network = network();
    let truss = Truss::new(Arc::clone(&network), None).unwrap();
    let (positions, mut states) = (moved(&network), FiberStates::default());
    truss.evaluate(&positions, &mut states);
    let mut energy = 0.0;
    for (k, &fiber) in truss.fiber_numbers().iter().enumerate() {
        let [a, b] = network.fibers()[fiber as usize].map(|node| positions[node as usize]);
        assert_eq!(truss.ends()[k], network.fibers()[fiber as usize]);
        let material = &network.materials()[usize::from(network.material_of()[fiber as usize])];
        let d = [b[0] - a[0], b[1] - a[1], b[2] - a[2]];
        let (length, rest) = (d.iter().map(|x| x * x).sum::<f64>().sqrt(), network.lengths()[fiber as usize]);
        let (stress, slope) = material.law.stress(length / rest);
        let (force, geometric) = (stress * material.area(), stress * material.area() / length);
        let stiffness = slope * material.area() / rest - geometric;
        let near = |found: f64, expected: f64| (found - expected).abs() <= 1e-12 * E * material.area() / rest;
        assert!((states.stretches[k] - length / rest).abs() < 1e-15 * states.stretches[k]);
        assert!((0..3).all(|i| (states.directions[k][i] - d[i] / length).abs() < 4e-16));
        assert!(near(states.forces[k], force) && near(states.geometric_stiffness[k], geometric), "fiber {fiber}");
        assert!(near(states.material_stiffness[k], stiffness), "fiber {fiber}");
        energy += material.law.energy(length / rest) * material.area() * rest;
    }
    assert!((truss.energy(&states) / energy - 1.0).abs() < 1e-13);
}

#[test]
fn one_pass_gives_the_results_of_two() {
    let network = network();
    let truss = Truss::new(Arc::clone(&network), None).unwrap();
    let positions = moved(&network);
    let (mut two, mut one) = (FiberStates::default(), FiberStates::default());
    let mut forces = [vec![[7.0; 3]; network.nodes().len()], vec![[3.0; 3]; network.nodes().len()]];
    truss.evaluate(&positions, &mut two);
    truss.nodal_forces(&two, &mut forces[0]);
    truss.evaluate_with_forces(&positions, &mut one, &mut forces[1]);
    assert_eq!(forces[0], forces[1], "bitwise");
    assert_eq!((&one.forces, &one.material_stiffness), (&two.forces, &two.material_stiffness));
    // The internal forces of a network sum to zero.
    let sum = (0..3).map(|i| forces[0].iter().map(|f| f[i]).sum::<f64>());
    let largest = forces[0].iter().flatten().fold(0.0_f64, |m, f| m.max(f.abs()));
    assert!(sum.into_iter().all(|sum| sum.abs() < 1e-12 * largest));
}

#[test]
fn at_rest_every_stretch_is_exactly_one() {
    let network = network();
    let truss = Truss::new(Arc::clone(&network), None).unwrap();
    let (mut states, mut forces) = (FiberStates::default(), vec![[1.0; 3]; network.nodes().len()]);
    truss.evaluate_with_forces(network.nodes(), &mut states, &mut forces);
    assert!(states.stretches.iter().all(|&stretch| stretch == 1.0));
    assert!(forces.iter().flatten().chain(&states.forces).all(|&force| force == 0.0));
    assert_eq!(truss.energy(&states), 0.0);
}
