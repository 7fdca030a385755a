//! Committed states: in equilibrium after material changes, and independent of the trial states.

use super::*;
use crate::fem::equilibrium::EquilibriumError;
use crate::fem::mesh::IntegrationPoint;
use crate::las::NewtonError;

/// Elements stretched beyond `limit` permanently lose most of their stiffness, the most stretched ones first.
struct Brittle {
    formula: FormulaField,
    limit: f64,
    /// Number of elements that break per round.
    at_a_time: usize,
    trial: Vec<Matrix3<f64>>,
    broken: Vec<bool>,
    committed: Vec<bool>,
    /// True if broken elements heal and break forever.
    mends: bool,
    /// Elements broken in the current attempt cannot be evaluated beyond this stretch.
    fails_beyond: f64,
}

impl Brittle {
    fn new(mesh: &Mesh, limit: f64, at_a_time: usize) -> Self {
        let elements = mesh.elements().len();
        Self {
            formula: formula(mesh),
            limit,
            at_a_time,
            trial: vec![Matrix3::identity(); elements],
            broken: vec![false; elements],
            committed: vec![false; elements],
            mends: false,
            fails_beyond: f64::INFINITY,
        }
    }
}

impl PointField for Brittle {
    type Error = PointError;

    fn update(&mut self, gradients: &[Matrix3<f64>], out: &mut PointResponses) -> Result<(), PointError> {
        self.trial.copy_from_slice(gradients);
        self.formula.update(gradients, out)?;
        for element in (0..gradients.len()).filter(|&element| self.broken[element]) {
            if !self.committed[element] && gradients[element][(0, 0)] > self.fails_beyond {
                return Err(PointError {
                    point: IntegrationPoint::of_element(element),
                    reason: MaterialError::Inverted(0.0),
                });
            }
            out.energy[element] *= 0.2;
            out.pk1[element] *= 0.2;
            out.tangent[element] *= 0.2;
        }
        Ok(())
    }

    fn evolve(&mut self) -> Result<bool, PointError> {
        if self.mends && self.broken.iter().any(|&broken| broken) {
            self.broken.fill(false);
            return Ok(true);
        }
        let stretch = |element: usize| self.trial[element][(0, 0)];
        let mut over: Vec<usize> =
            (0..self.trial.len()).filter(|&e| !self.broken[e] && stretch(e) > 1.0 + self.limit).collect();
        over.sort_by(|&a, &b| stretch(b).total_cmp(&stretch(a)));
        over.truncate(self.at_a_time);
        over.iter().for_each(|&element| self.broken[element] = true);
        Ok(!over.is_empty())
    }

    fn commit(&mut self, _: bool) -> Result<(), PointError> {
        self.committed.copy_from_slice(&self.broken);
        Ok(())
    }

    fn revert(&mut self) -> Result<(), PointError> {
        self.broken.copy_from_slice(&self.committed);
        Ok(())
    }
}

/// Returns the norm of the residual of all free components relative to that of the internal forces.
fn imbalance<P: PointField>(stepper: &Stepper<Sparse, P>) -> f64 {
    let (state, held) = (stepper.state(), stepper.body.boundary().prescribed_mask(stepper.mesh().nodes().len()));
    let mut squares = [0.0; 2];
    for ((internal, external), held) in state.internal.iter().zip(&state.external).zip(held) {
        for i in 0..3 {
            squares[1] += internal[i] * internal[i];
            if !held[i] {
                squares[0] += (internal[i] - external[i]).powi(2);
            }
        }
    }
    (squares[0] / squares[1]).sqrt()
}

#[test]
fn equilibrium_is_restored_after_material_changes_before_a_step_ends() {
    let mesh = bar(6);
    let params = StepParams { count: 4, ..StepParams::default() };
    let mut stepper = stepper(&mesh, &pushed(0.4), Brittle::new(&mesh, 0.25, 3), params);
    let mut rounds = 0;
    while stepper.completed_steps() < 4 {
        let report = stepper.step(&mut ()).unwrap();
        assert_eq!(report.solves.len(), 1 + report.evolutions, "Newton again after every change");
        rounds += report.evolutions;
        assert!(imbalance(&stepper) < 1e-8, "step {}: {:e}", report.step, imbalance(&stepper));
        let field = stepper.field();
        let responses = &stepper.state().responses;
        let mut again = PointResponses::default();
        formula(&mesh).update(&stepper.state().gradients, &mut again).unwrap();
        for (element, &broken) in field.committed.iter().enumerate() {
            assert_eq!(again.pk1[element] * if broken { 0.2 } else { 1.0 }, responses.pk1[element]);
            assert!(broken || field.trial[element][(0, 0)] <= 1.25, "nothing is left that should break");
        }
    }
    assert!(rounds > 3 && stepper.field().committed.contains(&true), "{rounds} rounds");
}

/// A failed attempt restores the material that it changed.
#[test]
fn a_failed_attempt_changes_no_material() {
    let mesh = bar(6);
    let params = StepParams { count: 2, max_cuts: 0, max_evolutions: 2, ..StepParams::default() };
    let mut stepper = stepper(&mesh, &pushed(0.4), Brittle::new(&mesh, 0.25, 1), params);
    stepper.step(&mut ()).unwrap();
    let before = stepper.field().broken.clone();
    let error = stepper.step(&mut ()).unwrap_err();
    let SteppingError::NotConverged { reason: NewtonError::Problem(reason), reached, .. } = error else {
        panic!("{error}");
    };
    assert_eq!((reason, reached), (EquilibriumError::StillChanging(2), 0.5));
    assert_eq!(stepper.field().broken, before);
    assert!(imbalance(&stepper) < 1e-8);
}

