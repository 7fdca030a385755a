use std::sync::Arc;

use super::*;
use crate::fem::material::NeoHookean;

fn stretched(by: f64) -> Matrix3<f64> {
    Matrix3::from_diagonal(&[1.0 + by, 1.0, 1.0].into())
}

/// One element of matrix alone, with a life cycle.
fn sites(rules: RveLifecycle) -> Sites {
    let matrix = Some(Arc::new(Formula::NeoHookean(NeoHookean { mu: 1.0, lambda: 2.0 })));
    let lifecycle = Some(Box::new(LifecycleState::new(rules)));
    Sites {
        sites: vec![Site::Rve(RveSite { region: 0, network: None, matrix, lifecycle })],
        points: PointNumbering::default(),
        at_rest: Vec::new(),
        pending: RveChanges::default(),
        is_restored: false,
    }
}

/// Ends a step at a stretch; the RVE, where it is solved, has ten times the stiffness of its matrix.
fn converge(sites: &mut Sites, by: f64) -> (Response, RveChanges) {
    converge_increment(sites, by, true)
}

fn converge_increment(sites: &mut Sites, by: f64, ends_step: bool) -> (Response, RveChanges) {
    let f = stretched(by);
    let response = match sites.sites[0].respond(&f, &sites.at_rest).unwrap() {
        Some(response) => response,
        None => {
            let response = NeoHookean { mu: 10.0, lambda: 20.0 }.evaluate(&f).unwrap();
            sites.store_response(0, &response);
            response
        }
    };
    let changes = sites.evolve();
    assert!(changes.is_empty() || sites.evolve().is_empty(), "once only");
    sites.commit(ends_step);
    (response, changes)
}

#[test]
fn an_rve_is_created_and_deleted_when_strain_exceeds_its_thresholds() {
    let rules =
        RveLifecycle { created_at: 0.05, before: BeforeCreation::Matrix, deleted_at: 0.2, ..RveLifecycle::default() };
    let mut sites = sites(rules);
    assert_eq!((sites.status(0), sites.existing().count()), (Some(RveStatus::Waiting), 0));
    let (response, changes) = converge(&mut sites, 0.04);
    assert_eq!(response, NeoHookean { mu: 1.0, lambda: 2.0 }.evaluate(&stretched(0.04)).unwrap());
    assert_eq!(changes, RveChanges::default());
    let (_, changes) = converge(&mut sites, 0.06);
    assert_eq!((changes.created, sites.status(0)), (vec![0], Some(RveStatus::Awake)));
    let (response, _) = converge(&mut sites, 0.1);
    assert_eq!(response, NeoHookean { mu: 10.0, lambda: 20.0 }.evaluate(&stretched(0.1)).unwrap());
    let (_, changes) = converge(&mut sites, 0.3);
    assert_eq!((changes.deleted, sites.status(0)), (vec![0], Some(RveStatus::Deleted)));
    let (response, _) = converge(&mut sites, 0.01);
    assert_eq!(response, NeoHookean { mu: 1.0, lambda: 2.0 }.evaluate(&stretched(0.01)).unwrap());
}

#[test]
fn an_rve_sleeps_while_changes_are_small_and_wakes_when_they_accumulate() {
    let mut sites = sites(RveLifecycle { asleep_below: 0.01, ..RveLifecycle::default() });
    converge(&mut sites, 0.1);
    assert_eq!(sites.status(0), Some(RveStatus::Awake), "one state is no change");
    let (extrapolation_point, _) = converge(&mut sites, 0.105);
    assert_eq!(sites.status(0), Some(RveStatus::Asleep));
    let (response, _) = converge(&mut sites, 0.11);
    assert_eq!((response.tangent, sites.status(0)), (extrapolation_point.tangent, Some(RveStatus::Asleep)));
    let expected = extrapolation_point.pk1[(0, 0)] + 0.005 * extrapolation_point.tangent[(0, 0)];
    assert!((response.pk1[(0, 0)] - expected).abs() < 1e-14);
    converge(&mut sites, 0.117);
    assert_eq!(sites.status(0), Some(RveStatus::Awake), "0.012 from where it fell asleep");
}

#[test]
fn an_rve_sleeps_by_its_change_in_a_whole_step() {
    let mut sites = sites(RveLifecycle { asleep_below: 0.01, ..RveLifecycle::default() });
    converge(&mut sites, 0.1);
    for by in [0.106, 0.112, 0.118] {
        converge_increment(&mut sites, by, false);
        assert_eq!(sites.status(0), Some(RveStatus::Awake));
    }
    converge(&mut sites, 0.12);
    assert_eq!(sites.status(0), Some(RveStatus::Awake), "the step changed it by 0.02");
    converge_increment(&mut sites, 0.123, false);
    converge(&mut sites, 0.126);
    assert_eq!(sites.status(0), Some(RveStatus::Asleep), "this one by 0.006");
}

/// The stress of a sleeping RVE is the derivative of its energy.
#[test]
fn the_response_of_a_sleeping_rve_derives_from_an_energy() {
    let from = Matrix3::new(1.1, 0.1, 0.0, 0.0, 0.9, 0.0, 0.2, 0.0, 1.0);
    let response = NeoHookean { mu: 3.0, lambda: 5.0 }.evaluate(&from).unwrap();
    let f = from + Matrix3::new(0.01, -0.02, 0.03, 0.0, 0.01, 0.0, 0.02, 0.0, -0.01);
    let (h, here) = (1e-5, extrapolate(&from, &response, &f));
    for k in 0..9 {
        let moved = |by: f64| {
            let mut f = f;
            f[(k / 3, k % 3)] += by;
            extrapolate(&from, &response, &f).energy
        };
        assert!(((moved(h) - moved(-h)) / (2.0 * h) - here.pk1[(k / 3, k % 3)]).abs() < 1e-8, "component {k}");
    }
}
