use std::convert::Infallible;
use std::sync::Arc;

use super::*;
use crate::backends::dense::Dense;
use crate::las::{Backend, SolverParams, Sparsity, Symmetry};

/// The equation `r(x) = 0`, with the derivative `dr` and the potential `w`.
pub(super) struct OneUnknown {
    pub x: f64,
    saved: f64,
    r: fn(f64) -> f64,
    dr: fn(f64) -> f64,
    w: fn(f64) -> f64,
    pub state_scale: Option<f64>,
}

impl NonlinearProblem<Dense> for OneUnknown {
    type Error = Infallible;

    fn residual(&mut self, r: &mut <Dense as Backend>::Vector) -> Result<ResidualScale, Infallible> {
        r.set(&[0], &[(self.r)(self.x)])?;
        Ok(ResidualScale { scale: 1.0, floor: 0.0 })
    }

    fn jacobian(&mut self, k: &mut <Dense as Backend>::Matrix) -> Result<(), Infallible> {
        k.add(&[0], &[0], &[(self.dr)(self.x)])
    }

    fn advance(&mut self, a: f64, d: &<Dense as Backend>::Vector) -> Result<(), Infallible> {
        let mut value = [0.0];
        d.get(&[0], &mut value)?;
        self.x += a * value[0];
        Ok(())
    }

    fn state_scale(&self) -> Option<f64> {
        self.state_scale
    }

    fn save(&mut self) {
        self.saved = self.x;
    }

    fn restore(&mut self) {
        self.x = self.saved;
    }
}

impl Potential<Dense> for OneUnknown {
    fn potential(&mut self) -> f64 {
        (self.w)(self.x)
    }
}

pub(super) fn equation(x: f64, r: fn(f64) -> f64, dr: fn(f64) -> f64) -> OneUnknown {
    OneUnknown { x, saved: 0.0, r, dr, w: |_| f64::NAN, state_scale: None }
}

pub(super) fn arctangent(x: f64) -> OneUnknown {
    equation(x, f64::atan, |x| 1.0 / (1.0 + x * x))
}

/// `w = (x^2 - 1)^2`, a potential with two wells and a hill between them.
fn wells(x: f64) -> OneUnknown {
    OneUnknown { w: |x| (x * x - 1.0).powi(2), ..equation(x, |x| 4.0 * x * (x * x - 1.0), |x| 12.0 * x * x - 4.0) }
}

pub(super) fn system() -> NewtonSystem<Dense> {
    let pattern = Arc::new(Sparsity::from_elements(1, [[0]]).unwrap());
    let symbolic = Dense::<f64>::analyze(&(), &pattern, &SolverParams::new(Symmetry::Definite)).unwrap();
    NewtonSystem::new(&(), &pattern, &symbolic).unwrap()
}

#[test]
fn full_newton_diverges_where_the_line_search_converges() {
    // |x| > 1.3917 makes Newton on the arctangent diverge.
    let full = NewtonParams { max_backtracks: 0, max_iterations: 20, ..NewtonParams::default() };
    let mut problem = arctangent(3.0);
    let failure = system().solve(&mut problem, &full).unwrap_err();
    assert_eq!(problem.x, 3.0, "the state is restored");
    assert!(!failure.report.residuals.is_empty());

    let report = system().solve(&mut problem, &NewtonParams::default()).unwrap();
    assert!(report.backtracks > 0);
    assert!(problem.x.abs() < 1e-9);
    assert_eq!(report.residuals.len(), report.iterations + 1);
    assert_eq!(report.cholesky, report.iterations);
}

#[test]
fn a_step_is_shortened_until_the_residual_decreases_sufficiently() {
    // The first full step on the arctangent from 1 leaves 0.66 of the residual.
    let backtracks = |sufficient_decrease| {
        let params = NewtonParams { sufficient_decrease, ..NewtonParams::default() };
        system().solve(&mut arctangent(1.0), &params).unwrap().backtracks
    };
    assert_eq!([backtracks(1e-4), backtracks(0.3)], [0, 0]);
    assert!(backtracks(0.4) > 0);
}

