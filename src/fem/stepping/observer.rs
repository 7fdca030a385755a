//! Observers of a run, which write results or show progress.

use std::convert::Infallible;
use std::sync::Arc;

use super::{SavedState, StepFailure, StepReport};
use crate::fem::constraint::Constraints;
use crate::fem::equilibrium::{BodyState, LargestResidual};
use crate::fem::mesh::Mesh;
use crate::fem::point_field::PointField;
use crate::fem::reactions::BoundaryForces;
use crate::las::NewtonReport;

/// Receives every converged step and every failed attempt; an error (a full disk, for example) stops the run.
///
/// `P` is the point field of the run, `F` the error of its backend.
pub trait StepObserver<P: PointField, F: std::error::Error> {
    /// The reason for stopping the run.
    type Error: std::error::Error;

    /// Called after a step has converged.
    ///
    /// # Errors
    /// An error stops the run, which keeps the state of this step.
    fn converged(&mut self, step: &ConvergedStep<'_, P>) -> Result<(), Self::Error>;

    /// Called before every iteration of Newton's method, to show progress within a step.
    fn iterating(&mut self, iteration: &Iterating<'_>) {
        let _ = iteration;
    }

    /// Called after an attempt has failed; the state is again the last converged one.
    ///
    /// # Errors
    /// An error stops the run.
    fn failed(&mut self, attempt: &FailedAttempt<'_, P, F>) -> Result<(), Self::Error> {
        let _ = attempt;
        Ok(())
    }
}

/// Ignores all steps.
impl<P: PointField, F: std::error::Error> StepObserver<P, F> for () {
    type Error = Infallible;

    fn converged(&mut self, _: &ConvergedStep<'_, P>) -> Result<(), Infallible> {
        Ok(())
    }
}

/// Newton's method within an attempt at an increment.
#[derive(Clone, Copy, Debug)]
pub struct Iterating<'a> {
    /// The step, from 1.
    pub step: usize,
    /// Number of steps of the run.
    pub count: usize,
    /// Pseudo-time at the end of the increment.
    pub t: f64,
    /// Newton's method so far.
    pub newton: &'a NewtonReport,
}

/// A converged full step; increments are only counted. Mesh, state and field are those of the part of this rank if the body
/// is divided, all else is that of the whole body.
#[derive(Debug)]
pub struct ConvergedStep<'a, P> {
    /// The step, from 1.
    pub step: usize,
    /// Number of steps of the run.
    pub count: usize,
    /// Pseudo-time at the end of the step.
    pub t: f64,
    /// Cost of the step: iterations, cuts, seconds.
    pub report: &'a StepReport,
    /// The mesh.
    pub mesh: &'a Mesh,
    /// Displacements, deformation gradients, stresses, tangents and nodal forces.
    pub state: &'a BodyState,
    /// Areas, forces and mean displacements of all surfaces; forces and displacements of the point conditions.
    pub forces: BoundaryForces,
    /// Volume of each region, m^3, in the order of [`Mesh::regions`].
    pub region_volumes: Vec<f64>,
    /// The volume constraints, whose states are [`BodyState::volumes`].
    pub constraints: &'a Constraints,
    /// The point field, for data other than stresses.
    pub field: &'a P,
}

/// A failed attempt.
#[derive(Debug)]
pub struct FailedAttempt<'a, P: PointField, F: std::error::Error> {
    /// The step, from 1.
    pub step: usize,
    /// Pseudo-time at which the attempt would have ended.
    pub t: f64,
    /// Length of the attempt in pseudo-time.
    pub increment: f64,
    /// Number of halvings at this attempt; with adaptive increments, since the last success.
    pub halvings: u32,
    /// The reason for the failure.
    pub reason: &'a StepFailure<P::Error, F>,
    /// The point field, reset to the last converged state.
    pub field: &'a P,
    /// The last converged state, and the mesh that it belongs to; those of the part if the body is divided.
    pub state: &'a BodyState,
    /// The mesh.
    pub mesh: &'a Arc<Mesh>,
    /// That state, from which a run can continue, if it ends a full step: as [`Stepper::saved`](super::Stepper::saved) before
    /// this attempt.
    pub saved: Option<SavedState>,
    /// The Newton report of the failure, or of the last converged solve if the state could not be committed; empty if
    /// the linearized start failed.
    pub newton: &'a NewtonReport,
    /// Where the residual is largest, if Newton's method ended without a small one.
    pub largest_residual: Option<&'a LargestResidual>,
}
