//! The checks of the published RVE, applied to the frozen network, which is part of the repository. The reference
//! results come from a dense Newton method in NumPy that shares no code with this crate.
use crate::support;
use crate::support::Bench;
use biotissue::backends::{dense::Dense, sparse::Sparse};
use biotissue::fiber::homogenize::Tangent;
use biotissue::fiber::orientation::{Weighting, tensor};
use biotissue::fiber::rve::Rve;
use biotissue::las::{Iterative, RealBackend, SolverParams};
use nalgebra::Matrix3;

const RESIDUALS: [f64; 4] =
    [3.4455495606786463e-07, 2.4960526672402314e-08, 1.9035552946428686e-10, 1.1896416136649279e-14];

#[rustfmt::skip]
const PK1: [f64; 9] = [
    6.149991150121224e-07, 1.0954968381666093e-07, 8.768152088715524e-09,
    1.0425200347948875e-07, -1.2054212637095344e-10, -2.3714575089806494e-08,
    7.001871553380709e-09, -2.9906044812725463e-08, 2.4947673773164943e-07,
];

const ENERGY: f64 = 2.684522924677931e-08;

/// Rows 0, 4 and 8 of the tangent `dP/dF`, those of `P_11`, `P_22` and `P_33`.
const TANGENT_ROWS: [(usize, [f64; 9]); 3] = [
    (
        0,
        [
            9.13570463857085e-06,
            4.06477368445810e-07,
            7.28149092115839e-08,
            2.85709778345009e-07,
            2.47592759567592e-06,
            -2.48286456042363e-07,
            6.44027176413899e-08,
            -3.71443189043254e-07,
            2.96839968396190e-06,
        ],
    ),
    (
        4,
        [
            2.47592759567593e-06,
            8.52667663087162e-08,
            5.35225441608670e-08,
            9.71495237070945e-09,
            6.91986751385753e-06,
            -1.77029497525144e-07,
            5.79503540214175e-08,
            -3.41131602227666e-07,
            2.15135263279001e-06,
        ],
    ),
    (
        8,
        [
            2.96839968396190e-06,
            9.63571157614422e-08,
            4.52862201505411e-07,
            6.26546890505802e-08,
            2.15135263279001e-06,
            -2.15146199302712e-07,
            4.43130548660388e-07,
            -4.78305308642211e-07,
            8.77427774274973e-06,
        ],
    ),
];

fn assert_reference_results<B: RealBackend<Context = ()>>() -> (Matrix3<f64>, Tangent) {
    let network = support::frozen();
    assert_eq!((network.nodes().len(), network.fibers().len(), network.boundary().len()), (127, 151, 115));
    assert!((network.total_length() - 54.194_076_548_916_55).abs() < 1e-12);
    let mut bench = Bench::<B>::new(&network, None);
    let mut rve = bench.at_rest();
    let report = bench.solve(&mut rve, &gradient()).unwrap();
    assert!(report.newton.residuals.len() >= RESIDUALS.len());
    for (found, expected) in report.newton.residuals.iter().zip(RESIDUALS) {
        assert!((found - expected).abs() < 1e-9 * expected + 1e-21, "residual {found:e}, expected {expected:e}");
    }
    assert_reference_state(&mut bench, &rve)
}

fn gradient() -> Matrix3<f64> {
    Matrix3::new(1.08, 0.03, 0.0, 0.01, 0.97, 0.02, 0.0, -0.02, 1.01)
}

fn assert_reference_state<B: RealBackend<Context = ()>>(bench: &mut Bench<B>, rve: &Rve) -> (Matrix3<f64>, Tangent) {
    let pk1 = bench.pk1();
    assert!((pk1 - Matrix3::from_row_slice(&PK1)).amax() < 1e-9 * pk1.amax(), "{pk1}");
    assert!((bench.energy() - ENERGY).abs() < 1e-9 * ENERGY, "{}", bench.energy());
    let omega = tensor(&bench.workspace.states().directions, bench.model.truss().lengths(), Weighting::Number);
    assert!((omega[(0, 0)] - 0.359_202_722_9).abs() < 1e-9, "{omega}");

    let tangent = bench.tangent(rve);
    for (row, expected) in TANGENT_ROWS {
        for (column, expected) in expected.into_iter().enumerate() {
            let found = tangent[(row, column)];
            assert!(
                (found - expected).abs() < 1e-9 * tangent.amax(),
                "A[{row},{column}] = {found:e}, not {expected:e}"
            );
        }
    }
    (pk1, tangent)
}

#[test]
fn every_backend_gives_the_reference_results_of_the_frozen_rve() {
    let (p_sparse, a_sparse) = assert_reference_results::<Sparse>();
    let (p_dense, a_dense) = assert_reference_results::<Dense>();
    assert!((p_sparse - p_dense).amax() < 1e-10 * p_dense.amax());
    assert!((a_sparse - a_dense).amax() < 1e-10 * a_dense.amax());
}

/// Solves the linear systems by BiCGSTAB with an incomplete factorization.
#[test]
fn an_iterative_solver_gives_the_reference_results_of_the_frozen_rve() {
    let method = Iterative { tolerance: 1e-13, ..Iterative::default() };
    let solver = SolverParams::default().iterative(method);
    let mut bench = Bench::<Sparse>::solved_by(&(), &support::frozen(), None, &solver);
    let mut rve = bench.at_rest();
    let report = bench.solve(&mut rve, &gradient()).unwrap();
    assert!(report.newton.linear_iterations > 0 && report.newton.cholesky == 0, "{report:?}");
    assert_reference_state(&mut bench, &rve);
}
