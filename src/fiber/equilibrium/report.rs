//! What an equilibrium took, and why there is none.

use std::fmt;

use thiserror::Error;

use super::params::Stage;
use crate::fiber::dynamic_relaxation::{RelaxationError, RelaxationReport};
use crate::fiber::rve::RveStateError;
use crate::las::{NewtonError, NewtonReport, SolveError};

/// What an equilibrium took, stage by stage.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct EquilibriumReport {
    /// The stage that reached it; `None` before one did.
    pub stage: Option<Stage>,
    /// Newton iterations in all, plain and regularized, those of failed attempts included.
    pub iterations: usize,
    /// The last Newton. Its residual history ends at equilibrium; where dynamic relaxation went there alone, the
    /// residual that it left is all of it.
    pub newton: NewtonReport,
    /// Equilibria that started from a first-order prediction.
    pub predicted: usize,
    /// Halvings of the increment.
    pub cuts: u32,
    /// Shortened steps in all.
    pub line_search_cuts: usize,
    /// Factorizations in all of a stiffness that was not positive definite.
    pub indefinite: usize,
    /// Factorizations in all of a stiffness that was singular.
    pub singular: usize,
    /// Iterations of regularized Newton among those above.
    pub regularized: usize,
    /// What dynamic relaxation took.
    pub relaxation: RelaxationReport,
    /// Saddle points of the energy that were reached, and left for a minimum.
    pub saddles: usize,
    /// Whether the state that was reached is stable but for motions that nothing resists, as in a floppy network at rest.
    pub neutral: bool,
    /// Negative pivots of the stiffness of the state that was reached, beyond rounding: 0 of a stable one. `None` before
    /// a state was reached, and where the backend does not count them.
    pub negative_pivots: Option<usize>,
}

impl EquilibriumReport {
    /// Counts a Newton, plain or regularized.
    pub(super) fn add(&mut self, newton: &NewtonReport) {
        self.iterations += newton.iterations;
        self.line_search_cuts += newton.line_search_cuts;
        self.indefinite += newton.indefinite;
        self.singular += newton.singular;
    }

    /// The counts of an equilibrium and of the one after it; the residual history, the stage and the stability are those of
    /// the latter.
    #[must_use]
    pub fn then(self, next: Self) -> Self {
        Self {
            stage: next.stage,
            iterations: self.iterations + next.iterations,
            newton: next.newton,
            predicted: self.predicted + next.predicted,
            cuts: self.cuts + next.cuts,
            line_search_cuts: self.line_search_cuts + next.line_search_cuts,
            indefinite: self.indefinite + next.indefinite,
            singular: self.singular + next.singular,
            regularized: self.regularized + next.regularized,
            relaxation: RelaxationReport {
                steps: self.relaxation.steps + next.relaxation.steps,
                repeats: self.relaxation.repeats + next.relaxation.repeats,
                ..next.relaxation
            },
            saddles: self.saddles + next.saddles,
            neutral: next.neutral,
            negative_pivots: next.negative_pivots,
        }
    }
}

/// What stopped a stage.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum StageError<F: std::error::Error + 'static> {
    /// Newton, plain or regularized.
    #[error("{0}")]
    Newton(NewtonError<F, F>),
    /// Dynamic relaxation.
    #[error("{0}")]
    Relaxation(#[from] RelaxationError),
    /// It found an equilibrium that is not stable: a saddle point of the energy. Either regularized Newton, which would
    /// go on to a minimum, is not among the stages, or one saddle point followed another.
    #[error("the equilibrium found is unstable{}", counted(*.negative_pivots))]
    Unstable {
        /// Negative pivots of its stiffness, where the backend counts them.
        negative_pivots: Option<usize>,
    },
}

fn counted(negative_pivots: Option<usize>) -> String {
    match negative_pivots {
        None => String::new(),
        Some(1) => ": its stiffness has 1 negative pivot".into(),
        Some(count) => format!(": its stiffness has {count} negative pivots"),
    }
}

