//! The condensed tangent of an RVE is compared with central differences of the stress and with the corner form.
use crate::support;
use std::sync::Arc;

use crate::support::Bench;
use biotissue::backends::{dense::Dense, sparse::Sparse};
use biotissue::fiber::homogenize::Tangent;
use biotissue::fiber::law::FiberMaterial;
use biotissue::fiber::network::Network;
use biotissue::fiber::rve::Rve;
use biotissue::las::RealBackend;
use nalgebra::{DMatrix, Matrix3, Rotation3, Vector3};

/// Returns a general strain of 1 % and of 15 %, and the latter rotated by 90 degrees.
fn states() -> [(&'static str, Matrix3<f64>); 3] {
    let strain = Matrix3::new(1.0, 0.4, 0.0, 0.2, -0.5, 0.3, 0.1, 0.0, 0.4);
    let large = Matrix3::identity() + strain * 0.15;
    let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), std::f64::consts::FRAC_PI_2);
    [("1 %", Matrix3::identity() + strain * 0.01), ("15 %", large), ("15 % rotated", turn * large)]
}

/// Creates a model whose solver has a tolerance tight enough for difference quotients.
fn bench<B: RealBackend<Context = ()>>(network: &Arc<Network>, material: FiberMaterial) -> Bench<B> {
    let mut bench = Bench::<B>::new(network, Some(material));
    bench.params.newton.tolerance = 1e-13;
    bench
}

fn central_differences<B: RealBackend<Context = ()>>(bench: &mut Bench<B>, rve: &Rve) -> Tangent {
    let h = 1e-5;
    let mut differences = Tangent::zeros();
    for column in 0..9 {
        let mut stress = |sign: f64| {
            let mut f = *rve.gradient();
            f[(column / 3, column % 3)] += sign * h;
            bench.solve(&mut rve.clone(), &f).unwrap();
            bench.pk1()
        };
        let difference = (stress(1.0) - stress(-1.0)) / (2.0 * h);
        for row in 0..9 {
            differences[(row, column)] = difference[(row / 3, row % 3)];
        }
    }
    differences
}

fn networks() -> Vec<Arc<Network>> {
    support::published("Network_2_7.txt").into_iter().chain([support::frozen()]).collect()
}

#[test]
fn the_tangent_is_the_derivative_of_the_stress() {
    for network in networks() {
        for material in support::laws() {
            for (name, f) in states() {
                let mut bench = bench::<Sparse>(&network, material.clone());
                let mut rve = bench.at_rest();
                bench.solve(&mut rve, &f).unwrap();
                let tangent = bench.tangent(&rve);
                let largest = tangent.amax();
                let asymmetry = (tangent - tangent.transpose()).amax() / largest;
                assert!(
                    asymmetry < 1e-10,
                    "{} {} {name}: asymmetry {asymmetry:.1e}",
                    network.name(),
                    material.law.name()
                );
                let error = (tangent - central_differences(&mut bench, &rve)).amax() / largest;
                assert!(error < 1e-7, "{} {} {name}: error {error:.1e}", network.name(), material.law.name());
            }
        }
    }
}

#[test]
fn the_stress_is_the_derivative_of_the_energy() {
    let network = support::frozen();
    for material in support::laws() {
        for (name, f) in states() {
            let mut bench = bench::<Dense>(&network, material.clone());
            let mut rve = bench.at_rest();
            bench.solve(&mut rve, &f).unwrap();
            let pk1 = bench.pk1();
            for i in 0..9 {
                let h = 1e-5;
                let mut energy = |sign: f64| {
                    let mut f = f;
                    f[i] += sign * h;
                    bench.solve(&mut rve.clone(), &f).unwrap();
                    bench.energy()
                };
                let difference = (energy(1.0) - energy(-1.0)) / (2.0 * h);
                assert!(
                    (difference - pk1[i]).abs() < 1e-7 * pk1.amax(),
                    "{} {name}: {difference} {}",
                    material.law.name(),
                    pk1[i]
                );
            }
        }
    }
}

