//! The interior nodes of an RVE as a nonlinear problem.

use crate::fiber::rve::{Rve, RveModel};
use crate::fiber::truss::FiberStates;
use crate::fiber::workspace::Workspace;
use crate::las::{Backend, NewtonSystem, NonlinearProblem, Potential, RealBackend, ResidualScale, VectorOps};

/// The interior positions of an RVE and the quantities computed from them.
pub(super) struct Interior<'a, B: Backend> {
    model: &'a RveModel<B>,
    positions: &'a mut Vec<[f64; 3]>,
    saved: &'a mut Vec<[f64; 3]>,
    forces: &'a mut Vec<[f64; 3]>,
    states: &'a mut FiberStates,
    diagonal: &'a mut Vec<[f64; 9]>,
}

impl<'a, B: Backend> Interior<'a, B> {
    /// Splits a workspace into the nonlinear problem at its current positions and the linear system.
    pub fn of(model: &'a RveModel<B>, workspace: &'a mut Workspace<B>) -> (Self, &'a mut NewtonSystem<B>) {
        let Workspace { system, positions, saved, forces, states, diagonal, .. } = workspace;
        (Self { model, positions, saved, forces, states, diagonal }, system)
    }
}

impl<B: RealBackend> Interior<'_, B> {
    /// Returns the Euclidean distance between the interior positions and those of another state, unit-cube units.
    pub fn distance(&self, other: &Rve) -> f64 {
        let interior = self.model.network().interior().iter().zip(other.interior());
        let squares = interior.flat_map(|(&node, x)| {
            let here = &self.positions[node as usize];
            (0..3).map(move |i| (here[i] - x[i]).powi(2))
        });
        squares.sum::<f64>().sqrt()
    }
}

impl<B: RealBackend> NonlinearProblem<B> for Interior<'_, B> {
    type Error = B::Error;

    fn residual(&mut self, r: &mut B::Vector) -> Result<ResidualScale, B::Error> {
        let truss = self.model.truss();
        truss.evaluate_with_forces(self.positions, self.states, self.forces);
        let forces = &*self.forces;
        let interior = self.model.network().interior();
        r.with_local_mut(|r| {
            for (r, &node) in r.chunks_exact_mut(3).zip(interior) {
                r.copy_from_slice(&forces[node as usize]);
            }
        })?;
        r.finish()?;
        let squares: f64 = forces.iter().flatten().map(|f| f * f).sum();
        Ok(ResidualScale { scale: squares.sqrt(), floor: self.model.rounding_floor() })
    }

    fn jacobian(&mut self, k: &mut B::Matrix) -> Result<(), B::Error> {
        self.model.slots.assemble(self.model.truss(), self.states, self.diagonal, k)
    }

    fn advance(&mut self, a: f64, d: &B::Vector) -> Result<(), B::Error> {
        let interior = self.model.network().interior();
        let positions = &mut *self.positions;
        d.with_local(|d| {
            for (d, &node) in d.chunks_exact(3).zip(interior) {
                let x = &mut positions[node as usize];
                (0..3).for_each(|i| x[i] += a * d[i]);
            }
        })
    }

    /// Fiber forces exist at every state, so only the backend can fail.
    fn is_final(_: &B::Error) -> bool {
        true
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

impl<B: RealBackend> Potential<B> for Interior<'_, B> {
    fn potential(&mut self) -> f64 {
        self.model.truss().energy(self.states)
    }
}
