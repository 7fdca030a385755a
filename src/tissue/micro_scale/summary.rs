//! What a picture shows of every point: where the fibers lie, how far they are stretched, what the RVE cost.

use std::sync::PoisonError;

use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

use super::TissueField;
use super::unit::{Fibers, UnitError};
use super::worker::Library;
use crate::fiber::orientation::{Weighting, principal, tensor};
use crate::las::{Backend, Scalar};

/// The fibers of one point at the last converged load step.
#[derive(Clone, Debug, PartialEq)]
pub struct PointSummary {
    /// Orientation tensor of the deformed fibers, each counted once; trace 1.
    pub orientation: Matrix3<f64>,
    /// Its principal direction.
    pub direction: Vector3<f64>,
    /// Its largest eigenvalue minus 1/3: 0 for fibers in all directions, 2/3 for fibers along one.
    pub alignment: f64,
    /// Smallest and largest fiber stretch.
    pub stretch: [f64; 2],
    /// Newton iterations of the last load step.
    pub iterations: usize,
    /// The number of the network among the models of the field.
    pub network: usize,
}

impl<B: Backend<Scalar = f64>> TissueField<B>
where
    B::Reduced: Scalar,
{
    /// The fibers of every element, `None` where there are none.
    ///
    /// # Errors
    /// Where a thread cannot have its workspace.
    pub fn summaries(&self) -> Result<Vec<Option<PointSummary>>, UnitError<B::Fault>> {
        (0..self.sites.len())
            .into_par_iter()
            .map(|element| {
                let Some(unit) = self.unit_of(element) else { return Ok(None) };
                let Some(fibers) = &unit.fibers else { return Ok(None) };
                self.summary(fibers, unit.committed_iterations).map(Some)
            })
            .collect()
    }

    fn summary(&self, fibers: &Fibers, iterations: usize) -> Result<PointSummary, UnitError<B::Fault>> {
        let model = &self.models[fibers.model];
        let library = Library { context: &self.context, models: &self.models, params: &self.params };
        let slot = rayon::current_thread_index().unwrap_or(0) % self.workers.len();
        let mut worker = self.workers[slot].lock().unwrap_or_else(PoisonError::into_inner);
        let workspace = worker.workspace(&library, fibers.model).map_err(UnitError::Workspace)?;
        workspace.show(model, &fibers.committed);
        let states = workspace.states();
        let orientation = tensor(&states.directions, model.truss().lengths(), Weighting::Number);
        let (direction, largest) = principal(&orientation);
        let (mut least, mut most) = (f64::INFINITY, 0.0_f64);
        for &stretch in &states.stretches {
            least = least.min(stretch);
            most = most.max(stretch);
        }
        Ok(PointSummary {
            orientation,
            direction,
            alignment: largest - 1.0 / 3.0,
            stretch: [least, most],
            iterations,
            network: fibers.model,
        })
    }
}