#[test]
fn rotating_the_deformation_rotates_the_stress() {
    let network = support::frozen();
    let turn = Rotation3::from_euler_angles(0.4, -1.1, 2.0);
    for material in support::laws() {
        let mut bench = bench::<Sparse>(&network, material.clone());
        for (_, f) in states() {
            let mut rve = bench.at_rest();
            bench.solve(&mut rve, &f).unwrap();
            let pk1 = bench.pk1();
            let report = bench.solve(&mut rve, &(turn * f)).unwrap();
            assert_eq!(report.iterations, 0, "a rotated equilibrium needs no iteration");
            assert!((turn * pk1 - bench.pk1()).amax() < 1e-10 * pk1.amax());
        }
    }
}

/// Returns the tangent in the corner form of the thesis (C.4 to C.18): the boundary follows the eight corners
/// trilinearly, the stiffness is condensed onto the corners, and the corners move by `F`. All matrices are dense, and
/// nothing of the crate's assembly is used.
fn corner_form(bench: &Bench<Sparse>) -> Tangent {
    let network = bench.model.network();
    let (truss, states) = (bench.model.truss(), bench.workspace.states());
    let n = 3 * network.nodes().len();
    let mut k = DMatrix::<f64>::zeros(n, n);
    for (fiber, &[a, b]) in truss.ends().iter().enumerate() {
        let block = states.block(fiber);
        for (r, row) in [(a, 1.0), (b, -1.0)] {
            for (c, col) in [(a, 1.0), (b, -1.0)] {
                for i in 0..9 {
                    k[(3 * r as usize + i / 3, 3 * c as usize + i % 3)] += row * col * block[i];
                }
            }
        }
    }
    let unknowns =
        |nodes: &[u32]| nodes.iter().flat_map(|&a| (0..3).map(move |i| 3 * a as usize + i)).collect::<Vec<_>>();
    let (interior, boundary) = (unknowns(network.interior()), unknowns(network.boundary()));
    let part = |rows: &[usize], cols: &[usize]| DMatrix::from_fn(rows.len(), cols.len(), |r, c| k[(rows[r], cols[c])]);
    let k_ib = part(&interior, &boundary);
    let condensed =
        part(&boundary, &boundary) - k_ib.transpose() * part(&interior, &interior).lu().solve(&k_ib).unwrap();

    let corner = |c: usize| Vector3::from_fn(|d, _| if c >> d & 1 == 1 { 0.5 } else { -0.5 });
    let weights = DMatrix::from_fn(boundary.len(), 24, |r, c| {
        let x = network.nodes()[boundary[r] / 3];
        let weight: f64 = (0..3).map(|d| 0.5 + 2.0 * corner(c / 3)[d] * x[d]).product();
        if boundary[r] % 3 == c % 3 { weight } else { 0.0 }
    });
    let on_corners = weights.transpose() * condensed * weights;
    let corners_by_f = DMatrix::from_fn(24, 9, |r, c| if r % 3 == c / 3 { corner(r / 3)[c % 3] } else { 0.0 });
    let a = corners_by_f.transpose() * on_corners * &corners_by_f;
    Tangent::from_fn(|r, c| a[(r, c)])
}

#[test]
fn the_tangent_equals_the_corner_form() {
    for network in networks() {
        for material in support::laws() {
            for (name, f) in states() {
                let mut bench = bench::<Sparse>(&network, material.clone());
                let mut rve = bench.at_rest();
                bench.solve(&mut rve, &f).unwrap();
                let tangent = bench.tangent(&rve);
                let error = (tangent - corner_form(&bench)).amax() / tangent.amax();
                assert!(error < 1e-10, "{} {} {name}: {error:.1e}", network.name(), material.law.name());
            }
        }
    }
}

#[test]
fn the_tangent_does_not_depend_on_earlier_solves() {
    let network = support::frozen();
    let [_, material, ..] = support::laws();
    let [(_, small), (_, large), _] = states();
    let mut fresh = bench::<Sparse>(&network, material.clone());
    let mut rve = fresh.at_rest();
    fresh.solve(&mut rve, &large).unwrap();
    let expected = fresh.tangent(&rve);

    let mut used = bench::<Sparse>(&network, material.clone());
    let mut other = used.at_rest();
    used.solve(&mut other, &small).unwrap();
    used.tangent(&other);
    let mut rve = used.at_rest();
    used.solve(&mut rve, &large).unwrap();
    assert_eq!(used.tangent(&rve), expected, "bitwise");
}
