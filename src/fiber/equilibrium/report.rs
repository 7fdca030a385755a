//! Statistics and errors of an equilibrium solve.

use std::fmt;

use thiserror::Error;

use super::params::Stage;
use crate::fiber::dynamic_relaxation::{RelaxationError, RelaxationReport};
use crate::fiber::law::{FiberLaw, Law};
use crate::fiber::rve::RveStateError;
use crate::las::{NewtonError, NewtonReport, SolveError};

/// Statistics of an equilibrium solve, summed over its stages.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct EquilibriumReport {
    /// The stage that reached the equilibrium; `None` as long as none did.
    pub stage: Option<Stage>,
    /// Total Newton iterations, plain and regularized, including those of failed solves.
    pub iterations: usize,
    /// Report of the last Newton solve that converged. Its residual history ends at equilibrium; if dynamic relaxation
    /// reached the equilibrium alone, the history holds only the final residual of the relaxation.
    pub newton: NewtonReport,
    /// Number of solves that started from a first-order prediction.
    pub predicted: usize,
    /// Number of times that the increment was halved.
    pub cuts: u32,
    /// Total number of step reductions by the line search.
    pub backtracks: usize,
    /// Total factorizations of a stiffness that was not positive definite.
    pub indefinite: usize,
    /// Total factorizations of a singular stiffness.
    pub singular: usize,
    /// Iterations of regularized Newton, included in `iterations`.
    pub regularized: usize,
    /// Statistics of dynamic relaxation.
    pub relaxation: RelaxationReport,
    /// Number of saddle points of the energy that were reached and left for a minimum.
    pub saddles: usize,
    /// Whether the equilibrium is neutral: stable except for motions that meet no resistance, as in a floppy network at
    /// rest.
    pub neutral: bool,
    /// Number of negative pivots, beyond rounding, of the stiffness at equilibrium: 0 at a minimum; it may be positive
    /// if the equilibrium is `neutral`. `None` if the backend does not count them; meaningless if no equilibrium was
    /// reached.
    pub negative_pivots: Option<usize>,
}

impl EquilibriumReport {
    /// Adds the counts of one Newton solve, plain or regularized.
    pub(super) fn add(&mut self, newton: &NewtonReport) {
        self.iterations += newton.iterations;
        self.backtracks += newton.backtracks;
        self.indefinite += newton.indefinite;
        self.singular += newton.singular;
    }

    /// Adds the counts of two consecutive equilibrium solves; the residual history, the stage and the stability are
    /// those of `next`.
    #[must_use]
    pub fn accumulate(self, next: Self) -> Self {
        Self {
            iterations: self.iterations + next.iterations,
            predicted: self.predicted + next.predicted,
            cuts: self.cuts + next.cuts,
            backtracks: self.backtracks + next.backtracks,
            indefinite: self.indefinite + next.indefinite,
            singular: self.singular + next.singular,
            regularized: self.regularized + next.regularized,
            relaxation: RelaxationReport {
                steps: self.relaxation.steps + next.relaxation.steps,
                repeats: self.relaxation.repeats + next.relaxation.repeats,
                ..next.relaxation
            },
            saddles: self.saddles + next.saddles,
            // Listed, so that a new counter is not forgotten above.
            stage: next.stage,
            newton: next.newton,
            neutral: next.neutral,
            negative_pivots: next.negative_pivots,
        }
    }
}

/// The reason why a stage failed.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum StageError<F: std::error::Error + 'static> {
    /// Newton, plain or regularized, failed.
    #[error(transparent)]
    Newton(#[from] NewtonError<F, F>),
    /// Dynamic relaxation failed.
    #[error(transparent)]
    Relaxation(#[from] RelaxationError),
    /// The stage found an unstable equilibrium, a saddle point of the energy. Either regularized Newton, which would
    /// continue to a minimum, is not among the stages, or every minimization ended in another saddle point. Holds the
    /// number of negative pivots of the stiffness, if the backend counts them.
    #[error("the equilibrium found is unstable{}", format_negative_pivots(*.0))]
    Unstable(Option<usize>),
    /// The affine motion, or an equilibrium that the stage reached, has an excessive force. Never part of
    /// [`RveError::NotConverged`]: the solve returns [`RveError::ExcessiveForce`] instead.
    #[error(transparent)]
    ExcessiveForce(ExcessiveForce),
}

fn format_negative_pivots(negative_pivots: Option<usize>) -> String {
    match negative_pivots {
        None => String::new(),
        Some(1) => ": its stiffness has 1 negative pivot".into(),
        Some(count) => format!(": its stiffness has {count} negative pivots"),
    }
}

/// A stage that found no equilibrium, with the reason.
#[derive(Clone, Debug, Error, PartialEq)]
pub struct StageFailure<F: std::error::Error + 'static> {
    /// The stage that failed.
    pub stage: Stage,
    /// Number of times that the increment had been halved.
    pub cuts: u32,
    /// The fraction of the increment that was reached.
    pub progress: f64,
    /// The reason for the failure.
    pub reason: StageError<F>,
}

