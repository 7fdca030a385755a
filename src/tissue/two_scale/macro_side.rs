//! The macro scale's side: the material of the body, whose RVEs are on other ranks.

use std::collections::{HashMap, HashSet};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use nalgebra::Matrix3;

use super::TwoScaleError;
use super::micro_proxy::{Lead, MicroProxy};
use super::protocol::{Command, Failed, Outcome, Task, UnitReport};
use super::shard::Change;
use crate::app::case::Case;
use crate::app::results::log::RankSeconds;
use crate::coupling::Scales;
use crate::fem::mesh::Mesh;
use crate::fem::point_field::{PointField, PointResponses};
use crate::las::{Backend, Comm, Scalar};
use crate::tissue::micro_scale::{
    DeformedNetwork, FailedRve, FieldRestoreError, Library, LibraryError, Life, PointFailure, PointSummary, RveStats,
    Sites, TissueFieldError, TissueMaterial, UnitState, check_states, write,
};
use crate::tissue::replay::RveDump;

/// The material of a body whose RVEs are solved by the micro scale.
pub struct ScaleField<'a, C: Comm, B: Backend> {
    micro: MicroProxy<'a, C>,
    library: Library<B>,
    sites: Sites,
    /// The rank of the program that solves the RVE of each element.
    rank_of: Vec<u32>,
    reports: Reports,
    lost: Mutex<Option<FailedRve>>,
    /// The reason why other ranks do not respond or are out of step; once it is set, nothing is exchanged.
    broken: Arc<OnceLock<String>>,
}

/// The last reports of the micro scale.
#[derive(Default)]
struct Reports {
    /// One entry per element.
    units: Vec<Option<UnitReport>>,
    stats: Mutex<RveStats>,
    seconds: Mutex<Vec<Vec<RankSeconds>>>,
    bytes: usize,
}

