//! Equilibrium of an RVE whose boundary is held at `x = F X`.
//!
//! The ladder: the full increment from the last equilibrium by Newton with line search; where that fails, the increment
//! is cut in half, and again, up to a limit. A failure leaves the RVE as it was.

use nalgebra::Matrix3;
use thiserror::Error;

use super::path::between;
use super::rve::{Rve, RveModel};
use super::workspace::Workspace;
use crate::las::{
    Backend, NewtonError, NewtonFailure, NewtonParams, NewtonReport, NonlinearProblem, Scalar, SolveError, VectorOps,
    Yardstick,
};

/// What an equilibrium may cost.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct EquilibriumParams {
    /// Newton of one increment; the tolerance is relative to the forces of all nodes.
    pub newton: NewtonParams,
    /// How often an increment may be halved. Default 6.
    pub max_cuts: u32,
}

impl Default for EquilibriumParams {
    fn default() -> Self {
        Self { newton: NewtonParams::default(), max_cuts: 6 }
    }
}

/// What an equilibrium took.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct EquilibriumReport {
    /// Newton iterations in all, those of failed attempts included.
    pub iterations: usize,
    /// The last increment's Newton: its residual history ends at equilibrium.
    pub newton: NewtonReport,
    /// Halvings of the increment.
    pub cuts: u32,
    /// Shortened steps in all.
    pub line_search_cuts: usize,
    /// Factorisations in all of a stiffness that was not positive definite.
    pub indefinite: usize,
}

impl EquilibriumReport {
    fn add(&mut self, newton: &NewtonReport) {
        self.iterations += newton.iterations;
        self.line_search_cuts += newton.line_search_cuts;
        self.indefinite += newton.indefinite;
    }
}

/// Why an RVE has no answer.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum RveError<F: std::error::Error + 'static> {
    /// The deformation asked for turns the material inside out.
    #[error("the deformation gradient has determinant {determinant:.3e}; it must be positive")]
    Inverted {
        /// `det F`.
        determinant: f64,
    },
    /// The ladder is exhausted.
    #[error("no equilibrium after {cuts} halvings of the increment (at {progress:.4} of it): {reason}")]
    NotConverged {
        /// Halvings made.
        cuts: u32,
        /// The part of the increment that was reached.
        progress: f64,
        /// What stopped the last attempt.
        reason: NewtonError<F, F>,
        /// What was done until then.
        report: Box<EquilibriumReport>,
    },
    /// The tangent could not be condensed.
    #[error("the condensed tangent could not be computed: {0}")]
    Tangent(SolveError<F>),
}

/// Brings `rve` into equilibrium with its boundary at `x = F X`.
///
/// Afterwards the workspace describes that state, for the averages of [`super::homogenise`].
///
/// # Errors
/// [`RveError`]; `rve` is then unchanged.
pub fn equilibrate<B: Backend<Scalar = f64>>(
    model: &RveModel<B>,
    rve: &mut Rve,
    target: &Matrix3<f64>,
    params: &EquilibriumParams,
    workspace: &mut Workspace<B>,
) -> Result<EquilibriumReport, RveError<B::Fault>>
where
    B::Reduced: Scalar,
{
    let determinant = target.determinant();
    if determinant.is_nan() || determinant <= 0.0 {
        return Err(RveError::Inverted { determinant });
    }
    let mut report = EquilibriumReport::default();
    match increment(model, rve, target, params, workspace) {
        Ok(newton) => {
            report.add(&newton);
            report.newton = newton;
            Ok(report)
        }
        Err(failure) => {
            report.add(&failure.report);
            let start = rve.clone();
            let outcome = in_parts(model, rve, target, params, workspace, report, failure);
            if outcome.is_err() {
                *rve = start;
            }
            outcome
        }
    }
}

