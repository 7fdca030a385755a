//! Equilibrium of an RVE whose boundary nodes have the prescribed positions `x = F X`.
//!
//! [`equilibrate`] tries up to four stages in order until one of them succeeds. [`EquilibriumParams::stages`] selects
//! the stages; each of them can also be used alone:
//!
//! 1. [`Stage::Newton`]: Newton with line search for the whole increment from the last equilibrium. The initial guess
//!    is a first-order prediction if the RVE has sensitivities ([`EquilibriumState::keep_sensitivities`]), and the
//!    affine motion if it has none or if Newton fails from the prediction;
//! 2. [`Stage::Regularized`]: energy minimization for the whole increment
//!    ([`NewtonSystem::minimize`](crate::las::NewtonSystem::minimize)), which tolerates indefinite and singular
//!    stiffness matrices and ends in a stable equilibrium;
//! 3. [`Stage::Cuts`]: the increment in halves, quarters and so on, up to a limit, each part by the stages above;
//! 4. [`Stage::Relaxation`]: damped dynamics ([`super::dynamic_relaxation`]) for the rest of the increment, followed by
//!    one of the stages above for the last digits.
//!
//! Only stable equilibria, that is, minima of the energy, are accepted. Every state that a stage reaches, including an
//! unchanged initial state, is tested after the check of the fiber forces (below) by one Cholesky factorization of its
//! stiffness, and the tangent uses that factor. If the factorization fails, the state is one of the following:
//!
//! * *Neutral*: Cholesky succeeds after a small shift of the diagonal, 1e-9 of its largest entry with the default
//!   tolerance ([`Curvature::Neutral`]). Some motions meet no resistance, as in a floppy network at rest; the state is
//!   accepted.
//! * *Unstable*: the state is a saddle point of the energy. The solver leaves it along a direction of negative
//!   curvature ([`NewtonSystem::escape_saddle`](crate::las::NewtonSystem::escape_saddle)) and minimizes the energy from
//!   there; the minimum is the equilibrium. If the energy does not decrease measurably along that direction, the state
//!   counts as neutral. If [`Stage::Regularized`] is not among the stages, no minimization is available and the stage
//!   fails ([`StageError::Unstable`]).
//!
//! A fiber force is *excessive* if it is not finite or at least [`ExcessiveForce::THRESHOLD`] times the stiffness of
//! the fiber at rest. The solve ends with [`RveError::ExcessiveForce`] in two cases: a stage reaches an equilibrium,
//! stable or not, with such a force; or Newton fails for the whole increment or is not selected, and the affine motions
//! to the target and to half of the increment both have such a force. In the second case a smaller increment may
//! succeed.
//!
//! Energy minimization precedes the cuts because it takes a tenth of their iterations: for strongly compressed networks
//! where plain Newton fails, it mostly fails for smaller increments too. [`RveError::NotConverged`] lists the failures
//! of all stages; the RVE is then unchanged.

mod continuation;
mod params;
mod problem;
mod report;
mod state;

use nalgebra::Matrix3;

pub use continuation::converges_to;
pub use params::{EquilibriumParams, RelaxationSwitch, Stage, StageInProgress, Stages};
pub use report::{EquilibriumReport, ExcessiveForce, RveError, StageError, StageFailure};
pub use state::EquilibriumState;

use super::deformation_path::DeformationPath;
use super::dynamic_relaxation::{Relaxation, RelaxationError, RelaxationReport};
use super::rve::{Rve, RveModel};
use super::workspace::Workspace;
use crate::las::{Backend, Curvature, NewtonError, NewtonFailure, NewtonReport, RealBackend, SaddleExit, SolveError};
use problem::Interior;

