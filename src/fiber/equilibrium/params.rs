//! Parameters of the equilibrium solve: stages, tolerances and limits.

use std::sync::atomic::{AtomicU8, Ordering};

use crate::fiber::dynamic_relaxation::RelaxationParams;
use crate::las::{NewtonParams, RegularizedParams};

/// A stage of the equilibrium solve.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "app", derive(serde::Serialize, serde::Deserialize))]
pub enum Stage {
    /// Newton with line search for the whole increment.
    Newton,
    /// Regularized Newton: energy minimization.
    Regularized,
    /// The increment in halves, quarters and so on, each part by Newton (and by regularized Newton, if that is among
    /// the stages).
    Cuts,
    /// Damped dynamic relaxation.
    Relaxation,
}

impl Stage {
    /// All stages, in the order in which they are tried.
    pub const ALL: [Self; 4] = [Self::Newton, Self::Regularized, Self::Cuts, Self::Relaxation];

    /// The name of the stage in cases, commands and logs.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Newton => "newton",
            Self::Cuts => "cuts",
            Self::Regularized => "regularized",
            Self::Relaxation => "relaxation",
        }
    }

    /// Returns the stage with this [`Stage::name`]; `regularised` is another name of [`Stage::Regularized`].
    pub fn named(name: &str) -> Option<Self> {
        let name = if name == "regularised" { "regularized" } else { name };
        Self::ALL.into_iter().find(|stage| stage.name() == name)
    }
}

/// The stage in which a solution is, for another thread that reports progress.
#[derive(Debug, Default)]
pub struct StageInProgress(AtomicU8);

impl StageInProgress {
    /// Returns the stage; `None` before the first one.
    pub fn get(&self) -> Option<Stage> {
        let number = usize::from(self.0.load(Ordering::Relaxed));
        number.checked_sub(1).and_then(|number| Stage::ALL.get(number)).copied()
    }

    /// Sets the stage.
    pub fn set(&self, stage: Option<Stage>) {
        let number = stage.and_then(|stage| Stage::ALL.iter().position(|&other| other == stage));
        self.0.store(number.map_or(0, |number| number as u8 + 1), Ordering::Relaxed);
    }
}

impl std::fmt::Display for Stage {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Newton => "Newton",
            Self::Cuts => "cut increments",
            Self::Regularized => "regularized Newton",
            Self::Relaxation => "dynamic relaxation",
        })
    }
}

/// A set of stages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stages([bool; Stage::ALL.len()]);

impl Default for Stages {
    fn default() -> Self {
        Self([true; Stage::ALL.len()])
    }
}

impl Stages {
    /// The set of exactly these stages.
    pub fn of(stages: &[Stage]) -> Self {
        Self(Stage::ALL.map(|stage| stages.contains(&stage)))
    }

    /// Returns true if the set contains `stage`.
    pub fn has(self, stage: Stage) -> bool {
        self.0[stage as usize]
    }

    /// Iterates over the stages in the order in which they are tried.
    pub fn iter(self) -> impl Iterator<Item = Stage> {
        Stage::ALL.into_iter().filter(move |&stage| self.has(stage))
    }
}

/// Parameters of the equilibrium solve.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct EquilibriumParams {
    /// Parameters of Newton for one increment. Its tolerance, relative to the forces of all nodes, applies to every
    /// stage.
    pub newton: NewtonParams,
    /// The most further steps that an iteration of Newton takes with its factorization
    /// ([`NewtonParams::chord_steps`]). Default `None`: with a direct solver, 3 for networks of at least 256 unknowns,
    /// whose factorizations take most of the time; otherwise those of `newton`.
    pub chord_steps: Option<usize>,
    /// Maximum number of times that an increment is halved. Default 6.
    pub max_cuts: u32,
    /// Parameters of regularized Newton.
    pub regularized: RegularizedParams,
    /// Parameters of dynamic relaxation.
    pub relaxation: RelaxationParams,
    /// The stage that computes the last digits after dynamic relaxation; `None` if the relaxation computes them itself.
    pub relaxation_switch: Option<RelaxationSwitch>,
    /// The stages to try. Default all of them.
    pub stages: Stages,
}

/// Residual at which dynamic relaxation stops, and the stage that continues from there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RelaxationSwitch {
    /// Residual at which the relaxation stops, relative to the forces of all nodes. Default `1e-3`.
    pub residual: f64,
    /// The stage that continues: [`Stage::Regularized`] (the default) or [`Stage::Newton`].
    pub to: Stage,
}

impl Default for RelaxationSwitch {
    fn default() -> Self {
        Self { residual: 1e-3, to: Stage::Regularized }
    }
}

impl EquilibriumParams {
    /// Returns the parameters of Newton for a model with these `RveModel::chord_steps`.
    pub(crate) fn newton_for(&self, chord_steps: usize) -> NewtonParams {
        let default = chord_steps.max(self.newton.chord_steps);
        NewtonParams { chord_steps: self.chord_steps.unwrap_or(default), ..self.newton }
    }

    /// Returns these parameters with other stages. Dynamic relaxation hands over to regularized Newton if that is among
    /// them, otherwise to Newton if that is, and computes the last digits itself if neither is.
    #[must_use]
    pub fn with_stages(self, stages: Stages) -> Self {
        let to = [Stage::Regularized, Stage::Newton].into_iter().find(|&stage| stages.has(stage));
        let residual = self.relaxation_switch.unwrap_or_default().residual;
        Self { stages, relaxation_switch: to.map(|to| RelaxationSwitch { residual, to }), ..self }
    }
}

impl Default for EquilibriumParams {
    fn default() -> Self {
        Self {
            newton: NewtonParams::default(),
            chord_steps: None,
            max_cuts: 6,
            regularized: RegularizedParams::default(),
            relaxation: RelaxationParams::default(),
            relaxation_switch: Some(RelaxationSwitch::default()),
            stages: Stages::default(),
        }
    }
}
