//! The engineering scale's side: the material of the body, whose RVEs are on ranks of their own.
//!
//! Each rank of the scale has a part of the elements, whose RVEs it exchanges with. There are two ways to solve for the body:
//! - the first rank does ([`Lead::First`]), and the others [`follow`](super::follow): they get the gradients of their part from it and hand
//!   the answers back;
//! - all ranks do, in step ([`Lead::All`]), on a backend that spreads the linear system over them; every rank gets all answers.

use std::collections::{HashMap, HashSet};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::time::Instant;

use nalgebra::Matrix3;

use super::TwoScaleError;
use super::follower::{ANSWERS, GRADIENTS, Order, SECONDS};
use super::part::{Change, Part};
use super::terms::{Answer, Failed, MICRO, RankReport, Seconds, Strain, Turn, UnitReport, pack};
use crate::coupling::Scales;
use crate::fem::mesh::Mesh;
use crate::fem::point_field::{PointField, PointResponses};
use crate::las::{Backend, Comm, Message, Scalar};
use crate::tissue::case::Case;
use crate::tissue::micro_scale::{
    DeformedNetwork, FieldRestoreError, Library, LibraryError, Life, LostRve, PointFailure, PointSummary, Sites,
    SweepStats, TissueFieldError, TissueMaterial, Turnover, UnitState, check_states, write,
};
use crate::tissue::results::log::RankSeconds;
use crate::tissue::rve_dump::RveDump;

/// Who solves for the body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lead {
    /// The first rank of the engineering scale.
    First,
    /// All its ranks, in step.
    All,
}

/// The material of a body whose RVEs are solved by the micro scale.
pub struct ScaleField<'a, C: Comm, B: Backend> {
    scales: &'a Scales<C>,
    /// The number of the micro scale.
    below: usize,
    lead: Lead,
    library: Library<B>,
    sites: Sites,
    /// The rank of the engineering scale whose part an element is in.
    part_of: Vec<u32>,
    /// The RVEs of the own part, once the scales are coupled.
    part: Option<Part<C>>,
    /// Elements with RVEs, by rank of the engineering scale.
    units: Vec<Vec<u64>>,
    /// The rank of the program that solves the RVE of an element.
    rank_of: Vec<u32>,
    in_step: bool,
    /// Trial state by trial state, rank by rank of the engineering scale.
    iterations: Vec<Vec<Seconds>>,
    since: Instant,
    heard: Heard,
    lost: Mutex<Option<LostRve>>,
    /// Why other ranks do not answer or have lost step: nothing is exchanged any more.
    broken: Arc<OnceLock<String>>,
}

/// What the micro scale said of the last steps.
#[derive(Default)]
struct Heard {
    /// Element by element.
    units: Vec<Option<UnitReport>>,
    stats: Mutex<SweepStats>,
    seconds: Mutex<Vec<Vec<RankSeconds>>>,
    bytes: usize,
}

impl<C: Comm, B: Backend> ScaleField<'_, C, B> {
    /// Ends the loops of the other ranks, and first a step that has not come to its end.
    fn complete(&self) -> Result<(), TwoScaleError> {
        if self.in_step {
            self.tell(&Turn::Reject)?;
            self.hear()?;
        }
        self.order(&Order::End)?;
        self.tell(&Turn::Complete)
    }

    /// What the micro scale says.
    fn hear(&self) -> Result<Message, TwoScaleError> {
        Ok(match self.lead {
            Lead::First => self.scales.listen(self.below)?,
            Lead::All => self.scales.hear(self.below)?,
        })
    }

    fn tell(&self, turn: &Turn) -> Result<(), TwoScaleError> {
        Ok(self.scales.tell(self.below, pack(turn)?)?)
    }

    fn order(&self, order: &Order) -> Result<(), TwoScaleError> {
        let comm = self.scales.comm();
        if comm.size() > 1 && self.lead == Lead::First {
            comm.broadcast(0, pack(order)?)?;
        }
        Ok(())
    }
}