/// The same by ever smaller increments, after the full one failed.
fn in_parts<B: Backend<Scalar = f64>>(
    model: &RveModel<B>,
    rve: &mut Rve,
    target: &Matrix3<f64>,
    params: &EquilibriumParams,
    workspace: &mut Workspace<B>,
    mut report: EquilibriumReport,
    mut failure: NewtonFailure<B::Fault, B::Fault>,
) -> Result<EquilibriumReport, RveError<B::Fault>>
where
    B::Reduced: Scalar,
{
    let start = rve.gradient;
    let (mut reached, mut part) = (0.0, 1.0);
    while reached < 1.0 {
        if report.cuts == params.max_cuts {
            let NewtonFailure { reason, .. } = failure;
            return Err(RveError::NotConverged {
                cuts: report.cuts,
                progress: reached,
                reason,
                report: Box::new(report),
            });
        }
        report.cuts += 1;
        part *= 0.5;
        // Parts are powers of two: the sum of them reaches 1 exactly.
        while reached < 1.0 {
            let goal = reached + part;
            let gradient = if goal >= 1.0 { *target } else { between(&start, target, goal) };
            match increment(model, rve, &gradient, params, workspace) {
                Ok(newton) => {
                    report.add(&newton);
                    report.newton = newton;
                    reached = goal;
                }
                Err(error) => {
                    report.add(&error.report);
                    failure = error;
                    break;
                }
            }
        }
    }
    Ok(report)
}

/// One increment by Newton; `rve` follows only if it converges.
fn increment<B: Backend<Scalar = f64>>(
    model: &RveModel<B>,
    rve: &mut Rve,
    target: &Matrix3<f64>,
    params: &EquilibriumParams,
    workspace: &mut Workspace<B>,
) -> Result<NewtonReport, NewtonFailure<B::Fault, B::Fault>>
where
    B::Reduced: Scalar,
{
    workspace.place(model, rve, target);
    workspace.factor_is_near = false;
    let Workspace { system, positions, saved, forces, states, diagonal, .. } = workspace;
    let mut problem = Interior { model, positions, saved, forces, states, diagonal };
    let report = system.solve(&mut problem, &params.newton)?;
    workspace.factor_is_near = report.iterations > 0;
    rve.gradient = *target;
    for (x, &node) in rve.interior.iter_mut().zip(model.network().interior()) {
        *x = workspace.positions[node as usize];
    }
    Ok(report)
}

/// The interior nodes of an RVE as a nonlinear problem.
struct Interior<'a, B: Backend> {
    model: &'a RveModel<B>,
    positions: &'a mut Vec<[f64; 3]>,
    saved: &'a mut Vec<[f64; 3]>,
    forces: &'a mut Vec<[f64; 3]>,
    states: &'a mut super::truss::FiberStates,
    diagonal: &'a mut Vec<[f64; 9]>,
}

impl<B: Backend<Scalar = f64>> NonlinearProblem<B> for Interior<'_, B> {
    type Error = B::Fault;

    fn residual(&mut self, r: &mut B::Vector) -> Result<Yardstick, B::Fault> {
        let truss = self.model.truss();
        truss.evaluate(self.positions, self.states);
        truss.nodal_forces(self.states, self.forces);
        let forces = &*self.forces;
        let interior = self.model.network().interior();
        r.with_local_mut(|r| {
            for (r, &node) in r.chunks_exact_mut(3).zip(interior) {
                r.copy_from_slice(&forces[node as usize]);
            }
        })?;
        r.finish()?;
        let squares: f64 = forces.iter().flatten().map(|f| f * f).sum();
        Ok(Yardstick { scale: squares.sqrt(), floor: self.model.rounding_floor() })
    }

    fn jacobian(&mut self, k: &mut B::Matrix) -> Result<(), B::Fault> {
        self.model.slots.assemble(self.model.truss(), self.states, self.diagonal, k)
    }

    fn advance(&mut self, a: f64, d: &B::Vector) -> Result<(), B::Fault> {
        let interior = self.model.network().interior();
        let positions = &mut *self.positions;
        d.with_local(|d| {
            for (d, &node) in d.chunks_exact(3).zip(interior) {
                let x = &mut positions[node as usize];
                (0..3).for_each(|i| x[i] += a * d[i]);
            }
        })
    }

    fn save(&mut self) {
        self.saved.clear();
        self.saved.extend(self.model.network().interior().iter().map(|&node| self.positions[node as usize]));
    }

    fn restore(&mut self) {
        for (&node, x) in self.model.network().interior().iter().zip(self.saved.iter()) {
            self.positions[node as usize] = *x;
        }
    }
}
