//! Couplings: units that one scale, the producer, has and another, the consumer, gets. They are made, changed and reconciled
//! by both scales together, each rank exchanging lists with its neighbors alone.

use std::collections::HashSet;

use thiserror::Error;

use super::data::{Distribution, UnitId};
use super::links::Links;
use super::pattern::Spread;
use super::scale::Scales;
use crate::las::{Comm, CommError, Message, Tag};

/// What a message of a coupling is about.
#[derive(Clone, Copy)]
pub(super) enum About {
    /// Lists of units.
    Lists,
    /// What the first ranks of two scales tell each other.
    First,
    /// Values of units.
    Values,
    /// Layouts of values.
    Layouts,
}

/// Why scales are not coupled.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum CouplingError {
    /// The ranks could not exchange something.
    #[error("coupling {producer} to {consumer}: {error}")]
    Comm {
        /// The one side.
        producer: String,
        /// The other.
        consumer: String,
        /// What happened.
        error: CommError,
    },
    /// A rank calls what the other side is to call.
    #[error("scale {scale} is not the {role} of this coupling")]
    Role {
        /// The scale of the rank.
        scale: String,
        /// What it is not.
        role: &'static str,
    },
    /// There is no such scale.
    #[error("there is no scale {0}")]
    Scale(String),
    /// A scale on both sides.
    #[error("scale {0} is to be coupled with itself; a coupling is of two scales")]
    Itself(String),
    /// A unit was added that is there, or removed that is not.
    #[error("unit {unit} {what}")]
    Unit {
        /// Its number.
        unit: UnitId,
        /// What is wrong with it.
        what: &'static str,
    },
    /// The spread is not one of these units over these ranks.
    #[error("{units} units were spread to {found} places, the last of rank {last} among {ranks}")]
    Spread {
        /// Units of this rank.
        units: usize,
        /// Places that the algorithm gave.
        found: usize,
        /// The largest rank among them.
        last: usize,
        /// Ranks of the consumer.
        ranks: usize,
    },
    /// Data are not one value a unit.
    #[error("{found} values for {units} units")]
    Values {
        /// Values given.
        found: usize,
        /// Units of this rank.
        units: usize,
    },
    /// Receiving was started for other units than it is finished for.
    #[error("receiving from {producer} on {consumer} was started before units came or went: finish it before they do")]
    Changed {
        /// Where the values come from.
        producer: String,
        /// Where they go to.
        consumer: String,
    },
    /// The two sides state different layouts.
    #[error("{producer} and {consumer} exchange different data: here {here}, there {there}")]
    Layout {
        /// The one side.
        producer: String,
        /// The other.
        consumer: String,
        /// The layout on this side.
        here: String,
        /// The layout on the other.
        there: String,
    },
}

/// The side of a coupling that a rank is on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// It has the units.
    Producer,
    /// It gets them.
    Consumer,
}

/// Units that a producer has and a consumer gets.
#[derive(Clone, Debug)]
pub struct Coupling<C: Comm> {
    /// All ranks of the program.
    pub(super) comm: C,
    /// What tells its messages from those of other couplings of the two scales.
    number: u32,
    /// The ranks of this side.
    own: C,
    pub(super) role: Role,
    /// Names of the producer and the consumer.
    names: [String; 2],
    /// The ranks in `comm` of this side and of the other.
    pub(super) here: Vec<usize>,
    pub(super) there: Vec<usize>,
    pub(super) links: Links,
}

/// What came to a coupling: the new units alone, in the order in which they stand behind the old ones.
pub type Delta<C> = Coupling<C>;

