//! RVEs that another processor solves, all of one model at once.
//!
//! A sweep over the RVEs begins with the batches; what they leave is then solved one by one. Which RVE a batch solves
//! depends on nothing but that RVE, so that results do not depend on ranks or threads, nor on the order in which they are
//! taken (`order`): the longest first.

#[cfg(all(test, feature = "sparse"))]
mod tests;

use std::sync::Arc;
use std::time::Instant;

use nalgebra::Matrix3;

use super::activity::Activity;
use super::error::{PointFailure, PointFailureKind};
use super::iterations::IterationCounts;
use super::library::Library;
use super::order::Order;
use super::sweep::GradientOf;
use super::unit::{Origin, RveStats, Unit};
use super::units::Units;
use crate::fem::material::Response;
use crate::fem::mesh::IntegrationPoint;
use crate::fiber::batch::{BatchEquilibrium, BatchProgress};
use crate::fiber::equilibrium::{Stage, StageInProgress};
use crate::fiber::rve::Rve;
use crate::las::RealBackend;
use crate::parallel;

/// What a batch did for each unit: its counters and the change of its deformation gradient; `None` for a unit that is
/// still to be solved.
pub(super) type Done = Vec<Option<(RveStats, f64)>>;

impl<B: RealBackend> Units<B> {
    /// Brings RVEs to equilibrium, those of each model with a solver for batches at once. RVEs without a gradient, or with
    /// an unchanged one, are left alone.
    pub(super) fn solve_batches(&mut self, gradient: &GradientOf<'_>, order: &Order) -> Result<Done, PointFailure> {
        let Self { library, points, units, activity, .. } = self;
        let target_of = |number: usize, unit: &Unit| {
            let target = gradient(number, points[number])?;
            unit.response.is_none_or(|(last, _)| last != target).then_some(target)
        };
        for_each_model(library, units, order, target_of, |model, mut chosen| {
            let Some(mut solver) = library.batch_solver(model) else { return Ok(Vec::new()) };
            let targets: Vec<Matrix3<f64>> = chosen.iter().map(|chosen| chosen.target).collect();
            let predicted: Vec<bool> = chosen.iter().map(|chosen| has_sensitivities(chosen.unit)).collect();
            let progress = Progress::new(activity, &chosen);
            let mut rves: Vec<&mut Rve> = chosen
                .iter_mut()
                .filter_map(|chosen| chosen.unit.fibers.as_mut().map(|fibers| &mut fibers.current))
                .collect();
            let solved = solver.solve(&mut rves, &targets, &library.params, &progress);
            let solved = solved.map_err(|reason| device_failure(&chosen, reason))?;
            let found = chosen.into_iter().zip(predicted).zip(solved);
            let accepted = parallel::map(found, |((chosen, predicted), equilibrium)| {
                let Chosen { number, unit, target } = chosen;
                Some((number, accept(unit, &target, predicted, &equilibrium?)?))
            });
            Ok(accepted.into_iter().flatten().collect())
        })
    }

    /// Verifies the equilibria of RVEs, those of each model with a solver for batches at once.
    pub(super) fn verify_batches(&mut self, gradient: &GradientOf<'_>, order: &Order) -> Result<Done, PointFailure> {
        let Self { library, points, units, .. } = self;
        let target_of = |number: usize, unit: &Unit| {
            let is_open = unit.fibers.as_ref().is_some_and(|fibers| fibers.origin == Origin::Trial);
            if is_open { gradient(number, points[number]) } else { None }
        };
        for_each_model(library, units, order, target_of, |model, mut chosen| {
            let Some(mut solver) = library.batch_solver(model) else { return Ok(Vec::new()) };
            let states = chosen
                .iter()
                .filter_map(|chosen| chosen.unit.fibers.as_ref().map(|fibers| (&fibers.committed, &fibers.current)));
            let (from, reached): (Vec<&Rve>, Vec<&Rve>) = states.unzip();
            let leads = solver.converge_to(&from, &reached, &library.params);
            let leads = leads.map_err(|reason| device_failure(&chosen, reason))?;
            let mut verified = Vec::new();
            for (chosen, _) in chosen.iter_mut().zip(leads).filter(|(_, leads)| *leads) {
                if let Some(fibers) = &mut chosen.unit.fibers {
                    fibers.origin = Origin::Branch;
                }
                let stats = RveStats { verified: 1, ..RveStats::default() };
                verified.push((chosen.number, (stats, 0.0)));
            }
            Ok(verified)
        })
    }
}

/// A unit that a batch takes, with its index and the deformation gradient to reach.
struct Chosen<'a> {
    number: usize,
    unit: &'a mut Unit,
    target: Matrix3<f64>,
}

/// The progress of a batch, whose groups count as their first RVE.
struct Progress<'a> {
    activity: &'a Activity,
    points: Vec<IntegrationPoint>,
    /// Batches know Newton's method only.
    stage: Arc<StageInProgress>,
}

impl<'a> Progress<'a> {
    fn new(activity: &'a Activity, chosen: &[Chosen<'_>]) -> Self {
        let stage = Arc::new(StageInProgress::default());
        stage.set(Some(Stage::Newton));
        Self { activity, points: chosen.iter().map(|chosen| chosen.unit.location).collect(), stage }
    }
}

