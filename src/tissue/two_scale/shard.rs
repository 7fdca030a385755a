//! The elements of one rank of the macro scale, and the couplings of their RVEs.

use std::collections::HashSet;
use std::time::Instant;

use super::TwoScaleError;
use super::channels::Channels;
use super::protocol::{Answer, NewRve, Seconds, Strain};
use crate::coupling::{EvenPartition, Scales, UnitId};
use crate::las::Comm;

/// The RVEs of one part of the body.
pub(super) struct Shard<C: Comm> {
    channels: Channels<C>,
    asked: Vec<Strain>,
    found: Vec<Answer>,
}

/// A change of the RVEs of the whole body: elements whose RVEs are deleted, and elements with new RVEs and their
/// regions.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Change {
    pub gone: Vec<UnitId>,
    pub new: Vec<[u64; 2]>,
}

impl<C: Comm> Shard<C> {
    /// A part without RVEs. Collective over both scales.
    pub fn new(scales: &Scales<C>) -> Result<Self, TwoScaleError> {
        Ok(Self { channels: Channels::new(scales)?, asked: Vec::new(), found: Vec::new() })
    }

    /// The elements with an RVE, in the order of the exchange.
    pub fn elements(&self) -> &[UnitId] {
        self.channels.units()
    }

    /// Deletes and creates RVEs of this part. Collective over both scales.
    pub fn change(&mut self, change: &Change, is_own: impl Fn(usize) -> bool) -> Result<(), TwoScaleError> {
        let here: HashSet<UnitId> = self.channels.units().iter().copied().collect();
        let gone: Vec<UnitId> = change.gone.iter().copied().filter(|unit| here.contains(unit)).collect();
        self.channels.down.remove(&gone)?;
        let new: Vec<[u64; 2]> = change.new.iter().copied().filter(|&[element, _]| is_own(element as usize)).collect();
        let units: Vec<UnitId> = new.iter().map(|&[element, _]| element).collect();
        let delta = self.channels.down.add(&units, &[], &EvenPartition)?;
        let headers: Vec<NewRve> = new.iter().map(|&[_, region]| NewRve { region }).collect();
        self.channels.headers.send(&delta, &headers)?;
        self.channels.turn_back();
        Ok(())
    }

    /// Sends a strain to every RVE and waits for the answers. `strain` returns the strain for an index into
    /// [`Shard::elements`] and the element there.
    pub fn exchange(
        &mut self,
        strain: impl Fn(usize, UnitId) -> Strain,
        seconds: &mut Seconds,
    ) -> Result<&[Answer], TwoScaleError> {
        let start = Instant::now();
        let units = self.channels.units();
        self.asked.clear();
        self.asked.extend(units.iter().enumerate().map(|(number, &element)| strain(number, element)));
        self.found.resize(units.len(), Answer::new(0, None, false));
        self.channels.strains.send(&self.channels.down, &self.asked)?;
        let before = self.channels.answers.waited();
        self.channels.answers.receive(&self.channels.back, &mut self.found)?;
        let waited = self.channels.answers.waited() - before;
        seconds.idle += waited.as_secs_f64();
        seconds.exchanging += (start.elapsed() - waited).as_secs_f64();
        Ok(&self.found)
    }
}
