//! Several ranks that solve for a body in step: the root writes, and all continue only if it succeeded.

use std::sync::OnceLock;

use super::other_rank;
use crate::app::results::ResultsError;
use crate::app::run::WriterGroup;
use crate::las::{Comm, Disagreement, Message};

/// The [`WriterGroup`] of several ranks: the root writes.
pub struct RootWriter<'a, C: Comm> {
    /// The ranks of the body.
    pub comm: &'a C,
    /// The reason why ranks are out of step ([`ScaleField::broken`](crate::tissue::two_scale::ScaleField::broken)).
    /// Once it is set, this rank takes part in no agreement, because others may wait for a message that it does not
    /// send.
    pub broken: &'a OnceLock<String>,
}

impl<C: Comm> RootWriter<'_, C> {
    fn check_connected(&self) -> Result<(), ResultsError> {
        self.broken.get().map_or(Ok(()), |reason| Err(other_rank(reason)))
    }
}

impl<C: Comm> WriterGroup for RootWriter<'_, C> {
    fn is_writer(&self) -> bool {
        self.comm.rank() == 0
    }

    fn any(&self, condition: bool) -> Result<bool, ResultsError> {
        self.check_connected()?;
        let mut most = [f64::from(u8::from(condition))];
        self.comm.max(&mut most).map_err(other_rank)?;
        Ok(most[0] > 0.0)
    }

    fn gather(&self, own: Message) -> Result<Option<Vec<Message>>, ResultsError> {
        self.check_connected()?;
        self.comm.gather(0, own).map_err(other_rank)
    }

    fn agree_on(&self, number: usize) -> Result<(), ResultsError> {
        self.check_connected()?;
        let mut span = [number as f64, -(number as f64)];
        self.comm.max(&mut span).map_err(other_rank)?;
        if span[0] == -span[1] {
            return Ok(());
        }
        Err(other_rank(format!("ranks of the body find checkpoints of steps {} to {}", -span[1], span[0])))
    }

    fn agree(&self, outcome: Result<(), ResultsError>) -> Result<(), ResultsError> {
        self.check_connected()?;
        self.comm.agree(outcome).map_err(|disagreement| match disagreement {
            Disagreement::Own(error) => error,
            other => other_rank(other),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backends::comm::thread;

    #[test]
    fn all_ranks_continue_if_the_root_wrote_and_their_steps_agree() {
        let outcome = thread::run(3, |comm| {
            let broken = OnceLock::new();
            let ranks = RootWriter { comm: &comm, broken: &broken };
            assert_eq!(ranks.is_writer(), comm.rank() == 0);
            assert!(ranks.agree(Ok(())).is_ok() && ranks.agree_on(7).is_ok());
            assert!(ranks.any(comm.rank() == 2)? && !ranks.any(false)?);
            let own = if comm.rank() == 0 { Err(other_rank("the disk is full")) } else { Ok(()) };
            assert!(ranks.agree(own).is_err_and(|error| error.to_string().contains("the disk is full")));
            let other = ranks.agree_on(comm.rank());
            assert!(other.is_err_and(|error| error.to_string().contains("checkpoints of steps 0 to 2")));
            Ok::<_, ResultsError>(())
        });
        assert!(outcome.is_ok(), "{outcome:?}");
    }

    /// Other ranks may wait for another message: a rank that knows that communication is broken ends without waiting.
    #[test]
    fn a_rank_whose_communication_is_broken_does_not_wait() {
        let outcome = thread::run(2, |comm| {
            let broken = OnceLock::from("scale micro did not answer".to_owned());
            let ranks = RootWriter { comm: &comm, broken: &broken };
            match comm.rank() {
                0 => ranks.agree(Ok(())).and(ranks.agree_on(1)),
                _ => comm.receive(0, crate::las::Tag::of(1)).map(drop).map_err(other_rank),
            }
        });
        assert!(outcome.is_err_and(|failed| failed.rank == 0 && failed.reason.contains("micro did not answer")));
    }
}
