//! RVEs that another processor solves, all of one model at once.
//!
//! A sweep over the RVEs begins with the batches; what they leave is then solved one by one. Which RVE a batch solves
//! depends on nothing but that RVE, so that results do not depend on ranks or threads.

#[cfg(all(test, feature = "cuda"))]
mod tests;

use std::time::Instant;

use nalgebra::Matrix3;
use rayon::prelude::*;

use super::error::{PointFailure, PointFailureKind};
use super::unit::{Origin, RveStats, Unit};
use super::units::Units;
use crate::fem::material::Response;
use crate::fiber::batch::BatchEquilibrium;
use crate::fiber::rve::Rve;
use crate::las::RealBackend;

/// What a batch did for each unit: its counters and the change of its deformation gradient; `None` for a unit that is
/// still to be solved.
pub(super) type Done = Vec<Option<(RveStats, f64)>>;

impl<B: RealBackend> Units<B> {
    /// Brings RVEs to equilibrium, those of each model with a solver for batches at once. RVEs without a gradient, or with
    /// an unchanged one, are left alone.
    pub(super) fn solve_batches(
        &mut self,
        gradient: &(impl Fn(usize, usize) -> Option<Matrix3<f64>> + Sync),
    ) -> Result<Done, PointFailure> {
        let mut done: Done = vec![None; self.units.len()];
        for model in 0..self.library.models.len() {
            let (library, points, units) = (&self.library, &self.points, &mut self.units);
            let Some(mut solver) = library.batch_solver(model) else { continue };
            let is_new = |unit: &Unit, target: &Matrix3<f64>| unit.response.is_none_or(|(last, _)| last != *target);
            let (mut chosen, mut targets) = (Vec::new(), Vec::new());
            for (number, unit) in units.iter_mut().enumerate() {
                if unit.fibers.as_ref().is_some_and(|fibers| fibers.model == model)
                    && let Some(target) = gradient(number, points[number]).filter(|target| is_new(unit, target))
                {
                    chosen.push((number, unit));
                    targets.push(target);
                }
            }
            if chosen.is_empty() {
                continue;
            }
            let predicted: Vec<bool> = chosen.iter().map(|(_, unit)| has_sensitivities(unit)).collect();
            let start = Instant::now();
            let mut rves: Vec<&mut Rve> = chosen
                .iter_mut()
                .filter_map(|(_, unit)| unit.fibers.as_mut().map(|fibers| &mut fibers.current))
                .collect();
            let solved = solver.solve(&mut rves, &targets, &library.params);
            let seconds = start.elapsed().as_secs_f64() / chosen.len() as f64;
            let solved = solved.map_err(|reason| device_failure(chosen[0].1, reason))?;
            let inputs = chosen.into_par_iter().zip(targets).zip(predicted).zip(solved);
            let accepted: Vec<_> = inputs
                .map(|((((number, unit), target), predicted), equilibrium)| {
                    Some((number, accept(unit, &target, predicted, &equilibrium?, seconds)?))
                })
                .collect();
            accepted.into_iter().flatten().for_each(|(number, counted)| done[number] = Some(counted));
        }
        Ok(done)
    }

    /// Verifies the equilibria of RVEs, those of each model with a solver for batches at once.
    pub(super) fn verify_batches(
        &mut self,
        gradient: &(impl Fn(usize, usize) -> Option<Matrix3<f64>> + Sync),
    ) -> Result<Done, PointFailure> {
        let mut done: Done = vec![None; self.units.len()];
        for model in 0..self.library.models.len() {
            let (library, points, units) = (&self.library, &self.points, &mut self.units);
            let Some(mut solver) = library.batch_solver(model) else { continue };
            let is_open = |unit: &Unit| {
                unit.fibers.as_ref().is_some_and(|fibers| fibers.model == model && fibers.origin == Origin::Trial)
            };
            let mut chosen: Vec<(usize, &mut Unit)> = units
                .iter_mut()
                .enumerate()
                .filter(|(number, unit)| is_open(unit) && gradient(*number, points[*number]).is_some())
                .collect();
            if chosen.is_empty() {
                continue;
            }
            let start = Instant::now();
            let states: Vec<(&Rve, &Rve)> = chosen
                .iter()
                .filter_map(|(_, unit)| unit.fibers.as_ref().map(|fibers| (&fibers.committed, &fibers.current)))
                .collect();
            let (from, reached): (Vec<&Rve>, Vec<&Rve>) = states.into_iter().unzip();
            let leads = solver.converge_to(&from, &reached, &library.params);
            let seconds = start.elapsed().as_secs_f64() / chosen.len() as f64;
            let leads = leads.map_err(|reason| device_failure(chosen[0].1, reason))?;
            for ((number, unit), _) in chosen.iter_mut().zip(leads).filter(|(_, leads)| *leads) {
                if let Some(fibers) = &mut unit.fibers {
                    fibers.origin = Origin::Branch;
                }
                done[*number] = Some((RveStats { verified: 1, seconds, ..RveStats::default() }, 0.0));
            }
        }
        Ok(done)
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
    seconds: f64,
) -> Option<(RveStats, f64)> {
    let matrix = match &unit.matrix {
        Some(formula) => Some(formula.respond(target).ok()?),
        None => None,
    };
    let mut response = Response { energy: found.energy, pk1: found.pk1, tangent: found.tangent };
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
        line_search_cuts: found.backtracks,
        predicted: usize::from(predicted),
        seconds,
        ..RveStats::default()
    };
    Some((stats, increment))
}

fn device_failure(unit: &Unit, reason: String) -> PointFailure {
    PointFailure { point: unit.location, network: None, reason, kind: PointFailureKind::Backend }
}
