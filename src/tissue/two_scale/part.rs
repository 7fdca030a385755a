//! A rank of the engineering scale as the micro scale sees it: the elements of its part, and the couplings of their RVEs.

use std::collections::HashSet;
use std::time::Instant;

use super::TwoScaleError;
use super::links::Links;
use super::terms::{Answer, Header, Seconds, Strain};
use crate::coupling::{Even, Scales, UnitId};
use crate::las::Comm;

/// The RVEs of one part of the body.
pub(super) struct Part<C: Comm> {
    links: Links<C>,
    asked: Vec<Strain>,
    found: Vec<Answer>,
}

/// What changes of the RVEs of the whole body: elements whose RVEs are deleted, and new ones with their regions.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Change {
    pub gone: Vec<UnitId>,
    pub new: Vec<[u64; 2]>,
}

impl<C: Comm> Part<C> {
    /// Without RVEs. Called by all ranks of both scales together.
    pub fn new(scales: &Scales<C>) -> Result<Self, TwoScaleError> {
        Ok(Self { links: Links::new(scales)?, asked: Vec::new(), found: Vec::new() })
    }

    /// The elements with an RVE, in the order in which they are asked.
    pub fn elements(&self) -> &[UnitId] {
        self.links.units()
    }

    /// Deletes and creates RVEs of this part; all ranks of both scales do so together.
    pub fn change(&mut self, change: &Change, is_own: impl Fn(usize) -> bool) -> Result<(), TwoScaleError> {
        let here: HashSet<UnitId> = self.links.units().iter().copied().collect();
        let gone: Vec<UnitId> = change.gone.iter().copied().filter(|unit| here.contains(unit)).collect();
        self.links.down.remove(&gone)?;
        let new: Vec<[u64; 2]> = change.new.iter().copied().filter(|&[element, _]| is_own(element as usize)).collect();
        let units: Vec<UnitId> = new.iter().map(|&[element, _]| element).collect();
        let delta = self.links.down.add(&units, &[], &Even)?;
        let headers: Vec<Header> = new.iter().map(|&[_, region]| Header { region }).collect();
        self.links.headers.send(&delta, &headers)?;
        self.links.turn_back();
        Ok(())
    }

    /// Sends every RVE what it is asked, and waits for the answers. `strain` gives that for the number and the element of each
    /// of [`Part::elements`].
    pub fn exchange(
        &mut self,
        strain: impl Fn(usize, UnitId) -> Strain,
        seconds: &mut Seconds,
    ) -> Result<&[Answer], TwoScaleError> {
        let start = Instant::now();
        let units = self.links.units();
        self.asked.clear();
        self.asked.extend(units.iter().enumerate().map(|(number, &element)| strain(number, element)));
        self.found.resize(units.len(), Answer::new(0, None, false));
        self.links.strains.send(&self.links.down, &self.asked)?;
        let before = self.links.answers.waited();
        self.links.answers.receive(&self.links.back, &mut self.found)?;
        let waited = self.links.answers.waited() - before;
        seconds.idle += waited.as_secs_f64();
        seconds.exchanging += (start.elapsed() - waited).as_secs_f64();
        Ok(&self.found)
    }
}