impl<'a, C: Comm, B: Backend<Scalar = f64>> ScaleField<'a, C, B>
where
    B::Reduced: Scalar,
{
    /// Sets up the materials of a mesh; also returns the warnings of the network reader. Does not communicate.
    ///
    /// # Errors
    /// Returns [`LibraryError`] if a network cannot be read or used, or a region of the mesh has no material.
    pub fn new(
        (scales, lead): (&'a Scales<C>, Lead),
        context: B::Context,
        case: &Case,
        mesh: &Mesh,
    ) -> Result<(Self, Vec<String>), LibraryError> {
        let (library, warnings) = Library::read(context, case)?;
        let sites = Sites::new(&library, case, mesh)?;
        let shard_of = super::partition::partition(mesh, scales.comm().size());
        let elements = sites.len();
        let field = Self {
            micro: MicroProxy::new(scales, lead, shard_of),
            library,
            sites,
            rank_of: vec![scales.world().rank() as u32; elements],
            reports: Reports { units: (0..elements).map(|_| None).collect(), ..Reports::default() },
            lost: Mutex::new(None),
            broken: Arc::default(),
        };
        Ok((field, warnings))
    }

    /// The reason why other ranks do not respond or are out of step, which ends the run; for callers that do not hold
    /// the field.
    #[must_use]
    pub fn broken(&self) -> Arc<OnceLock<String>> {
        Arc::clone(&self.broken)
    }

    /// Records an error in `broken`.
    fn whole<T>(&self, outcome: Result<T, TwoScaleError>) -> Result<T, TwoScaleError> {
        outcome.inspect_err(|error| {
            self.broken.get_or_init(|| error.to_string());
        })
    }

    /// Couples the scales and creates the initial RVEs. From then on the other ranks carry out commands of this one,
    /// until it is dropped.
    ///
    /// # Errors
    /// Returns [`TwoScaleError`] if communication fails.
    pub fn couple(&mut self) -> Result<(), TwoScaleError> {
        self.micro.couple()?;
        let new = self.sites.existing().map(|(element, region)| [element as u64, region as u64]);
        let change = Change { gone: Vec::new(), new: new.collect() };
        self.change(&change)
    }

    /// Deletes and creates RVEs on both scales.
    fn change(&mut self, change: &Change) -> Result<(), TwoScaleError> {
        change.gone.iter().for_each(|&unit| self.reports.units[unit as usize] = None);
        self.micro.change(change)
    }

    /// Deletes and creates the RVEs of these elements, if there are any.
    fn update_rves(&mut self, gone: &[usize], new: &[usize]) -> Result<(), TissueFieldError> {
        if gone.is_empty() && new.is_empty() {
            return Ok(());
        }
        let gone = gone.iter().map(|&element| element as u64).collect();
        let new = new.iter().map(|&element| [element as u64, self.sites.region(element) as u64]).collect();
        let changed = self.change(&Change { gone, new });
        Ok(self.whole(changed)?)
    }

    /// Sends a task to all awake RVEs and stores their responses; returns true if verification replaced any.
    fn ask(
        &mut self,
        task: Task,
        gradients: &[Matrix3<f64>],
        out: &mut PointResponses,
    ) -> Result<bool, TissueFieldError> {
        let answers = self.micro.ask(task, gradients, &self.sites);
        let mut answers = self.whole(answers)?;
        answers.retain(|answer| self.sites.is_awake(answer.element as usize));
        if answers.iter().any(|answer| answer.outcome == Outcome::Failed as u64) {
            let failure = self.explain();
            let failure = self.whole(failure)?;
            self.micro.rest();
            return Err(failure.into());
        }
        for answer in &answers {
            let (element, response) = (answer.element as usize, answer.response());
            write(out, element, &response);
            self.sites.answered(element, &response);
        }
        self.micro.rest();
        Ok(answers.iter().any(|answer| answer.outcome == Outcome::Replaced as u64))
    }

    /// Asks why the last trial state has no response; keeps the data that reproduces the failure.
    fn explain(&mut self) -> Result<PointFailure, TwoScaleError> {
        let Failed { failure, start } = self.micro.explain()?;
        if let Some((model, state, gradient)) = start
            && let Some(rve) = UnitState::from(state).rve
        {
            let (element, gradient) = (failure.element, Matrix3::from_column_slice(&gradient));
            let origin = format!("element {element}");
            let dump = RveDump::new(origin, &self.library.models()[model], (&rve, &gradient), self.library.params());
            *self.lost.get_mut().unwrap_or_else(PoisonError::into_inner) = Some(FailedRve { element, model, dump });
        }
        Ok(failure)
    }

    /// Ends a step on the micro scale and stores its reports.
    fn end_step(&mut self, converged: bool) -> Result<(), TwoScaleError> {
        let (reports, iterations) = self.micro.end_step(converged)?;
        let mut stats = RveStats::default();
        self.reports.bytes = reports.iter().map(|report| report.bytes).sum();
        for (report, &rank) in reports.into_iter().zip(self.micro.ranks()) {
            stats = stats.and(report.stats);
            for unit in report.units {
                let element = unit.element as usize;
                self.rank_of[element] = rank as u32;
                self.reports.units[element] = Some(unit);
            }
        }
        let reports = self.reports.stats.get_mut().unwrap_or_else(PoisonError::into_inner);
        *reports = reports.and(stats);
        self.reports.seconds.get_mut().unwrap_or_else(PoisonError::into_inner).extend(iterations);
        self.micro.rest();
        Ok(())
    }
}

/// Ends the loops of the other ranks however a run ends, except after a broken exchange or in a panic, which ends them.
impl<C: Comm, B: Backend> Drop for ScaleField<'_, C, B> {
    fn drop(&mut self) {
        if self.micro.is_coupled() && self.broken.get().is_none() && !std::thread::panicking() {
            // An error here means that the other ranks have ended.
            let _ = self.micro.complete();
        }
    }
}

impl<C: Comm, B: Backend<Scalar = f64>> PointField for ScaleField<'_, C, B>
where
    B::Reduced: Scalar,
{
    type Error = TissueFieldError;

    fn update(&mut self, gradients: &[Matrix3<f64>], out: &mut PointResponses) -> Result<(), Self::Error> {
        out.resize(gradients.len());
        // Points that need no RVE come first: an inverted element there fails before any RVE is solved.
        for (element, f) in gradients.iter().enumerate() {
            if let Some(answer) = self.sites.respond(element, f)? {
                write(out, element, &answer);
            }
        }
        self.ask(Task::Solve, gradients, out)?;
        Ok(())
    }

    fn verify(&mut self, gradients: &[Matrix3<f64>], out: &mut PointResponses) -> Result<bool, Self::Error> {
        self.ask(Task::Verify, gradients, out)
    }

    fn evolve(&mut self) -> Result<bool, Self::Error> {
        let turnover = self.sites.evolve();
        // Deleted RVEs are kept until the commit, because the step may still fail.
        self.update_rves(&[], &turnover.created)?;
        Ok(!turnover.is_empty())
    }

    fn commit(&mut self) -> Result<(), Self::Error> {
        let ended = self.end_step(true);
        self.whole(ended)?;
        let gone = self.sites.commit();
        self.update_rves(&gone, &[])
    }

    fn revert(&mut self) -> Result<(), Self::Error> {
        if let Some(reason) = self.broken.get() {
            return Err(TissueFieldError::Ranks(reason.clone()));
        }
        let ended = self.end_step(false);
        self.whole(ended)?;
        let created = self.sites.revert();
        self.update_rves(&created, &[])
    }

    fn is_final(error: &Self::Error) -> bool {
        matches!(error, TissueFieldError::Ranks(_))
    }
}

