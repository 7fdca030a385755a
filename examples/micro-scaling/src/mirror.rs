//! One rank of any number, alone in its process: what its computations cost if all ranks send what it sends.

use std::time::{Duration, Instant};

use biotissue::coupling::balance::{
    self, BalanceError, Cost, CostHistory, Loads, Moves, Predictor, Quantity, UnitLoads, migrate,
};
use biotissue::coupling::{Comm, CommError, Message};
use biotissue::las::{Disagreement, ReceiveRequest, SendRequest, Tag};

/// Rank 0 of a scale whose other ranks send the same messages to collectives. Other messages to single ranks are dropped.
#[derive(Clone, Copy, Debug)]
pub struct Mirror {
    ranks: usize,
}

/// A message that was dropped.
pub struct Dropped;

impl SendRequest for Dropped {
    fn wait(self) -> Result<Option<Message>, CommError> {
        Ok(None)
    }
}

impl ReceiveRequest for Dropped {
    fn wait(self) -> Result<Message, CommError> {
        Err(nothing_to_receive())
    }
}

fn nothing_to_receive() -> CommError {
    CommError::Library("the other ranks of a mirror send nothing to single ranks".into())
}

impl Comm for Mirror {
    type SendRequest = Dropped;
    type ReceiveRequest = Dropped;

    fn rank(&self) -> usize {
        0
    }

    fn size(&self) -> usize {
        self.ranks
    }

    fn start_send(&self, _: usize, _: Tag, _: Message) -> Result<Dropped, CommError> {
        Ok(Dropped)
    }

    fn receive(&self, _: usize, _: Tag) -> Result<Message, CommError> {
        Err(nothing_to_receive())
    }

    fn wait_for(&self, _: usize, _: Tag) -> Result<(), CommError> {
        Err(nothing_to_receive())
    }

    fn start_receive(&self, _: usize, _: Tag, _: usize, _: Message) -> Result<Dropped, CommError> {
        Ok(Dropped)
    }

    fn probe(&self, _: usize, _: Tag) -> Result<bool, CommError> {
        Ok(false)
    }

    fn split(&self, _: Option<usize>, _: usize) -> Result<Option<Self>, CommError> {
        Ok(Some(*self))
    }

    fn duplicate(&self, _: Option<Duration>) -> Result<Self, CommError> {
        Ok(*self)
    }

    fn barrier(&self) -> Result<(), CommError> {
        Ok(())
    }

    fn broadcast(&self, _: usize, message: Message) -> Result<Message, CommError> {
        Ok(message)
    }

    fn gather(&self, _: usize, message: Message) -> Result<Option<Vec<Message>>, CommError> {
        self.gather_all(message).map(Some)
    }

    fn gather_all(&self, message: Message) -> Result<Vec<Message>, CommError> {
        Ok(vec![message; self.ranks])
    }

    /// Takes the values of as many ranks as rank 0 receives messages in a tree.
    fn sum(&self, values: &mut [f64]) -> Result<(), CommError> {
        let mut distance = 1;
        while distance < self.ranks {
            let message = Message::of(values);
            let others = message.values::<f64>().unwrap_or_default();
            let share = distance.min(self.ranks - distance) as f64 / distance as f64;
            values.iter_mut().zip(others).for_each(|(sum, value)| *sum += share * value);
            distance *= 2;
        }
        Ok(())
    }

    fn max(&self, values: &mut [f64]) -> Result<(), CommError> {
        self.sum(&mut values.to_vec())
    }

    fn agree<T, E: std::fmt::Display>(&self, outcome: Result<T, E>) -> Result<T, Disagreement<E>> {
        self.gather_all(Message::new())?;
        outcome.map_err(Disagreement::Own)
    }
}

/// Seconds that one rank computes in the collectives of load balancing, without the transfer of messages. They are those
/// of the real functions of the library on a [`Mirror`], the least of some repetitions.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LocalSeconds {
    /// `balance::record` with a predictor, and the sum and maximum of the seconds of all ranks: after every sweep.
    pub record: f64,
    /// `Loads::gather_units`: once per plan.
    pub gather: f64,
    /// `migrate`, of one unit: once per migration.
    pub migrate: f64,
}

impl LocalSeconds {
    /// Measures them for a scale of so many ranks, which have `units` units each, of `networks` networks.
    ///
    /// # Errors
    /// Returns [`BalanceError`] if the library reports one.
    pub fn measure(ranks: usize, units: usize, networks: usize) -> Result<Self, BalanceError> {
        let scale = Mirror { ranks };
        let mut predictor = Predictor::new(Quantity::Seconds, networks + 1);
        let cost = |unit: usize| Cost { seconds: 1e-3 * (1 + unit) as f64, iterations: 1.0, ..Cost::default() };
        let costs: Vec<Cost> = (0..units).map(cost).collect();
        let mut histories = vec![CostHistory::new(0); units];
        let weights = vec![1.0; units];
        let bytes = vec![1; units];
        let partners = vec![0; units];
        let own = UnitLoads { weights: &weights, bytes: &bytes, partners: &partners };
        let names: Vec<u64> = (0..units as u64).collect();
        let moves = if ranks > 1 && units > 0 { Moves::default().with(&[0], 1) } else { Moves::default() };
        let record = least(|| {
            balance::record(&scale, &mut predictor, &mut histories, &costs)?;
            scale.sum(&mut [1.0])?;
            scale.max(&mut [1.0]).map_err(BalanceError::from)
        })?;
        let gather = least(|| Loads::gather_units(&scale, own).map(drop))?;
        let migrate = least(|| migrate(&scale, &moves, &names, |_| Message::new()).map(drop))?;
        Ok(Self { record, gather, migrate })
    }
}

/// Returns the least seconds of three calls.
fn least(mut call: impl FnMut() -> Result<(), BalanceError>) -> Result<f64, BalanceError> {
    let mut least = f64::INFINITY;
    for _ in 0..3 {
        let start = Instant::now();
        call()?;
        least = least.min(start.elapsed().as_secs_f64());
    }
    Ok(least)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mirror_runs_the_collectives_of_any_number_of_ranks() {
        let scale = Mirror { ranks: 1000 };
        let loads = Loads::gather(&scale, &[1.0, 2.0], &[5, 6]).unwrap();
        assert_eq!((loads.ranks(), loads.total(), loads.bytes(999, 1)), (1000, 3000.0, 6));
        let mut sums = [2.0];
        scale.sum(&mut sums).unwrap();
        assert_eq!(sums, [2000.0]);
        let moves = Moves::default().with(&[1], 7);
        let (migration, arrived) = migrate(&scale, &moves, &[3, 4], |_| Message::new()).unwrap();
        assert_eq!((migration.stayed(), arrived.len()), (&[0][..], 0));
        let few = LocalSeconds::measure(16, 10, 1).unwrap();
        let many = LocalSeconds::measure(16_384, 10, 1).unwrap();
        assert!(many.record > 0.0 && many.gather > few.gather && many.migrate > few.migrate, "{few:?}, {many:?}");
    }
}