impl BatchProgress for Progress<'_> {
    fn begin(&self, first: usize) {
        self.activity.begin_group(self.points[first], &self.stage);
    }

    fn end(&self, first: usize, done: usize) {
        self.activity.end_group(self.points[first], done);
    }
}

/// What a batch did: the indices of units, with their counters and the changes of their gradients.
type Outcome = Result<Vec<(usize, (RveStats, f64))>, PointFailure>;

/// Applies `solve` to the units of each model with a solver for batches, all models side by side, so that small batches
/// fill the device together. `target_of` returns the gradient of a unit that takes part. The units of a batch are in the
/// order of their expected iterations, the batches in that of their expected seconds, the most first.
fn for_each_model<B: RealBackend>(
    library: &Library<B>,
    units: &mut [Unit],
    order: &Order,
    target_of: impl Fn(usize, &Unit) -> Option<Matrix3<f64>>,
    solve: impl Fn(usize, Vec<Chosen<'_>>) -> Outcome + Sync,
) -> Result<Done, PointFailure> {
    let mut done: Done = vec![None; units.len()];
    let mut by_model: Vec<Vec<Chosen<'_>>> = library.models.iter().map(|_| Vec::new()).collect();
    for (number, unit) in units.iter_mut().enumerate() {
        let Some(model) = unit.fibers.as_ref().map(|fibers| fibers.model) else { continue };
        if library.has_batch_solver(model)
            && let Some(target) = target_of(number, unit)
        {
            by_model[model].push(Chosen { number, unit, target });
        }
    }
    let mut batches: Vec<_> = by_model.into_iter().enumerate().filter(|(_, chosen)| !chosen.is_empty()).collect();
    batches.iter_mut().for_each(|(_, chosen)| order.by_iterations(chosen, |chosen| chosen.number));
    let seconds = |chosen: &[Chosen<'_>]| order.seconds_of(chosen.iter().map(|chosen| chosen.number));
    batches.sort_by(|(_, a), (_, b)| seconds(b).total_cmp(&seconds(a)));
    let start = Instant::now();
    let outcomes: Vec<Outcome> = parallel::map(batches, |(model, chosen)| solve(model, chosen));
    let seconds = start.elapsed().as_secs_f64();
    for outcome in outcomes {
        outcome?.into_iter().for_each(|(number, counted)| done[number] = Some(counted));
    }
    share_seconds(seconds, &mut done);
    Ok(done)
}

/// Divides the time of all batches, which ran side by side, among the RVEs whose own time is not known: each takes one
/// factorization more than it has iterations.
fn share_seconds(seconds: f64, done: &mut Done) {
    let work = |stats: &RveStats| (1 + stats.iterations) as f64;
    let is_unknown = |stats: &RveStats| stats.seconds == 0.0;
    let sum: f64 = done.iter().flatten().map(|(stats, _)| work(stats)).sum();
    for (stats, _) in done.iter_mut().flatten().filter(|(stats, _)| is_unknown(stats)) {
        stats.seconds = seconds * work(stats) / sum;
    }
}

fn has_sensitivities(unit: &Unit) -> bool {
    unit.fibers.as_ref().is_some_and(|fibers| fibers.current.has_sensitivities())
}

/// Makes an equilibrium the response of a unit; `None` if its matrix has no response, which the solution of this unit
/// alone then reports.
fn accept(
    unit: &mut Unit,
    target: &Matrix3<f64>,
    predicted: bool,
    found: &BatchEquilibrium,
) -> Option<(RveStats, f64)> {
    let matrix = match &unit.matrix {
        Some(formula) => Some(formula.respond(target).ok()?),
        None => None,
    };
    let factor = unit.fibers.as_ref()?.factor;
    let mut response = Response { energy: found.energy, pk1: found.pk1, tangent: found.tangent }.scaled(factor);
    if let Some(matrix) = matrix {
        response.energy += matrix.energy;
        response.pk1 += matrix.pk1;
        response.tangent += matrix.tangent;
    }
    let increment = unit.response.map_or(0.0, |(last, _)| (target - last).norm());
    let fibers = unit.fibers.as_mut()?;
    let is_affine = fibers.origin == Origin::Committed && !predicted;
    fibers.origin = if is_affine { Origin::Branch } else { Origin::Trial };
    unit.response = Some((*target, response));
    unit.iterations += found.iterations;
    let stats = RveStats {
        solves: 1,
        in_batches: 1,
        iterations: found.iterations,
        most_iterations: found.iterations,
        by_iterations: IterationCounts::one(found.iterations),
        line_search_cuts: found.backtracks,
        predicted: usize::from(predicted),
        seconds: found.seconds.unwrap_or(0.0),
        ..RveStats::default()
    };
    Some((stats, increment))
}

/// Reports the failure of a device at the first of the RVEs that it should have solved, of which there is at least one.
fn device_failure(chosen: &[Chosen<'_>], reason: String) -> PointFailure {
    let first = chosen.iter().min_by_key(|chosen| chosen.number).unwrap_or(&chosen[0]);
    let reason = format!("the device that solves the RVEs failed: {reason}");
    PointFailure { point: first.unit.location, network: None, reason, kind: PointFailureKind::Device }
}
