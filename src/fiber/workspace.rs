//! Scratch memory for solving RVEs of one network: allocated once, used for any number of RVEs.

use std::sync::Arc;

use super::deformation_path::polar_decomposition;
use super::equilibrium::StageInProgress;
use super::rve::{Rve, RveModel, Sensitivities, transform};
use super::truss::FiberStates;
use crate::las::{Backend, NewtonSystem, RealBackend, SolveError, Sparsity};
use nalgebra::Matrix3;

/// Number of strain modes of the condensed tangent: the six symmetric unit strains.
pub(super) const MODES: usize = 6;

/// Scratch memory for RVEs of one model. It carries no state of an RVE: results do not depend on earlier solves.
pub struct Workspace<B: Backend> {
    /// The pattern of the model it was made for; it identifies the model, since no two models share a pattern.
    pattern: Arc<Sparsity>,
    /// The linear system of Newton.
    pub(super) system: NewtonSystem<B>,
    /// Positions of all nodes.
    pub(super) positions: Vec<[f64; 3]>,
    /// Interior positions that Newton can restore.
    pub(super) saved: Vec<[f64; 3]>,
    /// Forces at all nodes.
    pub(super) forces: Vec<[f64; 3]>,
    /// Fiber states at `positions`.
    pub(super) states: FiberStates,
    /// Diagonal blocks of the stiffness.
    pub(super) diagonal: Vec<[f64; 9]>,
    /// Whether the solver holds the factor of the unshifted stiffness at `positions`.
    pub(super) factor_is_exact: bool,
    /// The stage of the solution.
    pub(super) stage: Arc<StageInProgress>,
    /// Right-hand sides and solutions of the tangent, one per mode.
    pub(super) mode_loads: Vec<B::Vector>,
    pub(super) mode_solutions: Vec<B::Vector>,
    /// Sensitivities of the positions of all nodes in every mode, and those of the nodal forces.
    pub(super) sensitivities: Vec<[f64; 3 * MODES]>,
    pub(super) force_sensitivities: Vec<[f64; 3 * MODES]>,
}

impl<B: RealBackend> Workspace<B> {
    /// Allocates a workspace for RVEs of this model.
    ///
    /// # Errors
    /// Returns [`SolveError`] if the backend cannot make a vector, a matrix or a solver.
    pub fn new(context: &B::Context, model: &RveModel<B>) -> Result<Self, SolveError<B::Error>> {
        let nodes = model.network().nodes().len();
        let interior = model.network().interior().len();
        let vectors = || (0..MODES).map(|_| B::vector(context, model.unknowns())).collect::<Result<_, _>>();
        Ok(Self {
            pattern: Arc::clone(&model.pattern),
            system: NewtonSystem::new(context, &model.pattern, &model.symbolic)?,
            positions: vec![[0.0; 3]; nodes],
            saved: Vec::with_capacity(interior),
            forces: vec![[0.0; 3]; nodes],
            states: FiberStates::default(),
            diagonal: Vec::with_capacity(interior),
            factor_is_exact: false,
            stage: Arc::default(),
            mode_loads: vectors()?,
            mode_solutions: vectors()?,
            sensitivities: vec![[0.0; 3 * MODES]; nodes],
            force_sensitivities: vec![[0.0; 3 * MODES]; nodes],
        })
    }

    /// Bytes of a workspace for RVEs of this model: its arrays, the values of the stiffness, and the factor as far as the
    /// backend knows it.
    pub fn bytes_for(model: &RveModel<B>) -> usize {
        let network = model.network();
        let vector = size_of::<[f64; 3]>();
        let of_node = 2 * (vector + size_of::<[f64; 3 * MODES]>());
        let of_interior = vector + size_of::<[f64; 9]>();
        let of_fiber = vector + 4 * size_of::<f64>();
        // Residual, direction, and a load and a solution for each mode.
        let of_unknown = (2 + 2 * MODES) * size_of::<f64>();
        network.nodes().len() * of_node
            + network.interior().len() * of_interior
            + network.fibers().len() * of_fiber
            + model.unknowns() * of_unknown
            + model.pattern.nnz() * size_of::<f64>()
            + B::factor_bytes(&model.symbolic)
    }

    /// Reports the stages of solutions in `stage`, which other threads may read.
    pub fn report_stages(&mut self, stage: Arc<StageInProgress>) {
        self.stage = stage;
    }

    /// Returns true if the workspace was made for this model.
    pub(super) fn is_of(&self, model: &RveModel<B>) -> bool {
        Arc::ptr_eq(&self.pattern, &model.pattern)
    }

    /// Moves the boundary to `target` and the interior of `rve` affinely, plus the first-order prediction if `rve` has
    /// sensitivities.
    pub(super) fn set_initial_guess(&mut self, model: &RveModel<B>, rve: &Rve, target: &Matrix3<f64>) {
        let Some(increment) = self.set_affine_guess(model, rve, target) else { return };
        if let Some(sensitivities) = &rve.sensitivities {
            self.predict(model, &increment, sensitivities);
        }
    }

    /// Moves the boundary to `target` and the interior of `rve` by the same affine increment. Returns the increment, or
    /// `None` if the interior stays in place.
    pub(super) fn set_affine_guess(
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
            self.copy_interior(model, rve);
            return None;
        };
        // Applying the increment to the current positions is exact for rotations and preserves the non-affine
        // displacements of the last equilibrium.
        let increment = target * inverse;
        for (&node, x) in network.interior().iter().zip(&rve.interior) {
            self.positions[node as usize] = transform(&increment, x);
        }
        Some(increment)
    }

    /// Copies the interior positions of `rve` unchanged.
    fn copy_interior(&mut self, model: &RveModel<B>, rve: &Rve) {
        for (&node, x) in model.network().interior().iter().zip(&rve.interior) {
            self.positions[node as usize] = *x;
        }
    }

    /// Adds the first-order prediction to an affine motion by `F = R U`: `R sum_k (U - I)_k v_k`, with `v_k` the
    /// non-affine part of the sensitivities.
    fn predict(&mut self, model: &RveModel<B>, increment: &Matrix3<f64>, sensitivities: &[Sensitivities]) {
        let Some((stretch, rotation)) = polar_decomposition(*increment) else { return };
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

    /// Loads an RVE without a solve: computes positions, fiber states and forces at its last equilibrium.
    pub fn load_state(&mut self, model: &RveModel<B>, rve: &Rve) {
        self.set_initial_guess(model, rve, &rve.gradient);
        model.truss.evaluate_with_forces(&self.positions, &mut self.states, &mut self.forces);
        self.factor_is_exact = false;
    }

    /// Positions of all nodes of the last RVE solved or loaded, unit-cube units.
    pub fn positions(&self) -> &[[f64; 3]] {
        &self.positions
    }

    /// Fiber states of the last RVE solved or loaded.
    pub fn states(&self) -> &FiberStates {
        &self.states
    }
}
