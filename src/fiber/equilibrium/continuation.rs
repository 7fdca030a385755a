//! Test whether Newton leads from one equilibrium to another.

use super::problem::Interior;
use crate::fiber::rve::{Rve, RveModel};
use crate::fiber::workspace::Workspace;
use crate::las::{MatrixOps, NewtonParams, NewtonSystem, NonlinearProblem, RealBackend, SolveError, Solver, VectorOps};

/// Maximum number of Newton steps before the test gives up.
const STEPS: usize = 3;

/// A step that reduces the distance to an equilibrium to this fraction is taken as proof that the iterate has entered
/// its basin of attraction, where the next Newton steps are shorter still.
const CONTRACTION: f64 = 0.1;

/// Interior positions within this distance, unit-cube units, belong to the same equilibrium.
const SAME: f64 = 1e-10;

/// Returns true if Newton leads from the equilibrium `from`, moved affinely to the boundary of `reached`, to the
/// equilibrium `reached`.
///
/// The test requires full Newton steps that the line search would accept, that start from a positive definite stiffness
/// and that contract toward `reached`. It costs one or two, at most three, factorizations and solves, and no tangent.
/// False is inconclusive: only [`equilibrate`](super::equilibrate) from `from` decides then. Afterward the workspace no
/// longer describes an equilibrium.
pub fn converges_to<B: RealBackend>(
    model: &RveModel<B>,
    from: &Rve,
    reached: &Rve,
    params: &NewtonParams,
    workspace: &mut Workspace<B>,
) -> bool {
    workspace.set_affine_guess(model, from, &reached.gradient);
    workspace.factor_is_exact = false;
    let (problem, system) = Interior::of(model, workspace);
    // A failed factorization and a state without a residual are inconclusive.
    newton_contracts(problem, system, reached, params).unwrap_or(false)
}

fn newton_contracts<B: RealBackend>(
    mut problem: Interior<'_, B>,
    system: &mut NewtonSystem<B>,
    reached: &Rve,
    params: &NewtonParams,
) -> Result<bool, SolveError<B::Error>> {
    let mut distance = problem.distance(reached);
    if distance <= SAME {
        return Ok(true);
    }
    problem.residual(&mut system.residual)?;
    let mut norm = system.residual.norm()?;
    for _ in 0..STEPS {
        system.matrix.assemble(|k| problem.jacobian(k))?;
        system.solver.factor_definite(&system.matrix)?;
        system.solver.solve(&system.residual, &mut system.direction)?;
        problem.advance(-1.0, &system.direction)?;
        let (distance_before, norm_before) = (distance, norm);
        distance = problem.distance(reached);
        problem.residual(&mut system.residual)?;
        norm = system.residual.norm()?;
        let is_taken = norm <= (1.0 - params.sufficient_decrease) * norm_before;
        if !is_taken || distance.is_nan() {
            return Ok(false);
        }
        if distance <= (CONTRACTION * distance_before).max(SAME) {
            return Ok(true);
        }
    }
    Ok(false)
}
