//! The couplings of the RVEs of one rank, the same on both scales: strains go down, answers come back.

use super::TwoScaleError;
use super::protocol::{Answer, Header, MACRO, MICRO, Strain};
use crate::coupling::{Channel, Coupling, Even, Scales, UnitId};
use crate::las::Comm;

/// What goes between a rank and the RVEs that it has or asks.
pub(super) struct Channels<C: Comm> {
    /// From the macro scale to the micro scale, and back.
    pub down: Coupling<C>,
    pub back: Coupling<C>,
    pub headers: Channel<Header>,
    pub strains: Channel<Strain>,
    pub answers: Channel<Answer>,
}

impl<C: Comm> Channels<C> {
    /// Without RVEs: the first ones come like all others. Called by all ranks of both scales together.
    pub fn new(scales: &Scales<C>) -> Result<Self, TwoScaleError> {
        let down = Coupling::new(scales, MACRO, MICRO, &[], &[], &Even)?;
        let back = down.inverse();
        let headers = Channel::new(&down)?;
        let strains = Channel::new(&down)?;
        let answers = Channel::new(&back)?;
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
