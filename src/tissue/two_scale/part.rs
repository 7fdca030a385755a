//! A rank of the engineering scale as the micro scale sees it: the elements of its part, and the couplings of their RVEs.

use std::collections::HashSet;
use std::time::Instant;

use nalgebra::Matrix3;

use super::TwoScaleError;
use super::terms::{Answer, Header, MACRO, MICRO, Seconds, Strain};
use crate::coupling::{Carrier, Coupling, Even, Scales, UnitId};
use crate::las::Comm;

/// The RVEs of one part of the body.
pub(super) struct Part<C: Comm> {
    coupling: Coupling<C>,
    back: Coupling<C>,
    headers: Carrier<Header>,
    strains: Carrier<Strain>,
    answers: Carrier<Answer>,
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
        let coupling = Coupling::new(scales, MACRO, MICRO, &[], &[], &Even)?;
        let back = coupling.inverse();
        let headers = Carrier::new(&coupling)?;
        let strains = Carrier::new(&coupling)?;
        let answers = Carrier::new(&back)?;
        Ok(Self { coupling, back, headers, strains, answers, asked: Vec::new(), found: Vec::new() })
    }

    /// The elements with an RVE, in the order in which they are asked.
    pub fn elements(&self) -> &[UnitId] {
        self.coupling.units()
    }

    /// Deletes and creates RVEs of this part; all ranks of both scales do so together.
    pub fn change(&mut self, change: &Change, is_own: impl Fn(usize) -> bool) -> Result<(), TwoScaleError> {
        let here: HashSet<UnitId> = self.coupling.units().iter().copied().collect();
        let gone: Vec<UnitId> = change.gone.iter().copied().filter(|unit| here.contains(unit)).collect();
        self.coupling.remove(&gone)?;
        let new: Vec<[u64; 2]> = change.new.iter().copied().filter(|&[element, _]| is_own(element as usize)).collect();
        let units: Vec<UnitId> = new.iter().map(|&[element, _]| element).collect();
        let delta = self.coupling.add(&units, &[], &Even)?;
        let headers: Vec<Header> = new.iter().map(|&[_, region]| Header { region }).collect();
        self.headers.send(&delta, &headers)?;
        self.back = self.coupling.inverse();
        Ok(())
    }

    /// Sends every RVE its gradient, and whether it is awake, and waits for the answers.
    pub fn exchange(
        &mut self,
        strain: impl Fn(usize) -> (Matrix3<f64>, bool),
        seconds: &mut Seconds,
    ) -> Result<&[Answer], TwoScaleError> {
        let start = Instant::now();
        let units = self.coupling.units();
        self.asked.clear();
        self.asked.extend(units.iter().map(|&element| {
            let (gradient, is_awake) = strain(element as usize);
            Strain::new(&gradient, is_awake)
        }));
        self.found.resize(units.len(), Answer::new(0, None));
        self.strains.send(&self.coupling, &self.asked)?;
        let sent = Instant::now();
        self.answers.receive(&self.back, &mut self.found)?;
        seconds.exchanging += (sent - start).as_secs_f64();
        seconds.idle += sent.elapsed().as_secs_f64();
        Ok(&self.found)
    }
}
