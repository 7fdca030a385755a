//! The micro scale of a tissue: a formula or a fiber network at every integration point, networks on all cores.

mod formula;
mod library;
mod saved;
mod summary;
mod unit;
mod worker;

use std::sync::{Mutex, PoisonError};

use nalgebra::Matrix3;
use rayon::prelude::*;
use thiserror::Error;

use crate::fem::material::{MaterialError, Response};
use crate::fem::point_field::{PointField, PointResponses};
use crate::fiber::equilibrium::EquilibriumParams;
use crate::fiber::rve::RveModel;
use crate::las::{Backend, Scalar};
use crate::tissue::rve_dump::RveDump;

pub use formula::Formula;
pub use library::LibraryError;
pub use saved::{FieldRestoreError, UnitState};
pub use summary::{DeformedNetwork, PointSummary};
pub use unit::{SweepStats, UnitError};

use unit::Unit;
use worker::{Library, Worker};

/// What answers at one integration point.
#[derive(Clone, Debug)]
enum Site {
    Formula(Formula),
    /// The number of the unit.
    Rve(usize),
}

/// The material of the whole body: the answer to the seam of [`crate::fem::point_field`].
///
/// Networks are solved on all threads of the current rayon pool. Every RVE starts from its own last equilibrium and
/// writes its own answer, so results do not depend on the number of threads or on which thread solved what.
pub struct TissueField<B: Backend> {
    context: B::Context,
    models: Vec<RveModel<B>>,
    sites: Vec<Site>,
    units: Vec<Unit>,
    /// The element of every unit.
    element_of: Vec<usize>,
    workers: Vec<Mutex<Worker<B>>>,
    params: EquilibriumParams,
    predict: bool,
    /// Behind a lock, because whoever watches a run only has the field for reading.
    stats: Mutex<SweepStats>,
    /// The last RVE that found no equilibrium.
    lost: Mutex<Option<LostRve>>,
}

/// An RVE that found no equilibrium.
#[derive(Clone, Debug)]
pub struct LostRve {
    /// Its element, from 0.
    pub element: usize,
    /// Everything that repeats the failure.
    pub dump: RveDump,
}

/// A point without an answer.
#[derive(Clone, Debug, Error, PartialEq)]
#[error("element {element}{}: {reason}", network.as_ref().map(|n| format!(" (network {n})")).unwrap_or_default())]
pub struct TissueFieldError<F: std::error::Error + 'static> {
    /// The element, from 0.
    pub element: usize,
    /// The network there, if there is one.
    pub network: Option<String>,
    /// Why.
    pub reason: UnitError<F>,
}

