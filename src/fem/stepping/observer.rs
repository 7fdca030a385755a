//! Whoever watches a run: writes results, shows progress.

use std::convert::Infallible;

use super::{StepFailure, StepReport};
use crate::fem::equilibrium::BodyState;
use crate::fem::mesh::Mesh;
use crate::fem::point_field::PointField;
use crate::fem::reactions::BoundaryForces;
use crate::las::NewtonReport;

/// Is told of every converged step and of every failed attempt, and may stop the run by an error (a full disk).
///
/// `P` is the point field of the run, `F` the fault of its backend.
pub trait StepObserver<P: PointField, F: std::error::Error> {
    /// Why the run should stop.
    type Error: std::error::Error;

    /// A step has converged.
    ///
    /// # Errors
    /// Stops the run, which keeps the state of this step.
    fn converged(&mut self, step: &ConvergedStep<'_, P>) -> Result<(), Self::Error>;

    /// An attempt has failed; the state is the last converged one again.
    ///
    /// # Errors
    /// Stops the run.
    fn failed(&mut self, attempt: &FailedAttempt<'_, P, F>) -> Result<(), Self::Error> {
        let _ = attempt;
        Ok(())
    }
}

/// Nobody watches.
impl<P: PointField, F: std::error::Error> StepObserver<P, F> for () {
    type Error = Infallible;

    fn converged(&mut self, _: &ConvergedStep<'_, P>) -> Result<(), Infallible> {
        Ok(())
    }
}

/// A full step that converged; sub-steps in between are only counted.
#[derive(Debug)]
pub struct ConvergedStep<'a, P> {
    /// The step, from 1.
    pub step: usize,
    /// How many steps the run has.
    pub count: usize,
    /// Where the step ends.
    pub t: f64,
    /// What it cost: iterations, cuts, seconds.
    pub report: &'a StepReport,
    /// The mesh.
    pub mesh: &'a Mesh,
    /// Displacements, deformation gradients, stresses, tangents, nodal forces.
    pub state: &'a BodyState,
    /// Areas, forces and mean displacements of all surfaces; held points.
    pub forces: BoundaryForces,
    /// The point field, for what it knows beyond stresses.
    pub field: &'a P,
}

/// An attempt that failed.
#[derive(Debug)]
pub struct FailedAttempt<'a, P: PointField, F: std::error::Error> {
    /// The step, from 1.
    pub step: usize,
    /// Where the attempt would have ended.
    pub t: f64,
    /// Its length in pseudo-time.
    pub increment: f64,
    /// Halvings of the step at this attempt: the increment is `1 / (count 2^halvings)`.
    pub halvings: u32,
    /// Why.
    pub reason: &'a StepFailure<P::Error, F>,
    /// The point field, taken back to the last converged state.
    pub field: &'a P,
    /// What Newton did until then; empty where the linearized start failed.
    pub newton: &'a NewtonReport,
}
