//! Bordered systems against whole ones, and Newton with constraints.

use std::convert::Infallible;
use std::sync::Arc;

use super::*;
use crate::backends::dense::Dense;
use crate::las::{
    MatrixOps, NewtonError, NewtonParams, NewtonSystem, NonlinearProblem, ResidualScale, SolverParams, Sparsity,
    Symmetry,
};

type Vector = <Dense as Backend>::Vector;
type Matrix = <Dense as Backend>::Matrix;

/// The stationary points of `sum_i (x_i^4 / 4 + s x_i^2 / 2) - a . x` under the constraints `x . x / 2 = h_0` and
/// `x_0 x_1 + d p_1 = h_1`.
#[derive(Clone, Debug, PartialEq)]
struct OnSphere {
    x: [f64; 3],
    p: [f64; 2],
    saved: ([f64; 3], [f64; 2]),
    stiffness: f64,
    compliance: f64,
    targets: [f64; 2],
}

const LOADS: [f64; 3] = [1.0, -2.0, 0.5];

fn on_sphere(stiffness: f64, compliance: f64) -> OnSphere {
    let saved = ([0.0; 3], [0.0; 2]);
    OnSphere { x: [1.0, 0.7, -0.4], p: [0.0; 2], saved, stiffness, compliance, targets: [1.0, 0.3] }
}

impl OnSphere {
    fn gradients(&self) -> [[f64; 3]; 2] {
        [self.x, [self.x[1], self.x[0], 0.0]]
    }
}

impl NonlinearProblem<Dense> for OnSphere {
    type Error = Infallible;

    fn residual(&mut self, r: &mut Vector) -> Result<ResidualScale, Infallible> {
        let [first, second] = self.gradients();
        let forces = std::array::from_fn::<f64, 3, _>(|i| {
            let x = self.x[i];
            x.powi(3) + self.stiffness * x - LOADS[i] - self.p[0] * first[i] - self.p[1] * second[i]
        });
        r.set(&[0, 1, 2], &forces)?;
        Ok(ResidualScale { scale: 1.0, floor: 0.0 })
    }

    fn jacobian(&mut self, k: &mut Matrix) -> Result<(), Infallible> {
        let diagonal = self.x.map(|x| 3.0 * x * x + self.stiffness - self.p[0]);
        let [a, b, c] = diagonal;
        k.add(&[0, 1, 2], &[0, 1, 2], &[a, -self.p[1], 0.0, -self.p[1], b, 0.0, 0.0, 0.0, c])
    }

    fn advance(&mut self, a: f64, d: &Vector) -> Result<(), Infallible> {
        let mut step = [0.0; 3];
        d.get(&[0, 1, 2], &mut step)?;
        self.x.iter_mut().zip(step).for_each(|(x, d)| *x += a * d);
        Ok(())
    }

    fn constraints(&self) -> usize {
        2
    }

    fn constraint_residuals(&self, c: &mut [f64]) {
        let [x, y, z] = self.x;
        c[0] = 0.5 * (x * x + y * y + z * z) - self.targets[0];
        c[1] = x * y + self.compliance * self.p[1] - self.targets[1];
    }

    fn border(&mut self, border: &mut Border<Dense>) -> Result<(), Infallible> {
        border.compliances.copy_from_slice(&[0.0, self.compliance]);
        let gradients = self.gradients();
        border.gradients_mut().iter_mut().zip(gradients).try_for_each(|(to, from)| to.set(&[0, 1, 2], &from))
    }

    fn advance_multipliers(&mut self, a: f64, dp: &[f64]) {
        self.p.iter_mut().zip(dp).for_each(|(p, dp)| *p += a * dp);
    }

    fn save(&mut self) {
        self.saved = (self.x, self.p);
    }

    fn restore(&mut self) {
        (self.x, self.p) = self.saved;
    }
}

fn dense(size: usize, constraints: usize) -> NewtonSystem<Dense> {
    let pattern = Arc::new(Sparsity::from_elements(size, [(0..size as i32).collect::<Vec<_>>()]).unwrap());
    let symbolic = Dense::<f64>::analyze(&(), &pattern, &SolverParams::new(Symmetry::None)).unwrap();
    NewtonSystem::bordered(&(), &pattern, &symbolic, constraints).unwrap()
}

#[test]
fn the_bordered_solve_equals_that_of_the_whole_system() {
    let mut problem = OnSphere { p: [0.4, -0.3], ..on_sphere(2.0, 0.25) };
    let (mut system, mut whole) = (dense(3, 2), dense(5, 0));
    problem.residual(&mut system.residual).unwrap();
    problem.constraint_residuals(&mut system.border.residuals);
    problem.border(&mut system.border).unwrap();
    system.matrix.assemble(|k| problem.jacobian(k)).unwrap();
    system.solver.factor(&system.matrix).unwrap();
    system.solve_linear().unwrap();

    let gradients = problem.gradients();
    let fill = |k: &mut Matrix| {
        problem.jacobian(k)?;
        k.add(&[4], &[4], &[problem.compliance])?;
        for (row, gradient) in [3, 4].into_iter().zip(gradients) {
            k.add(&[row], &[0, 1, 2], &gradient)?;
            k.add(&[0, 1, 2], &[row], &gradient.map(|g| -g))?;
        }
        Ok::<(), Infallible>(())
    };
    whole.matrix.assemble(fill).unwrap();
    let mut r = [0.0; 3];
    system.residual.get(&[0, 1, 2], &mut r).unwrap();
    whole.residual.set(&[0, 1, 2], &r).unwrap();
    whole.residual.set(&[3, 4], &system.border.residuals).unwrap();
    whole.solver.factor(&whole.matrix).unwrap();
    whole.solve_linear().unwrap();
    let (mut all, mut dx) = ([0.0; 5], [0.0; 3]);
    whole.direction.get(&[0, 1, 2, 3, 4], &mut all).unwrap();
    system.direction.get(&[0, 1, 2], &mut dx).unwrap();
    for (one, other) in dx.iter().chain(&system.border.increments).zip(all) {
        assert!((one - other).abs() < 1e-13 * (1.0 + other.abs()), "{one} {other}");
    }
}

