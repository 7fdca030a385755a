//! What an equilibrium may cost, and which stages may be tried.

use crate::fiber::dynamic_relaxation::RelaxationParams;
use crate::las::{NewtonParams, RegularizedParams};

/// A stage of the ladder.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Stage {
    /// The whole increment by Newton with line search.
    Newton,
    /// Regularized Newton: a descent in the energy.
    Regularized,
    /// The increment cut in halves, quarters and so on, each part by Newton (and regularized Newton, where that is
    /// among the stages).
    Cuts,
    /// Damped dynamic relaxation.
    Relaxation,
}

impl Stage {
    /// All of them, in the order in which they are tried.
    pub const ALL: [Self; 4] = [Self::Newton, Self::Regularized, Self::Cuts, Self::Relaxation];

    /// How cases, commands and logs spell it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Newton => "newton",
            Self::Cuts => "cuts",
            Self::Regularized => "regularised",
            Self::Relaxation => "relaxation",
        }
    }

    /// The stage of that name.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|stage| stage.name() == name)
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
    /// These stages and no others.
    #[must_use]
    pub fn of(stages: &[Stage]) -> Self {
        Self(Stage::ALL.map(|stage| stages.contains(&stage)))
    }

    /// Whether a stage is among them.
    #[must_use]
    pub fn has(self, stage: Stage) -> bool {
        self.0[stage as usize]
    }

    /// The stages, in the order in which they are tried.
    pub fn iter(self) -> impl Iterator<Item = Stage> {
        Stage::ALL.into_iter().filter(move |&stage| self.has(stage))
    }
}

/// What an equilibrium may cost.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct EquilibriumParams {
    /// Newton of one increment. Its tolerance, relative to the forces of all nodes, is that of every stage.
    pub newton: NewtonParams,
    /// How often an increment may be halved. Default 6.
    pub max_cuts: u32,
    /// Regularized Newton.
    pub regularized: RegularizedParams,
    /// Dynamic relaxation.
    pub relaxation: RelaxationParams,
    /// Which stage finds the last digits of a dynamic relaxation; `None` if it is to find them itself.
    pub handover: Option<Handover>,
    /// The stages that may be tried. Default all of them.
    pub stages: Stages,
}

/// Where dynamic relaxation stops, and what goes on from there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Handover {
    /// The residual, relative to the forces of all nodes. Default `1e-3`.
    pub residual: f64,
    /// [`Stage::Regularized`] (the default) or [`Stage::Newton`].
    pub to: Stage,
}

impl Default for Handover {
    fn default() -> Self {
        Self { residual: 1e-3, to: Stage::Regularized }
    }
}

impl EquilibriumParams {
    /// The same with these stages. Dynamic relaxation hands over to regularized Newton if that is among them, else to
    /// Newton if that is, and finds the last digits itself if neither is.
    #[must_use]
    pub fn with_stages(self, stages: Stages) -> Self {
        let to = [Stage::Regularized, Stage::Newton].into_iter().find(|&stage| stages.has(stage));
        let residual = self.handover.unwrap_or_default().residual;
        Self { stages, handover: to.map(|to| Handover { residual, to }), ..self }
    }
}

impl Default for EquilibriumParams {
    fn default() -> Self {
        Self {
            newton: NewtonParams::default(),
            max_cuts: 6,
            regularized: RegularizedParams::default(),
            relaxation: RelaxationParams::default(),
            handover: Some(Handover::default()),
            stages: Stages::default(),
        }
    }
}
