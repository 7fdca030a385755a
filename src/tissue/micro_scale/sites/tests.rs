use super::*;
use crate::fem::material::NeoHookean;

fn stretched(by: f64) -> Matrix3<f64> {
    Matrix3::from_diagonal(&[1.0 + by, 1.0, 1.0].into())
}

/// One element of matrix alone, with a life cycle.
fn sites(rules: LifeCase) -> Sites {
    let matrix = Some(Formula::NeoHookean(NeoHookean { mu: 1.0, lambda: 2.0 }));
    let course = Some(Box::new(LifeCycle::new(rules)));
    Sites {
        sites: vec![Site::Rve(Point { region: 0, model: None, matrix, course })],
        at_rest: Vec::new(),
        pending: RveChanges::default(),
        is_restored: false,
    }
}

/// Converges at a stretch; the RVE, where it is solved, has ten times the stiffness of its matrix.
fn converge(sites: &mut Sites, by: f64) -> (Response, RveChanges) {
    let f = stretched(by);
    let answer = match sites.respond(0, &f).unwrap() {
        Some(answer) => answer,
        None => {
            let answer = NeoHookean { mu: 10.0, lambda: 20.0 }.evaluate(&f).unwrap();
            sites.answered(0, &answer);
            answer
        }
    };
    let turnover = sites.evolve();
    assert!(turnover.is_empty() || sites.evolve().is_empty(), "once only");
    sites.commit();
    (answer, turnover)
}

#[test]
fn an_rve_comes_when_strain_passes_a_threshold_and_goes_when_it_passes_another() {
    let rules = LifeCase { created_at: 0.05, before: Before::Matrix, deleted_at: 0.2, ..LifeCase::default() };
    let mut sites = sites(rules);
    assert_eq!((sites.life(0), sites.existing().count()), (Some(Life::Waiting), 0));
    let (answer, turnover) = converge(&mut sites, 0.04);
    assert_eq!(answer, NeoHookean { mu: 1.0, lambda: 2.0 }.evaluate(&stretched(0.04)).unwrap());
    assert_eq!(turnover, RveChanges::default());
    let (_, turnover) = converge(&mut sites, 0.06);
    assert_eq!((turnover.created, sites.life(0)), (vec![0], Some(Life::Awake)));
    let (answer, _) = converge(&mut sites, 0.1);
    assert_eq!(answer, NeoHookean { mu: 10.0, lambda: 20.0 }.evaluate(&stretched(0.1)).unwrap());
    let (_, turnover) = converge(&mut sites, 0.3);
    assert_eq!((turnover.deleted, sites.life(0)), (vec![0], Some(Life::Deleted)));
    let (answer, _) = converge(&mut sites, 0.01);
    assert_eq!(answer, NeoHookean { mu: 1.0, lambda: 2.0 }.evaluate(&stretched(0.01)).unwrap());
}

#[test]
fn an_rve_sleeps_while_little_changes_and_wakes_when_that_adds_up() {
    let mut sites = sites(LifeCase { asleep_below: 0.01, ..LifeCase::default() });
    converge(&mut sites, 0.1);
    assert_eq!(sites.life(0), Some(Life::Awake), "one state is no change");
    let (anchor, _) = converge(&mut sites, 0.105);
    assert_eq!(sites.life(0), Some(Life::Asleep));
    let (answer, _) = converge(&mut sites, 0.11);
    assert_eq!((answer.tangent, sites.life(0)), (anchor.tangent, Some(Life::Asleep)));
    let expected = anchor.pk1[(0, 0)] + 0.005 * anchor.tangent[(0, 0)];
    assert!((answer.pk1[(0, 0)] - expected).abs() < 1e-14);
    converge(&mut sites, 0.117);
    assert_eq!(sites.life(0), Some(Life::Awake), "0.012 from where it fell asleep");
}

/// The stress of a sleeping RVE is the derivative of its energy.
#[test]
fn what_a_sleeping_rve_answers_has_an_energy() {
    let from = Matrix3::new(1.1, 0.1, 0.0, 0.0, 0.9, 0.0, 0.2, 0.0, 1.0);
    let answer = NeoHookean { mu: 3.0, lambda: 5.0 }.evaluate(&from).unwrap();
    let f = from + Matrix3::new(0.01, -0.02, 0.03, 0.0, 0.01, 0.0, 0.02, 0.0, -0.01);
    let (h, here) = (1e-5, extrapolate(&from, &answer, &f));
    for k in 0..9 {
        let moved = |by: f64| {
            let mut f = f;
            f[(k / 3, k % 3)] += by;
            extrapolate(&from, &answer, &f).energy
        };
        assert!(((moved(h) - moved(-h)) / (2.0 * h) - here.pk1[(k / 3, k % 3)]).abs() < 1e-8, "component {k}");
    }
}