#[test]
fn newton_satisfies_the_constraints_and_converges_quadratically() {
    // With the negative stiffness, the matrix is indefinite at the solution.
    let near = [1.2, 0.3, 0.6];
    for (x, stiffness, compliance) in [(near, 2.0, 0.0), (near, 2.0, 0.25), (near, -1.0, 0.0)] {
        let mut problem = OnSphere { x, ..on_sphere(stiffness, compliance) };
        let params = NewtonParams { tolerance: 1e-12, ..NewtonParams::default() };
        let report = dense(3, 2).solve(&mut problem, &params).unwrap();
        let mut c = [0.0; 2];
        problem.constraint_residuals(&mut c);
        assert!(c.iter().all(|c| c.abs() < 1e-12), "{c:?}");
        let r = &report.residuals;
        let [before, last] = [r[r.len() - 2], r[r.len() - 1]];
        assert!(report.iterations < 12 && last < 20.0 * before * before + 1e-15, "{r:?}");
        assert_eq!(report.lu, report.iterations, "one factorization per iteration");
    }
}

#[test]
fn chord_steps_satisfy_the_constraints() {
    let solve = |chord_steps| {
        let mut problem = OnSphere { x: [1.2, 0.3, 0.6], ..on_sphere(2.0, 0.25) };
        let params = NewtonParams { tolerance: 1e-12, chord_steps, ..NewtonParams::default() };
        let report = dense(3, 2).solve(&mut problem, &params).unwrap();
        (problem, report)
    };
    let ((newton, of_newton), (chord, of_chord)) = (solve(0), solve(2));
    assert!(of_chord.kept > 0 && of_chord.iterations < of_newton.iterations, "{of_chord:?}");
    for (one, other) in newton.x.iter().chain(&newton.p).zip(chord.x.iter().chain(&chord.p)) {
        assert!((one - other).abs() < 1e-10, "{one} {other}");
    }
}

#[test]
fn the_line_search_judges_the_constraints_too() {
    // Far from its target, the constraint dominates the norm; the full steps alternate or diverge.
    let mut problem = OnSphere { x: [1e-3, 2e-3, -1e-3], targets: [50.0, 3.0], ..on_sphere(2.0, 0.0) };
    let mut system = dense(3, 2);
    let report = system.solve(&mut problem, &NewtonParams::default()).unwrap();
    assert!(report.backtracks > 0, "{report:?}");
    let mut r = <Dense as Backend>::vector(&(), 3).unwrap();
    problem.residual(&mut r).unwrap();
    let mut c = [0.0; 2];
    problem.constraint_residuals(&mut c);
    let combined = (r.norm().unwrap().powi(2) + c[0] * c[0] + c[1] * c[1]).sqrt();
    assert!((combined - report.residuals[report.iterations]).abs() < 1e-13);
}

#[test]
fn constraints_without_influence_are_singular_and_a_failure_restores_the_multipliers() {
    // At the origin no unknown changes either constraint; on the plane x = y = 0, none changes the second one.
    for (x, constraint) in [([0.0; 3], 1), ([0.0, 0.0, 1.0], 1)] {
        let mut problem = OnSphere { x, p: [0.1, 0.2], ..on_sphere(2.0, 0.0) };
        let before = problem.clone();
        let failure = dense(3, 2).solve(&mut problem, &NewtonParams::default()).unwrap_err();
        let NewtonError::Solve(SolveError::SingularBorder { constraint: singular, .. }) = failure.reason else {
            panic!("{failure}")
        };
        assert_eq!((singular, problem.x, problem.p), (constraint, before.x, before.p));
    }
    // Two constraints with parallel gradients: x = (1, 1, 0).
    let mut problem = OnSphere { x: [1.0, 1.0, 0.0], ..on_sphere(2.0, 0.0) };
    let failure = dense(3, 2).solve(&mut problem, &NewtonParams::default()).unwrap_err();
    assert!(matches!(failure.reason, NewtonError::Solve(SolveError::SingularBorder { .. })), "{failure}");
    // A compliance makes the second one regular.
    let mut problem = OnSphere { x: [1.0, 1.0, 0.0], ..on_sphere(2.0, 0.5) };
    let once = NewtonParams { max_iterations: 1, ..NewtonParams::default() };
    let failure = dense(3, 2).solve(&mut problem, &once).unwrap_err();
    assert!(matches!(failure.reason, NewtonError::TooManyIterations { iterations: 1, .. }), "{failure}");
}
