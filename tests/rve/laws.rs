//! For every law, the stress of an RVE is the derivative of the energy, the tangent that of the stress, and the stress
//! rotates with the deformation.
use crate::support;
use crate::support::Bench;
use biotissue::backends::sparse::Sparse;
use biotissue::fiber::law::{FiberLaw, FiberMaterial, Law, Table};
use nalgebra::{Matrix3, Rotation3};

const E: f64 = 1.0e8;

/// A custom law: linear up to a strain of 2 %, then with a quadratic term.
#[derive(Debug)]
struct Toe;

impl FiberLaw for Toe {
    fn name(&self) -> &str {
        "toe"
    }

    fn parameters(&self) -> Vec<(&'static str, f64)> {
        Vec::new()
    }

    fn stress(&self, stretch: f64) -> (f64, f64) {
        let strain = stretch - 1.0;
        let beyond = (strain - 0.02).max(0.0);
        (E * (strain + 40.0 * beyond * beyond), E * (1.0 + 80.0 * beyond))
    }
}

fn laws() -> Vec<Law> {
    let points = [[0.8, -1.2e7], [0.95, -4e6], [1.0, 0.0], [1.03, 3.2e6], [1.08, 1.4e7], [1.2, 6e7], [1.4, 1.8e8]];
    let plain = support::laws().map(|material| material.law).into_iter();
    let mut laws: Vec<Law> =
        plain.chain([Law::table(Table::new(points.to_vec()).unwrap()), Law::custom(Toe)]).collect();
    let buckling: Vec<Law> = laws.iter().map(|law| law.clone().with_buckling(0.05, 0.04)).collect();
    laws.extend(buckling);
    laws
}

fn bench(law: Law) -> Bench<Sparse> {
    let material = FiberMaterial { law, radius: 5.0e-5, density: None };
    let mut bench = Bench::new(&support::frozen(), Some(material));
    bench.params.newton.tolerance = 1e-12;
    bench
}

fn states() -> [Matrix3<f64>; 2] {
    let strain = Matrix3::new(1.0, 0.4, 0.0, 0.2, -0.5, 0.3, 0.1, 0.0, 0.4);
    [Matrix3::identity() + strain * 0.01, Matrix3::identity() + strain * 0.12]
}

#[test]
fn the_stress_is_the_derivative_of_the_energy_for_every_law() {
    for law in laws() {
        for f in states() {
            let mut bench = bench(law.clone());
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
                let error = (difference - pk1[i]).abs() / pk1.amax();
                assert!(error < 1e-6, "{law:?}: {error:.1e}");
            }
        }
    }
}

#[test]
fn the_tangent_is_the_derivative_of_the_stress_for_every_law() {
    for law in laws() {
        for f in states() {
            let mut bench = bench(law.clone());
            let mut rve = bench.at_rest();
            bench.solve(&mut rve, &f).unwrap();
            let tangent = bench.tangent(&rve);
            for column in 0..9 {
                let h = 1e-6;
                let mut stress = |sign: f64| {
                    let mut f = f;
                    f[(column / 3, column % 3)] += sign * h;
                    bench.solve(&mut rve.clone(), &f).unwrap();
                    bench.pk1()
                };
                let difference = (stress(1.0) - stress(-1.0)) / (2.0 * h);
                for row in 0..9 {
                    let error = (difference[(row / 3, row % 3)] - tangent[(row, column)]).abs() / tangent.amax();
                    assert!(error < 1e-5, "{law:?}: {error:.1e}");
                }
            }
        }
    }
}

#[test]
fn rotating_the_deformation_rotates_the_stress_for_every_law() {
    let turn = Rotation3::from_euler_angles(0.4, -1.1, 2.0);
    for law in laws() {
        for f in states() {
            let mut bench = bench(law.clone());
            let mut rve = bench.at_rest();
            bench.solve(&mut rve, &f).unwrap();
            let (pk1, energy) = (bench.pk1(), bench.energy());
            bench.solve(&mut rve, &(turn * f)).unwrap();
            assert!((turn * pk1 - bench.pk1()).amax() < 1e-10 * pk1.amax(), "{law:?}");
            assert!((bench.energy() / energy - 1.0).abs() < 1e-10, "{law:?}");
        }
    }
}

#[test]
fn buckling_reduces_the_stress_in_compression() {
    let pressed = Matrix3::from_diagonal(&[0.93, 0.97, 0.97].into());
    let plain = laws().swap_remove(1);
    let [stiff, weak] = [plain.clone(), plain.with_buckling(0.05, 0.02)].map(|law| {
        let mut bench = bench(law);
        let mut rve = bench.at_rest();
        bench.solve(&mut rve, &pressed).unwrap();
        bench.pk1()[(0, 0)]
    });
    assert!(stiff < 0.0 && weak < 0.0 && weak > 0.6 * stiff, "{stiff:e} {weak:e}");
}
