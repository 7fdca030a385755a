//! Solving for the equilibrium of an RVE on one backend.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use biotissue::fiber::equilibrium::{EquilibriumParams, EquilibriumReport, RveError, Stages, equilibrate};
use biotissue::fiber::law::FiberMaterial;
use biotissue::fiber::network::Network;
use biotissue::fiber::orientation::{Weighting, tensor};
use biotissue::fiber::rve::{Rve, RveModel, StressScale};
use biotissue::fiber::stress_gradient::StressGradient;
use biotissue::fiber::workspace::Workspace;
use biotissue::las::NewtonReport;
use biotissue::tensor::{cauchy, rows};
use biotissue::tissue::replay::RveDump;
use nalgebra::Matrix3;

use super::result::{
    NetworkSize, Orientation, RveResult, Seconds, Stability, StageReport, State, Stretch, tangent_rows,
};
use crate::dispatch::{Job, ProgramBackend};
use crate::failure::Failure;
use crate::increments::{Increments, unusable};

/// The checked arguments.
pub struct RveJob {
    /// Name of the RVE in messages.
    pub place: String,
    /// File of the network, if it has one.
    pub file: Option<PathBuf>,
    pub network: Arc<Network>,
    /// Edge of its cube in the unit of the file, if it has one.
    pub cube_edge: Option<f64>,
    pub start: Rve,
    pub gradient: Matrix3<f64>,
    pub material: Option<FiberMaterial>,
    pub scale: StressScale,
    pub steps: usize,
    pub params: EquilibriumParams,
    /// The file for the last increment, if requested.
    pub dump: Option<PathBuf>,
}

impl Job for RveJob {
    type Output = (RveResult, Option<Failure>);

    fn run<B: ProgramBackend>(self, context: B::Context) -> Result<Self::Output, Failure> {
        let start = Instant::now();
        let model = RveModel::<B>::new(&context, Arc::clone(&self.network), self.material.clone(), self.scale)
            .map_err(|error| unusable(&self.place, &error))?;
        let mut workspace = Workspace::new(&context, &model).map_err(Failure::library)?;
        let mut seconds = Seconds { analyze: start.elapsed().as_secs_f64(), ..Seconds::default() };

        let start = Instant::now();
        let mut rve = self.start.clone();
        let mut last = (rve.clone(), self.gradient);
        let outcome = self.increments().apply(&model, &mut rve, &mut workspace, &mut last);
        seconds.solve = start.elapsed().as_secs_f64();
        if let Some(file) = &self.dump {
            let dump = RveDump::new(self.place.clone(), &model, (&last.0, &last.1), &self.params);
            dump.write(file).map_err(|error| Failure::unwritable(file, &error))?;
        }

        let start = Instant::now();
        let stability = Stability::of(outcome.as_ref().map_err(|failed| &failed.error));
        let (report, state) = match outcome {
            Ok(report) => {
                let state = self.state(&model, &mut rve, &mut workspace);
                (report, state.map_err(|error| self.increments().response_failure(&error)))
            }
            Err(failed) => {
                let report = failed.error.report().cloned().unwrap_or_default();
                (report, Err(self.increments().increment_failure(&failed)))
            }
        };
        seconds.tangent = start.elapsed().as_secs_f64();
        let (state, failure) = match state {
            Ok(state) => (Some(state), None),
            Err(failure) => (None, Some(failure)),
        };
        Ok((self.result(&model, &report, state, stability, seconds), failure))
    }
}

impl RveJob {
    /// Creates the job from the content of an [`RveDump`] file; `stages`, if given, replace those of the file.
    pub fn replay(dump: RveDump, stages: Option<Stages>, again: Option<PathBuf>) -> Self {
        let RveDump { origin, network, scale, start, target, params } = dump;
        let params = params.with_stages(stages.unwrap_or(params.stages));
        Self {
            place: origin,
            file: None,
            network,
            cube_edge: None,
            start,
            gradient: target,
            material: None,
            scale,
            steps: 1,
            params,
            dump: again,
        }
    }

    fn increments(&self) -> Increments<'_> {
        Increments {
            target: &self.gradient,
            steps: self.steps,
            params: &self.params,
            place: &self.place,
            file: self.file.as_deref(),
            replayed: self.file.is_none(),
        }
    }

    fn state<B: ProgramBackend>(
        &self,
        model: &RveModel<B>,
        rve: &mut Rve,
        workspace: &mut Workspace<B>,
    ) -> Result<State, RveError<B::Error>> {
        // The RVE is already in equilibrium, so no stage has any work to do.
        let (gradient, params) = (*rve.gradient(), self.params.with_stages(Stages::default()));
        let mut solved = equilibrate(model, rve, &gradient, &params, workspace)?;
        let (pk1, tangent, energy) = (solved.pk1(), solved.tangent()?, solved.energy());
        let (stress_gradient, stress_gradient_undefined) = match solved.stress_gradient()? {
            StressGradient::Defined(value) => (Some(value), 0),
            StressGradient::FibersInFaces(count) => (None, count),
        };
        let states = solved.states();
        let stretch = states.stretches.iter().fold(Stretch { min: f64::INFINITY, max: 0.0 }, |range, &stretch| {
            Stretch { min: range.min.min(stretch), max: range.max.max(stretch) }
        });
        let lengths = model.truss().lengths();
        let current = rows(&tensor(&states.directions, lengths, Weighting::Number));
        workspace.load_state(model, &Rve::at_rest(model.network()));
        let reference = rows(&tensor(&workspace.states().directions, lengths, Weighting::Number));
        Ok(State {
            pk1: rows(&pk1),
            cauchy: rows(&cauchy(&pk1, &gradient)),
            tangent: tangent_rows(&tangent),
            energy,
            stress_gradient,
            stress_gradient_undefined,
            stretch,
            orientation: Orientation { reference, current },
        })
    }

    fn result<B: ProgramBackend>(
        &self,
        model: &RveModel<B>,
        report: &EquilibriumReport,
        state: Option<State>,
        stability: Option<Stability>,
        seconds: Seconds,
    ) -> RveResult {
        let NewtonReport { residuals, relative, .. } = &report.newton;
        RveResult {
            converged: state.is_some(),
            iterations: report.iterations,
            residuals: residuals.iter().zip(relative).map(|(&norm, &relative)| [norm, relative]).collect(),
            determinant: self.gradient.determinant(),
            network: NetworkSize::of(&self.network, model, self.cube_edge),
            scale: model.scale(),
            state,
            stability,
            stages: StageReport::of(report, self.params.newton.tolerance),
            seconds,
        }
    }
}
