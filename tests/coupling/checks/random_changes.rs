//! Random sequences of changes to couplings: every unit arrives exactly once and in order, whichever units are added
//! or removed, and whichever rank of either side they migrate to.

use std::collections::{BTreeMap, HashSet};
use std::ops::Range;

use biotissue::coupling::balance::{Migration, Moves, migrate};
use biotissue::coupling::{
    Channel, Coupling, CouplingError, Distribution, EvenPartition, Plan, Role, Scales, Share, UnitId, WeightedPartition,
};
use biotissue::las::conformance::Random;
use biotissue::las::{Comm, Message};

use super::Outcome;
use super::units::Load;

type Error = Box<dyn std::error::Error>;

/// Runs one random sequence for each seed, between two or three scales.
pub fn every_unit_arrives_once<C: Comm>(comm: &C, seeds: Range<u64>, scales: usize) -> Outcome {
    if comm.size() < scales {
        return Ok(());
    }
    for seed in seeds {
        run_sequence(comm, seed, scales).map_err(|error| format!("seed {seed}: {error}"))?;
    }
    Ok(())
}

/// Creates the couplings of `count` scales and changes them at random, with an exchange after every change.
fn run_sequence<C: Comm>(comm: &C, seed: u64, count: usize) -> Outcome {
    let mut draw = RandomChoices { random: Random::new(seed), next: 0 };
    let scales = Scales::new(comm, &draw.plan(comm.size(), count))?;
    let couplings: &[[&str; 2]] = match count {
        2 => &[["a", "b"]],
        _ => &[["a", "b"], ["b", "c"], ["c", "a"], ["b", "a"]],
    };
    let mut tested = Vec::new();
    for &names in couplings {
        tested.push(TestedCoupling::new(&scales, names, &mut draw)?);
    }
    for step in 0..=draw.random.below(6) {
        let which = draw.random.below(tested.len());
        match draw.random.below(5) {
            0 if step > 0 => tested[which].add_units(&mut draw)?,
            1 if step > 0 => tested[which].remove_units(&mut draw)?,
            2 | 3 if step > 0 => tested[which].migrate_units(&mut draw)?,
            _ => {}
        }
        for coupling in &mut tested {
            coupling.exchange()?;
        }
    }
    tested.iter().try_for_each(|coupling| coupling.check_distribution(comm))
}

/// The random choices, which are the same on all ranks.
struct RandomChoices {
    random: Random,
    /// The number of the next unit.
    next: UnitId,
}

impl RandomChoices {
    /// Draws the numbers of ranks, at least one, of the scales `a`, `b` and so on.
    fn plan(&mut self, ranks: usize, scales: usize) -> Plan {
        let (mut plan, mut left) = (Plan::default(), ranks);
        for (name, more) in ["a", "b", "c"].into_iter().zip((0..scales).rev()) {
            let count = if more == 0 { left } else { 1 + self.random.below(left - more) };
            plan = plan.with(name, Share::Count(count));
            left -= count;
        }
        plan
    }

    /// Draws up to `most` new units for each rank of a producer.
    fn units(&mut self, producers: usize, most: usize) -> Vec<Vec<UnitId>> {
        (0..producers)
            .map(|_| {
                let first = self.next;
                self.next += 7 * self.random.below(most + 1) as u64;
                (first..self.next).step_by(7).collect()
            })
            .collect()
    }
}

/// A coupling, and the units that it is expected to have.
struct TestedCoupling<C: Comm> {
    /// The side of this rank; `None` on the ranks of a third scale, which only draw the same random numbers.
    side: Option<Side<C>>,
    /// The expected units, by rank of the producer; the order is that of the data on this rank only.
    expected: Vec<Vec<UnitId>>,
    /// Number of ranks of the consumer.
    consumers: usize,
}

impl<C: Comm> TestedCoupling<C> {
    fn new(scales: &Scales<C>, names: [&str; 2], draw: &mut RandomChoices) -> Result<Self, Error> {
        let ranks = |name| Ok::<_, Error>(scales.ranks(scales.find(name).ok_or("there is no such scale")?).len());
        let (expected, consumers) = (draw.units(ranks(names[0])?, 9), ranks(names[1])?);
        let partition = draw.random.below(3);
        let own = scales.name(scales.own());
        let rank = scales.comm().rank();
        let units: &[UnitId] = if own == names[0] { &expected[rank] } else { &[] };
        let side = if names.contains(&own) { Some(Side::new(scales, names, units, partition)?) } else { None };
        Ok(Self { side, expected, consumers })
    }

    /// Adds units and exchanges the values of these units only.
    fn add_units(&mut self, draw: &mut RandomChoices) -> Result<(), CouplingError> {
        let new = draw.units(self.expected.len(), 4);
        if let Some(side) = &mut self.side {
            side.add_units(&new)?;
        }
        self.expected.iter_mut().zip(new).for_each(|(expected, new)| expected.extend(new));
        Ok(())
    }

