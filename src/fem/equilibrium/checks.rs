//! Checks of a state that is about to be committed.

use super::{Equilibrium, EquilibriumError};
use crate::fem::boundary::Source;
use crate::fem::point_field::PointField;
use crate::las::RealBackend;

impl<B: RealBackend, P: PointField> Equilibrium<B, P> {
    /// Checks that the forces of the trial state, as they are about to be committed and written, balance, and that the
    /// constraints hold: the norm of the residual of the free unknowns and constraints, which Newton also uses, must
    /// not exceed ten times the threshold at which Newton stops with this tolerance. The internal forces are summed
    /// again from the stresses, so the check detects stresses that changed after Newton converged; the factor allows
    /// for iterative solvers and other orders of summation.
    ///
    /// # Errors
    /// Returns [`EquilibriumError::OutOfBalance`] if the residual is too large.
    pub(in crate::fem) fn check_balance(&mut self, tolerance: f64) -> Result<(), EquilibriumError<P::Error, B::Error>> {
        const FACTOR: f64 = 10.0;
        let trial = &mut self.trial;
        self.assembler.internal_forces(&trial.displacements, &trial.responses.pk1, &mut trial.internal);
        self.add_region_forces();
        self.set_net_forces();
        let residual = self.assembler.free_norm(&mut self.nodal, &self.trial.rigid);
        let residual = residual.hypot(self.volumes.residual(&self.trial.volumes));
        let limit = (tolerance * self.scale()).max(self.residual_floor());
        // A NaN residual also fails.
        if residual <= FACTOR * limit && self.constraints_hold(tolerance, FACTOR) {
            self.check_supports(FACTOR * limit)
        } else {
            Err(EquilibriumError::OutOfBalance { residual, limit })
        }
    }

    /// Checks that the supports against free rigid-body modes exert no force on the body. If the loads balance, these
    /// forces are sums over all nodes of the residual, whose norm is at most `residual`.
    fn check_supports(&self, residual: f64) -> Result<(), EquilibriumError<P::Error, B::Error>> {
        let mut force: f64 = 0.0;
        self.boundary.reactions(&self.trial.internal, &self.trial.external, |source, reaction| {
            if source == Source::FreeMode {
                force = reaction.iter().fold(force, |most, component| most.max(component.abs()));
            }
        });
        // By the inequality of Cauchy and Schwarz; the factor allows for the lever arms of rotations.
        let limit = 10.0 * residual * (self.trial.displacements.len() as f64).sqrt();
        if force <= limit { Ok(()) } else { Err(EquilibriumError::UnbalancedLoads { force, limit }) }
    }
}