#[test]
fn the_residual_may_rise_below_its_maximum_over_the_last_iterates() {
    // The full steps 2 -> 1 -> -3 -> 0 have the residuals 8, 1, 3 and 0.
    let problem = || {
        equation(
            2.0,
            |x| if x > 1.5 { 8.0 } else { x },
            |x| {
                if x > 1.5 {
                    8.0
                } else if x > 0.0 {
                    0.25
                } else {
                    1.0
                }
            },
        )
    };
    let backtracks = |nonmonotone_memory| {
        let params = NewtonParams { nonmonotone_memory, ..NewtonParams::default() };
        system().solve(&mut problem(), &params).unwrap().backtracks
    };
    assert_eq!(backtracks(2), 0);
    assert!(backtracks(1) > 0);
}

#[test]
fn converges_quadratically_near_the_root() {
    let mut problem = equation(1.5, |x| x * x - 2.0, |x| 2.0 * x);
    let report = system().solve(&mut problem, &NewtonParams::default()).unwrap();
    assert!((problem.x - 2.0_f64.sqrt()).abs() < 1e-10);
    assert!(report.iterations <= 4);
    let r = &report.residuals;
    assert!(r[2] < 2.0 * r[1] * r[1]);
}

#[test]
fn the_first_iteration_reuses_the_factorization_that_the_system_holds() {
    let parabola = || equation(1.6, |x| x * x - 2.0, |x| 2.0 * x);
    let params = NewtonParams { reuse_factorization: true, ..NewtonParams::default() };
    let mut system = system();
    let first = system.solve(&mut equation(1.0, |x| 4.0 * x, |_| 4.0), &params).unwrap();
    assert_eq!((first.iterations, first.kept, first.cholesky), (1, 0, 1), "there is no factorization yet");

    // With the slope 4 that the system holds, the step from 1.6 ends at 1.46; with the slope 3.2 there, at 1.425.
    let mut problem = parabola();
    let chord = system.solve(&mut problem, &params).unwrap();
    assert_eq!((chord.kept, chord.cholesky), (1, chord.iterations - 1));
    assert!((chord.residuals[1] - (1.46 * 1.46 - 2.0)).abs() < 1e-12, "{:?}", chord.residuals);
    assert!((problem.x - 2.0_f64.sqrt()).abs() < 1e-10);

    system.start_anew();
    let mut problem = parabola();
    let anew = system.solve(&mut problem, &params).unwrap();
    assert_eq!((anew.kept, anew.cholesky), (0, anew.iterations));
    assert!((anew.residuals[1] - (1.425 * 1.425 - 2.0)).abs() < 1e-12, "{:?}", anew.residuals);
    assert!((problem.x - 2.0_f64.sqrt()).abs() < 1e-10);
}

#[test]
fn criteria_of_the_step_and_of_its_work_add_iterations() {
    let iterations = |step_tolerance, energy_tolerance, state_scale| {
        let params = NewtonParams { tolerance: 0.5, step_tolerance, energy_tolerance, ..NewtonParams::default() };
        let mut problem = OneUnknown { state_scale, ..arctangent(0.4) };
        (system().solve(&mut problem, &params).unwrap().iterations, problem.x.abs())
    };
    assert_eq!(iterations(None, None, Some(1.0)), (0, 0.4), "the residual alone is small from the start");
    assert_eq!(iterations(Some(1e-6), None, None), (0, 0.4), "nothing to compare the steps with");
    // The iterates are 0.4, -0.0414, 4.7e-5, -7e-14; the steps 0.44, 0.041, 4.7e-5.
    let steps = [0.5, 0.1, 1e-4].map(|tolerance| iterations(Some(tolerance), None, Some(1.0)).0);
    assert_eq!(steps, [1, 2, 3]);
    assert_eq!(iterations(Some(0.1), None, Some(1e-3)).0, 3, "relative to the scale of the state");
    // The work of the steps is 0.17, 1.7e-3 and 2.2e-9.
    let works = [0.2, 1e-2, 1e-8].map(|tolerance| iterations(None, Some(tolerance), Some(1.0)).0);
    assert_eq!(works, [1, 2, 3]);

    let mut params = NewtonParams { step_tolerance: Some(1e-6), max_iterations: 2, ..NewtonParams::default() };
    params.tolerance = 0.5;
    let mut problem = OneUnknown { state_scale: Some(1.0), ..arctangent(0.4) };
    let failure = system().solve(&mut problem, &params).unwrap_err();
    assert!(matches!(failure.reason, NewtonError::StillMoving { iterations: 2, .. }), "{failure}");
    assert_eq!(problem.x, 0.4);
}

