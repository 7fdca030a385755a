//! An RVE on the way to another rank, with all its states: it may move between any two tasks.

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::rve_material::RveMaterial;
use super::saved::{FieldRestoreError, UnitState};
use super::unit::{Fibers, Origin, Unit};
use super::units::Units;
use crate::coupling::balance::{CostHistory, Migration};
use crate::fem::mesh::IntegrationPoint;
use crate::las::{Message, RealBackend, bytemuck};

/// An RVE with the history of its costs.
#[derive(Serialize, Deserialize)]
struct MovingRve {
    point: u64,
    /// The element, the number of the point in it, and the number of its points.
    location: (u32, u16, u16),
    material: RveMaterial,
    current: UnitState,
    /// The last converged state, unless the current one is that.
    committed: Option<UnitState>,
    is_verified: bool,
    iterations_of_step: u64,
    committed_iterations: u64,
    history: Vec<u8>,
}

/// The reason why an RVE cannot be moved.
#[derive(Debug, Error)]
pub enum MovingError {
    /// The message cannot be encoded or decoded.
    #[error(transparent)]
    Message(#[from] postcard::Error),
    /// The RVE does not match the materials of this rank.
    #[error(transparent)]
    State(#[from] FieldRestoreError),
    /// This rank does not have the region of the RVE, its network, or its matrix.
    #[error("{0}: the ranks have different materials")]
    Material(IntegrationPoint),
}

impl MovingRve {
    fn new(point: usize, unit: &Unit, material: RveMaterial, history: &CostHistory) -> Self {
        let IntegrationPoint { element, point: of_element, points } = unit.location;
        let fibers = unit.fibers.as_ref();
        let unfinished = fibers.filter(|fibers| fibers.origin != Origin::Committed);
        Self {
            point: point as u64,
            location: (element, of_element, points),
            material,
            current: UnitState {
                rve: fibers.map(|fibers| fibers.current.clone()),
                response: unit.response,
                iterations: unit.iterations,
            },
            committed: unfinished.map(|fibers| UnitState {
                rve: Some(fibers.committed.clone()),
                response: None,
                iterations: 0,
            }),
            is_verified: fibers.is_some_and(|fibers| fibers.origin == Origin::Branch),
            iterations_of_step: unit.iterations_of_step as u64,
            committed_iterations: unit.committed_iterations as u64,
            history: bytemuck::bytes_of(history).to_vec(),
        }
    }
}

impl<B: RealBackend> Units<B> {
    /// Serializes an RVE.
    ///
    /// # Errors
    /// Never in practice: postcard can encode every RVE.
    pub fn pack(&self, number: usize) -> Result<Message, MovingError> {
        let (unit, history) = self.parts(number);
        let network = unit.fibers.as_ref().map(Fibers::network);
        let material = self.library().to_send(unit.region, network, unit.matrix.as_ref());
        Ok(Message::of(&postcard::to_allocvec(&MovingRve::new(self.points()[number], unit, material, history))?))
    }

    /// Returns the number of bytes that [`Units::pack`] takes for an RVE, about.
    pub fn packed_bytes(&self, number: usize) -> u64 {
        self.parts(number).0.bytes(false) as u64
    }

    /// Removes the RVEs that left this rank, and appends those that arrived.
    ///
    /// # Errors
    /// Returns [`MovingError`] if a message holds an RVE whose region, network or matrix this rank does not have.
    pub fn migrate(&mut self, migration: &Migration, arrived: &[Message]) -> Result<(), MovingError> {
        let mut keep = vec![false; self.len()];
        migration.stayed().iter().for_each(|&number| keep[number as usize] = true);
        self.retain(&keep);
        arrived.iter().try_for_each(|message| self.unpack(message))
    }

    fn unpack(&mut self, message: &Message) -> Result<(), MovingError> {
        let moving: MovingRve = postcard::from_bytes(message.bytes())?;
        let (element, point, points) = moving.location;
        let location = IntegrationPoint { element, point, points };
        let (point, region) = (moving.point as usize, moving.material.region);
        let material = self.library().received(point, moving.material);
        let (of_point, matrix) = material.ok_or(MovingError::Material(location))?;
        let network = of_point.map(|of| &**self.library().models()[of.model].network());
        moving.current.check(location, network)?;
        if let Some(committed) = &moving.committed {
            committed.check(location, network)?;
        }
        let UnitState { rve, response, iterations } = moving.current;
        let mut unit = Unit::new((location, region), of_point, self.library().models(), matrix);
        if let (Some(Fibers { current, committed, origin, .. }), Some(rve)) = (&mut unit.fibers, rve) {
            (*committed, *origin) = match moving.committed.and_then(|committed| committed.rve) {
                Some(committed) if moving.is_verified => (committed, Origin::Branch),
                Some(committed) => (committed, Origin::Trial),
                None => {
                    committed.copy_equilibrium_from(&rve);
                    (committed.clone(), Origin::Committed)
                }
            };
            *current = rve;
        }
        (unit.response, unit.iterations) = (response, iterations);
        unit.iterations_of_step = moving.iterations_of_step as usize;
        unit.committed_iterations = moving.committed_iterations as usize;
        let history = bytemuck::try_pod_read_unaligned(&moving.history);
        self.append(point, unit, history.unwrap_or_default());
        Ok(())
    }
}
