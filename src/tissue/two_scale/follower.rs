//! The other ranks of the macro scale if the first one solves for the body: each exchanges with the RVEs of its part.

use std::time::Instant;

use serde::{Deserialize, Serialize};

use super::TwoScaleError;
use super::protocol::{Seconds, Strain, unpack};
use super::shard::{Change, Shard};
use crate::coupling::Scales;
use crate::fem::mesh::Mesh;
use crate::las::{Comm, Message, Tag};

/// Gradients to the rank of a part, and answers from it.
pub(super) const GRADIENTS: Tag = Tag::of(0);
pub(super) const ANSWERS: Tag = Tag::of(1);
/// Busy, idle and exchange times from the rank of a part.
pub(super) const SECONDS: Tag = Tag::of(2);

/// A command of the first rank of the macro scale to the others.
#[derive(Serialize, Deserialize)]
pub(super) enum Order {
    /// Delete and create RVEs: elements whose RVEs are deleted; elements with new RVEs and their regions.
    Change(Vec<u64>, Vec<[u64; 2]>),
    /// Receive gradients, exchange with the RVEs, and return the answers.
    Exchange,
    /// End of the run.
    End,
}

/// The main function of the other ranks of the macro scale: carries out the commands of the first rank.
///
/// # Errors
/// Returns [`TwoScaleError`] if communication fails or a message does not follow the protocol.
pub fn follow<C: Comm>(scales: &Scales<C>, mesh: &Mesh) -> Result<(), TwoScaleError> {
    let comm = scales.comm();
    let shard_of = super::partition::partition(mesh, comm.size());
    let own = comm.rank() as u32;
    let mut part = Shard::new(scales)?;
    let mut seconds = Seconds::default();
    loop {
        let waiting = Instant::now();
        match unpack(&comm.broadcast(0, Message::new())?)? {
            Order::Change(gone, new) => {
                seconds.idle += waiting.elapsed().as_secs_f64();
                let start = Instant::now();
                part.change(&Change { gone, new }, |element| shard_of[element] == own)?;
                seconds.exchanging += start.elapsed().as_secs_f64();
            }
            Order::Exchange => {
                comm.wait_for(0, GRADIENTS)?;
                seconds.idle += waiting.elapsed().as_secs_f64();
                let start = Instant::now();
                let gradients = comm.receive(0, GRADIENTS)?;
                seconds.exchanging += start.elapsed().as_secs_f64();
                let gradients = gradients.values::<Strain>().ok_or(TwoScaleError::Protocol)?;
                if gradients.len() != part.elements().len() {
                    return Err(TwoScaleError::Protocol);
                }
                let answers = part.exchange(|number, _| gradients[number], &mut seconds)?;
                let start = Instant::now();
                comm.send(0, ANSWERS, Message::of(answers))?;
                seconds.exchanging += start.elapsed().as_secs_f64();
                comm.send(0, SECONDS, Message::of(&std::mem::take(&mut seconds).numbers()))?;
            }
            Order::End => return Ok(()),
        }
    }
}
