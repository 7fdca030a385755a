//! The couplings of the RVEs of one rank, the same on both scales: strains go down, answers come back.

use super::TwoScaleError;
use super::protocol::{Answer, MACRO, MICRO, NewRve, Strain};
use crate::coupling::{Channel, Coupling, EvenPartition, Scales, UnitId};
use crate::las::Comm;

/// The couplings and channels between a rank and its RVEs (micro scale) or those of its elements (macro scale).
pub(super) struct Channels<C: Comm> {
    /// From the macro scale to the micro scale; `back` is its inverse.
    pub down: Coupling<C>,
    pub back: Coupling<C>,
    pub headers: Channel<NewRve>,
    pub strains: Channel<Strain>,
    pub answers: Channel<Answer>,
}

impl<C: Comm> Channels<C> {
    /// Couples the scales without RVEs; the initial RVEs are added like all later ones. Collective over both scales.
    pub fn new(scales: &Scales<C>) -> Result<Self, TwoScaleError> {
        let down = Coupling::new(scales, MACRO, MICRO, &[], &[], &EvenPartition)?;
        let back = down.inverse();
        let headers = Channel::new(&down)?;
        let strains = Channel::new(&down)?;
        let answers = Channel::new(&back)?;
        Ok(Self { down, back, headers, strains, answers })
    }

    /// The elements with an RVE, in the order of the exchanged values.
    pub fn units(&self) -> &[UnitId] {
        self.down.units()
    }

    /// Updates `back` after RVEs were added or removed.
    pub fn turn_back(&mut self) {
        self.back = self.down.inverse();
    }
}