    /// Removes about a third of the units.
    fn remove_units(&mut self, draw: &mut RandomChoices) -> Result<(), CouplingError> {
        let removed: HashSet<UnitId> = self.all_units().into_iter().filter(|_| draw.random.below(3) == 0).collect();
        if let Some(side) = &mut self.side {
            side.remove_units(&removed)?;
        }
        self.expected.iter_mut().for_each(|expected| expected.retain(|unit| !removed.contains(unit)));
        Ok(())
    }

    /// Moves about half of the units of the producer or of the consumer to other ranks of the same scale. Then, at
    /// times, takes the permutation on one of the sides.
    fn migrate_units(&mut self, draw: &mut RandomChoices) -> Outcome {
        let moved = [Role::Producer, Role::Consumer][draw.random.below(2)];
        let ranks = if moved == Role::Producer { self.expected.len() } else { self.consumers };
        let targets = self.all_units().into_iter().map(|unit| (unit, draw.random.below(2 * ranks)));
        let targets: BTreeMap<UnitId, usize> = targets.filter(|&(_, to)| to < ranks).collect();
        let (is_announced, permuted) = (draw.random.below(3) == 0, draw.random.below(4));
        if let Some(side) = &mut self.side {
            side.migrate_units(moved, &targets, is_announced)?;
        }
        if moved == Role::Producer {
            let all = std::mem::replace(&mut self.expected, vec![Vec::new(); ranks]);
            for (rank, unit) in
                all.into_iter().enumerate().flat_map(|(rank, units)| units.into_iter().map(move |u| (rank, u)))
            {
                self.expected[targets.get(&unit).copied().unwrap_or(rank)].push(unit);
            }
        }
        let Some(side) = &mut self.side else { return Ok(()) };
        if moved == Role::Producer && side.coupling.role() == Role::Producer {
            let (mut found, mut expected) = (side.coupling.units().to_vec(), self.expected[side.rank].clone());
            self.expected[side.rank].clone_from(&found);
            found.sort_unstable();
            expected.sort_unstable();
            assert_eq!(found, expected);
        }
        if permuted == side.coupling.role() as usize {
            let former = side.coupling.units().to_vec();
            let order = side.coupling.take_permutation();
            let reordered: Vec<UnitId> = order.into_iter().map(|index| former[index as usize]).collect();
            assert_eq!(reordered, side.coupling.units());
            if side.coupling.role() == Role::Producer {
                self.expected[side.rank] = reordered;
            }
        }
        Ok(())
    }

    /// Returns all units in ascending order, the same on all ranks.
    fn all_units(&self) -> Vec<UnitId> {
        let mut all = self.expected.concat();
        all.sort_unstable();
        all
    }

    fn exchange(&mut self) -> Result<(), CouplingError> {
        let Some(side) = &mut self.side else { return Ok(()) };
        if side.coupling.role() == Role::Producer {
            assert_eq!(side.coupling.units(), self.expected[side.rank], "the order of the units");
        }
        exchange(&side.coupling, &mut side.there, &mut side.back)
    }

    /// Checks that each unit is on one rank of each side, and that both sides compute the same table.
    fn check_distribution(&self, comm: &C) -> Outcome {
        let units = self.side.as_ref().map_or_else(Vec::new, |side| side.coupling.units().to_vec());
        let mut count = BTreeMap::new();
        for message in comm.gather_all(Message::of(&units))? {
            for &unit in message.values::<UnitId>().unwrap_or_default() {
                *count.entry(unit).or_insert(0) += 1;
            }
        }
        let expected = self.expected.iter().map(Vec::len).sum::<usize>();
        assert!(count.len() == expected && count.values().all(|&count| count == 2), "{count:?}");
        let table = self.side.as_ref().map_or_else(|| Ok(Vec::new()), |side| side.coupling.table())?;
        let table: Vec<u64> = table.into_iter().flatten().map(|count| count as u64).collect();
        let mut tables = comm.gather_all(Message::of(&table))?;
        // The ranks of a third scale have no table.
        tables.retain(|table| !table.is_empty());
        assert!(tables.windows(2).all(|pair| pair[0] == pair[1]), "{tables:?}");
        let sum = tables[0].values::<u64>().unwrap_or_default().iter().sum::<u64>();
        assert_eq!(sum, expected as u64);
        Ok(())
    }
}

/// One side of a coupling, with channels in both directions.
struct Side<C: Comm> {
    coupling: Coupling<C>,
    scale: C,
    /// The number of this rank within its scale.
    rank: usize,
    there: Channel<Load>,
    back: Channel<f64>,
}

impl<C: Comm> Side<C> {
    fn new(scales: &Scales<C>, names: [&str; 2], units: &[UnitId], partition: usize) -> Result<Self, CouplingError> {
        let [from, to] = names;
        let weights: Vec<f64> = units.iter().map(|unit| (1 + unit % 5) as f64).collect();
        let one_consumer = |_: &Distribution, rank: usize, consumers: usize| vec![rank % consumers; units.len()];
        let coupling = match partition {
            0 => Coupling::new(scales, from, to, units, &[], &EvenPartition)?,
            1 => Coupling::new(scales, from, to, units, &weights, &WeightedPartition)?,
            _ => Coupling::new(scales, from, to, units, &[], &one_consumer)?,
        };
        let (there, back) = (Channel::new(&coupling)?, Channel::new(&coupling.inverse())?);
        Ok(Self { coupling, scale: scales.comm().clone(), rank: scales.comm().rank(), there, back })
    }