impl<C: Comm> Coupling<C> {
    /// Couples two scales. Called by all ranks of both together, with the same names in the same order, and of no other; a rank
    /// of the producer gives its units and what they weigh (nothing for 1 each), a rank of the consumer gives none. Several
    /// couplings of two scales are made in the same order on both.
    ///
    /// # Errors
    /// [`CouplingError`].
    pub fn new(
        scales: &Scales<C>,
        producer: &str,
        consumer: &str,
        units: &[UnitId],
        weights: &[f64],
        spread: &impl Spread,
    ) -> Result<Self, CouplingError> {
        let mut coupling = Self::empty(scales, producer, consumer)?;
        match coupling.role {
            Role::Producer => drop(coupling.add(units, weights, spread)?),
            Role::Consumer => drop(coupling.reconcile()?),
        }
        Ok(coupling)
    }

    fn empty(scales: &Scales<C>, producer: &str, consumer: &str) -> Result<Self, CouplingError> {
        let find = |name: &str| scales.find(name).ok_or_else(|| CouplingError::Scale(name.to_owned()));
        let (first, second) = (find(producer)?, find(consumer)?);
        if first == second {
            return Err(CouplingError::Itself(producer.to_owned()));
        }
        let names = [producer.to_owned(), consumer.to_owned()];
        let ranks = |scale: usize| scales.ranks(scale).to_vec();
        let (role, here, there) = match scales.own() {
            own if own == first => (Role::Producer, ranks(first), ranks(second)),
            own if own == second => (Role::Consumer, ranks(second), ranks(first)),
            own => {
                return Err(CouplingError::Role { scale: scales.name(own).to_owned(), role: "producer or consumer" });
            }
        };
        let (comm, number) = (scales.world().clone(), scales.next_coupling(first, second));
        Ok(Self { comm, number, own: scales.comm().clone(), role, names, here, there, links: Links::default() })
    }

    /// The side that this rank is on.
    #[must_use]
    pub fn role(&self) -> Role {
        self.role
    }

    /// The units of this rank, in the order of its data.
    #[must_use]
    pub fn units(&self) -> &[UnitId] {
        &self.links.units
    }

    /// The ranks of the other scale, by their rank in it, that this rank exchanges with, and how many units with each.
    pub fn neighbors(&self) -> impl Iterator<Item = (usize, usize)> {
        self.links.neighbors.iter().map(|neighbor| (neighbor.rank, neighbor.places.len()))
    }

    /// The coupling the other way: its producer is the consumer of this one, and its consumer the producer; every unit goes
    /// back to where it came from. A copy of now, which needs no other rank and does not follow what is added or removed later.
    #[must_use]
    pub fn inverse(&self) -> Self {
        let role = match self.role {
            Role::Producer => Role::Consumer,
            Role::Consumer => Role::Producer,
        };
        let [producer, consumer] = self.names.clone();
        Self { role, names: [consumer, producer], ..self.clone() }
    }

    /// Adds units, on the producer; all its ranks call this together, those without new units too, and those of the consumer
    /// [`reconcile`](Self::reconcile). Gives a coupling of the new units alone, for what only they need. The weights are one a
    /// unit, or none, which is 1 for each. Units that are there stay where they are. A coupling that was made by
    /// [`inverse`](Self::inverse) before is of the units of then: take it anew.
    ///
    /// An error is of one rank, and leaves the others waiting for it: it is to end the run.
    ///
    /// That no other rank adds the same unit is the caller's part: it is found only where both come to one consumer.
    ///
    /// # Errors
    /// [`CouplingError`].
    pub fn add(&mut self, units: &[UnitId], weights: &[f64], spread: &impl Spread) -> Result<Delta<C>, CouplingError> {
        self.must_be(Role::Producer)?;
        let mut known: HashSet<UnitId> = self.links.units.iter().copied().collect();
        if let Some(&unit) = units.iter().find(|&&unit| !known.insert(unit)) {
            return Err(CouplingError::Unit { unit, what: "is in this coupling already" });
        }
        let ones = vec![1.0; units.len()];
        let weights = if weights.is_empty() { &ones } else { weights };
        if weights.len() != units.len() {
            return Err(CouplingError::Values { found: weights.len(), units: units.len() });
        }
        let mut distribution = Distribution::assemble(&self.own, weights).map_err(|error| self.failed(error))?;
        distribution.held = self.held().map_err(|error| self.failed(error))?;
        let to = spread.spread(&distribution, self.own.rank(), self.there.len());
        let (last, ranks) = (to.iter().copied().max().unwrap_or(0), self.there.len());
        if to.len() != units.len() || last >= ranks {
            return Err(CouplingError::Spread { units: units.len(), found: to.len(), last, ranks });
        }
        let new = Links::new(units, &to);
        self.announce(&new).map_err(|error| self.failed(error))?;
        self.links.append(units, &to);
        Ok(Self { links: new, ..self.clone() })
    }

