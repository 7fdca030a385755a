//! What a worker needs to solve RVEs of one network: sized once, used for any number of RVEs.

use std::sync::Arc;

use super::deformation_path::split;
use super::rve::{Rve, RveModel, Sensitivities, transform};
use super::truss::FiberStates;
use crate::las::{Backend, NewtonSystem, Scalar, SolveError, Sparsity};
use nalgebra::Matrix3;

/// Strain modes of the condensed tangent: six symmetric ones.
pub(super) const MODES: usize = 6;

/// Scratch for RVEs of one model. Nothing in it belongs to an RVE: results do not depend on what was solved before.
pub struct Workspace<B: Backend> {
    /// That of the model it was made for: no two models share one.
    pattern: Arc<Sparsity>,
    /// The linear system of Newton.
    pub(super) system: NewtonSystem<B>,
    /// Positions of all nodes.
    pub(super) positions: Vec<[f64; 3]>,
    /// Interior positions that Newton may come back to.
    pub(super) saved: Vec<[f64; 3]>,
    /// Forces at all nodes.
    pub(super) forces: Vec<[f64; 3]>,
    /// The fibers at `positions`.
    pub(super) states: FiberStates,
    /// Diagonal blocks of the stiffness.
    pub(super) diagonal: Vec<[f64; 9]>,
    /// Whether the solver holds the factor of the stiffness at `positions`.
    pub(super) factor_is_exact: bool,
    /// Right-hand sides and solutions of the tangent, one a mode.
    pub(super) mode_loads: Vec<B::Vector>,
    pub(super) mode_solutions: Vec<B::Vector>,
    /// Velocity of all nodes in every mode, and the force rate it causes.
    pub(super) sensitivities: Vec<[f64; 3 * MODES]>,
    pub(super) force_rates: Vec<[f64; 3 * MODES]>,
}

impl<B: Backend<Scalar = f64>> Workspace<B>
where
    B::Reduced: Scalar,
{
    /// A workspace for RVEs of this model.
    ///
    /// # Errors
    /// What the backend reports when it cannot make a vector, a matrix or a solver.
    pub fn new(context: &B::Context, model: &RveModel<B>) -> Result<Self, SolveError<B::Fault>> {
        let nodes = model.network().nodes().len();
        let interior = model.network().interior().len();
        let vectors = || -> Result<Vec<B::Vector>, SolveError<B::Fault>> {
            (0..MODES).map(|_| B::vector(context, model.unknowns()).map_err(SolveError::Fault)).collect()
        };
        Ok(Self {
            pattern: Arc::clone(&model.pattern),
            system: NewtonSystem::new(context, &model.pattern, &model.symbolic)?,
            positions: vec![[0.0; 3]; nodes],
            saved: Vec::with_capacity(interior),
            forces: vec![[0.0; 3]; nodes],
            states: FiberStates::default(),
            diagonal: Vec::with_capacity(interior),
            factor_is_exact: false,
            mode_loads: vectors()?,
            mode_solutions: vectors()?,
            sensitivities: vec![[0.0; 3 * MODES]; nodes],
            force_rates: vec![[0.0; 3 * MODES]; nodes],
        })
    }

    /// Whether it was made for this model.
    pub(super) fn is_of(&self, model: &RveModel<B>) -> bool {
        Arc::ptr_eq(&self.pattern, &model.pattern)
    }

    /// Moves the boundary to `target` and carries the interior of `rve` along: affinely, or by the prediction it has kept.
    pub(super) fn place(&mut self, model: &RveModel<B>, rve: &Rve, target: &Matrix3<f64>) {
        let Some(increment) = self.place_affinely(model, rve, target) else { return };
        if let Some(sensitivities) = &rve.sensitivities {
            self.predict(model, &increment, sensitivities);
        }
    }

    /// Moves the boundary to `target` and the interior of `rve` by the same affine increment, which is returned; `None`
    /// where the interior stays.
    pub(super) fn place_affinely(
        &mut self,
        model: &RveModel<B>,
        rve: &Rve,
        target: &Matrix3<f64>,
    ) -> Option<Matrix3<f64>> {
        let network = model.network();
        for &node in network.boundary() {
            self.positions[node as usize] = transform(target, &network.nodes()[node as usize]);
        }
        let inverse = if target == &rve.gradient { None } else { rve.gradient.try_inverse() };
        let Some(inverse) = inverse else {
            self.hold(model, rve);
            return None;
        };
        // By the increment on the current positions: exact for rotations, and a relaxed network stays relaxed.
        let increment = target * inverse;
        for (&node, x) in network.interior().iter().zip(&rve.interior) {
            self.positions[node as usize] = transform(&increment, x);
        }
        Some(increment)
    }

    /// The interior where it is.
    fn hold(&mut self, model: &RveModel<B>, rve: &Rve) {
        for (&node, x) in model.network().interior().iter().zip(&rve.interior) {
            self.positions[node as usize] = *x;
        }
    }

    /// Adds to an affine motion by `F = R U` what the sensitivities tell to first order: `R sum_k (U - I)_k v_k`, with `v_k` the
    /// part of the velocity that is not affine.
    fn predict(&mut self, model: &RveModel<B>, increment: &Matrix3<f64>, sensitivities: &[Sensitivities]) {
        let Some((stretch, rotation)) = split(*increment) else { return };
        let rotation = rotation.to_rotation_matrix();
        let e = [
            stretch[(0, 0)] - 1.0,
            stretch[(1, 1)] - 1.0,
            stretch[(2, 2)] - 1.0,
            stretch[(1, 2)],
            stretch[(0, 2)],
            stretch[(0, 1)],
        ];
        for (&node, sensitivities) in model.network().interior().iter().zip(sensitivities) {
            let mut correction = [0.0; 3];
            for (e, v) in e.iter().zip(sensitivities.chunks_exact(3)) {
                (0..3).for_each(|i| correction[i] += e * f64::from(v[i]));
            }
            let correction = transform(rotation.matrix(), &correction);
            let x = &mut self.positions[node as usize];
            (0..3).for_each(|i| x[i] += correction[i]);
        }
    }

    /// Takes up an RVE as it is, for looking at: positions and fiber states, no solve.
    pub fn show(&mut self, model: &RveModel<B>, rve: &Rve) {
        self.place(model, rve, &rve.gradient);
        model.truss.evaluate_with_forces(&self.positions, &mut self.states, &mut self.forces);
        self.factor_is_exact = false;
    }

    /// Positions of all nodes of the RVE that was solved last, unit-cube units.
    #[must_use]
    pub fn positions(&self) -> &[[f64; 3]] {
        &self.positions
    }

    /// The fibers of the RVE that was solved last.
    #[must_use]
    pub fn states(&self) -> &FiberStates {
        &self.states
    }
}
