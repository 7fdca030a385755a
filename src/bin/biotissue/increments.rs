//! Incremental deformation of a network, shared by all commands.

use std::path::Path;

use biotissue::fiber::deformation_path::between;
use biotissue::fiber::equilibrium::{EquilibriumParams, EquilibriumReport, RveError, equilibrate};
use biotissue::fiber::rve::{Rve, RveModel, RveModelError};
use biotissue::fiber::truss::TrussError;
use biotissue::fiber::workspace::Workspace;

use nalgebra::Matrix3;

use crate::dispatch::ProgramBackend;
use crate::failure::Failure;
use crate::output;

/// Maximum number of increments, the same as for the load steps of a run.
const MAX_STEPS: usize = 1_000_000;

/// Checks the value of `--steps`.
pub fn check_steps(steps: usize) -> Result<(), Failure> {
    if (1..=MAX_STEPS).contains(&steps) {
        return Ok(());
    }
    let expected = format!("between 1 and {MAX_STEPS} increments");
    Err(Failure::arguments(format!("invalid --steps {steps}"), expected, "leave --steps out for one"))
}

/// Returns the failure for a network whose model cannot be built, usually because its fibers have no material.
pub fn unusable<F: std::error::Error + 'static>(place: &str, error: &RveModelError<F>) -> Failure {
    let what = match error {
        RveModelError::Analysis(_) => return Failure::library(format!("{place}: {error}")),
        // The message of this error names the network.
        RveModelError::Truss(TrussError::NoMaterial(_)) => error.to_string(),
        _ => format!("{place}: {error}"),
    };
    let cure = format!("give --law with its parameters, or put {place}.toml with a [law] or {place}.params beside it");
    Failure::arguments(what, "a network whose fibers have a law, a radius and a modulus", cure)
}

/// The increments that take an RVE to a deformation gradient.
pub struct Increments<'a> {
    pub target: &'a Matrix3<f64>,
    pub steps: usize,
    pub params: &'a EquilibriumParams,
    /// Name of the RVE in messages.
    pub place: &'a str,
    /// File of the network, if it has one.
    pub file: Option<&'a Path>,
    /// Whether the increment comes from a `--dump` file; then neither it nor its subdivision can be chosen.
    pub replayed: bool,
}

/// The last increment: the state before it and its target.
pub type LastIncrement = (Rve, Matrix3<f64>);

/// An increment that failed.
pub struct FailedIncrement<F: std::error::Error + 'static> {
    pub error: RveError<F>,
    /// Number of the increment, from 1.
    step: usize,
}

impl Increments<'_> {
    /// Applies all increments, each from a first-order prediction if the previous one has a tangent. If one of several
    /// increments fails, tries to reach the target in a single increment and warns about it.
    pub fn apply<B: ProgramBackend>(
        &self,
        model: &RveModel<B>,
        rve: &mut Rve,
        workspace: &mut Workspace<B>,
        last: &mut LastIncrement,
    ) -> Result<EquilibriumReport, FailedIncrement<B::Error>> {
        let start = rve.clone();
        let failed = match self.apply_each(model, rve, workspace, last) {
            Err(failed) if self.steps > 1 => failed,
            outcome => return outcome,
        };
        let mut single = start.clone();
        let Ok(solved) = equilibrate(model, &mut single, self.target, self.params, workspace) else {
            return Err(failed);
        };
        let report = solved.into_report();
        let FailedIncrement { step, error } = failed;
        let steps = self.steps;
        output::warn(&[format!("step {step} of {steps} of {}: {error}; one increment reached F instead", self.place)]);
        *last = (start, *self.target);
        *rve = single;
        Ok(report)
    }

    fn apply_each<B: ProgramBackend>(
        &self,
        model: &RveModel<B>,
        rve: &mut Rve,
        workspace: &mut Workspace<B>,
        last: &mut LastIncrement,
    ) -> Result<EquilibriumReport, FailedIncrement<B::Error>> {
        let start = *rve.gradient();
        let mut sum = EquilibriumReport::default();
        for step in 1..=self.steps {
            let part = step as f64 / self.steps as f64;
            let target = if step == self.steps { *self.target } else { between(&start, self.target, part) };
            *last = (rve.clone(), target);
            let solved = equilibrate(model, rve, &target, self.params, workspace);
            let mut solved = solved.map_err(|error| FailedIncrement { error, step })?;
            sum = sum.accumulate(solved.report().clone());
            if step < self.steps {
                // Without a tangent the next increment starts from an affine motion.
                let _ = solved.keep_sensitivities();
            }
        }
        Ok(sum)
    }

    /// Returns the failure for an increment that was not solved.
    pub fn increment_failure<F: std::error::Error + 'static>(&self, failed: &FailedIncrement<F>) -> Failure {
        let at = match self.steps {
            1 => self.place_of_rve(),
            steps => format!("step {} of {steps} of {}", failed.step, self.place),
        };
        self.failure(&failed.error, at)
    }

    /// Returns the failure for an equilibrium whose stress or tangent cannot be computed.
    pub fn response_failure<F: std::error::Error + 'static>(&self, error: &RveError<F>) -> Failure {
        self.failure(error, self.place_of_rve())
    }

    fn place_of_rve(&self) -> String {
        format!("the RVE of {}", self.place)
    }

    fn failure<F: std::error::Error + 'static>(&self, error: &RveError<F>, at: String) -> Failure {
        if error.is_backend_error() {
            return Failure::library(error);
        }
        let restricted = self.params.stages != EquilibriumParams::default().stages;
        let advice = match self.replayed {
            true if restricted => {
                "leave --stages out, or try all of them: --stages newton,regularized,cuts,relaxation".to_owned()
            }
            true => "no stage reaches it: use smaller increments in the run that wrote it".to_owned(),
            false if restricted => {
                format!("leave --stages out, or use more --steps (now {})", self.steps)
            }
            false => format!("use more --steps (now {}), or an F nearer to the undeformed state", self.steps),
        };
        let (expected, cure) = if let RveError::ExcessiveForce { .. } = error {
            let units = "moduli and stresses are in Pa, radii in m, F has no unit";
            (
                "fiber forces below 1e12 times the stiffness of the fiber at rest",
                match self.replayed {
                    // Other stages reach the same equilibrium.
                    true => format!(
                        "check the law and the deformation of the run that wrote it ({units}); else use smaller \
                         increments in that run"
                    ),
                    false => format!("check the law and F ({units}); else {advice}"),
                },
            )
        } else if error.is_linear() {
            let cure = match self.file {
                Some(file) => {
                    let file = file.display();
                    format!("`biotissue network check {file}` shows where it is floppy; if it is not, {advice}")
                }
                None => format!("{advice}; or use another network, or a cleaned one"),
            };
            ("a network that resists every motion of its interior nodes", cure)
        } else {
            ("an equilibrium of the network with its boundary at x = F X", advice)
        };
        Failure::not_converged(error.to_string(), at, expected, cure)
    }
}
