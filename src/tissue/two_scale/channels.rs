//! The couplings of the RVEs of one rank, the same on both scales: tasks go to the micro scale, responses come back.

use super::TwoScaleError;
use super::protocol::{MACRO, MICRO, NewMatrix, NewRve, RveResponse, RveSummary, RveTask};
use crate::coupling::{Channel, Coupling, EvenPartition, Scales};
use crate::las::Comm;

/// The couplings and channels between a rank and its RVEs (micro scale) or those of its elements (macro scale).
pub(super) struct Channels<C: Comm> {
    /// Its units are the elements with an RVE, in the order of the exchanged values.
    pub to_micro: Coupling<C>,
    /// The inverse of `to_micro`; set again after RVEs were added or removed.
    pub to_macro: Coupling<C>,
    pub new_rves: Channel<NewRve>,
    /// For RVEs whose matrices vary over the body.
    pub new_matrices: Channel<NewMatrix>,
    pub tasks: Channel<RveTask>,
    pub responses: Channel<RveResponse>,
    pub summaries: Channel<RveSummary>,
}

impl<C: Comm> Channels<C> {
    /// Couples the scales without RVEs; the initial RVEs are added like all later ones. Collective over both scales.
    pub fn new(scales: &Scales<C>) -> Result<Self, TwoScaleError> {
        let to_micro = Coupling::new(scales, MACRO, MICRO, &[], &[], &EvenPartition)?;
        let to_macro = to_micro.inverse();
        let (new_rves, new_matrices) = (Channel::new(&to_micro)?, Channel::new(&to_micro)?);
        let tasks = Channel::new(&to_micro)?;
        let (responses, summaries) = (Channel::new(&to_macro)?, Channel::new(&to_macro)?);
        Ok(Self { to_micro, to_macro, new_rves, new_matrices, tasks, responses, summaries })
    }
}