impl<C: Comm, B: Backend<Scalar = f64>> TissueMaterial for ScaleField<'_, C, B>
where
    B::Reduced: Scalar,
{
    type Micro = B;

    fn library(&self) -> &Library<B> {
        &self.library
    }

    fn sites(&self) -> &Sites {
        &self.sites
    }

    fn rve_bytes(&self) -> usize {
        self.reports.bytes
    }

    fn take_stats(&self) -> RveStats {
        std::mem::take(&mut self.reports.stats.lock().unwrap_or_else(PoisonError::into_inner))
    }

    fn take_seconds(&self) -> Vec<Vec<RankSeconds>> {
        std::mem::take(&mut self.reports.seconds.lock().unwrap_or_else(PoisonError::into_inner))
    }

    fn take_lost(&self) -> Option<FailedRve> {
        self.lost.lock().unwrap_or_else(PoisonError::into_inner).take()
    }

    fn summaries(&self) -> Vec<Option<PointSummary>> {
        self.reports.units.iter().map(|unit| unit.as_ref().and_then(|unit| unit.summary.clone())).collect()
    }

    fn deformed_network(&self, element: usize) -> Option<DeformedNetwork> {
        let drawn = self.reports.units.get(element)?.as_ref()?.network.as_ref()?;
        Some(DeformedNetwork {
            network: std::sync::Arc::clone(self.library.models()[drawn.model].network()),
            positions: drawn.positions.clone(),
            stretches: drawn.stretches.clone(),
            forces: drawn.forces.clone(),
        })
    }

    fn ranks(&self) -> [usize; 2] {
        [self.micro.scales.comm().size(), self.micro.ranks().len()]
    }

    fn parts(&self) -> Option<(&[u32], usize)> {
        let parts = self.micro.scales.comm().size();
        (parts > 1).then_some((&*self.micro.shard_of, parts))
    }

    /// Orders the nodes by rank if all ranks solve: the rows of a rank are then mostly those of its own elements.
    fn node_order(&self, mesh: &Mesh) -> Vec<u32> {
        let mut order: Vec<u32> = (0..mesh.nodes().len() as u32).collect();
        if self.micro.lead == Lead::All {
            let mut shard_of = vec![u32::MAX; order.len()];
            for (nodes, &part) in mesh.elements().iter().zip(&self.micro.shard_of) {
                nodes.iter().for_each(|&node| shard_of[node as usize] = shard_of[node as usize].min(part));
            }
            order.sort_by_key(|&node| shard_of[node as usize]);
        }
        order
    }

    fn rank_of(&self, element: usize) -> usize {
        self.rank_of[element] as usize
    }

    fn unit_states(&self) -> impl ExactSizeIterator<Item = UnitState> + '_ {
        let existing = self.sites.existing();
        let all: Vec<_> = existing
            .filter_map(|(e, _)| Some((&self.reports.units[e].as_ref()?.state, self.sites.anchor(e))))
            .collect();
        all.into_iter().map(|(state, anchor)| {
            let state = UnitState::from(state.clone());
            UnitState { answer: anchor.or(state.answer), ..state }
        })
    }

    fn restore_units(&mut self, lives: &[Life], states: Vec<UnitState>) -> Result<(), FieldRestoreError> {
        check_states(&self.sites, &self.library, lives, &states)?;
        let before: HashSet<usize> = self.sites.existing().map(|(element, _)| element).collect();
        self.sites.restore(lives, |_| None);
        let existing: Vec<(usize, usize)> = self.sites.existing().collect();
        let answers: HashMap<usize, _> =
            existing.iter().zip(&states).filter_map(|(&(element, _), state)| Some((element, state.answer?))).collect();
        self.sites.restore(lives, |element| answers.get(&element).copied());
        let now: HashSet<usize> = existing.iter().map(|&(element, _)| element).collect();
        let mut gone: Vec<u64> = before.difference(&now).map(|&element| element as u64).collect();
        gone.sort_unstable();
        let new = existing.iter().filter(|(element, _)| !before.contains(element));
        let change = Change { gone, new: new.map(|&(element, region)| [element as u64, region as u64]).collect() };
        let states = existing.iter().zip(states).map(|(&(element, _), state)| (element as u64, state.into())).collect();
        let told = self.change(&change).and_then(|()| self.micro.broadcast(&Command::Restore(states)));
        self.whole(told).map_err(|error| FieldRestoreError::Ranks(error.to_string()))
    }
}
