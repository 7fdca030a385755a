//! The stages that solve an RVE if full Newton does not converge, and the error if all of them fail.
use crate::support;
use std::sync::Arc;

use crate::support::Bench;
use biotissue::backends::sparse::Sparse;
use biotissue::fiber::deformation_path::between;
use biotissue::fiber::equilibrium::{EquilibriumReport, RveError, Stage, Stages};
use biotissue::fiber::law::FiberMaterial;
use biotissue::fiber::network::Network;
use biotissue::fiber::network::generate::voronoi;
use biotissue::fiber::rve::Rve;
use nalgebra::{Matrix3, Vector3};

/// Returns the frozen network with the exponential law.
fn bench() -> Bench<Sparse> {
    Bench::new(&support::frozen(), Some(support::laws()[1].clone()))
}

/// Returns the stages whose failures an error lists.
fn stages_of<F: std::error::Error>(error: &RveError<F>) -> Vec<Stage> {
    let RveError::NotConverged { failures, .. } = error else { panic!("{error}") };
    failures.iter().map(|failure| failure.stage).collect()
}

#[test]
fn the_line_search_converges_where_full_newton_diverges() {
    // The network is compressed along x and y, so that fibers slacken and the first full steps overshoot.
    let f = Matrix3::new(0.84, 0.07, 0.13, -0.03, 0.84, 0.19, 0.04, 0.0, 1.08);
    let mut full = bench();
    full.params.newton.max_backtracks = 0;
    full.params.stages = Stages::of(&[Stage::Newton]);
    let mut rve = full.at_rest();
    let before = rve.clone();
    let error = full.solve(&mut rve, &f).unwrap_err();
    assert_eq!(stages_of(&error), [Stage::Newton], "{error}");
    assert_eq!(rve, before, "a failure does not change the state");

    let mut searching = bench();
    searching.params.stages = Stages::of(&[Stage::Newton]);
    let report = searching.solve(&mut rve, &f).unwrap();
    assert!(report.backtracks > 0 && report.cuts == 0, "{report:?}");
    assert_balanced(&searching, &report);
}

#[test]
fn an_indefinite_stiffness_is_factored_and_counted() {
    let f = Matrix3::new(0.9, 0.18, 0.16, -0.08, 0.81, 0.11, -0.02, -0.18, 0.91);
    let mut bench = bench();
    let mut rve = bench.at_rest();
    let report = bench.solve(&mut rve, &f).unwrap();
    assert!(report.indefinite > 0, "{report:?}");
    assert_balanced(&bench, &report);
}

/// Checks equilibrium by the stress: `sum x (x) T` over the boundary is symmetric only if the moments balance.
fn assert_balanced(bench: &Bench<Sparse>, report: &EquilibriumReport) {
    assert!(report.newton.relative.last().unwrap() <= &1e-10);
    let positions = bench.workspace.positions();
    let mut sum = Matrix3::zeros();
    let mut forces = vec![[0.0; 3]; positions.len()];
    bench.model.truss().nodal_forces(bench.workspace.states(), &mut forces);
    for &node in bench.model.network().boundary() {
        let (x, t) = (positions[node as usize], forces[node as usize]);
        sum += Matrix3::from_fn(|i, j| t[i] * x[j]);
    }
    assert!((sum - sum.transpose()).amax() < 1e-8 * sum.amax(), "{sum}");
}

#[test]
fn cut_increments_converge_where_newton_needs_too_many_iterations() {
    let f = Matrix3::new(2.0, 0.3, 0.0, 0.0, 0.9, 0.1, 0.0, 0.0, 0.8);
    let mut whole = bench();
    let mut expected = whole.at_rest();
    whole.solve(&mut expected, &f).unwrap();

    let mut cut = bench();
    cut.params.newton.max_iterations = 4;
    cut.params.stages = Stages::of(&[Stage::Newton, Stage::Cuts]);
    let mut rve = cut.at_rest();
    let report = cut.solve(&mut rve, &f).unwrap();
    assert!(report.cuts > 0 && report.iterations > report.newton.iterations, "{report:?}");
    let difference = (cut.pk1() - whole.pk1()).amax() / whole.pk1().amax();
    assert!(difference < 1e-9, "{difference:.1e}");
}

