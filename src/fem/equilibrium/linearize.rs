//! The start of a step from the linearization of the committed state.

use std::time::Instant;

use super::{BodyState, Equilibrium, net_forces, scatter};
use crate::fem::point_field::PointField;
use crate::las::{MatrixOps, NewtonSeconds, NewtonSystem, RealBackend, SolveError, SolveReport, VectorOps};

/// The cost of a linearized start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinearizedStart {
    /// Computation time by phase.
    pub seconds: NewtonSeconds,
    /// The solution of its linear system.
    pub solve: SolveReport,
}

impl Default for LinearizedStart {
    fn default() -> Self {
        Self { seconds: NewtonSeconds::default(), solve: SolveReport::DIRECT }
    }
}

impl<B: RealBackend, P: PointField> Equilibrium<B, P> {
    /// Starts a step to pseudo-time `t` from the linearization of the committed state: solves
    /// `K du = f_ext(t) - f_int - K_fc dg` with the tangent stiffness `K` of the committed state and the increments
    /// `dg` of the prescribed displacements. From the undeformed body this is the linear-elastic solution. `f_ext` is
    /// evaluated with `dg` applied, so `K_fc` is the stiffness of the elements alone. Constraints border this system.
    ///
    /// # Errors
    /// Returns the [`SolveError`] of the solver; the trial state is then as [`Equilibrium::begin_step`] leaves it.
    pub fn linearize(&mut self, t: f64, system: &mut NewtonSystem<B>) -> Result<LinearizedStart, SolveError<B::Error>> {
        self.begin_step(t);
        if self.ranks.unknowns(system.residual.len()) == 0 {
            return Ok(LinearizedStart::default());
        }
        let start = Instant::now();
        let moved = self.trial.displacements.iter().zip(&self.committed.displacements);
        let increments: Vec<[f64; 3]> = moved.map(|(new, old)| std::array::from_fn(|i| new[i] - old[i])).collect();
        let BodyState { displacements, responses, .. } = &self.committed;
        self.assembler.linearized_forces(displacements, responses, &increments, &mut self.nodal);
        self.linearize_constraint_forces(&increments);
        for ((force, external), internal) in
            self.nodal.iter_mut().zip(&self.trial.external).zip(&self.committed.internal)
        {
            *force = std::array::from_fn(|i| external[i] - internal[i] - force[i]);
        }
        scatter(&self.assembler, &mut self.nodal, &self.committed.rigid, &mut system.residual)?;
        self.linearize_constraints(&increments, system)?;
        net_forces(&self.committed, &mut self.nodal);
        let loaded = Instant::now();
        system.matrix.assemble(|k| self.add_tangent(&self.committed, t, k))?;
        let assembled = Instant::now();
        system.prepare(true)?;
        let factored = Instant::now();
        let solve = system.solve_linear()?;
        self.advance_pressures(1.0, &system.border.increments);
        self.advance_displacements(1.0, &system.direction)?;
        let seconds = NewtonSeconds {
            residual: (loaded - start).as_secs_f64(),
            jacobian: (assembled - loaded).as_secs_f64(),
            factor: (factored - assembled).as_secs_f64(),
            solve: factored.elapsed().as_secs_f64(),
        };
        Ok(LinearizedStart { seconds, solve })
    }
}
