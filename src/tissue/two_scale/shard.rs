//! The elements of one rank of the macro scale, and the couplings of their RVEs.

use std::collections::HashSet;
use std::time::Instant;

use serde::{Deserialize, Serialize};

use super::TwoScaleError;
use super::channels::Channels;
use super::protocol::{NewMatrix, NewRve, RankTimes, RveResponse, RveSummary, RveTask};
use crate::coupling::{EvenPartition, Scales, UnitId};
use crate::fem::mesh::IntegrationPoint;
use crate::las::Comm;
use crate::tissue::micro_scale::RveMaterial;

/// The RVEs of one shard of the body.
pub(super) struct Shard<C: Comm> {
    channels: Channels<C>,
    tasks: Vec<RveTask>,
    responses: Vec<RveResponse>,
    /// Seconds of the last exchange with the RVEs, without waiting.
    exchange: f64,
}

/// Changes of the RVEs of a shard. Among those deleted may be RVEs of others.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct RveUpdate {
    /// The points whose RVEs are deleted.
    pub deleted: Vec<UnitId>,
    /// The point, its position and the material of each new RVE.
    pub created: Vec<(UnitId, IntegrationPoint, RveMaterial)>,
    /// Whether RVEs bring their matrices along.
    pub sends_matrices: bool,
}

impl<C: Comm> Shard<C> {
    /// A shard without RVEs. Collective over both scales.
    pub fn new(scales: &Scales<C>) -> Result<Self, TwoScaleError> {
        Ok(Self { channels: Channels::new(scales)?, tasks: Vec::new(), responses: Vec::new(), exchange: 0.0 })
    }

    /// The points with an RVE, in the order of the exchange.
    pub fn points(&self) -> &[UnitId] {
        self.channels.to_micro.units()
    }

    /// Deletes and creates RVEs of this shard. Collective over both scales.
    pub fn update_rves(&mut self, update: &RveUpdate) -> Result<(), TwoScaleError> {
        let existing: HashSet<UnitId> = self.channels.to_micro.units().iter().copied().collect();
        let deleted: Vec<UnitId> = update.deleted.iter().copied().filter(|unit| existing.contains(unit)).collect();
        self.channels.to_micro.remove(&deleted)?;
        let created = || update.created.iter();
        let units: Vec<UnitId> = created().map(|(point, ..)| *point).collect();
        let new_rves: Vec<NewRve> = created().map(|(_, location, material)| NewRve::new(*location, material)).collect();
        let delta = self.channels.to_micro.add(&units, &[], &EvenPartition)?;
        self.channels.new_rves.send(&delta, &new_rves)?;
        if update.sends_matrices {
            let matrices = created().map(|(.., material)| NewMatrix::new(material)).collect::<Result<Vec<_>, _>>()?;
            self.channels.new_matrices.send(&delta, &matrices)?;
        }
        self.channels.to_macro = self.channels.to_micro.inverse();
        Ok(())
    }

    /// Updates the couplings after RVEs have migrated between ranks of the micro scale. Collective over both scales.
    pub fn reconcile_migrated(&mut self) -> Result<(), TwoScaleError> {
        self.channels.to_micro.reconcile_migrated()?;
        self.channels.to_macro = self.channels.to_micro.inverse();
        Ok(())
    }

    /// Sends a task to every RVE and waits for the responses. `task` returns the task for an index into
    /// [`Shard::points`] and the point there.
    pub fn exchange(
        &mut self,
        task: impl Fn(usize, UnitId) -> RveTask,
        times: &mut RankTimes,
    ) -> Result<&[RveResponse], TwoScaleError> {
        let start = Instant::now();
        let units = self.channels.to_micro.units();
        self.tasks.clear();
        self.tasks.extend(units.iter().enumerate().map(|(number, &point)| task(number, point)));
        self.responses.resize(units.len(), RveResponse::new(0, None, false));
        self.channels.tasks.send(&self.channels.to_micro, &self.tasks)?;
        let before = self.channels.responses.waited();
        self.channels.responses.receive(&self.channels.to_macro, &mut self.responses)?;
        let waited = self.channels.responses.waited() - before;
        times.idle += waited.as_secs_f64();
        self.exchange = (start.elapsed() - waited).as_secs_f64();
        times.communication += self.exchange;
        Ok(&self.responses)
    }

    /// Returns the seconds of the last exchange, without waiting.
    pub fn seconds_of_exchange(&self) -> f64 {
        self.exchange
    }

    /// Receives the summaries of all RVEs after a commit.
    pub fn receive_summaries(&mut self, times: &mut RankTimes) -> Result<Vec<RveSummary>, TwoScaleError> {
        let start = Instant::now();
        let Channels { to_macro, summaries, .. } = &mut self.channels;
        let mut received = vec![RveSummary::NONE; to_macro.units().len()];
        let before = summaries.waited();
        summaries.receive(to_macro, &mut received)?;
        let waited = summaries.waited() - before;
        times.idle += waited.as_secs_f64();
        times.communication += (start.elapsed() - waited).as_secs_f64();
        Ok(received)
    }
}