    /// The units of each rank of the consumer: the same on all of the producer.
    fn held(&self) -> Result<Vec<usize>, CommError> {
        let mut held = vec![0.0; self.there.len()];
        self.neighbors().for_each(|(rank, count)| held[rank] = count as f64);
        self.own.sum(&mut held)?;
        Ok(held.into_iter().map(|count| count as usize).collect())
    }

    /// Tells the consumer who will send how much to whom, and then each neighbor its units.
    fn announce(&self, new: &Links) -> Result<(), CommError> {
        let rows: Vec<[u64; 3]> = new
            .neighbors
            .iter()
            .map(|neighbor| [self.own.rank(), neighbor.rank, neighbor.places.len()].map(|number| number as u64))
            .collect();
        let table = self.own.gather(0, Message::of(bytemuck::cast_slice::<_, u64>(&rows)))?;
        if let Some(table) = table {
            let all: Vec<u64> = table.iter().filter_map(|row| row.values::<u64>()).flatten().copied().collect();
            self.comm.send(self.there[0], self.tag(About::First), Message::of(&all))?;
        }
        for neighbor in &new.neighbors {
            let units: Vec<UnitId> = new.units_of(neighbor).collect();
            self.comm.send(self.there[neighbor.rank], self.tag(About::Lists), Message::of(&units))?;
        }
        Ok(())
    }

    /// Takes in what the producer [`add`](Self::add)s, on the consumer. Gives a coupling of the new units alone.
    ///
    /// # Errors
    /// [`CouplingError`].
    pub fn reconcile(&mut self) -> Result<Delta<C>, CouplingError> {
        self.must_be(Role::Consumer)?;
        let (units, ranks) = self.announced().map_err(|error| self.failed(error))?;
        let mut known: HashSet<UnitId> = self.links.units.iter().copied().collect();
        if let Some(&unit) = units.iter().find(|&&unit| !known.insert(unit)) {
            return Err(CouplingError::Unit { unit, what: "came twice" });
        }
        self.links.append(&units, &ranks);
        Ok(Self { links: Links::new(&units, &ranks), ..self.clone() })
    }

    /// New units, by rank of the producer, and these ranks.
    fn announced(&self) -> Result<(Vec<UnitId>, Vec<usize>), CommError> {
        let table = match self.own.rank() {
            0 => self.comm.receive(self.there[0], self.tag(About::First))?,
            _ => Message::new(),
        };
        let table = self.own.broadcast(0, table)?;
        let mine = self.own.rank() as u64;
        let rows = table.values::<[u64; 3]>().unwrap_or_default();
        let (mut units, mut ranks) = (Vec::new(), Vec::new());
        for &[from, _, count] in rows.iter().filter(|&&[_, to, _]| to == mine) {
            let (from, count) = (from as usize, count as usize);
            let list = self.comm.receive(self.there[from], self.tag(About::Lists))?;
            let size = CommError::Size { from: self.there[from], found: list.len(), expected: 8 * count };
            let list = list.values::<UnitId>().filter(|list| list.len() == count).ok_or(size)?;
            units.extend_from_slice(list);
            ranks.resize(units.len(), from);
        }
        Ok((units, ranks))
    }