#[test]
fn the_iteration_limit_reports_the_residual() {
    let params = NewtonParams { max_iterations: 1, ..NewtonParams::default() };
    let mut problem = equation(1.5, |x| x * x - 2.0, |x| 2.0 * x);
    let failure = system().solve(&mut problem, &params).unwrap_err();
    match failure.reason {
        NewtonError::TooManyIterations { iterations: 1, residual, limit } => {
            assert!(residual > limit);
        }
        other => panic!("{other}"),
    }
    assert_eq!(problem.x, 1.5);
}

#[test]
fn minimization_descends_where_newton_ascends() {
    let mut climbing = wells(0.1);
    system().solve(&mut climbing, &NewtonParams::default()).unwrap();
    assert!(climbing.x.abs() < 1e-9, "plain Newton goes to the nearest stationary point, a hilltop");

    for start in [0.1, -0.3, 0.57735, 40.0] {
        let mut falling = wells(start);
        let report = system().minimize(&mut falling, 1e-12, &RegularizedParams::default()).unwrap();
        assert!((falling.x.abs() - 1.0).abs() < 1e-12, "from {start} to {}", falling.x);
        assert!(report.iterations < 40, "{report:?}");
        // Without a shift near the minimum, the convergence is quadratic.
        let r = &report.residuals;
        let [before, last] = [r[r.len() - 2], r[r.len() - 1]];
        assert!(last < 1e2 * before * before + 1e-15, "{r:?}");
    }
    assert!(system().minimize(&mut wells(0.1), 1e-12, &RegularizedParams::default()).unwrap().shifts > 0);
}

#[test]
fn a_minimization_that_fails_restores_the_state() {
    let params = RegularizedParams { max_iterations: 1, ..RegularizedParams::default() };
    let mut problem = wells(0.1);
    let failure = system().minimize(&mut problem, 1e-12, &params).unwrap_err();
    assert!(matches!(failure.reason, NewtonError::TooManyIterations { iterations: 1, .. }), "{failure}");
    assert_eq!(problem.x, 0.1);
}

/// The double-well problem with its residual computed by another process, which ends after a given number of
/// evaluations.
struct Remote {
    wells: OneUnknown,
    evaluations: usize,
    last: usize,
}

/// The reason why the residual is unavailable.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
enum Lost {
    #[error("too far out")]
    TooFar,
    #[error("the process that computes it has ended")]
    Gone,
}

impl NonlinearProblem<Dense> for Remote {
    type Error = Lost;

    fn residual(&mut self, r: &mut <Dense as Backend>::Vector) -> Result<ResidualScale, Lost> {
        self.evaluations += 1;
        if self.evaluations > self.last {
            return Err(Lost::Gone);
        }
        if self.wells.x.abs() > 2.0 {
            return Err(Lost::TooFar);
        }
        self.wells.residual(r).map_err(|never| match never {})
    }

    fn jacobian(&mut self, k: &mut <Dense as Backend>::Matrix) -> Result<(), Lost> {
        self.wells.jacobian(k).map_err(|never| match never {})
    }

