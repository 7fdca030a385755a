//! Equilibrium as a problem of Newton's method.

use super::{Equilibrium, EquilibriumError, scatter};
use crate::fem::point_field::PointField;
use crate::las::{Border, NonlinearProblem, RealBackend, ResidualScale};

impl<B: RealBackend, P: PointField> NonlinearProblem<B> for Equilibrium<B, P> {
    type Error = EquilibriumError<P::Error, B::Error>;

    /// Evaluates `r = f_int - f_ext` of the free unknowns, N. The scale is the larger norm of the two over all nodes,
    /// or that of the forces of a constraint. The floor is
    /// [`Assembler::rounding_error`](crate::fem::assembly::Assembler::rounding_error) of the undeformed body, greater for
    /// displacements that are longer than an element, and the rounding of the constrained volumes.
    fn residual(&mut self, r: &mut B::Vector) -> Result<ResidualScale, Self::Error> {
        self.evaluate_points()?;
        // The forces of dead loads are those of `begin_step`.
        if self.boundary.depends_on_displacements() || self.volumes.constraints.have_cavities() {
            self.evaluate_external_forces();
        }
        self.add_constraint_forces();
        self.set_net_forces();
        scatter(&self.assembler, &mut self.nodal, &self.trial.rigid, r).map_err(EquilibriumError::Backend)?;
        self.residual_scale().map_err(EquilibriumError::Backend)
    }

    fn jacobian(&mut self, k: &mut B::Matrix) -> Result<(), Self::Error> {
        self.set_net_forces();
        self.add_tangent(&self.trial, self.trial.t, k).map_err(EquilibriumError::Backend)
    }

    fn advance(&mut self, a: f64, d: &B::Vector) -> Result<(), Self::Error> {
        self.advance_displacements(a, d).map_err(EquilibriumError::Backend)
    }

    fn is_settled(&self, tolerance: f64) -> bool {
        self.constraints_hold(tolerance, 1.0)
    }

    fn is_final(error: &Self::Error) -> bool {
        match error {
            EquilibriumError::PointField(error) => P::is_final(error),
            // Smaller increments end in states that are out of balance too.
            EquilibriumError::Backend(_) | EquilibriumError::UnbalancedLoads { .. } => true,
            EquilibriumError::OtherRank
            | EquilibriumError::OffBranch(_)
            | EquilibriumError::StillChanging(_)
            | EquilibriumError::VolumeNotReached { .. }
            | EquilibriumError::OutOfBalance { .. } => false,
        }
    }

    fn constraints(&self) -> usize {
        self.volumes.constraints.len()
    }

    fn constraint_residuals(&self, c: &mut [f64]) {
        self.write_constraint_residuals(c);
    }

    fn border(&mut self, border: &mut Border<B>) -> Result<(), Self::Error> {
        self.write_border(border).map_err(EquilibriumError::Backend)
    }

    fn advance_multipliers(&mut self, a: f64, dp: &[f64]) {
        self.advance_pressures(a, dp);
    }

    /// The norm of the displacement increments of all nodes since the committed state, prescribed ones included, m.
    /// Changes below `1e-8` of the displacements are due to rounding.
    fn state_scale(&self) -> Option<f64> {
        let (new, old) = (&self.trial.displacements, &self.committed.displacements);
        let change = |node: usize, component: usize| (new[node][component] - old[node][component]).powi(2);
        let mut squares = [self.ranks.over_own(new.len(), change), self.ranks.squares(new)];
        // A NaN is no small step.
        self.ranks.sum(&mut squares).map_or(Some(f64::NAN), |()| Some(squares[0].sqrt().max(1e-8 * squares[1].sqrt())))
    }

    fn save(&mut self) {
        self.saved.0.copy_from_slice(&self.trial.displacements);
        self.saved.1.copy_from_slice(&self.trial.rigid);
        self.volumes.saved.clone_from(&self.trial.volumes);
    }

    fn restore(&mut self) {
        self.trial.displacements.copy_from_slice(&self.saved.0);
        self.trial.rigid.copy_from_slice(&self.saved.1);
        self.trial.volumes.copy_from_slice(&self.volumes.saved);
    }
}