#[test]
fn the_error_lists_the_progress_of_all_stages() {
    let f = Matrix3::new(2.0, 0.3, 0.0, 0.0, 0.9, 0.1, 0.0, 0.0, 0.8);
    let mut bench = bench();
    bench.params.newton.max_iterations = 1;
    bench.params.max_cuts = 2;
    bench.params.regularized.max_iterations = 2;
    bench.params.relaxation.max_steps = 100;
    let mut rve = bench.at_rest();
    let before = rve.clone();
    let error = bench.solve(&mut rve, &f).unwrap_err();
    assert_eq!(rve, before);
    assert_eq!(stages_of(&error), Stage::ALL);
    let RveError::NotConverged { failures, report } = &error else { panic!("{error}") };
    assert!(failures[2].cuts == 2 && failures[2].progress < 1.0 && report.regularized == 6, "{report:?}");
    assert_eq!(report.relaxation.steps, 100);
    let text = error.to_string();
    for part in [
        "Newton: no convergence in 1 iterations: |r| = ",
        "regularized Newton: no convergence in 2 iterations",
        "cut increments (2 halvings, 0.0000 of the way): no convergence in 2 iterations",
        "dynamic relaxation: not at rest after 100 steps: |r| = ",
    ] {
        assert!(text.contains(part), "{text}");
    }
}

/// Returns a straight chain across the cube; its two interior nodes can move sideways, so that the stiffness is
/// singular at rest.
fn chain() -> Arc<Network> {
    let mut nodes = vec![[-0.5, 0.0, 0.0], [-0.1, 0.0, 0.0], [0.2, 0.0, 0.0], [0.5, 0.0, 0.0]];
    let mut fibers = vec![[0, 1], [1, 2], [2, 3]];
    // Fibers with both ends on the boundary make the bounding box a cube.
    for (x, y) in [([0.1, -0.5, 0.1], [0.3, 0.5, 0.1]), ([0.1, 0.1, -0.5], [0.3, 0.1, 0.5])] {
        fibers.push([nodes.len() as u32, nodes.len() as u32 + 1]);
        nodes.extend([x, y]);
    }
    Arc::new(Network::new("chain", nodes, fibers).unwrap())
}

/// Only the axial stiffness of the fibers contributes to the tangent; the free lateral motions of the chain do not.
#[test]
fn a_floppy_network_has_a_tangent_at_rest() {
    let mut bench = Bench::<Sparse>::new(&chain(), Some(support::laws()[0].clone()));
    let mut rve = bench.at_rest();
    bench.solve(&mut rve, &Matrix3::identity()).unwrap();
    let tangent = bench.tangent(&rve);
    // The chain has total length 1; each of the two fibers across, of direction n and length L, contributes EA n_x^4 L.
    let stiffness = 1.0e8 * std::f64::consts::PI * 5.0e-5_f64.powi(2);
    let across = |x: f64| x.powi(4) / (x * x + 1.0).powf(1.5);
    let expected = stiffness * (1.0 + 2.0 * across(0.2));
    assert!((tangent[(0, 0)] / expected - 1.0).abs() < 1e-9, "{} {expected}", tangent[(0, 0)]);
}

/// A Voronoi network is compressed in ten steps. In one of them, the pivots indicate a regular stiffness, although its
/// factorization is too inaccurate for a solution.
#[test]
fn a_compressed_floppy_network_has_a_tangent_in_every_step() {
    let network = Arc::new(voronoi(40, 1).unwrap());
    let material = FiberMaterial { radius: 5e-8, ..support::laws()[0].clone() };
    let mut bench = Bench::<Sparse>::new(&network, Some(material));
    let (mut rve, pressed) = (bench.at_rest(), Matrix3::from_diagonal(&[0.7, 1.0, 1.0].into()));
    for step in 1..=10 {
        let f = if step == 10 { pressed } else { between(&Matrix3::identity(), &pressed, f64::from(step) / 10.0) };
        bench.solve(&mut rve, &f).unwrap();
        // The call panics if there is no tangent.
        let tangent = bench.tangent(&rve);
        let asymmetry = (tangent - tangent.transpose()).amax() / tangent.amax();
        assert!(asymmetry < 1e-9, "step {step}: {asymmetry:.1e}");
        bench.keep_sensitivities(&mut rve);
    }
}