    fn advance(&mut self, a: f64, d: &<Dense as Backend>::Vector) -> Result<(), Lost> {
        self.wells.advance(a, d).map_err(|never| match never {})
    }

    fn is_final(error: &Lost) -> bool {
        *error == Lost::Gone
    }

    fn save(&mut self) {
        self.wells.save();
    }

    fn restore(&mut self) {
        self.wells.restore();
    }
}

impl Potential<Dense> for Remote {
    fn potential(&mut self) -> f64 {
        self.wells.potential()
    }
}

#[test]
fn a_minimization_shortens_a_step_that_fails_and_ends_if_no_step_can_succeed() {
    // The first full step from just outside the inflection point goes beyond 2.
    let remote = |last| Remote { wells: wells(0.6), evaluations: 0, last };
    let mut near = remote(usize::MAX);
    let report = system().minimize(&mut near, 1e-12, &RegularizedParams::default()).unwrap();
    assert!(report.backtracks > 0 && (near.wells.x - 1.0).abs() < 1e-12, "{report:?}");

    // The process has ended before one of the trial steps: another evaluation cannot succeed.
    for last in 1..4 {
        let mut gone = remote(last);
        let failure = system().minimize(&mut gone, 1e-12, &RegularizedParams::default()).unwrap_err();
        assert_eq!(failure.reason, NewtonError::Problem(Lost::Gone), "after {last} evaluations");
        assert_eq!((gone.evaluations, gone.wells.x), (last + 1, 0.6), "asked once more, and no more");
    }
}

#[test]
fn the_curvature_distinguishes_minima_maxima_and_neutral_points() {
    let at = |x: f64| system().curvature(&mut wells(x), 1e-12).unwrap();
    assert_eq!(at(1.0), Curvature::Definite);
    assert_eq!(at(0.0), Curvature::Indefinite { negative_pivots: Some(1) });
    let plain = |slope: fn(f64) -> f64| {
        let mut plain = equation(0.0, |_| 0.0, slope);
        system().curvature(&mut plain, 1e-12).unwrap()
    };
    // With one unknown, the pivot ratio is 1 for every nonzero Hessian, so that only an exact zero is neutral.
    assert_eq!(plain(|_| 0.0), Curvature::Neutral);
}

#[test]
fn a_maximum_is_left_to_the_same_side_every_time() {
    let mut sides = Vec::new();
    for _ in 0..2 {
        let mut hilltop = wells(0.0);
        let (mut system, mut report) = (system(), NewtonReport::default());
        assert_eq!(system.escape_saddle(&mut hilltop, 1e-12, &mut report).unwrap(), SaddleExit::Descended);
        assert!(hilltop.potential() < 1.0 && hilltop.x.abs() < 1.5, "{}", hilltop.x);
        system.minimize(&mut hilltop, 1e-12, &RegularizedParams::default()).unwrap();
        assert!((hilltop.x.abs() - 1.0).abs() < 1e-12, "{}", hilltop.x);
        sides.push(hilltop.x);
    }
    assert_eq!(sides[0], sides[1]);
    // At a minimum there is no descent direction, and the state does not change.
    let mut minimum = wells(1.0);
    let left = system().escape_saddle(&mut minimum, 1e-12, &mut NewtonReport::default()).unwrap();
    assert_eq!((left, minimum.x), (SaddleExit::Stationary, 1.0));
}

/// `w = x^2 / 2 + (y^2 - 1)^2 + s z^2 / 2`, rotated so that no axis is a principal one: a saddle point at the origin.
#[derive(Default)]
struct Saddle {
    x: [f64; 3],
    saved: [f64; 3],
    /// `s`.
    stiffness: f64,
}

const AXES: [[f64; 3]; 3] =
    [[2.0 / 3.0, 2.0 / 3.0, 1.0 / 3.0], [-2.0 / 3.0, 1.0 / 3.0, 2.0 / 3.0], [1.0 / 3.0, -2.0 / 3.0, 2.0 / 3.0]];

