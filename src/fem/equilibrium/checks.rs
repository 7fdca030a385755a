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
        let squares = self.assembler.free_squares(&mut self.nodal, &self.trial.rigid);
        let residual = self.ranks.root(squares).map_err(EquilibriumError::Backend)?;
        let residual = residual.hypot(self.volumes.residual(&self.trial.volumes));
        let limit = self.residual_scale().map_err(EquilibriumError::Backend)?.limit(tolerance);
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
        let (forces, mut force) = ((&self.trial.internal[..], &self.trial.external[..]), 0.0_f64);
        self.boundary.reactions(
            forces,
            |node| self.mesh.is_own_node(node),
            |source, reaction| {
                if source == Source::FreeMode {
                    force = reaction.iter().fold(force, |most, component| most.max(component.abs()));
                }
            },
        );
        let mut largest = [force];
        self.ranks.max(&mut largest).map_err(EquilibriumError::Backend)?;
        let [force] = largest;
        // By the inequality of Cauchy and Schwarz; the factor allows for the lever arms of rotations.
        let nodes = self.ranks.nodes(self.trial.displacements.len());
        let limit = 10.0 * residual * (nodes as f64).sqrt();
        if force <= limit { Ok(()) } else { Err(EquilibriumError::UnbalancedLoads { force, limit }) }
    }
}