/// Models an RVE created at a strain that it cannot reach in one increment.
#[test]
fn an_error_right_after_a_material_change_cuts_the_step() {
    let mesh = bar(6);
    let field = Brittle { fails_beyond: 1.4, ..Brittle::new(&mesh, 0.25, 100) };
    let mut stepper = stepper(&mesh, &pushed(0.5), field, StepParams { count: 1, ..StepParams::default() });
    let mut log = Log::default();
    let reports = stepper.run(&mut log).unwrap();
    assert!(reports[0].cuts > 0 && reports[0].evolutions > 0, "{:?}", log.failed);
    assert!(stepper.field().committed.contains(&true) && imbalance(&stepper) < 1e-8);
}

#[test]
fn a_material_that_never_settles_is_an_error() {
    let mesh = bar(4);
    let field = Brittle { mends: true, ..Brittle::new(&mesh, 0.05, 100) };
    let params = StepParams { count: 1, max_cuts: 1, max_evolutions: 7, ..StepParams::default() };
    let mut stepper = stepper(&mesh, &pushed(0.4), field, params);
    let error = stepper.run(&mut ()).unwrap_err().to_string();
    assert!(error.contains("after equilibrium was restored 7 times"), "{error}");
}

/// Models two micro-scale equilibria: a trial state beyond `limit` enters the stiffer one, and no trial state leaves
/// it.
struct Bistable {
    formula: FormulaField,
    limit: f64,
    gradients: Vec<Matrix3<f64>>,
    is_stiff: Vec<bool>,
    verifications: usize,
}

impl PointField for Bistable {
    type Error = PointError;

    fn update(&mut self, gradients: &[Matrix3<f64>], out: &mut PointResponses) -> Result<(), PointError> {
        self.gradients.copy_from_slice(gradients);
        for (element, f) in gradients.iter().enumerate() {
            self.is_stiff[element] |= f[(0, 0)] < 1.0 - self.limit;
        }
        self.formula.update(gradients, out)?;
        for element in (0..gradients.len()).filter(|&element| self.is_stiff[element]) {
            out.pk1[element] *= 1.5;
            out.tangent[element] *= 1.5;
        }
        Ok(())
    }

    /// Goes directly from the committed state, which is never stiff, to these gradients.
    fn verify(&mut self, gradients: &[Matrix3<f64>], out: &mut PointResponses) -> Result<bool, PointError> {
        assert_eq!(gradients, self.gradients);
        self.verifications += 1;
        let before = self.is_stiff.clone();
        self.is_stiff.fill(false);
        self.update(gradients, out)?;
        Ok(before != self.is_stiff)
    }

    fn commit(&mut self, _: bool) -> Result<(), PointError> {
        Ok(())
    }

    fn revert(&mut self) -> Result<(), PointError> {
        self.is_stiff.fill(false);
        Ok(())
    }
}

#[test]
fn a_committed_state_does_not_depend_on_trial_states() {
    let mesh = bar(6);
    let run = |start, cuts| {
        let elements = mesh.elements().len();
        let field = Bistable {
            formula: formula(&mesh),
            limit: 0.2,
            gradients: vec![Matrix3::identity(); elements],
            is_stiff: vec![false; elements],
            verifications: 0,
        };
        let mut params = StepParams { count: 2, max_cuts: 0, start, ..StepParams::default() };
        params.newton.tolerance = 1e-11;
        params.newton.max_backtracks = cuts;
        let mut stepper = stepper(&mesh, &pushed(-0.15), field, params);
        let reports = stepper.run(&mut ()).unwrap();
        assert!(imbalance(&stepper) < 1e-10, "{:e}", imbalance(&stepper));
        let replaced: usize = reports.iter().map(|report| report.verification_rounds).sum();
        let force = stepper.forces().surfaces.iter().find(|surface| surface.name == "x1").unwrap().force[0];
        (force, replaced)
    };
    // A start from the prescribed displacements moves the whole increment into the last cell.
    let (held, replaced) = run(StepStart::Prescribed, 10);
    let (straight, none) = run(StepStart::Tangent, 10);
    assert!(replaced > 0 && none == 0, "{replaced} {none}");
    assert!((held - straight).abs() < 1e-8 * straight.abs(), "{held} {straight}");
    let (full_steps, _) = run(StepStart::Prescribed, 0);
    assert!((full_steps - straight).abs() < 1e-8 * straight.abs(), "{full_steps} {straight}");
}

/// Models a faulty material that changes its stress after Newton has converged but reports no change.
struct Deceptive(FormulaField);

impl PointField for Deceptive {
    type Error = PointError;

    fn update(&mut self, gradients: &[Matrix3<f64>], out: &mut PointResponses) -> Result<(), PointError> {
        self.0.update(gradients, out)
    }

    fn verify(&mut self, _: &[Matrix3<f64>], out: &mut PointResponses) -> Result<bool, PointError> {
        out.pk1[0] *= 1.0 + 1e-4;
        Ok(false)
    }

    fn commit(&mut self, _: bool) -> Result<(), PointError> {
        Ok(())
    }

    fn revert(&mut self) -> Result<(), PointError> {
        Ok(())
    }
}

#[test]
fn a_state_out_of_balance_is_not_committed() {
    let mesh = bar(6);
    let params = StepParams { count: 1, max_cuts: 1, ..StepParams::default() };
    let mut stepper = stepper(&mesh, &pushed(0.4), Deceptive(formula(&mesh)), params);
    let SteppingError::NotConverged { reason, reached, .. } = stepper.run(&mut ()).unwrap_err();
    assert!(matches!(reason, NewtonError::Problem(EquilibriumError::OutOfBalance { .. })), "{reason}");
    assert_eq!((stepper.completed_steps(), reached), (0, 0.0));
}