#[test]
fn a_bad_prediction_does_not_change_the_result() {
    let mut bench = bench();
    bench.params.stages = Stages::of(&[Stage::Newton]);
    let (mut rve, f) = (bench.at_rest(), Matrix3::from_diagonal(&[1.1, 1.0, 0.95].into()));
    bench.solve(&mut rve, &Matrix3::identity()).unwrap();
    let nodes = rve.interior().len();
    // Sensitivities that move every node far out of the cube, each by another amount.
    let rates = (0..nodes).map(|node| [1e3 * (node as f32 + 1.0).sin(); 18]).collect();
    let mut astray = Rve::restored(Matrix3::identity(), rve.interior().to_vec(), Some(rates));
    let (before, params) = (astray.clone(), bench.params);
    bench.params.newton.max_iterations = 1;
    let error = bench.solve(&mut astray, &f).unwrap_err();
    assert!(matches!(&error, RveError::NotConverged { failures, .. } if failures.len() == 1), "{error}");
    assert!(astray == before, "a failure changes neither the state nor its sensitivities");
    bench.params = params;
    let plain = bench.solve(&mut rve, &f).unwrap();
    let report = bench.solve(&mut astray, &f).unwrap();
    assert!(report.predicted == 1 && report.iterations >= plain.iterations, "{report:?}");
    assert_eq!((report.stage, astray.interior()), (Some(Stage::Newton), rve.interior()));
}

#[test]
fn regularized_newton_solves_a_floppy_network() {
    // Nothing is deformed along x, so that the chain along x remains floppy; a second chain with a bend is pulled along
    // y.
    let straight = chain();
    let (mut nodes, mut fibers) = (straight.nodes().to_vec(), straight.fibers().to_vec());
    let first = nodes.len() as u32;
    nodes.extend([[-0.2, -0.5, -0.1], [-0.3, 0.1, -0.2], [-0.2, 0.5, -0.1]]);
    fibers.extend([[first, first + 1], [first + 1, first + 2]]);
    let network = Arc::new(Network::new("two chains", nodes, fibers).unwrap());
    let mut bench = Bench::<Sparse>::new(&network, Some(support::laws()[0].clone()));
    let mut rve = bench.at_rest();
    let report = bench.solve(&mut rve, &Matrix3::from_diagonal(&[1.0, 1.2, 1.0].into())).unwrap();
    assert_eq!((report.stage, report.cuts), (Some(Stage::Regularized), 0), "{report:?}");
    assert!(report.singular > 0, "{report:?}");
    assert_balanced(&bench, &report);
}

#[test]
fn regularized_newton_solves_a_network_whose_fibers_reverse() {
    let f = Matrix3::new(0.93, -0.3, 0.05, 0.0, 0.81, 0.09, 0.02, 0.0, 0.69);
    let mut bench = bench();
    let mut rve = bench.at_rest();
    let report = bench.solve(&mut rve, &f).unwrap();
    assert_eq!(report.stage, Some(Stage::Regularized), "{report:?}");
    assert_balanced(&bench, &report);
    let network = bench.model.network();
    let reversed =
        bench.model.truss().ends().iter().zip(&bench.workspace.states().directions).filter(|&(&[a, b], n)| {
            let [a, b] = [a, b].map(|node| Vector3::from(network.nodes()[node as usize]));
            (f * (b - a)).dot(&Vector3::from(*n)) < 0.0
        });
    assert!(reversed.count() > 0, "no fiber has reversed relative to the affine deformation");
}

#[test]
fn dynamic_relaxation_converges_without_regularized_newton() {
    let f = Matrix3::new(0.93, -0.3, 0.05, 0.0, 0.81, 0.09, 0.02, 0.0, 0.69);
    let mut bench = bench();
    bench.params = bench.params.with_stages(Stages::of(&[Stage::Newton, Stage::Cuts, Stage::Relaxation]));
    let mut rve = bench.at_rest();
    let report = bench.solve(&mut rve, &f).unwrap();
    assert_eq!(report.stage, Some(Stage::Relaxation), "{report:?}");
    assert!(report.cuts == 6 && report.relaxation.steps > 0, "{report:?}");
    assert_eq!(report.regularized, 0, "a stage that is not allowed was used");
    assert_balanced(&bench, &report);
}

#[test]
fn an_inverted_deformation_is_an_error() {
    let mut bench = bench();
    let mut rve = bench.at_rest();
    let error = bench.solve(&mut rve, &Matrix3::from_diagonal(&[1.0, 1.0, -0.5].into())).unwrap_err();
    assert_eq!(error, RveError::Inverted(-0.5));
    let error = bench.solve(&mut rve, &Matrix3::from_element(f64::NAN)).unwrap_err();
    assert!(matches!(error, RveError::Inverted(determinant) if determinant.is_nan()));
}