impl<B: Backend<Scalar = f64>> TissueField<B>
where
    B::Reduced: Scalar,
{
    /// Number of RVEs.
    #[must_use]
    pub fn rves(&self) -> usize {
        self.units.len()
    }

    /// The networks in use.
    #[must_use]
    pub fn models(&self) -> &[RveModel<B>] {
        &self.models
    }

    /// What the RVEs have taken since this was last asked.
    pub fn take_stats(&self) -> SweepStats {
        std::mem::take(&mut self.stats.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// For every network of [`TissueField::models`] the number of RVEs that use it.
    #[must_use]
    pub fn users(&self) -> Vec<usize> {
        let mut users = vec![0; self.models.len()];
        for fibers in self.units.iter().filter_map(|unit| unit.fibers.as_ref()) {
            users[fibers.model] += 1;
        }
        users
    }

    /// Bytes that all RVEs own in a run: states, last answers, and what the next solves start from.
    #[must_use]
    pub fn rve_bytes(&self) -> usize {
        self.units.iter().map(|unit| unit.bytes(self.predict)).sum()
    }

    /// Whether there are fibers in an element.
    #[must_use]
    pub fn has_fibers(&self, element: usize) -> bool {
        self.unit_of(element).is_some_and(|unit| unit.fibers.is_some())
    }

    /// The unit of an element, `None` where a formula answers or there is no such element.
    fn unit_of(&self, element: usize) -> Option<&Unit> {
        match self.sites.get(element)? {
            Site::Formula(_) => None,
            Site::Rve(unit) => self.units.get(*unit),
        }
    }

    fn solve_units(&mut self, gradients: &[Matrix3<f64>]) -> Result<(), TissueFieldError<B::Fault>> {
        let Self { context, models, units, element_of, workers, params, predict, .. } = self;
        let library = Library { context, models, params, predict: *predict };
        let (stats, failed) = units
            .par_iter_mut()
            .enumerate()
            .map(|(number, unit)| {
                let slot = rayon::current_thread_index().unwrap_or(0) % workers.len();
                // A worker is scratch: whatever a panicking thread left in it is overwritten.
                let mut worker = workers[slot].lock().unwrap_or_else(PoisonError::into_inner);
                let mut stats = SweepStats::default();
                let gradient = &gradients[element_of[number]];
                let outcome = unit.respond(gradient, &library, &mut worker, &mut stats);
                (stats, outcome.err().map(|reason| (number, reason)))
            })
            .reduce(|| (SweepStats::default(), None), |(a, first), (b, second)| (a.and(b), earlier(first, second)));
        let sum = self.stats.get_mut().unwrap_or_else(PoisonError::into_inner);
        *sum = sum.and(stats);
        let Some((number, reason)) = failed else { return Ok(()) };
        let element = self.element_of[number];
        let fibers = self.units[number].fibers.as_ref();
        let network = fibers.map(|f| self.models[f.model].network().name().to_owned());
        if let (UnitError::Rve(_), Some(fibers)) = (&reason, fibers) {
            let origin = format!("element {element}");
            let ends = (&fibers.current, &gradients[element]);
            let dump = RveDump::new(origin, &self.models[fibers.model], ends, &self.params);
            *self.lost.get_mut().unwrap_or_else(PoisonError::into_inner) = Some(LostRve { element, dump });
        }
        Err(TissueFieldError { element, network, reason })
    }

    /// The RVE that made the last update fail, once.
    pub fn take_lost(&self) -> Option<LostRve> {
        self.lost.lock().unwrap_or_else(PoisonError::into_inner).take()
    }
}

/// The failure of the unit with the lower number: the same one whatever the threads did.
fn earlier<E>(a: Option<(usize, E)>, b: Option<(usize, E)>) -> Option<(usize, E)> {
    match (a, b) {
        (Some(a), Some(b)) => Some(if a.0 <= b.0 { a } else { b }),
        (a, b) => a.or(b),
    }
}

impl<B: Backend<Scalar = f64>> PointField for TissueField<B>
where
    B::Reduced: Scalar,
{
    type Error = TissueFieldError<B::Fault>;

    fn update(&mut self, gradients: &[Matrix3<f64>], out: &mut PointResponses) -> Result<(), Self::Error> {
        out.resize(gradients.len());
        // Formulas first: an element that is inside out is found before its RVE is asked.
        for (element, f) in gradients.iter().enumerate() {
            if let Site::Formula(formula) = &self.sites[element] {
                let answer = not_inverted(f).and_then(|()| formula.respond(f));
                let answer = answer.map_err(|e| TissueFieldError { element, network: None, reason: e.into() })?;
                write(out, element, &answer);
            }
        }
        self.solve_units(gradients)?;
        for (unit, &element) in self.units.iter().zip(&self.element_of) {
            if let Some((_, answer)) = &unit.answer {
                write(out, element, answer);
            }
        }
        Ok(())
    }

    fn commit(&mut self) {
        self.units.par_iter_mut().for_each(Unit::commit);
    }

    fn revert(&mut self) {
        self.units.par_iter_mut().for_each(Unit::revert);
    }
}

/// Small-strain formulas have an answer at any gradient, but a body that is inside out is none.
fn not_inverted(f: &Matrix3<f64>) -> Result<(), MaterialError> {
    let determinant = f.determinant();
    if determinant > 0.0 { Ok(()) } else { Err(MaterialError::Inverted { determinant }) }
}

fn write(out: &mut PointResponses, element: usize, answer: &Response) {
    out.energy[element] = answer.energy;
    out.pk1[element] = answer.pk1;
    out.tangent[element] = answer.tangent;
}