impl<F: std::error::Error + 'static> fmt::Display for StageFailure<F> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { stage, cuts, progress, reason } = self;
        match stage {
            Stage::Cuts => write!(f, "{stage} ({cuts} halvings, {progress:.4} of the way): {reason}"),
            _ => write!(f, "{stage}: {reason}"),
        }
    }
}

/// Error of an RVE solve.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum RveError<F: std::error::Error + 'static> {
    /// The deformation gradient has no positive determinant. Holds `det F`.
    #[error("the deformation gradient has determinant {0:.3e}; it must be positive")]
    Inverted(f64),
    /// All stages failed.
    #[error("no equilibrium; {}", format_failures(failures))]
    NotConverged {
        /// The failures of the stages, in the order in which they were tried.
        failures: Vec<StageFailure<F>>,
        /// Statistics up to the failure.
        report: Box<EquilibriumReport>,
    },
    /// The workspace was made for another model.
    #[error("the workspace was made for another model: make one with `Workspace::new` for each model")]
    Workspace,
    /// The state does not belong to the network of the model.
    #[error("the RVE does not belong to this model: {0}")]
    State(#[from] RveStateError),
    /// The affine motion or an equilibrium found has a fiber force so large that an equilibrium cannot be
    /// distinguished from rounding.
    #[error("{force}")]
    ExcessiveForce {
        /// The force.
        force: ExcessiveForce,
        /// Statistics up to the failure.
        report: Box<EquilibriumReport>,
    },
    /// The tangent could not be condensed.
    #[error("the condensed tangent could not be computed: {0}")]
    Tangent(#[from] SolveError<F>),
}

/// A fiber whose force is too large for the solver. No fiber withstands such a force; it indicates a deformation or a
/// modulus in a wrong unit.
#[derive(Clone, Debug, Error, PartialEq)]
#[error(
    "the fiber forces are excessive: at stretch {stretch:.4}, the law {law} pulls with {force_ratio:.1e} times the \
     stiffness of the fiber at rest; check the units of lengths, loads and moduli"
)]
pub struct ExcessiveForce {
    /// The law of the fiber with its parameters.
    pub law: String,
    /// The stretch of the fiber.
    pub stretch: f64,
    /// Force over stiffness at rest, `|f| / (E A)`; infinite if that is not a number.
    pub force_ratio: f64,
}

impl ExcessiveForce {
    /// Smallest `force_ratio` that is excessive: the forces of fibers near rest then vanish within the tolerance of
    /// the residual, which is relative to the norm of all forces.
    pub const THRESHOLD: f64 = 1e12;

    /// The force of the fiber with this law, stretch and `force_ratio`.
    pub(super) fn of((law, stretch, force_ratio): (&Law, f64, f64)) -> Self {
        let parameters = FiberLaw::parameters(law).into_iter().map(|(name, value)| format!("{name} = {value:?}"));
        let parameters = parameters.collect::<Vec<_>>().join(", ");
        Self { law: format!("{} ({parameters})", law.name()), stretch, force_ratio }
    }
}

fn format_failures<F: std::error::Error + 'static>(failures: &[StageFailure<F>]) -> String {
    if failures.is_empty() {
        return "no stage was selected".into();
    }
    failures.iter().map(ToString::to_string).collect::<Vec<_>>().join("; ")
}

impl<F: std::error::Error + 'static> RveError<F> {
    /// Returns the statistics up to the failure of the solve; `None` for errors found before the solve, and for
    /// [`Self::Tangent`], which follows a successful solve.
    pub fn report(&self) -> Option<&EquilibriumReport> {
        match self {
            Self::NotConverged { report, .. } | Self::ExcessiveForce { report, .. } => Some(report),
            Self::Inverted(_) | Self::Workspace | Self::State(_) | Self::Tangent(_) => None,
        }
    }

    /// Returns true if the last stage failed because of a singular or unsolvable linear system, and not because the
    /// state is hard to reach.
    pub fn is_linear(&self) -> bool {
        match self {
            Self::Inverted(_) | Self::Workspace | Self::State(_) | Self::ExcessiveForce { .. } => false,
            Self::Tangent(_) => true,
            Self::NotConverged { failures, .. } => failures
                .last()
                .is_some_and(|failure| matches!(failure.reason, StageError::Newton(NewtonError::Solve(_)))),
        }
    }

    /// Returns true if the linear-algebra library itself failed.
    pub fn is_backend_error(&self) -> bool {
        match self {
            Self::Inverted(_) | Self::Workspace | Self::State(_) | Self::ExcessiveForce { .. } => false,
            Self::Tangent(error) => matches!(error, SolveError::Backend(_) | SolveError::Library { .. }),
            Self::NotConverged { failures, .. } => failures.last().is_some_and(|failure| {
                matches!(
                    failure.reason,
                    StageError::Newton(
                        NewtonError::Problem(_)
                            | NewtonError::Solve(SolveError::Backend(_) | SolveError::Library { .. })
                    )
                )
            }),
        }
    }
}
