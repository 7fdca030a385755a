//! Whether an equilibrium continues another one.

use super::problem::Interior;
use crate::fiber::rve::{Rve, RveModel};
use crate::fiber::workspace::Workspace;
use crate::las::{
    Backend, MatrixOps, NewtonParams, NewtonSystem, NonlinearProblem, Scalar, SolveError, Solver, VectorOps,
};

/// Newton steps that may be taken before the question is left open.
const STEPS: usize = 3;

/// A step that takes the distance to an equilibrium to this part of what it was has arrived in its basin of attraction,
/// where Newton's next steps are shorter still.
const CONTRACTION: f64 = 0.1;

/// Positions this close to each other, unit-cube units, are of one equilibrium.
const SAME: f64 = 1e-10;

/// Whether Newton evidently leads from the equilibrium `from`, moved affinely to the boundary of `reached`, to the
/// equilibrium `reached`.
///
/// It does if its undamped steps, which the line search would take and at which the stiffness is positive definite,
/// contract toward `reached`. This costs a factorization and a solution or two, and no tangent. False says nothing:
/// only [`equilibrate`](super::equilibrate) from there tells then. The workspace no longer describes an equilibrium
/// afterward.
pub fn continues<B: Backend<Scalar = f64>>(
    model: &RveModel<B>,
    from: &Rve,
    reached: &Rve,
    params: &NewtonParams,
    workspace: &mut Workspace<B>,
) -> bool
where
    B::Reduced: Scalar,
{
    workspace.place_affinely(model, from, &reached.gradient);
    workspace.factor_is_exact = false;
    let (problem, system) = Interior::of(model, workspace);
    // A matrix that cannot be factored here, or a state without a residual, leaves the question open.
    contracts(problem, system, reached, params).unwrap_or(false)
}

fn contracts<B: Backend<Scalar = f64>>(
    mut problem: Interior<'_, B>,
    system: &mut NewtonSystem<B>,
    reached: &Rve,
    params: &NewtonParams,
) -> Result<bool, SolveError<B::Fault>>
where
    B::Reduced: Scalar,
{
    let mut distance = problem.distance(reached);
    if distance <= SAME {
        return Ok(true);
    }
    problem.residual(&mut system.residual).map_err(SolveError::Fault)?;
    let mut norm = system.residual.norm().map_err(SolveError::Fault)?.as_f64();
    for _ in 0..STEPS {
        system.matrix.zero().map_err(SolveError::Fault)?;
        problem.jacobian(&mut system.matrix).map_err(SolveError::Fault)?;
        system.matrix.finish().map_err(SolveError::Fault)?;
        system.solver.factor_definite(&system.matrix)?;
        system.solver.solve(&system.residual, &mut system.direction)?;
        problem.advance(-1.0, &system.direction).map_err(SolveError::Fault)?;
        let (distance_before, norm_before) = (distance, norm);
        distance = problem.distance(reached);
        problem.residual(&mut system.residual).map_err(SolveError::Fault)?;
        norm = system.residual.norm().map_err(SolveError::Fault)?.as_f64();
        let is_taken = norm <= (1.0 - params.decrease) * norm_before;
        if !is_taken || distance.is_nan() {
            return Ok(false);
        }
        if distance <= (CONTRACTION * distance_before).max(SAME) {
            return Ok(true);
        }
    }
    Ok(false)
}
