//! What an evaluation of the body and its RVEs costs, measured before a run.

use std::collections::BTreeMap;
use std::sync::Arc;

use serde::Serialize;

use super::setup::{Setup, SimulationError};
use crate::app::macro_scale;
use crate::fem::stepping::{ConvergedStep, FailedAttempt, StepObserver, Stepper};
use crate::las::{NewtonSeconds, RealBackend};
use crate::tissue::micro_scale::{RveCost, SampledField, TissueField, TissueMaterial};

/// Number of RVEs of each network that are solved, if lanes do not take more at once.
const SAMPLES: usize = 3;

/// What an evaluation costs, on average over those of the first load step. In this step, the networks respond as at
/// rest, by a linear law, and a few RVEs of each are solved at the deformation gradients of their points.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Measurement {
    /// Number of evaluations in the step.
    pub evaluations: usize,
    /// Whether the step converged; if not, the measured times are those up to its failure.
    pub converged: bool,
    /// Wall time of assembly and linear solution on the threads of this process, s.
    pub body_seconds: f64,
    /// The number of these threads.
    pub threads: usize,
    /// The costs of the RVEs of each network.
    pub networks: Vec<NetworkCost>,
    /// Number of evaluations in which an RVE found no equilibrium.
    pub failures: usize,
}

/// What the RVEs of a network cost.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NetworkCost {
    /// The name of the network; empty for RVEs without one.
    pub name: String,
    /// Number of RVEs that use it.
    pub rves: usize,
    /// Number of those that were solved.
    pub samples: usize,
    /// Mean time of a solution on one thread, s.
    pub seconds: f64,
    /// Longest time of a solution, s: of those with equally many iterations, the median.
    pub longest: f64,
    /// Mean number of iterations of Newton's method.
    pub iterations: f64,
}

impl Measurement {
    /// Number of RVEs.
    pub fn rves(&self) -> usize {
        self.networks.iter().map(|network| network.rves).sum()
    }

    /// Time of one evaluation of all RVEs on one thread, s.
    pub fn rve_seconds(&self) -> f64 {
        self.networks.iter().map(|network| network.rves as f64 * network.seconds).sum()
    }

    /// Longest time of a single solution, s.
    pub fn longest(&self) -> f64 {
        self.networks.iter().map(|network| network.longest).fold(0.0, f64::max)
    }
}

/// The time that failed attempts at a step spent on the body, s.
struct FailedAttempts(f64);

fn of_body(seconds: NewtonSeconds) -> f64 {
    seconds.jacobian + seconds.factor + seconds.solve
}

impl<B: RealBackend, F: std::error::Error> StepObserver<SampledField<B>, F> for FailedAttempts {
    type Error = std::convert::Infallible;

    fn converged(&mut self, _: &ConvergedStep<'_, SampledField<B>>) -> Result<(), Self::Error> {
        Ok(())
    }

    fn failed(&mut self, attempt: &FailedAttempt<'_, SampledField<B>, F>) -> Result<(), Self::Error> {
        self.0 += of_body(attempt.newton.seconds);
        Ok(())
    }
}

impl<B: RealBackend, N: RealBackend> Setup<B, TissueField<N>> {
    /// Measures what an evaluation costs, in the first load step.
    ///
    /// # Errors
    /// Returns [`SimulationError`] if the linear system cannot be set up, or a network has no response at rest.
    pub fn measure(self) -> Result<Measurement, SimulationError<B::Error>> {
        let Self { context, case, mesh, conditions, field, .. } = self;
        let params = macro_scale::step_params(&case);
        let counts = field.rve_counts();
        let without_network = counts.rves - counts.per_model.iter().sum::<usize>();
        let order = field.node_order(&mesh);
        let sampled = field.sampled(SAMPLES)?;
        let stepper = Stepper::in_order(&order, &context, Arc::clone(&mesh), &conditions, sampled, params);
        let mut stepper: Stepper<B, SampledField<N>> = stepper.map_err(Box::new)?;
        // At rest, where no RVE has to move, the costs say little.
        stepper.field().take_costs();
        let mut failed = FailedAttempts(0.0);
        let (seconds, converged) = match stepper.step(&mut failed) {
            Ok(report) => (of_body(report.seconds()), true),
            Err(_) => (failed.0, false),
        };
        let costs = stepper.field().take_costs();
        let is_solved = |sweep: &&Vec<RveCost>| counts.rves == 0 || sweep.iter().any(|cost| cost.seconds > 0.0);
        let evaluations = costs.iter().filter(is_solved).count();
        let models = stepper.field().library().models();
        let names = models.iter().map(|model| model.network().name().to_owned()).chain([String::new()]);
        let rves = counts.per_model.iter().copied().chain([without_network]);
        let of_model = |model: usize| (model < models.len()).then_some(model as u32);
        let networks = names.zip(rves).enumerate().filter(|(_, (_, rves))| *rves > 0);
        Ok(Measurement {
            evaluations,
            converged,
            body_seconds: seconds / evaluations.max(1) as f64,
            threads: rayon::current_num_threads(),
            networks: networks
                .map(|(model, (name, rves))| NetworkCost::of(name, rves, of_model(model), &costs))
                .collect(),
            failures: stepper.field().failures(),
        })
    }
}

impl NetworkCost {
    /// Averages the costs of the samples of a model over the evaluations that solved them. Each counts with the median time
    /// of all with as many iterations, so that a thread that was suspended does not look like an expensive RVE.
    fn of(name: String, rves: usize, model: Option<u32>, costs: &[Vec<RveCost>]) -> Self {
        let mut by_iterations: BTreeMap<u32, Vec<f64>> = BTreeMap::new();
        for cost in costs.iter().flatten().filter(|cost| cost.model == model && cost.seconds > 0.0) {
            by_iterations.entry(cost.iterations).or_default().push(cost.seconds);
        }
        let (mut count, mut seconds, mut longest, mut iterations) = (0.0, 0.0, 0.0, 0.0);
        for (of_solve, mut times) in by_iterations {
            times.sort_by(f64::total_cmp);
            let (number, median) = (times.len() as f64, times[times.len() / 2]);
            count += number;
            seconds += number * median;
            iterations += number * f64::from(of_solve);
            longest = f64::max(longest, median);
        }
        let count = f64::max(count, 1.0);
        let samples = costs.iter().map(|sweep| sweep.iter().filter(|cost| cost.model == model).count());
        let samples = samples.max().unwrap_or(0);
        Self { name, rves, samples, seconds: seconds / count, longest, iterations: iterations / count }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_suspended_thread_is_no_expensive_rve() {
        let cost = |iterations, seconds| RveCost { point: 0, model: Some(1), iterations, seconds };
        let other = RveCost { model: Some(0), ..cost(2, 100.0) };
        let costs = [vec![cost(2, 2.0), cost(2, 2.2), cost(2, 50.0), other], vec![cost(9, 8.0), cost(1, 0.0), other]];
        let network = NetworkCost::of("a".into(), 10, Some(1), &costs);
        assert_eq!((network.samples, network.longest), (3, 8.0));
        assert!((network.seconds - (3.0 * 2.2 + 8.0) / 4.0).abs() < 1e-12 && network.iterations == 15.0 / 4.0);
        let unsolved = NetworkCost::of("a".into(), 10, Some(2), &costs);
        assert_eq!((unsolved.seconds, unsolved.longest, unsolved.samples), (0.0, 0.0, 0));
    }
}