impl Saddle {
    fn along(&self, axis: usize) -> f64 {
        (0..3).map(|i| AXES[axis][i] * self.x[i]).sum()
    }
}

impl NonlinearProblem<Dense> for Saddle {
    type Error = Infallible;

    fn residual(&mut self, r: &mut <Dense as Backend>::Vector) -> Result<ResidualScale, Infallible> {
        let [x, y, z] = [0, 1, 2].map(|axis| self.along(axis));
        let slopes = [x, 4.0 * y * (y * y - 1.0), self.stiffness * z];
        let values = [0, 1, 2].map(|i| (0..3).map(|axis| slopes[axis] * AXES[axis][i]).sum());
        r.set(&[0, 1, 2], &values)?;
        Ok(ResidualScale { scale: 1.0, floor: 0.0 })
    }

    fn jacobian(&mut self, k: &mut <Dense as Backend>::Matrix) -> Result<(), Infallible> {
        let y = self.along(1);
        let slopes = [1.0, 12.0 * y * y - 4.0, self.stiffness];
        let mut block = [0.0; 9];
        for (at, value) in block.iter_mut().enumerate() {
            *value = (0..3).map(|axis| slopes[axis] * AXES[axis][at / 3] * AXES[axis][at % 3]).sum();
        }
        k.add(&[0, 1, 2], &[0, 1, 2], &block)
    }

    fn advance(&mut self, a: f64, d: &<Dense as Backend>::Vector) -> Result<(), Infallible> {
        let mut step = [0.0; 3];
        d.get(&[0, 1, 2], &mut step)?;
        self.x.iter_mut().zip(step).for_each(|(x, d)| *x += a * d);
        Ok(())
    }

    fn save(&mut self) {
        self.saved = self.x;
    }

    fn restore(&mut self) {
        self.x = self.saved;
    }
}

impl Potential<Dense> for Saddle {
    fn potential(&mut self) -> f64 {
        let [x, y, z] = [0, 1, 2].map(|axis| self.along(axis));
        0.5 * x * x + (y * y - 1.0).powi(2) + 0.5 * self.stiffness * z * z
    }
}

#[test]
fn a_saddle_point_is_left_along_its_negative_curvature() {
    let system = || {
        let pattern = Arc::new(Sparsity::from_elements(3, [[0, 1, 2]]).unwrap());
        let symbolic = Dense::<f64>::analyze(&(), &pattern, &SolverParams::new(Symmetry::Definite)).unwrap();
        NewtonSystem::new(&(), &pattern, &symbolic).unwrap()
    };
    // The stiffness `s` is zero up to rounding (of either sign), large, or negative, which adds a second negative
    // pivot.
    for (stiffness, negative) in [(1e-14, 1), (-1e-14, 1), (1e6, 1), (-0.5, 2)] {
        let mut saddle = Saddle { stiffness, ..Saddle::default() };
        let mut system = system();
        let curvature = system.curvature(&mut saddle, 1e-12).unwrap();
        assert_eq!(curvature, Curvature::Indefinite { negative_pivots: Some(negative) }, "{stiffness}");
        if stiffness < -0.1 {
            continue; // There is no minimum to go to.
        }
        let left = system.escape_saddle(&mut saddle, 1e-12, &mut NewtonReport::default()).unwrap();
        assert_eq!(left, SaddleExit::Descended, "{stiffness}");
        system.minimize(&mut saddle, 1e-12, &RegularizedParams::default()).unwrap();
        assert!((saddle.along(1).abs() - 1.0).abs() < 1e-10, "{stiffness}: {:?}", saddle.x);
        let expected = if stiffness == 1e6 { Curvature::Definite } else { Curvature::Neutral };
        assert_eq!(system.curvature(&mut saddle, 1e-12).unwrap(), expected, "{stiffness}");
    }
}
