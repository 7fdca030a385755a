//! The stress-gradient term of networks for which it is known.

use std::sync::Arc;

use biotissue::backends::sparse::Sparse;
use biotissue::fiber::equilibrium::{EquilibriumParams, equilibrate};
use biotissue::fiber::law::{FiberLaw, FiberMaterial, Law};
use biotissue::fiber::network::{Cube, Network};
use biotissue::fiber::rve::{Rve, RveModel, StressScale};
use biotissue::fiber::stress_gradient::StressGradient;
use biotissue::fiber::workspace::Workspace;
use nalgebra::{Matrix3, Vector3};

use crate::support;

const LAW: Law = Law::Linear { youngs_modulus: 1.0e6 };
const RADIUS: f64 = 1.0e-3;

/// Returns the term and the stress scale of a network at `f`.
fn term(network: &Arc<Network>, stress_scale: StressScale, f: Matrix3<f64>) -> (StressGradient, f64) {
    let material = FiberMaterial { law: LAW, radius: RADIUS, density: None };
    let model = RveModel::<Sparse>::new(&(), Arc::clone(network), Some(material), stress_scale)
        .unwrap_or_else(|error| panic!("{error}"));
    let mut workspace = Workspace::new(&(), &model).unwrap();
    let mut rve = Rve::at_rest(model.network());
    let solved = equilibrate(&model, &mut rve, &f, &EquilibriumParams::default(), &mut workspace).unwrap();
    (solved.stress_gradient().unwrap(), model.scale())
}

fn one_fiber(from: [f64; 3], to: [f64; 3]) -> Arc<Network> {
    Arc::new(Network::in_cube("one fiber", Cube::UNIT, vec![from, to], vec![[0, 1]]).unwrap())
}

fn defined(term: StressGradient) -> Vector3<f64> {
    match term {
        StressGradient::Defined(value) => value.into(),
        StressGradient::FibersInFaces(count) => panic!("{count} fibers in faces"),
    }
}

/// For `F = diag(a, b, c)` every end of a fiber on a face contributes its pull times `1 - 1 / stretch` of the normal.
#[test]
fn a_fiber_across_a_corner() {
    let (a, b, c) = (1.2, 0.9, 1.1);
    let f = Matrix3::from_diagonal(&Vector3::new(a, b, c));
    let network = one_fiber([0.5, 0.0, 0.1], [0.0, 0.5, 0.1]);
    let length = (0.5_f64 * (a * a + b * b)).sqrt() / 2.0_f64.sqrt();
    let (stress, _) = LAW.stress(length / 0.5_f64.sqrt());
    let force = stress * std::f64::consts::PI * RADIUS * RADIUS;
    let pull = Vector3::new(a, -b, 0.0) * (0.5 * force / length);
    for scale in [StressScale::Raw, StressScale::FiberVolumeFraction(0.01)] {
        let (found, kappa) = term(&network, scale, f);
        let expected = pull * ((1.0 - 1.0 / a) - (1.0 - 1.0 / b)) * kappa.powf(1.5) / (a * b * c);
        assert!((defined(found) - expected).norm() < 1e-12 * expected.norm(), "{found:?} {expected:?}");
    }
}

#[test]
fn a_straight_fiber_and_a_uniform_dilatation_have_none() {
    let f = Matrix3::new(1.2, 0.1, 0.0, 0.05, 0.9, 0.2, 0.0, 0.1, 1.1);
    let straight = one_fiber([-0.5, 0.1, 0.2], [0.5, 0.3, -0.1]);
    assert!(defined(term(&straight, StressScale::Raw, f).0).norm() < 1e-12);

    let network = support::frozen();
    let stretched = Matrix3::from_diagonal(&Vector3::new(1.2, 1.0, 1.0));
    let [dilated, stretched] =
        [Matrix3::identity() * 1.1, stretched].map(|f| defined(term(&network, StressScale::Raw, f).0).norm());
    assert!(stretched > 0.0 && dilated < 1e-8 * stretched, "{dilated} {stretched}");
}

#[test]
fn a_loaded_fiber_in_a_face_leaves_it_undefined() {
    let network = one_fiber([0.5, 0.0, 0.1], [0.5, 0.5, 0.1]);
    let stretched = Matrix3::from_diagonal(&Vector3::new(1.0, 1.1, 1.0));
    assert_eq!(term(&network, StressScale::Raw, stretched).0, StressGradient::FibersInFaces(1));
    assert_eq!(term(&network, StressScale::Raw, Matrix3::identity()).0, StressGradient::Defined([0.0; 3]));
}