    fn add_units(&mut self, new: &[Vec<UnitId>]) -> Result<(), CouplingError> {
        let before = self.there.sent();
        let delta = match self.coupling.role() {
            Role::Producer => self.coupling.add(&new[self.rank], &[], &EvenPartition)?,
            Role::Consumer => self.coupling.reconcile_added()?,
        };
        exchange(&delta, &mut self.there, &mut self.back)?;
        if self.coupling.role() == Role::Producer {
            // Only the data of the new units is sent.
            assert_eq!(self.there.sent() - before, 16 * new[self.rank].len() as u64);
        }
        Ok(())
    }

    fn remove_units(&mut self, removed: &HashSet<UnitId>) -> Result<(), CouplingError> {
        let before = self.coupling.units().to_vec();
        let kept = match self.coupling.role() {
            Role::Producer => {
                let own: Vec<UnitId> = before.iter().copied().filter(|unit| removed.contains(unit)).collect();
                self.coupling.remove(&own)?
            }
            Role::Consumer => self.coupling.reconcile_removed()?,
        };
        let kept: Vec<UnitId> = kept.into_iter().map(|index| before[index as usize]).collect();
        assert_eq!(kept, self.coupling.units());
        Ok(())
    }
}

impl<C: Comm> Side<C> {
    /// Moves the units with a target on the scale with the role `moved`, together with data of theirs, or else only
    /// announces their migration.
    fn migrate_units(&mut self, moved: Role, targets: &BTreeMap<UnitId, usize>, is_announced: bool) -> Outcome {
        if self.coupling.role() != moved {
            let before = self.coupling.units().to_vec();
            self.coupling.reconcile_migrated()?;
            assert_eq!(self.coupling.units(), before);
            return Ok(());
        }
        let before = self.coupling.units().to_vec();
        let mut moves = Moves::default();
        for (index, unit) in (0..).zip(&before) {
            if let Some(&to) = targets.get(unit).filter(|&&to| to != self.rank) {
                moves = moves.with(&[index], to);
            }
        }
        if is_announced {
            let migration = Migration::announce(&self.scale, &moves, &before)?;
            self.coupling.migrate(&migration)?;
            let stayed = migration.stayed().iter().map(|&index| &before[index as usize]);
            assert!(self.coupling.units().iter().take(migration.stayed().len()).eq(stayed));
            return Ok(());
        }
        // The data of a unit: its number, as often as is different for each.
        let data = |unit: UnitId| Message::of(&vec![unit; 1 + (unit % 4) as usize]);
        let (migration, arrived) = migrate(&self.scale, &moves, &before, |index| data(before[index]))?;
        let is_complete = |message: &Message| message.values().is_some_and(|units: &[u64]| *message == data(units[0]));
        assert!(arrived.iter().all(is_complete));
        assert!(migration.arrived().is_sorted() && migration.arrived().len() == arrived.len());
        let arrived = arrived.iter().map(|message| message.values::<u64>().unwrap_or_default()[0]).collect();
        let data = migration.apply(before, arrived)?;
        self.coupling.migrate(&migration)?;
        assert_eq!(self.coupling.units(), data);
        Ok(())
    }
}

/// Sends the number of every unit and checks the values that arrive; then does the same in the other direction.
fn exchange<C: Comm>(
    coupling: &Coupling<C>,
    there: &mut Channel<Load>,
    back: &mut Channel<f64>,
) -> Result<(), CouplingError> {
    let loads: Vec<Load> = coupling.units().iter().map(|&unit| Load { unit, value: 0.5 * unit as f64 }).collect();
    let expected: Vec<f64> = coupling.units().iter().map(|&unit| 3.0 * unit as f64).collect();
    let inverse = coupling.inverse();
    match coupling.role() {
        Role::Producer => {
            let mut answers = vec![f64::NAN; loads.len()];
            // Each rank may choose between one call and two.
            if loads.len().is_multiple_of(2) {
                there.send(coupling, &loads)?;
                back.receive(&inverse, &mut answers)?;
            } else {
                let (underway, arriving) = (there.start(coupling, &loads)?, back.start_receive(&inverse)?);
                back.finish_receive(&inverse, arriving, &mut answers)?;
                there.finish(coupling, underway)?;
            }
            assert_eq!(answers, expected);
        }
        Role::Consumer => {
            let mut found = vec![Load { unit: u64::MAX, value: 0.0 }; loads.len()];
            if loads.len().is_multiple_of(2) {
                there.receive(coupling, &mut found)?;
            } else {
                let arriving = there.start_receive(coupling)?;
                there.finish_receive(coupling, arriving, &mut found)?;
            }
            assert_eq!(found, loads);
            back.send(&inverse, &expected)?;
        }
    }
    Ok(())
}
