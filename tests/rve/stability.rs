//! Equilibria are minima of the energy, whichever stage finds them, and results belong to the RVE that was solved.
use crate::support;
use std::sync::Arc;

use crate::support::Bench;
use biotissue::backends::sparse::Sparse;
use biotissue::fiber::equilibrium::{EquilibriumParams, RveError, Stage, StageError, Stages, equilibrate};
use biotissue::fiber::law::FiberMaterial;
use biotissue::fiber::network::Network;
use biotissue::fiber::network::generate::{Alignment, GeneratorParams, Kind};
use biotissue::fiber::rve::{Rve, RveStateError};
use nalgebra::{DMatrix, Matrix3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{RngCore, SeedableRng};

/// Returns two fibers in a straight line along x with a free common node, and boundary fibers that reach the other
/// faces.
fn column() -> Arc<Network> {
    let nodes = vec![
        [-0.5, 0.0, 0.0],
        [0.0, 0.0, 0.0],
        [0.5, 0.0, 0.0],
        [0.1, -0.5, 0.1],
        [0.3, 0.5, 0.1],
        [0.1, 0.1, -0.5],
        [0.3, 0.1, 0.5],
    ];
    Arc::new(Network::new("column", nodes, vec![[0, 1], [1, 2], [3, 4], [5, 6]]).unwrap())
}

fn pressed() -> Matrix3<f64> {
    Matrix3::from_diagonal(&[0.8, 1.0, 1.0].into())
}

fn linear() -> FiberMaterial {
    support::laws()[0].clone()
}

/// Returns every stage that found an unstable equilibrium, with the number of negative pivots.
fn unstable<F: std::error::Error>(error: &RveError<F>) -> Vec<(Stage, Option<usize>)> {
    let RveError::NotConverged { failures, .. } = error else { panic!("{error}") };
    let unstable = failures.iter().filter_map(|failure| match failure.reason {
        StageError::Unstable(negative_pivots) => Some((failure.stage, negative_pivots)),
        _ => None,
    });
    unstable.collect()
}

/// The straight column in compression is in unstable equilibrium. It buckles in any lateral direction until both fibers
/// have their reference length.
#[test]
fn a_straight_column_in_compression_buckles() {
    for stages in [
        Stages::default(),
        Stages::of(&[Stage::Regularized]),
        Stages::of(&[Stage::Cuts, Stage::Regularized]),
        Stages::of(&[Stage::Regularized, Stage::Relaxation]),
    ] {
        let mut bench = Bench::<Sparse>::new(&column(), Some(linear()));
        bench.params = bench.params.with_stages(stages);
        let straight = Rve::restored(pressed(), vec![[0.0; 3]], None);
        // The solve starts from rest, and from the unstable equilibrium itself, which needs no iteration.
        for mut rve in [bench.at_rest(), straight] {
            let report = bench.solve(&mut rve, &pressed()).unwrap();
            assert_eq!((report.stage, report.saddles), (Some(Stage::Regularized), 1), "{report:?}");
            assert_eq!((report.neutral, report.negative_pivots), (true, Some(0)), "free to rotate about x: {report:?}");
            let [x, y, z] = rve.interior()[0];
            assert!(x.abs() < 1e-6 && (y.hypot(z) - 0.3).abs() < 1e-6, "{:?}", rve.interior());
            let stretches = &bench.workspace.states().stretches[..2];
            assert!(stretches.iter().all(|stretch| (stretch - 1.0).abs() < 1e-6), "{stretches:?}");
            bench.tangent(&rve);
        }
    }
}

#[test]
fn a_saddle_point_is_an_error_without_regularized_newton() {
    use Stage::{Cuts, Newton, Relaxation};
    for stages in [&[Newton][..], &[Newton, Relaxation], &[Cuts], &[Relaxation]] {
        let mut bench = Bench::<Sparse>::new(&column(), Some(linear()));
        bench.params = bench.params.with_stages(Stages::of(stages));
        let mut rve = bench.at_rest();
        let before = rve.clone();
        let error = bench.solve(&mut rve, &pressed()).unwrap_err();
        let expected: Vec<_> = stages.iter().map(|&stage| (stage, Some(2))).collect();
        assert_eq!(unstable(&error), expected, "{error}");
        assert!(error.to_string().contains("unstable: its stiffness has 2 negative pivots"), "{error}");
        assert_eq!(rve, before, "a failure does not change the state");
    }
}

#[test]
fn a_network_in_tension_is_definite_and_a_slack_one_neutral() {
    let mut bench = Bench::<Sparse>::new(&column(), Some(linear()));
    let pulled = Matrix3::from_diagonal(&[1.2, 1.0, 1.0].into());
    for (f, neutral) in [(Matrix3::identity(), true), (pulled, false)] {
        let mut rve = bench.at_rest();
        let report = bench.solve(&mut rve, &f).unwrap();
        assert_eq!((report.neutral, report.negative_pivots, report.saddles), (neutral, Some(0), 0), "{f}");
    }
}

fn uniform(random: &mut ChaCha8Rng) -> f64 {
    (random.next_u64() >> 11) as f64 / (1u64 << 53) as f64
}

/// The network is one of the random networks of `studies/robustness.rs`; at this random deformation, Newton's method
/// finds a saddle point.
#[test]
fn the_stages_leave_a_saddle_point_that_newton_finds() {
    let seed = 5;
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut params = GeneratorParams::new(Kind::Delaunay, seed);
    params.alignment = Some(Alignment::new([(); 3].map(|()| uniform(&mut random) - 0.5), 0.7).unwrap());
    let network = Arc::new(params.of_nodes(200).unwrap().network);
    let material = FiberMaterial { radius: 5.0e-8, ..support::laws()[1].clone() };
    let f = Matrix3::new(
        -0.15970220668209478,
        -1.0140212347502837,
        -0.1673460933955929,
        -0.03632431786109705,
        -0.25014210975431406,
        0.9927530752452093,
        -0.8980898766708115,
        0.2145482004155396,
        -0.059594757856116454,
    );
    let mut bench = Bench::<Sparse>::new(&network, Some(material));
    let params = bench.params;
    bench.params = params.with_stages(Stages::of(&[Stage::Newton]));
    let error = bench.solve(&mut bench.at_rest(), &f).unwrap_err();
    assert_eq!(unstable(&error), [(Stage::Newton, Some(2))], "{error}");

    bench.params = params;
    let mut rve = bench.at_rest();
    let report = bench.solve(&mut rve, &f).unwrap();
    assert_eq!((report.stage, report.saddles), (Some(Stage::Regularized), 1), "{report:?}");
    assert_eq!((report.neutral, report.negative_pivots), (false, Some(0)), "{report:?}");
    assert!(stiffness(&bench).cholesky().is_some(), "the stiffness is not positive definite");
}

/// Assembles the whole stiffness of the interior nodes from the fiber states in the workspace.
fn stiffness(bench: &Bench<Sparse>) -> DMatrix<f64> {
    let (network, states) = (bench.model.network(), bench.workspace.states());
    let number = network.interior_number();
    let mut stiffness = DMatrix::zeros(bench.model.unknowns(), bench.model.unknowns());
    for (fiber, ends) in bench.model.truss().ends().iter().enumerate() {
        let block = Matrix3::from_row_slice(&states.block(fiber));
        for (k, &a) in ends.iter().enumerate() {
            for (l, &b) in ends.iter().enumerate() {
                let (Ok(a), Ok(b)) = (usize::try_from(number[a as usize]), usize::try_from(number[b as usize])) else {
                    continue;
                };
                let sign = if k == l { 1.0 } else { -1.0 };
                let mut part = stiffness.fixed_view_mut::<3, 3>(3 * a, 3 * b);
                part += block * sign;
            }
        }
    }
    stiffness
}

/// The other model has the same network with another law, or another network of the same or another size.
#[test]
fn a_workspace_or_an_rve_of_another_network_is_rejected() {
    let (f, params) = (Matrix3::identity(), EquilibriumParams::default());
    let mut own = Bench::<Sparse>::new(&column(), Some(linear()));
    let mut stiffer = Bench::<Sparse>::new(&column(), Some(support::laws()[1].clone()));
    let mut larger = Bench::<Sparse>::new(&support::frozen(), Some(linear()));
    for other in [&mut stiffer, &mut larger] {
        let refused = equilibrate(&own.model, &mut own.at_rest(), &f, &params, &mut other.workspace).unwrap_err();
        assert_eq!(refused, RveError::Workspace);
    }
    let mut rest = larger.at_rest();
    let (found, expected) = (rest.interior().len(), 1);
    assert_eq!(own.solve(&mut rest, &f).unwrap_err(), RveError::State(RveStateError::Nodes { found, expected }));

    let mut nodes = column().nodes().to_vec();
    nodes[1] = [0.1, 0.0, 0.0];
    let moved = Arc::new(Network::new("moved", nodes, column().fibers().to_vec()).unwrap());
    let mut moved = Bench::<Sparse>::new(&moved, Some(linear()));
    let mut rve = own.at_rest();
    assert_eq!(moved.solve(&mut rve, &f).unwrap_err(), RveError::State(RveStateError::Network));
    // The network of a restored state is unknown until the state has been solved.
    let (gradient, interior, rates) = rve.into_parts();
    let mut kept = Rve::restored(gradient, interior, rates);
    own.solve(&mut kept, &f).unwrap();
    assert_eq!(moved.solve(&mut kept, &f).unwrap_err(), RveError::State(RveStateError::Network));
}

/// Two RVEs that are solved alternately in one workspace have the same tangents as in separate workspaces.
#[test]
fn a_tangent_belongs_to_the_rve_that_was_solved() {
    let network = support::frozen();
    let [mut both, mut alone] = [(); 2].map(|()| Bench::<Sparse>::new(&network, Some(support::laws()[1].clone())));
    let targets = [[1.1, 1.0, 0.95], [0.95, 1.2, 1.0]].map(|stretches| Matrix3::from_diagonal(&stretches.into()));
    let mut rves = [both.at_rest(), both.at_rest()];
    for (rve, f) in rves.iter_mut().zip(&targets) {
        both.solve(rve, f).unwrap();
    }
    for (rve, f) in rves.iter().zip(&targets) {
        let mut own = alone.at_rest();
        alone.solve(&mut own, f).unwrap();
        assert_eq!(both.tangent(rve), alone.tangent(&own));
    }
}

/// The forces are excessive because of the unit of lengths, not of the modulus: 1 mm read as 1 m is a stretch of 1000.
#[test]
fn excessive_forces_end_all_stages() {
    let mut bench = Bench::<Sparse>::new(&support::frozen(), Some(support::laws()[1].clone()));
    let any = bench.params.newton.max_iterations;
    // After a single iteration, Newton's method fails and no later stage may be tried. After more, it converges.
    for (stretch, max_iterations) in [(20.0, 1), (40.0, 1), (1e3, 1), (1e60, 1), (18.0, any), (20.0, any)] {
        let mut rve = bench.at_rest();
        let before = rve.clone();
        bench.params.newton.max_iterations = max_iterations;
        let error = bench.solve(&mut rve, &Matrix3::from_diagonal(&[stretch, 1.0, 1.0].into())).unwrap_err();
        let RveError::ExcessiveForce { force, .. } = &error else { panic!("{error}") };
        assert!(force.force_ratio >= 1e12 && force.stretch > 0.5 * stretch, "{error}");
        let message = "the law exponential (youngs_modulus = 100000000.0, nonlinearity = 1.2) pulls with ";
        assert!(
            error.to_string().contains(message) && error.to_string().contains("check the units of lengths"),
            "{error}"
        );
        assert_eq!(rve, before);
    }
}

/// Half of the increment has no excessive force, so the affine motion does not end the solve; the first stage that
/// reaches an equilibrium rejects it.
#[test]
fn an_equilibrium_with_excessive_forces_is_rejected_by_every_stage() {
    let mut bench = Bench::<Sparse>::new(&support::frozen(), Some(support::laws()[1].clone()));
    let stretched = |stretch: f64| Matrix3::from_diagonal(&[stretch, 1.0, 1.0].into());
    let mut rve = bench.at_rest();
    for stretch in [1.5, 2.0, 3.0, 4.0, 5.0] {
        bench.solve(&mut rve, &stretched(stretch)).unwrap();
    }
    bench.keep_sensitivities(&mut rve);
    let (before, params) = (rve.clone(), bench.params);
    for stages in [&[Stage::Newton][..], &[Stage::Regularized], &[Stage::Cuts], &[Stage::Relaxation], &Stage::ALL] {
        bench.params = params.with_stages(Stages::of(stages));
        let error = bench.solve(&mut rve, &stretched(7.4)).unwrap_err();
        assert!(matches!(error, RveError::ExcessiveForce { .. }), "{stages:?}: {error}");
        let report = error.report().unwrap();
        assert!(report.stage.is_none() && report.iterations + report.relaxation.steps > 0, "{stages:?}: {report:?}");
        assert_eq!(rve, before, "{stages:?}");
    }
}
