//! An RVE brought to equilibrium on one backend.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use biotissue::fiber::equilibrium::{EquilibriumParams, EquilibriumReport, RveError, equilibrate};
use biotissue::fiber::homogenise;
use biotissue::fiber::law::FiberMaterial;
use biotissue::fiber::network::Network;
use biotissue::fiber::orientation::{Weighting, tensor};
use biotissue::fiber::path::between;
use biotissue::fiber::rve::{Rve, RveModel, RveModelError, StressScale};
use biotissue::fiber::workspace::Workspace;
use biotissue::las::{Backend, NewtonReport, Scalar};
use nalgebra::Matrix3;

use super::answer::{Answer, Ladder, NetworkFacts, Orientation, Seconds, State, Stretch, rows, tangent_rows};
use crate::dispatch::Job;
use crate::failure::Failure;

/// The checked arguments.
pub struct RveJob {
    pub path: PathBuf,
    pub network: Arc<Network>,
    pub gradient: Matrix3<f64>,
    pub material: Option<FiberMaterial>,
    pub scale: StressScale,
    pub steps: usize,
    pub tolerance: f64,
}

impl Job for RveJob {
    type Output = (Answer, Option<Failure>);

    fn run<B>(self) -> Result<Self::Output, Failure>
    where
        B: Backend<Scalar = f64, Context = ()>,
        B::Reduced: Scalar,
    {
        let start = Instant::now();
        let model = RveModel::<B>::new(&(), Arc::clone(&self.network), self.material, self.scale)
            .map_err(|error| self.unusable(&error))?;
        let mut workspace = Workspace::new(&(), &model).map_err(Failure::library)?;
        let mut seconds = Seconds { analyze: start.elapsed().as_secs_f64(), ..Seconds::default() };

        let start = Instant::now();
        let mut rve = Rve::at_rest(&self.network);
        let outcome = self.equilibrate(&model, &mut rve, &mut workspace);
        seconds.solve = start.elapsed().as_secs_f64();

        let start = Instant::now();
        let (report, state) = match outcome {
            Ok(report) => (report, self.state(&model, &rve, &mut workspace)),
            Err(error) => {
                let report = if let RveError::NotConverged { report, .. } = &error {
                    (**report).clone()
                } else {
                    EquilibriumReport::default()
                };
                (report, Err(error))
            }
        };
        seconds.tangent = start.elapsed().as_secs_f64();
        let (state, failure) = match state {
            Ok(state) => (Some(state), None),
            Err(error) => (None, Some(self.failure(&error))),
        };
        Ok((self.answer(&model, &report, state, seconds), failure))
    }
}

impl RveJob {
    /// The deformation gradient of a step from 1 to `steps`, on the way from the undeformed state to the one asked for.
    pub fn target(&self, step: usize) -> Matrix3<f64> {
        if step == self.steps {
            return self.gradient;
        }
        between(&Matrix3::identity(), &self.gradient, step as f64 / self.steps as f64)
    }

    fn equilibrate<B>(
        &self,
        model: &RveModel<B>,
        rve: &mut Rve,
        workspace: &mut Workspace<B>,
    ) -> Result<EquilibriumReport, RveError<B::Fault>>
    where
        B: Backend<Scalar = f64>,
        B::Reduced: Scalar,
    {
        let mut params = EquilibriumParams::default();
        params.newton.tolerance = self.tolerance;
        let mut sum = EquilibriumReport::default();
        for step in 1..=self.steps {
            let report = equilibrate(model, rve, &self.target(step), &params, workspace)?;
            sum = sum.then(report);
        }
        Ok(sum)
    }

    fn state<B>(
        &self,
        model: &RveModel<B>,
        rve: &Rve,
        workspace: &mut Workspace<B>,
    ) -> Result<State, RveError<B::Fault>>
    where
        B: Backend<Scalar = f64>,
        B::Reduced: Scalar,
    {
        let pk1 = homogenise::pk1(model, workspace);
        let tangent = homogenise::tangent(model, rve, &pk1, workspace)?;
        let energy = homogenise::energy(model, workspace);
        let states = workspace.states();
        let stretch = states.stretches.iter().fold(Stretch { min: f64::INFINITY, max: 0.0 }, |range, &stretch| {
            Stretch { min: range.min.min(stretch), max: range.max.max(stretch) }
        });
        let lengths = model.truss().lengths();
        let current = rows(&tensor(&states.directions, lengths, Weighting::Number));
        workspace.show(model, &Rve::at_rest(model.network()));
        let reference = rows(&tensor(&workspace.states().directions, lengths, Weighting::Number));
        Ok(State {
            pk1: rows(&pk1),
            cauchy: rows(&homogenise::cauchy(&pk1, rve.gradient())),
            tangent: tangent_rows(&tangent),
            energy,
            stretch,
            orientation: Orientation { reference, current },
        })
    }

    fn answer<B>(
        &self,
        model: &RveModel<B>,
        report: &EquilibriumReport,
        state: Option<State>,
        seconds: Seconds,
    ) -> Answer
    where
        B: Backend<Scalar = f64>,
    {
        let NewtonReport { residuals, relative, .. } = &report.newton;
        Answer {
            converged: state.is_some(),
            iterations: report.iterations,
            residuals: residuals.iter().zip(relative).map(|(&norm, &relative)| [norm, relative]).collect(),
            determinant: self.gradient.determinant(),
            network: NetworkFacts::of(&self.network, model),
            scale: model.scale(),
            state,
            ladder: Ladder::from(report),
            seconds,
        }
    }

    fn unusable<F: std::error::Error + 'static>(&self, error: &RveModelError<F>) -> Failure {
        let what = format!("{}: {error}", self.path.display());
        if matches!(error, RveModelError::Analysis(_)) {
            return Failure::library(what);
        }
        Failure::arguments(
            what,
            "a network whose fibers have a law, a radius and a modulus",
            "give --law with its parameters, or put a .params file beside the network",
        )
    }

    fn failure<F: std::error::Error + 'static>(&self, error: &RveError<F>) -> Failure {
        let path = self.path.display();
        if error.is_fault() {
            return Failure::library(error);
        }
        let (expected, cure) = if error.is_linear() {
            (
                "a network that resists every motion of its interior nodes",
                format!(
                    "`biotissue network check {path}` tells whether it is floppy or hangs loose; if not, take more --steps"
                ),
            )
        } else {
            (
                "an equilibrium of the network with its boundary at x = F X",
                format!("take more --steps (now {}), or an F nearer to the undeformed state", self.steps),
            )
        };
        Failure::NotConverged {
            what: error.to_string(),
            place: format!("the RVE of {path}"),
            expected: expected.into(),
            cure,
        }
    }
}
