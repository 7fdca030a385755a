//! One RVE at one integration point: its states, its last response, and its cost.

use std::sync::Arc;

use nalgebra::Matrix3;

use super::iterations::IterationCounts;
use super::library::{Library, PointNetwork};
use super::worker::Worker;
use crate::coupling::balance::Cost;
use crate::fem::material::{MaterialError, Response};
use crate::fem::mesh::IntegrationPoint;
use crate::fiber::equilibrium::{EquilibriumReport, RveError, Stage, converges_to, equilibrate};
use crate::fiber::homogenize::Tangent;
use crate::fiber::rve::{Rve, RveModel, Sensitivities};
use crate::fiber::workspace::Workspace;
use crate::las::RealBackend;
use crate::processor_time::ProcessorTime;
use crate::tissue::materials::Formula;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// The network of an RVE with the states that load stepping needs.
#[derive(Clone, Debug)]
pub(super) struct Fibers {
    /// The index of its network among the models of the field.
    pub model: usize,
    /// The stress over that of the model.
    pub factor: f64,
    /// The last equilibrium, from which the next solve starts.
    pub current: Rve,
    /// The equilibrium at the last converged load step.
    pub committed: Rve,
    /// How `current` was found.
    pub origin: Origin,
}

/// How an equilibrium was found, which decides whether it has to be verified before it is accepted.
///
/// A network may have several equilibria, above all under compression. The accepted one is that which the stages of
/// [`equilibrate`] find from the committed state moved affinely, so that it does not depend on any trial state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Origin {
    /// It is the committed state.
    Committed,
    /// It continues the committed state: found from there directly, or verified.
    Branch,
    /// It was found from another trial state or from a prediction.
    Trial,
}

/// An RVE: fibers, a matrix, or both in parallel.
///
/// Without fibers it is the matrix alone, whose response must equal that of the formula without an RVE.
#[derive(Clone, Debug)]
pub(super) struct Unit {
    /// Its integration point.
    pub location: IntegrationPoint,
    /// The region of its point.
    pub region: usize,
    /// The network.
    pub fibers: Option<Fibers>,
    /// The matrix in parallel.
    pub matrix: Option<Arc<Formula>>,
    /// The last deformation gradient, and the response there.
    pub response: Option<(Matrix3<f64>, Response)>,
    /// Newton iterations since the last commit.
    pub iterations: usize,
    /// Newton iterations of the committed increments of the present load step.
    pub iterations_of_step: usize,
    /// Newton iterations of the load step up to the last commit, for the output.
    pub committed_iterations: usize,
}

