//! The couplings of the RVEs of one rank, the same on both scales: strains go down, answers come back.

use super::TwoScaleError;
use super::terms::{Answer, Header, MACRO, MICRO, Strain};
use crate::coupling::{Carrier, Coupling, Even, Scales, UnitId};
use crate::las::Comm;

/// What goes between a rank and the RVEs that it has or asks.
pub(super) struct Links<C: Comm> {
    /// From the engineering scale to the micro scale, and back.
    pub down: Coupling<C>,
    pub back: Coupling<C>,
    pub headers: Carrier<Header>,
    pub strains: Carrier<Strain>,
    pub answers: Carrier<Answer>,
}

impl<C: Comm> Links<C> {
    /// Without RVEs: the first ones come like all others. Called by all ranks of both scales together.
    pub fn new(scales: &Scales<C>) -> Result<Self, TwoScaleError> {
        let down = Coupling::new(scales, MACRO, MICRO, &[], &[], &Even)?;
        let back = down.inverse();
        let headers = Carrier::new(&down)?;
        let strains = Carrier::new(&down)?;
        let answers = Carrier::new(&back)?;
        Ok(Self { down, back, headers, strains, answers })
    }

    /// The elements with an RVE, in the order of what is exchanged.
    pub fn units(&self) -> &[UnitId] {
        self.down.units()
    }

    /// The way back after RVEs have come or gone.
    pub fn turn_back(&mut self) {
        self.back = self.down.inverse();
    }
}
