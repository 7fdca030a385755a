//! An RVE with stored sensitivities starts the next solve from a prediction that is exact to first order.
use crate::support;
use crate::support::Bench;
use biotissue::backends::sparse::Sparse;
use nalgebra::{Matrix3, Rotation3};

/// Returns the relative residual at the start of an increment of size `h` beyond a deformed state, and the number of
/// iterations.
fn first_residual(h: f64, predict: bool) -> (f64, usize) {
    let mut bench = Bench::<Sparse>::new(&support::frozen(), Some(support::laws()[1].clone()));
    let here = Matrix3::new(1.2, 0.1, 0.0, 0.0, 0.9, 0.05, 0.1, 0.0, 1.05);
    let mut rve = bench.at_rest();
    bench.solve(&mut rve, &here).unwrap();
    bench.tangent(&rve);
    if predict {
        bench.keep_sensitivities(&mut rve);
    }
    // The increment has all six strains and a finite rotation, which does not reduce the accuracy of the prediction.
    let strain = Matrix3::new(0.5, -0.3, 0.2, -0.3, 0.1, 0.4, 0.2, 0.4, -0.6);
    let rotation = Rotation3::from_euler_angles(0.4, -0.2, 1.0);
    let target = rotation * (Matrix3::identity() + strain * h) * here;
    let report = bench.solve(&mut rve, &target).unwrap();
    assert_eq!(report.predicted, usize::from(predict));
    assert!(!rve.has_sensitivities(), "the sensitivities of the previous state were kept");
    (report.newton.relative[0], report.iterations)
}

#[test]
fn the_prediction_is_exact_to_first_order() {
    for h in [4e-2, 2e-2, 1e-2] {
        let (affine, predicted) = (first_residual(h, false).0, first_residual(h, true).0);
        let orders =
            [(affine, false), (predicted, true)].map(|(whole, p)| (whole / first_residual(h / 2.0, p).0).log2());
        assert!((orders[0] - 1.0).abs() < 0.2 && (orders[1] - 2.0).abs() < 0.2, "{h}: orders {orders:?}");
        assert!(predicted < 0.2 * affine, "{h}: {predicted:.1e} against {affine:.1e}");
    }
}

#[test]
fn the_prediction_saves_iterations() {
    let (without, with) = (first_residual(1e-2, false).1, first_residual(1e-2, true).1);
    assert!(with < without, "{with} against {without}");
}