/// The reason why a point has no response.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum UnitError<F: std::error::Error + 'static> {
    /// The network has no equilibrium.
    #[error(transparent)]
    Rve(#[from] RveError<F>),
    /// The formula (or the matrix in parallel with the network) has no response.
    #[error(transparent)]
    Material(#[from] MaterialError),
    /// The backend cannot create a workspace.
    #[error("no workspace: {0}")]
    Workspace(#[from] crate::las::SolveError<F>),
}

/// Counters of the solves of RVEs in one or more updates.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RveStats {
    /// Equilibrium solves, including those that failed.
    pub solves: usize,
    /// Those of them that were solved many at once, in lanes or on a device.
    #[serde(default)]
    pub in_batches: usize,
    /// Responses reused because the gradient had not changed.
    pub reused: usize,
    /// Newton iterations in total.
    pub iterations: usize,
    /// Most Newton iterations of one solve.
    pub most_iterations: usize,
    /// Numbers of solves by their Newton iterations.
    #[serde(default)]
    pub by_iterations: IterationCounts,
    /// Halvings of an increment.
    pub cuts: usize,
    /// Newton steps shortened by the line search.
    pub line_search_cuts: usize,
    /// LDL^T factorizations, needed if the stiffness is not positive definite.
    pub indefinite: usize,
    /// Solves that started from a first-order prediction.
    pub predicted: usize,
    /// Equilibria reached by cut increments after the whole increment failed.
    pub by_cuts: usize,
    /// Equilibria reached by regularized Newton after plain Newton failed.
    pub by_regularized: usize,
    /// Equilibria reached by dynamic relaxation after all other stages failed.
    pub by_relaxation: usize,
    /// Equilibria that were shown, at the end of a load step, to continue the last converged one.
    pub verified: usize,
    /// Equilibria that were solved for again from the last converged one because this could not be shown.
    pub replaced: usize,
    /// Steps of dynamic relaxation in total.
    pub relaxation_steps: usize,
    /// Processor time of all solutions, s; for those on a device, their part of the wall time
    /// of the batches.
    pub seconds: f64,
}

impl RveStats {
    /// Adds two sets of counters.
    #[must_use]
    pub fn merge(self, other: Self) -> Self {
        Self {
            solves: self.solves + other.solves,
            in_batches: self.in_batches + other.in_batches,
            reused: self.reused + other.reused,
            iterations: self.iterations + other.iterations,
            most_iterations: self.most_iterations.max(other.most_iterations),
            by_iterations: self.by_iterations.merge(other.by_iterations),
            cuts: self.cuts + other.cuts,
            line_search_cuts: self.line_search_cuts + other.line_search_cuts,
            indefinite: self.indefinite + other.indefinite,
            predicted: self.predicted + other.predicted,
            by_cuts: self.by_cuts + other.by_cuts,
            by_regularized: self.by_regularized + other.by_regularized,
            by_relaxation: self.by_relaxation + other.by_relaxation,
            verified: self.verified + other.verified,
            replaced: self.replaced + other.replaced,
            relaxation_steps: self.relaxation_steps + other.relaxation_steps,
            seconds: self.seconds + other.seconds,
        }
    }

    /// Returns the cost of the solves counted here, those of one RVE after this increment of its deformation gradient.
    pub(super) fn cost(&self, increment: f64) -> Cost {
        let (by_relaxation, by_regularized) = (self.by_relaxation as f64, self.by_regularized as f64);
        let stage = 3.0 * by_relaxation + 2.0 * by_regularized + self.by_cuts as f64;
        let features = [increment, stage, self.line_search_cuts as f64, self.indefinite as f64];
        Cost { iterations: self.iterations as f64, seconds: self.seconds, features }
    }

    fn count(&mut self, report: &EquilibriumReport) {
        self.solves += 1;
        self.iterations += report.iterations;
        self.most_iterations = self.most_iterations.max(report.iterations);
        self.by_iterations.count(report.iterations);
        self.cuts += report.cuts as usize;
        self.line_search_cuts += report.backtracks;
        self.indefinite += report.indefinite;
        self.predicted += report.predicted;
        self.by_cuts += usize::from(report.stage == Some(Stage::Cuts));
        self.by_regularized += usize::from(report.stage == Some(Stage::Regularized));
        self.by_relaxation += usize::from(report.stage == Some(Stage::Relaxation));
        self.relaxation_steps += report.relaxation.steps;
    }
}

impl Unit {
    /// Creates an RVE at rest, at a point of a region.
    pub fn new<B: RealBackend>(
        (location, region): (IntegrationPoint, usize),
        network: Option<PointNetwork>,
        models: &[RveModel<B>],
        matrix: Option<Arc<Formula>>,
    ) -> Self {
        let fibers = network.map(|PointNetwork { model, factor }| {
            let rest = Rve::at_rest(models[model].network());
            Fibers { model, factor, committed: rest.clone(), current: rest, origin: Origin::Committed }
        });
        Self {
            location,
            region,
            fibers,
            matrix,
            response: None,
            iterations: 0,
            iterations_of_step: 0,
            committed_iterations: 0,
        }
    }

    /// Returns stress and tangent at `gradient`. The last response is reused if the gradient has not changed.
    pub fn respond<B: RealBackend>(
        &mut self,
        gradient: &Matrix3<f64>,
        library: &Library<B>,
        worker: &mut Worker<B>,
        stats: &mut RveStats,
    ) -> Result<Response, UnitError<B::Error>> {
        if let Some((last, response)) = &self.response
            && last == gradient
        {
            stats.reused += 1;
            return Ok(*response);
        }
        let start = ProcessorTime::now();
        let outcome = self.solve(gradient, library, worker, stats);
        stats.seconds += start.seconds();
        let response = outcome?;
        self.response = Some((*gradient, response));
        Ok(response)
    }

    fn solve<B: RealBackend>(
        &mut self,
        gradient: &Matrix3<f64>,
        library: &Library<B>,
        worker: &mut Worker<B>,
        stats: &mut RveStats,
    ) -> Result<Response, UnitError<B::Error>> {
        let mut sum = match &self.matrix {
            Some(formula) => formula.respond(gradient)?,
            None => Response { energy: 0.0, pk1: Matrix3::zeros(), tangent: Tangent::zeros() },
        };
        if let Some(fibers) = &mut self.fibers {
            let workspace = worker.workspace(library, fibers.model)?;
            let (network, iterations) = fibers.solve(gradient, library, workspace, stats)?;
            self.iterations += iterations;
            sum.energy += network.energy;
            sum.pk1 += network.pk1;
            sum.tangent += network.tangent;
        }
        Ok(sum)
    }

    /// Verifies that the equilibrium found by [`Unit::respond`] at the converged gradient continues the committed one,
    /// and solves for it again from the committed state if not. Returns true if the response was replaced.
    pub fn verify<B: RealBackend>(
        &mut self,
        gradient: &Matrix3<f64>,
        library: &Library<B>,
        worker: &mut Worker<B>,
        stats: &mut RveStats,
    ) -> Result<bool, UnitError<B::Error>> {
        let Some(fibers) = &mut self.fibers else { return Ok(false) };
        if fibers.origin != Origin::Trial {
            return Ok(false);
        }
        let start = ProcessorTime::now();
        let outcome = self.solve_again(gradient, library, worker, stats);
        stats.seconds += start.seconds();
        outcome
    }

    /// Solves from the committed state, unless Newton evidently leads from there to the current equilibrium.
    fn solve_again<B: RealBackend>(
        &mut self,
        gradient: &Matrix3<f64>,
        library: &Library<B>,
        worker: &mut Worker<B>,
        stats: &mut RveStats,
    ) -> Result<bool, UnitError<B::Error>> {
        let Some(fibers) = &mut self.fibers else { return Ok(false) };
        let workspace = worker.workspace(library, fibers.model)?;
        let model = &library.models[fibers.model];
        if converges_to(model, &fibers.committed, &fibers.current, &library.params.newton, workspace) {
            fibers.origin = Origin::Branch;
            stats.verified += 1;
            return Ok(false);
        }
        stats.replaced += 1;
        let trial = std::mem::replace(&mut fibers.current, fibers.committed.clone());
        fibers.origin = Origin::Committed;
        let response = self.solve(gradient, library, worker, stats)?;
        let is_another = self.fibers.as_ref().is_none_or(|fibers| !fibers.current.is_same_equilibrium(&trial));
        if is_another {
            self.response = Some((*gradient, response));
        } else if let Some(fibers) = &mut self.fibers {
            fibers.current = trial;
        }
        Ok(is_another)
    }

    /// Bytes of this unit in a run, including those on the heap. With `predict`, the count includes the space for the
    /// prediction even before the first solve.
    pub fn bytes(&self, predict: bool) -> usize {
        let heap = self.fibers.as_ref().map_or(0, |fibers| {
            let to_come =
                if predict && !fibers.current.has_sensitivities() { fibers.current.interior().len() } else { 0 };
            fibers.current.heap_bytes() + fibers.committed.heap_bytes() + to_come * size_of::<Sensitivities>()
        });
        size_of::<Self>() + heap
    }

    /// Makes the current equilibrium the start of the next increment, and of the next load step if `ends_step` is true.
    pub fn commit(&mut self, ends_step: bool) {
        if let Some(fibers) = &mut self.fibers {
            fibers.committed.copy_equilibrium_from(&fibers.current);
            fibers.origin = Origin::Committed;
        }
        self.iterations_of_step += std::mem::take(&mut self.iterations);
        self.committed_iterations = self.iterations_of_step;
        if ends_step {
            self.iterations_of_step = 0;
        }
    }

    /// Returns to the last commit.
    pub fn revert(&mut self) {
        if let Some(fibers) = &mut self.fibers {
            fibers.current.copy_equilibrium_from(&fibers.committed);
            fibers.origin = Origin::Committed;
        }
        self.response = None;
        self.iterations = 0;
    }
}

impl Fibers {
    /// Returns the network of the point.
    pub fn network(&self) -> PointNetwork {
        PointNetwork { model: self.model, factor: self.factor }
    }

    fn solve<B: RealBackend>(
        &mut self,
        gradient: &Matrix3<f64>,
        library: &Library<B>,
        workspace: &mut Workspace<B>,
        stats: &mut RveStats,
    ) -> Result<(Response, usize), UnitError<B::Error>> {
        let model = &library.models[self.model];
        let is_affine = self.origin == Origin::Committed && !self.current.has_sensitivities();
        let mut solved = match equilibrate(model, &mut self.current, gradient, &library.params, workspace) {
            Ok(solved) => solved,
            Err(error) => {
                if let Some(report) = error.report() {
                    stats.count(report);
                }
                return Err(error.into());
            }
        };
        self.origin = if is_affine { Origin::Branch } else { Origin::Trial };
        stats.count(solved.report());
        let response = Response { energy: solved.energy(), pk1: solved.pk1(), tangent: solved.tangent()? };
        if library.predict {
            solved.keep_sensitivities()?;
        }
        Ok((response.scaled(self.factor), solved.report().iterations))
    }
}