/// A stage that found no equilibrium.
#[derive(Clone, Debug, Error, PartialEq)]
pub struct StageFailure<F: std::error::Error + 'static> {
    /// Which.
    pub stage: Stage,
    /// Halvings of the increment until then.
    pub cuts: u32,
    /// The part of the increment that was reached.
    pub progress: f64,
    /// What stopped it.
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

/// Why an RVE has no answer.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum RveError<F: std::error::Error + 'static> {
    /// The deformation asked for turns the material inside out.
    #[error("the deformation gradient has determinant {determinant:.3e}; it must be positive")]
    Inverted {
        /// `det F`.
        determinant: f64,
    },
    /// The ladder is exhausted.
    #[error("no equilibrium; {}", told(failures))]
    NotConverged {
        /// What stopped each stage, in the order in which they were tried.
        failures: Vec<StageFailure<F>>,
        /// What was done until then.
        report: Box<EquilibriumReport>,
    },
    /// The workspace was made for another model.
    #[error("the workspace was made for another model: make one with `Workspace::new` for each model")]
    Workspace,
    /// The state cannot be one of this network.
    #[error("the RVE is not one of this model: {0}")]
    State(RveStateError),
    /// Carried along affinely, the fibers pull so hard that no equilibrium can be told from rounding.
    #[error("{0}")]
    Overflow(Overflow),
    /// The tangent could not be condensed.
    #[error("the condensed tangent could not be computed: {0}")]
    Tangent(SolveError<F>),
}

/// A fiber whose force is out of all proportion.
#[derive(Clone, Debug, Error, PartialEq)]
#[error(
    "the forces of the fibers overflow: at stretch {stretch:.4} the law {law} pulls with {multiple:.1e} times the stiffness \
     of the fiber at rest; check the units of lengths, loads and moduli"
)]
pub struct Overflow {
    /// Its law with its parameters.
    pub law: String,
    /// The stretch to which the deformation gradient carries it.
    pub stretch: f64,
    /// Its force over its stiffness at rest, `|f| / (E A)`; infinite where that is no number.
    pub multiple: f64,
}

impl Overflow {
    /// Multiples from here on are too large: the fibers near rest have forces that vanish within the tolerance of the
    /// residual, which is relative to all forces.
    pub const FROM: f64 = 1e12;
}

fn told<F: std::error::Error + 'static>(failures: &[StageFailure<F>]) -> String {
    if failures.is_empty() {
        return "no stage was to be tried".into();
    }
    failures.iter().map(ToString::to_string).collect::<Vec<_>>().join("; ")
}

impl<F: std::error::Error + 'static> RveError<F> {
    /// Whether the last stage that was tried met a singular or unsolvable linear system, rather than a state that is hard
    /// to reach.
    #[must_use]
    pub fn is_linear(&self) -> bool {
        match self {
            Self::Inverted { .. } | Self::Workspace | Self::State(_) | Self::Overflow(_) => false,
            Self::Tangent(_) => true,
            Self::NotConverged { failures, .. } => failures
                .last()
                .is_some_and(|failure| matches!(failure.reason, StageError::Newton(NewtonError::Solve(_)))),
        }
    }

    /// Whether the linear-algebra library failed for reasons of its own.
    #[must_use]
    pub fn is_fault(&self) -> bool {
        match self {
            Self::Inverted { .. } | Self::Workspace | Self::State(_) | Self::Overflow(_) => false,
            Self::Tangent(error) => matches!(error, SolveError::Fault(_) | SolveError::Library { .. }),
            Self::NotConverged { failures, .. } => failures.last().is_some_and(|failure| {
                matches!(
                    failure.reason,
                    StageError::Newton(
                        NewtonError::Problem(_) | NewtonError::Solve(SolveError::Fault(_) | SolveError::Library { .. })
                    )
                )
            }),
        }
    }
}