/// Brings `rve` into a stable equilibrium with its boundary at `x = F X`, where `F` is `target`.
///
/// The returned [`EquilibriumState`] gives stress, tangent and energy; it borrows `rve` and the workspace until it is
/// dropped.
///
/// # Errors
/// Returns [`RveError`] if `det F <= 0`, if `rve` or the workspace belongs to another model, if a fiber force is an
/// [`ExcessiveForce`], or if no stage reaches an equilibrium; `rve` is then unchanged.
pub fn equilibrate<'a, B: RealBackend>(
    model: &'a RveModel<B>,
    rve: &'a mut Rve,
    target: &Matrix3<f64>,
    params: &EquilibriumParams,
    workspace: &'a mut Workspace<B>,
) -> Result<EquilibriumState<'a, B>, RveError<B::Error>> {
    let determinant = target.determinant();
    if determinant.is_nan() || determinant <= 0.0 {
        return Err(RveError::Inverted(determinant));
    }
    if !workspace.is_of(model) {
        return Err(RveError::Workspace);
    }
    rve.belongs_to(model)?;
    let report = find(model, rve, target, params, workspace)?;
    Ok(EquilibriumState::new(model, rve, workspace, report))
}

/// Tries the stages in order.
fn find<B: RealBackend>(
    model: &RveModel<B>,
    rve: &mut Rve,
    target: &Matrix3<f64>,
    params: &EquilibriumParams,
    workspace: &mut Workspace<B>,
) -> Result<EquilibriumReport, RveError<B::Error>> {
    let report = EquilibriumReport { predicted: usize::from(rve.has_sensitivities()), ..EquilibriumReport::default() };
    let may_minimize = params.stages.has(Stage::Regularized);
    let mut solver = EquilibriumSolver { model, target, params, workspace, report, failures: Vec::new(), may_minimize };
    if params.stages.has(Stage::Newton) && solver.try_newton(rve) {
        return Ok(solver.report);
    }
    if solver.has_excessive_force() {
        return Err(solver.into_error());
    }
    // Newton may still succeed from the affine motion where it failed from the prediction.
    let sensitivities = rve.sensitivities.take();
    if sensitivities.is_some() && params.stages.has(Stage::Newton) {
        solver.failures.clear();
        if solver.try_newton(rve) {
            return Ok(solver.report);
        }
    }
    let affine = if solver.has_excessive_force() { None } else { solver.excessive_affine_force(rve) };
    if let Some(force) = affine {
        solver.record_failure(Stage::Newton, 0.0, StageError::ExcessiveForce(force));
    }
    if solver.has_excessive_force() {
        rve.sensitivities = sensitivities;
        return Err(solver.into_error());
    }
    let start = rve.clone();
    if solver.try_remaining_stages(rve) {
        return Ok(solver.report);
    }
    *rve = Rve { sensitivities, ..start };
    Err(solver.into_error())
}

/// The outcome of Newton, plain or regularized.
type NewtonOutcome<B> = Result<NewtonReport, NewtonFailure<<B as Backend>::Error, <B as Backend>::Error>>;
/// The outcome of a stage.
type Staged<B> = Result<NewtonReport, StageError<<B as Backend>::Error>>;

/// An equilibrium solve in progress. The method of a stage returns true if the stage reached the target, and otherwise
/// records its failure and returns false.
struct EquilibriumSolver<'a, B: Backend> {
    model: &'a RveModel<B>,
    target: &'a Matrix3<f64>,
    params: &'a EquilibriumParams,
    workspace: &'a mut Workspace<B>,
    report: EquilibriumReport,
    failures: Vec<StageFailure<B::Error>>,
    /// Whether regularized Newton may be used to leave a saddle point.
    may_minimize: bool,
}

