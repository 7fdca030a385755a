//! Values of every point for the result files: fiber orientation, fiber stretch, and the cost of the RVE.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::unit::Fibers;
use super::units::Units;
use crate::fiber::orientation::{Weighting, principal, tensor};
use crate::fiber::truss::FiberStates;
use crate::las::RealBackend;

/// The network of one point at the last converged load step; nodes and fibers in the order of the network's file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DeformedNetwork {
    /// The index of the undeformed network among the models of the field.
    pub model: usize,
    /// Positions of the nodes, in units of the unit cube.
    pub positions: Vec<[f64; 3]>,
    /// Stretch of every fiber.
    pub stretches: Vec<f64>,
    /// Axial force of every fiber, N.
    pub forces: Vec<f64>,
}

/// The fibers of one point at the last converged load step.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PointSummary {
    /// Orientation tensor of the deformed fibers, each counted once, column by column; trace 1.
    pub orientation: [[f64; 3]; 3],
    /// Its principal direction.
    pub direction: [f64; 3],
    /// Its largest eigenvalue minus 1/3: 0 for fibers in all directions, 2/3 for fibers along one.
    pub alignment: f64,
    /// Smallest and largest fiber stretch.
    pub stretch: [f64; 2],
    /// Newton iterations of the last load step.
    pub iterations: usize,
    /// The index of the network among the models of the field.
    pub network: usize,
}

impl<B: RealBackend> Units<B> {
    /// Returns the summary of the fibers of every unit, `None` for one without fibers.
    pub fn summaries(&self) -> Vec<Option<PointSummary>> {
        (0..self.len())
            .into_par_iter()
            .map(|number| {
                let unit = self.unit(number)?;
                unit.fibers.as_ref().map(|fibers| self.summary(fibers, unit.committed_iterations))
            })
            .collect()
    }

    /// Returns the deformed network of a unit, `None` for one without.
    pub fn deformed_network(&self, number: usize) -> Option<DeformedNetwork> {
        let fibers = self.unit(number)?.fibers.as_ref()?;
        let truss = self.library().models()[fibers.model].truss();
        let positions = fibers.committed.positions(truss.network());
        let mut states = FiberStates::default();
        truss.evaluate(&positions, &mut states);
        let mut deformed = DeformedNetwork {
            model: fibers.model,
            positions,
            stretches: vec![0.0; states.stretches.len()],
            forces: vec![0.0; states.forces.len()],
        };
        // The truss sorts its fibers by law.
        for (k, &fiber) in truss.fiber_numbers().iter().enumerate() {
            deformed.stretches[fiber as usize] = states.stretches[k];
            deformed.forces[fiber as usize] = states.forces[k];
        }
        Some(deformed)
    }

    fn summary(&self, fibers: &Fibers, iterations: usize) -> PointSummary {
        let model = &self.library().models()[fibers.model];
        let positions = fibers.committed.positions(model.network());
        let mut states = FiberStates::default();
        model.truss().evaluate(&positions, &mut states);
        let orientation = tensor(&states.directions, model.truss().lengths(), Weighting::Number);
        let (direction, largest) = principal(&orientation);
        let stretch = states.stretches.iter().fold([f64::INFINITY, 0.0_f64], |[a, b], &s| [a.min(s), b.max(s)]);
        let alignment = largest - 1.0 / 3.0;
        let (orientation, direction) = (orientation.into(), direction.into());
        PointSummary { orientation, direction, alignment, stretch, iterations, network: fibers.model }
    }
}