    /// Removes units of this rank, on the producer; all its ranks call this together, and those of the consumer
    /// [`forget`](Self::forget). The other units keep their order. Gives for each of them its index in the data of before, so
    /// that these can follow: `kept.iter().map(|&place| old[place as usize])`. Where units are also added, both sides do both
    /// in the same order.
    ///
    /// # Errors
    /// [`CouplingError`].
    pub fn remove(&mut self, units: &[UnitId]) -> Result<Vec<u32>, CouplingError> {
        self.must_be(Role::Producer)?;
        let gone: HashSet<UnitId> = units.iter().copied().collect();
        let known: HashSet<UnitId> = self.links.units.iter().copied().collect();
        if let Some(&unit) = units.iter().find(|unit| !known.contains(unit)) {
            return Err(CouplingError::Unit { unit, what: "is not in this coupling" });
        }
        for neighbor in &self.links.neighbors {
            let list: Vec<UnitId> = self.links.units_of(neighbor).filter(|unit| gone.contains(unit)).collect();
            let sent = self.comm.send(self.there[neighbor.rank], self.tag(About::Lists), Message::of(&list));
            sent.map_err(|error| self.failed(error))?;
        }
        Ok(self.links.remove(&gone))
    }

    /// Gives up what the producer [`remove`](Self::remove)s, on the consumer. Gives for each unit that stays its index in the
    /// data of before.
    ///
    /// # Errors
    /// [`CouplingError`].
    pub fn forget(&mut self) -> Result<Vec<u32>, CouplingError> {
        self.must_be(Role::Consumer)?;
        let mut gone = HashSet::new();
        for neighbor in &self.links.neighbors {
            let list = self
                .comm
                .receive(self.there[neighbor.rank], self.tag(About::Lists))
                .map_err(|error| self.failed(error))?;
            gone.extend(list.values::<UnitId>().unwrap_or_default());
        }
        Ok(self.links.remove(&gone))
    }

    /// The units between each pair of ranks: a row a rank of the producer, a column a rank of the consumer. The same on all
    /// ranks of this side, which call this together; each side makes it of what it knows itself.
    ///
    /// # Errors
    /// [`CouplingError`].
    pub fn table(&self) -> Result<Vec<Vec<usize>>, CouplingError> {
        let own: Vec<u64> = self.neighbors().flat_map(|(rank, count)| [rank as u64, count as u64]).collect();
        let all = self.own.gather_all(Message::of(&own)).map_err(|error| self.failed(error))?;
        let (producers, consumers) = match self.role {
            Role::Producer => (self.here.len(), self.there.len()),
            Role::Consumer => (self.there.len(), self.here.len()),
        };
        let mut table = vec![vec![0; consumers]; producers];
        for (here, row) in all.iter().enumerate() {
            for &[there, count] in row.values::<[u64; 2]>().unwrap_or_default() {
                match self.role {
                    Role::Producer => table[here][there as usize] = count as usize,
                    Role::Consumer => table[there as usize][here] = count as usize,
                }
            }
        }
        Ok(table)
    }

    pub(super) fn tag(&self, about: About) -> Tag {
        /// Tags below are of scales.
        const FIRST: u32 = 16;
        Tag(FIRST + 4 * self.number + about as u32)
    }

    pub(super) fn own_side(&self) -> &C {
        &self.own
    }

    fn must_be(&self, role: Role) -> Result<(), CouplingError> {
        let (own, name) = match self.role {
            Role::Producer => (&self.names[0], "consumer"),
            Role::Consumer => (&self.names[1], "producer"),
        };
        if self.role == role { Ok(()) } else { Err(CouplingError::Role { scale: own.clone(), role: name }) }
    }

    /// Names the scales in an error.
    pub(super) fn failed(&self, error: CommError) -> CouplingError {
        let [producer, consumer] = self.names.clone();
        CouplingError::Comm { producer, consumer, error }
    }

    pub(super) fn names(&self) -> [String; 2] {
        self.names.clone()
    }
}