impl<B: RealBackend> EquilibriumSolver<'_, B> {
    fn try_newton(&mut self, rve: &mut Rve) -> bool {
        let saddles = self.report.saddles;
        self.workspace.stage.set(Some(Stage::Newton));
        match self.increment(rve, self.target) {
            Ok(newton) => {
                self.report.newton = newton;
                // If Newton converged to a saddle point, energy minimization continued from there.
                self.record_success(if self.report.saddles > saddles { Stage::Regularized } else { Stage::Newton })
            }
            Err(reason) => self.record_failure(Stage::Newton, 0.0, reason),
        }
    }

    /// Returns the excessive force of the affine motion to the target if half of the increment causes one too: either
    /// the increment or a unit of the input is then wrong, and the later stages would fail too, after seconds. If half
    /// of the increment does not, the stages that cut the increment may still succeed.
    fn excessive_affine_force(&mut self, rve: &Rve) -> Option<ExcessiveForce> {
        let force = self.affine_force(rve, self.target)?;
        let half = DeformationPath::new(&rve.gradient, self.target).at(0.5);
        self.affine_force(rve, &half).is_some().then_some(force)
    }

    /// Returns the largest fiber force of the affine motion to `target` if it is excessive or not finite.
    fn affine_force(&mut self, rve: &Rve, target: &Matrix3<f64>) -> Option<ExcessiveForce> {
        self.workspace.set_initial_guess(self.model, rve, target);
        let truss = self.model.truss();
        let Workspace { positions, states, forces, .. } = &mut *self.workspace;
        truss.evaluate_with_forces(positions, states, forces);
        let fiber = truss.max_relative_force(states)?;
        let is_finite = truss.energy(states).is_finite() && forces.iter().flatten().all(|f| f.is_finite());
        (fiber.2 >= ExcessiveForce::THRESHOLD || !is_finite).then(|| ExcessiveForce::of(fiber))
    }

    /// Tries the stages after the first.
    fn try_remaining_stages(&mut self, rve: &mut Rve) -> bool {
        let may_try = |this: &Self, stage| {
            this.workspace.stage.set(Some(stage));
            this.params.stages.has(stage) && !this.has_excessive_force()
        };
        (may_try(self, Stage::Regularized) && self.regularized(rve))
            || (may_try(self, Stage::Cuts) && self.params.max_cuts > 0 && self.solve_by_substepping(rve))
            || (may_try(self, Stage::Relaxation) && self.solve_by_relaxation(rve))
    }

    /// Returns true if the last stage failed because of an excessive force; no further stage is then tried.
    fn has_excessive_force(&self) -> bool {
        self.failures.last().is_some_and(|failure| matches!(failure.reason, StageError::ExcessiveForce(_)))
    }

    fn into_error(mut self) -> RveError<B::Error> {
        let report = Box::new(self.report);
        match self.failures.pop() {
            Some(StageFailure { reason: StageError::ExcessiveForce(force), .. }) => {
                RveError::ExcessiveForce { force, report }
            }
            last => {
                self.failures.extend(last);
                RveError::NotConverged { failures: self.failures, report }
            }
        }
    }

    /// Applies ever smaller increments; `rve` follows the last increment that converged.
    fn solve_by_substepping(&mut self, rve: &mut Rve) -> bool {
        let path = DeformationPath::new(&rve.gradient, self.target);
        let (mut reached, mut part) = (0.0, 1.0);
        loop {
            self.report.cuts += 1;
            part *= 0.5;
            // The parts are powers of two, so their sum reaches 1 exactly.
            let stopped = loop {
                let goal = reached + part;
                let gradient = if goal >= 1.0 { *self.target } else { path.at(goal) };
                match self.solve_substep(rve, &gradient) {
                    Ok(newton) => {
                        self.report.newton = newton;
                        reached = goal;
                    }
                    Err(reason) => break reason,
                }
                if reached >= 1.0 {
                    return self.record_success(Stage::Cuts);
                }
            };
            if self.report.cuts >= self.params.max_cuts || matches!(stopped, StageError::ExcessiveForce(_)) {
                return self.record_failure(Stage::Cuts, reached, stopped);
            }
        }
    }

    /// Solves one increment by Newton and, if that fails, by energy minimization.
    fn solve_substep(&mut self, rve: &mut Rve, target: &Matrix3<f64>) -> Staged<B> {
        match self.increment(rve, target) {
            Err(StageError::ExcessiveForce(force)) => Err(StageError::ExcessiveForce(force)),
            Err(_) if self.params.stages.has(Stage::Regularized) => {
                self.workspace.set_initial_guess(self.model, rve, target);
                self.descend(rve, target)
            }
            outcome => outcome,
        }
    }

    /// Solves one increment by Newton; `rve` is updated only on convergence.
    fn increment(&mut self, rve: &mut Rve, target: &Matrix3<f64>) -> Staged<B> {
        self.workspace.set_initial_guess(self.model, rve, target);
        self.newton(rve, target)
    }

    /// Runs Newton from the positions in the workspace.
    fn newton(&mut self, rve: &mut Rve, target: &Matrix3<f64>) -> Staged<B> {
        let (mut problem, system) = Interior::of(self.model, self.workspace);
        let outcome = system.solve(&mut problem, &self.params.newton_for(self.model.chord_steps()));
        self.accept_if_stable(rve, target, outcome)
    }

    /// Solves the whole increment by energy minimization.
    fn regularized(&mut self, rve: &mut Rve) -> bool {
        self.workspace.set_initial_guess(self.model, rve, self.target);
        let outcome = self.descend(rve, self.target);
        self.record(Stage::Regularized, outcome)
    }

    /// Minimizes the energy from the positions in the workspace.
    fn descend(&mut self, rve: &mut Rve, target: &Matrix3<f64>) -> Staged<B> {
        let outcome = self.minimize();
        self.accept_if_stable(rve, target, outcome)
    }

    fn minimize(&mut self) -> NewtonOutcome<B> {
        let (mut problem, system) = Interior::of(self.model, self.workspace);
        let outcome = system.minimize(&mut problem, self.params.newton.tolerance, &self.params.regularized);
        let newton = match &outcome {
            Ok(newton) => newton,
            Err(failure) => &failure.report,
        };
        self.report.regularized += newton.iterations;
        outcome
    }

    /// Stores the converged state in `rve` if it is stable, and otherwise the minimum that follows the saddle point.
    fn accept_if_stable(&mut self, rve: &mut Rve, target: &Matrix3<f64>, outcome: NewtonOutcome<B>) -> Staged<B> {
        let newton = self.count(outcome)?;
        let newton = self.stabilize(newton)?;
        self.store_state(rve, target);
        Ok(newton)
    }

    fn count(&mut self, outcome: NewtonOutcome<B>) -> Staged<B> {
        match outcome {
            Ok(newton) => {
                self.report.add(&newton);
                Ok(newton)
            }
            Err(failure) => {
                self.report.add(&failure.report);
                if let NewtonError::Solve(SolveError::Singular { .. }) = failure.reason {
                    self.report.singular += 1;
                }
                Err(StageError::Newton(failure.reason))
            }
        }
    }

    /// Ensures that the converged state in the workspace is stable: leaves saddle points and minimizes the energy from
    /// there. On return the solver holds the factor of the stiffness if that is positive definite.
    fn stabilize(&mut self, mut newton: NewtonReport) -> Staged<B> {
        /// Maximum number of saddle points to leave; after the first, minimization usually ends in a minimum.
        const MAX_SADDLES: usize = 10;
        for round in 0.. {
            // The check precedes the factorization, which excessive forces make inaccurate.
            self.check_forces()?;
            let (mut problem, system) = Interior::of(self.model, self.workspace);
            let curvature = system.curvature(&mut problem, self.params.newton.tolerance)?;
            self.workspace.factor_is_exact = curvature == Curvature::Definite;
            self.report.neutral = curvature == Curvature::Neutral;
            self.report.negative_pivots = Some(0);
            let negative_pivots = match curvature {
                Curvature::Definite | Curvature::Neutral => break,
                Curvature::Unknown => {
                    self.report.negative_pivots = None;
                    break;
                }
                Curvature::Indefinite { negative_pivots } => negative_pivots,
            };
            if round == MAX_SADDLES || !self.may_minimize {
                return Err(StageError::Unstable(negative_pivots));
            }
            let (mut problem, system) = Interior::of(self.model, self.workspace);
            let mut walked = NewtonReport::default();
            let departure = system.escape_saddle(&mut problem, self.params.newton.tolerance, &mut walked);
            if departure? == SaddleExit::Stationary {
                (self.report.neutral, self.report.negative_pivots) = (true, negative_pivots);
                break;
            }
            self.report.saddles += 1;
            let outcome = self.minimize();
            newton = self.count(outcome)?;
        }
        Ok(newton)
    }

    /// Checks that no fiber of the converged state in the workspace has an excessive force.
    fn check_forces(&self) -> Result<(), StageError<B::Error>> {
        let fiber = self.model.truss().max_relative_force(&self.workspace.states);
        match fiber.filter(|fiber| fiber.2 >= ExcessiveForce::THRESHOLD) {
            Some(fiber) => Err(StageError::ExcessiveForce(ExcessiveForce::of(fiber))),
            None => Ok(()),
        }
    }

    fn store_state(&self, rve: &mut Rve, target: &Matrix3<f64>) {
        rve.gradient = *target;
        rve.network = self.model.fingerprint;
        rve.clear_sensitivities();
        for (x, &node) in rve.interior.iter_mut().zip(self.model.network().interior()) {
            *x = self.workspace.positions[node as usize];
        }
    }

    /// Solves the rest of the increment by dynamic relaxation, and the last digits by the stage of the
    /// [`RelaxationSwitch`].
    fn solve_by_relaxation(&mut self, rve: &mut Rve) -> bool {
        let tolerance = self.params.newton.tolerance;
        self.may_minimize |= self.params.relaxation_switch.is_some_and(|switch| switch.to == Stage::Regularized);
        let mut path = DeformationPath::new(&rve.gradient, self.target);
        self.workspace.set_initial_guess(self.model, rve, &rve.gradient);
        if let Some(switch) = self.params.relaxation_switch {
            if let Err(reason) = self.relax(&path, switch.residual.max(tolerance)) {
                return self.record_failure(Stage::Relaxation, 0.0, reason.into());
            }
            let before = self.workspace.positions.clone();
            let finished = match switch.to {
                Stage::Newton => self.newton(rve, self.target),
                _ => self.descend(rve, self.target),
            };
            if matches!(finished, Ok(_) | Err(StageError::ExcessiveForce(_))) {
                return self.record(Stage::Relaxation, finished);
            }
            self.workspace.positions = before;
            // The boundary is already at the target: the second relaxation applies no load.
            path = DeformationPath::new(self.target, self.target);
        }
        if let Err(reason) = self.relax(&path, tolerance) {
            return self.record_failure(Stage::Relaxation, 0.0, reason.into());
        }
        let RelaxationReport { residual, relative, .. } = self.report.relaxation;
        let alone = NewtonReport { residuals: vec![residual], relative: vec![relative], ..NewtonReport::default() };
        let outcome = self.stabilize(alone);
        if outcome.is_ok() {
            self.store_state(rve, self.target);
        }
        self.record(Stage::Relaxation, outcome)
    }

    fn relax(&mut self, path: &DeformationPath, tolerance: f64) -> Result<(), RelaxationError> {
        let Workspace { positions, forces, states, .. } = &mut *self.workspace;
        let (truss, floor, masses) = (self.model.truss(), self.model.rounding_floor(), self.model.masses());
        let mut relaxation = Relaxation { truss, masses, floor, positions, forces, states };
        let (report, error) = relaxation.run(path, tolerance, &self.params.relaxation);
        let sum = &mut self.report.relaxation;
        (sum.steps, sum.repeats) = (sum.steps + report.steps, sum.repeats + report.repeats);
        (sum.residual, sum.relative, sum.energies) = (report.residual, report.relative, report.energies);
        error.map_or(Ok(()), Err)
    }

    /// Records the outcome of a stage that solves the whole increment.
    fn record(&mut self, stage: Stage, outcome: Staged<B>) -> bool {
        match outcome {
            Ok(newton) => {
                self.report.newton = newton;
                self.record_success(stage)
            }
            Err(reason) => self.record_failure(stage, 0.0, reason),
        }
    }

    fn record_success(&mut self, stage: Stage) -> bool {
        self.report.stage = Some(stage);
        true
    }

    fn record_failure(&mut self, stage: Stage, progress: f64, reason: StageError<B::Error>) -> bool {
        self.failures.push(StageFailure { stage, cuts: self.report.cuts, progress, reason });
        false
    }
}