impl<'a, C: Comm, B: Backend<Scalar = f64>> ScaleField<'a, C, B>
where
    B::Reduced: Scalar,
{
    /// The materials of a mesh. Exchanges nothing yet.
    ///
    /// # Errors
    /// [`LibraryError`].
    pub fn new(
        (scales, lead): (&'a Scales<C>, Lead),
        context: B::Context,
        case: &Case,
        mesh: &Mesh,
    ) -> Result<(Self, Vec<String>), LibraryError> {
        let (library, warnings) = Library::read(context, case)?;
        let sites = Sites::new(&library, case, mesh)?;
        let part_of = super::partition::partition(mesh, scales.comm().size());
        let elements = sites.len();
        let field = Self {
            scales,
            below: scales.find(MICRO).unwrap_or(usize::MAX),
            lead,
            library,
            sites,
            part_of,
            part: None,
            units: vec![Vec::new(); scales.comm().size()],
            rank_of: vec![scales.world().rank() as u32; elements],
            in_step: false,
            iterations: Vec::new(),
            since: Instant::now(),
            heard: Heard { units: (0..elements).map(|_| None).collect(), ..Heard::default() },
            lost: Mutex::new(None),
            broken: Arc::default(),
        };
        Ok((field, warnings))
    }

    /// Why other ranks do not answer or have lost step, from which no run recovers: for who holds the run, not the field.
    #[must_use]
    pub fn broken(&self) -> Arc<OnceLock<String>> {
        Arc::clone(&self.broken)
    }

    /// Remembers that ranks do not go on together.
    fn whole<T>(&self, outcome: Result<T, TwoScaleError>) -> Result<T, TwoScaleError> {
        outcome.inspect_err(|error| {
            self.broken.get_or_init(|| error.to_string());
        })
    }

    /// Couples the scales, with the RVEs that there are from the start: from here on the other ranks follow this one, until
    /// it is dropped.
    ///
    /// # Errors
    /// [`TwoScaleError`].
    pub fn couple(&mut self) -> Result<(), TwoScaleError> {
        self.part = Some(Part::new(self.scales)?);
        let new = self.sites.existing().map(|(element, region)| [element as u64, region as u64]);
        let change = Change { gone: Vec::new(), new: new.collect() };
        self.change(&change)
    }

    /// What the ranks of the micro scale say, in their order.
    fn listen<T: for<'de> serde::Deserialize<'de>>(&self, seconds: &mut Seconds) -> Result<Vec<T>, TwoScaleError> {
        let start = Instant::now();
        let said = self.hear()?;
        let heard = Instant::now();
        let all = said.split().ok_or(TwoScaleError::Turn)?;
        let all = all.into_iter().map(|bytes| Ok(postcard::from_bytes(bytes)?)).collect();
        seconds.idle += (heard - start).as_secs_f64();
        seconds.exchanging += heard.elapsed().as_secs_f64();
        all
    }

    /// Deletes and creates RVEs, on both scales.
    fn change(&mut self, change: &Change) -> Result<(), TwoScaleError> {
        self.order(&Order::Change(change.gone.clone(), change.new.clone()))?;
        self.tell(&Turn::Units)?;
        let own = self.scales.comm().rank() as u32;
        let Self { part: Some(part), part_of, .. } = self else { return Err(TwoScaleError::Turn) };
        part.change(change, |element| part_of[element] == own)?;
        // As every rank of the scale does with its own.
        let gone: HashSet<u64> = change.gone.iter().copied().collect();
        for units in &mut self.units {
            units.retain(|unit| !gone.contains(unit));
        }
        gone.iter().for_each(|&unit| self.heard.units[unit as usize] = None);
        for &[element, _] in &change.new {
            self.units[self.part_of[element as usize] as usize].push(element);
        }
        Ok(())
    }

    /// Asks all RVEs, those of other parts through their ranks.
    fn ask(&mut self, gradients: &[Matrix3<f64>]) -> Result<Vec<Answer>, TwoScaleError> {
        let turn = if std::mem::replace(&mut self.in_step, true) { Turn::Iterate } else { Turn::Step };
        let comm = self.scales.comm().clone();
        let mut seconds = Seconds { busy: self.since.elapsed().as_secs_f64(), ..Seconds::default() };
        let start = Instant::now();
        self.order(&Order::Exchange)?;
        let followers = if self.lead == Lead::First { comm.size() } else { 1 };
        for (rank, units) in self.units.iter().enumerate().take(followers).skip(1) {
            let strain = |&unit: &u64| Strain::new(&gradients[unit as usize], self.sites.is_awake(unit as usize));
            let of_part: Vec<Strain> = units.iter().map(strain).collect();
            comm.send(rank, GRADIENTS, Message::of(&of_part))?;
        }
        self.tell(&turn)?;
        seconds.exchanging += start.elapsed().as_secs_f64();
        let Self { part: Some(part), sites, .. } = self else { return Err(TwoScaleError::Turn) };
        let mut answers =
            part.exchange(|element| (gradients[element], sites.is_awake(element)), &mut seconds)?.to_vec();
        let start = Instant::now();
        let of_parts = match self.lead {
            Lead::First => (1..comm.size()).map(|rank| comm.receive(rank, ANSWERS)).collect::<Result<_, _>>()?,
            Lead::All if comm.size() > 1 => comm.gather_all(Message::of(&std::mem::take(&mut answers)))?,
            Lead::All => Vec::new(),
        };
        for of_part in of_parts {
            answers.extend_from_slice(of_part.values::<Answer>().ok_or(TwoScaleError::Turn)?);
        }
        seconds.idle += start.elapsed().as_secs_f64();
        let all = match self.lead {
            Lead::First => (1..comm.size()).map(|rank| comm.receive(rank, SECONDS)).collect::<Result<_, _>>()?,
            Lead::All => comm.gather_all(Message::of(&seconds.numbers()))?.split_off(1),
        };
        let all = all.iter().map(|message| message.values().and_then(Seconds::of).ok_or(TwoScaleError::Turn));
        self.iterations.push(std::iter::once(Ok(seconds)).chain(all).collect::<Result<_, _>>()?);
        Ok(answers)
    }

    /// The failure of the lowest element.
    fn explain(&mut self) -> Result<PointFailure, TwoScaleError> {
        self.tell(&Turn::Explain)?;
        let failed: Vec<Option<Failed>> = self.listen(&mut Seconds::default())?;
        let first = failed.into_iter().flatten().min_by_key(|failed| failed.failure.element);
        let Failed { failure, start } = first.ok_or(TwoScaleError::Turn)?;
        if let Some((model, state, gradient)) = start
            && let Some(rve) = UnitState::from(state).rve
        {
            let (element, gradient) = (failure.element, Matrix3::from_column_slice(&gradient));
            let origin = format!("element {element}");
            let dump = RveDump::new(origin, &self.library.models()[model], (&rve, &gradient), self.library.params());
            *self.lost.get_mut().unwrap_or_else(PoisonError::into_inner) = Some(LostRve { element, model, dump });
        }
        Ok(failure)
    }

    /// Ends a step on the micro scale, and hears what it says of it.
    fn end_step(&mut self, converged: bool) -> Result<(), TwoScaleError> {
        self.tell(&if converged { Turn::Accept } else { Turn::Reject })?;
        self.in_step = false;
        let mut reporting = Seconds::default();
        let reports: Vec<RankReport> = self.listen(&mut reporting)?;
        if let Some(last) = self.iterations.last_mut().and_then(|ranks| ranks.first_mut()) {
            last.idle += reporting.idle;
            last.exchanging += reporting.exchanging;
        }
        let (above, ranks) = (self.scales.ranks(self.scales.own()), self.scales.ranks(self.below));
        let mut stats = SweepStats::default();
        let mut iterations: Vec<Vec<RankSeconds>> = std::mem::take(&mut self.iterations)
            .into_iter()
            .map(|all| all.into_iter().zip(above).map(|(seconds, &rank)| rank_seconds(rank, seconds)).collect())
            .collect();
        self.heard.bytes = reports.iter().map(|report| report.bytes).sum();
        for (report, &rank) in reports.into_iter().zip(ranks) {
            stats = stats.and(report.stats);
            for (iteration, seconds) in iterations.iter_mut().zip(report.seconds) {
                iteration.push(rank_seconds(rank, seconds));
            }
            for unit in report.units {
                let element = unit.element as usize;
                self.rank_of[element] = rank as u32;
                self.heard.units[element] = Some(unit);
            }
        }
        let heard = self.heard.stats.get_mut().unwrap_or_else(PoisonError::into_inner);
        *heard = heard.and(stats);
        self.heard.seconds.get_mut().unwrap_or_else(PoisonError::into_inner).extend(iterations);
        self.since = Instant::now();
        Ok(())
    }
}

fn rank_seconds(rank: usize, Seconds { busy, idle, exchanging }: Seconds) -> RankSeconds {
    RankSeconds { rank, busy, idle, exchanging }
}

/// However a run ends, the other ranks are told, unless this one ends them all by a panic.
impl<C: Comm, B: Backend> Drop for ScaleField<'_, C, B> {
    fn drop(&mut self) {
        if self.part.is_some() && self.broken.get().is_none() && !std::thread::panicking() {
            // Ranks that cannot be told have ended.
            let _ = self.complete();
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
        // What needs no RVE first: an element that is inside out is found before any RVE is asked.
        for (element, f) in gradients.iter().enumerate() {
            if let Some(answer) = self.sites.respond(element, f)? {
                write(out, element, &answer);
            }
        }
        let answers = self.ask(gradients);
        let mut answers = self.whole(answers)?;
        answers.retain(|answer| self.sites.is_awake(answer.element as usize));
        if answers.iter().any(|answer| answer.failed != 0) {
            let failure = self.explain();
            let failure = self.whole(failure)?;
            self.since = Instant::now();
            return Err(failure.into());
        }
        for answer in &answers {
            let (element, response) = (answer.element as usize, answer.response());
            write(out, element, &response);
            self.sites.answered(element, &response);
        }
        self.since = Instant::now();
        Ok(())
    }

    fn commit(&mut self) -> Result<bool, Self::Error> {
        let ended = self.end_step(true);
        self.whole(ended)?;
        let turnover = self.sites.decide();
        if !(turnover.created.is_empty() && turnover.deleted.is_empty()) {
            let new = turnover.created.iter().map(|&element| [element as u64, self.sites.region(element) as u64]);
            let gone = turnover.deleted.iter().map(|&element| element as u64);
            let changed = self.change(&Change { gone: gone.collect(), new: new.collect() });
            self.whole(changed)?;
        }
        Ok(turnover != Turnover::default())
    }

    fn revert(&mut self) -> Result<(), Self::Error> {
        if let Some(reason) = self.broken.get() {
            return Err(TissueFieldError::Ranks(reason.clone()));
        }
        let ended = self.end_step(false);
        Ok(self.whole(ended)?)
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

    fn rves(&self) -> usize {
        self.sites.rves()
    }

    fn life(&self, element: usize) -> Option<Life> {
        self.sites.life(element)
    }

    fn lives(&self) -> Vec<Life> {
        self.sites.lives()
    }

    fn has_fibers(&self, element: usize) -> bool {
        self.sites.material(element).is_some_and(|(model, _)| model.is_some())
    }

    fn users(&self) -> Vec<usize> {
        self.sites.users(self.library.models().len())
    }

    fn rve_bytes(&self) -> usize {
        self.heard.bytes
    }

    fn take_stats(&self) -> SweepStats {
        std::mem::take(&mut self.heard.stats.lock().unwrap_or_else(PoisonError::into_inner))
    }

    fn take_seconds(&self) -> Vec<Vec<RankSeconds>> {
        std::mem::take(&mut self.heard.seconds.lock().unwrap_or_else(PoisonError::into_inner))
    }

    fn take_lost(&self) -> Option<LostRve> {
        self.lost.lock().unwrap_or_else(PoisonError::into_inner).take()
    }

    fn summaries(&self) -> Vec<Option<PointSummary>> {
        self.heard.units.iter().map(|unit| unit.as_ref().and_then(|unit| unit.summary.clone())).collect()
    }

    fn deformed_network(&self, element: usize) -> Option<DeformedNetwork> {
        let drawn = self.heard.units.get(element)?.as_ref()?.network.as_ref()?;
        Some(DeformedNetwork {
            network: std::sync::Arc::clone(self.library.models()[drawn.model].network()),
            positions: drawn.positions.clone(),
            stretches: drawn.stretches.clone(),
            forces: drawn.forces.clone(),
        })
    }

    fn ranks(&self) -> [usize; 2] {
        [self.scales.comm().size(), self.scales.ranks(self.below).len()]
    }

    fn parts(&self) -> Option<(&[u32], usize)> {
        let parts = self.scales.comm().size();
        (parts > 1).then_some((&*self.part_of, parts))
    }

    /// Part by part where all ranks solve: the rows of a rank are then about those of its own elements.
    fn node_order(&self, mesh: &Mesh) -> Vec<u32> {
        let mut order: Vec<u32> = (0..mesh.nodes().len() as u32).collect();
        if self.lead == Lead::All {
            let mut part_of = vec![u32::MAX; order.len()];
            for (nodes, &part) in mesh.elements().iter().zip(&self.part_of) {
                nodes.iter().for_each(|&node| part_of[node as usize] = part_of[node as usize].min(part));
            }
            order.sort_by_key(|&node| part_of[node as usize]);
        }
        order
    }

    fn rank_of(&self, element: usize) -> usize {
        self.rank_of[element] as usize
    }

    fn unit_states(&self) -> impl ExactSizeIterator<Item = UnitState> + '_ {
        let existing = self.sites.existing();
        let all: Vec<_> =
            existing.filter_map(|(e, _)| Some((&self.heard.units[e].as_ref()?.state, self.sites.anchor(e)))).collect();
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
        let told = self.change(&change).and_then(|()| self.tell(&Turn::Restore(states)));
        told.map_err(|error| FieldRestoreError::Ranks(error.to_string()))
    }
}
