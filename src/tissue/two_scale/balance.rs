//! Load balancing of the micro scale: RVEs move between its ranks, and the couplings to the macro scale follow.

use std::collections::HashMap;

use serde::{Deserialize, Serialize};

use super::TwoScaleError;
use crate::coupling::balance::{
    self, BalanceError, Balancer, Cost, CostHistory, Diffusive, DueMigration, Greedy, Iterations, Loads, LongestFirst,
    Migration, MigrationPlan, Planner, Predictor, Quantity, Seconds, TriggerParams, Unit, UnitLoads, Weights, migrate,
};
use crate::las::{Comm, RealBackend};
use crate::tissue::micro_scale::Units;

/// How the micro scale balances its load: `P` is a [`Planner`], `W` is [`RveWeights`]. A case file names both; other
/// callers may pass their own.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BalanceParams<P = PlannerName, W = WeightsName> {
    /// The algorithm that plans which RVEs move; the same on all ranks.
    pub planner: P,
    /// What an RVE is expected to cost; the same on all ranks.
    pub weights: W,
    /// When a migration is due.
    pub trigger: TriggerParams,
    /// When it is carried out.
    pub when: When,
}

/// An algorithm that plans migrations.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PlannerName {
    /// [`Greedy`].
    Greedy,
    /// [`LongestFirst`].
    LongestFirst,
    /// [`Diffusive`].
    #[default]
    Diffusive,
    /// METIS, in a build with it.
    #[cfg(feature = "metis")]
    Metis,
}

/// What an RVE is expected to cost.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum WeightsName {
    /// The same for all.
    Unit,
    /// Its mean Newton iterations since the last migration.
    Iterations,
    /// Its mean seconds since the last migration.
    Seconds,
    /// The prediction of [`Predictor`] for its seconds.
    #[default]
    Predictor,
}

/// When a migration that is due is carried out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum When {
    /// Before the next evaluation of the RVEs.
    #[default]
    Iteration,
    /// Before the first evaluation of the next step.
    Step,
}

impl PlannerName {
    /// All planners of this build.
    pub const ALL: &[Self] = &[
        Self::Greedy,
        Self::LongestFirst,
        Self::Diffusive,
        #[cfg(feature = "metis")]
        Self::Metis,
    ];

    /// Its name in a case file.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Greedy => "greedy",
            Self::LongestFirst => "longest-first",
            Self::Diffusive => "diffusive",
            #[cfg(feature = "metis")]
            Self::Metis => "metis",
        }
    }
}

impl Planner for PlannerName {
    fn plan(&self, loads: &Loads) -> Result<MigrationPlan, BalanceError> {
        match self {
            Self::Greedy => Greedy.plan(loads),
            Self::LongestFirst => LongestFirst::default().plan(loads),
            Self::Diffusive => Diffusive::default().plan(loads),
            #[cfg(feature = "metis")]
            Self::Metis => balance::Metis::default().plan(loads),
        }
    }
}

impl WeightsName {
    /// All weights.
    pub const ALL: &[Self] = &[Self::Unit, Self::Iterations, Self::Seconds, Self::Predictor];

    /// Its name in a case file.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Unit => "unit",
            Self::Iterations => "iterations",
            Self::Seconds => "seconds",
            Self::Predictor => "predictor",
        }
    }
}

impl When {
    /// Both.
    pub const ALL: &[Self] = &[Self::Iteration, Self::Step];

    /// Its name in a case file.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Iteration => "iteration",
            Self::Step => "step",
        }
    }
}

/// A migration that was carried out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct MigrationReport {
    /// Number of the trial state within the step before which it was carried out, from 1.
    pub iteration: usize,
    /// RVEs that moved.
    pub units: usize,
    /// Bytes of their states.
    pub bytes: u64,
    /// The load of the most loaded rank over the mean: before, and as expected after it.
    pub max_over_mean: [f64; 2],
}

/// The load balancing of a step.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BalanceReport {
    /// The migrations.
    pub migrations: Vec<MigrationReport>,
    /// The rank correlation of the expected and the measured costs of all RVEs in the last evaluation.
    pub skill: Option<f64>,
}

/// What RVEs are expected to cost, before their networks are known: a [`WeightsName`], or any [`Weights`].
pub trait RveWeights {
    /// The weights of a run.
    type Weights: Weights;

    /// Returns the weights of RVEs of so many networks. The class of an RVE ([`CostHistory::class`]) is the number of its
    /// network, or their number if it has none.
    fn for_networks(self, networks: usize) -> Self::Weights;

    /// Returns true if the weights expect iterations, and not seconds.
    fn are_iterations(&self) -> bool {
        false
    }
}

/// User-defined weights, which expect seconds, up to a factor.
impl<W: Weights> RveWeights for W {
    type Weights = Self;

    fn for_networks(self, _: usize) -> Self {
        self
    }
}

impl RveWeights for WeightsName {
    type Weights = NamedWeights;

    fn for_networks(self, networks: usize) -> NamedWeights {
        match self {
            Self::Unit => NamedWeights::Unit(Unit),
            Self::Iterations => NamedWeights::Iterations(Iterations),
            Self::Seconds => NamedWeights::Seconds(Seconds),
            // The last class is that of RVEs without a network.
            Self::Predictor => NamedWeights::Predictor(Box::new(Predictor::new(Quantity::Seconds, networks + 1))),
        }
    }

    fn are_iterations(&self) -> bool {
        *self == Self::Iterations
    }
}

/// The weights that a [`WeightsName`] stands for.
pub enum NamedWeights {
    /// The same for all.
    Unit(Unit),
    /// Newton iterations.
    Iterations(Iterations),
    /// Seconds.
    Seconds(Seconds),
    /// Predicted seconds.
    Predictor(Box<Predictor>),
}

impl Weights for NamedWeights {
    fn weight(&self, history: &CostHistory) -> f64 {
        match self {
            Self::Unit(unit) => unit.weight(history),
            Self::Iterations(iterations) => iterations.weight(history),
            Self::Seconds(seconds) => seconds.weight(history),
            Self::Predictor(predictor) => predictor.weight(history),
        }
    }

    fn learn(&mut self, histories: &[CostHistory], costs: &[Cost]) {
        if let Self::Predictor(predictor) = self {
            predictor.learn(histories, costs);
        }
    }

    fn take_sums(&mut self) -> Vec<f64> {
        if let Self::Predictor(predictor) = self { predictor.take_sums() } else { Vec::new() }
    }

    fn add_sums(&mut self, sums: &[f64]) {
        if let Self::Predictor(predictor) = self {
            predictor.add_sums(sums);
        }
    }
}

/// Balances the load of one rank of the micro scale with the others. A sweep is one evaluation of all RVEs.
pub(super) struct RveBalancer<P, V> {
    planner: P,
    weights: V,
    /// Whether the weights expect iterations, and not seconds.
    by_iterations: bool,
    balancer: Balancer,
    /// The weight of each RVE before the last sweep, and what it cost then.
    compared: Vec<[f64; 2]>,
}

impl MigrationReport {
    pub(super) fn new(due: &DueMigration) -> Self {
        Self { iteration: 0, units: due.units(), bytes: due.bytes(), max_over_mean: due.max_over_mean() }
    }
}

impl<P: Planner, V: Weights> RveBalancer<P, V> {
    /// Creates a balancer for RVEs of so many networks.
    pub fn new(params: BalanceParams<P, impl RveWeights<Weights = V>>, networks: usize) -> Self {
        let BalanceParams { planner, weights, trigger, when: _ } = params;
        let by_iterations = weights.are_iterations();
        let (weights, balancer) = (weights.for_networks(networks), Balancer::new(trigger));
        Self { planner, weights, by_iterations, balancer, compared: Vec::new() }
    }

    /// Learns from the costs of a sweep that took `seconds` on this rank. Collective over the scale.
    pub fn observe<C: Comm, B: RealBackend>(
        &mut self,
        scale: &C,
        units: &mut Units<B>,
        seconds: f64,
    ) -> Result<(), TwoScaleError> {
        units.learn_costs();
        let (histories, costs) = units.histories();
        let of_cost = |cost: &Cost| if self.by_iterations { cost.iterations } else { cost.seconds };
        let pairs = histories.iter().zip(costs);
        self.compared = pairs.map(|(history, cost)| [self.weights.weight(history), of_cost(cost)]).collect();
        balance::record(scale, &mut self.weights, histories, costs)?;
        Ok(self.balancer.observe(scale, seconds, histories, costs)?)
    }

    /// Returns the skill of the weights in the last sweep. Collective over the scale.
    pub fn skill<C: Comm>(&self, scale: &C) -> Result<Option<f64>, TwoScaleError> {
        let (weights, costs): (Vec<f64>, Vec<f64>) = self.compared.iter().map(|&[weight, cost]| (weight, cost)).unzip();
        Ok(balance::skill(scale, &weights, &costs)?)
    }

    /// Plans a migration if one is due; `None` if it is not or does not pay. `partners` are the ranks of the macro
    /// scale that the RVEs exchange with, and `exchange` is what that took in the last sweep, if it is known, s. Collective
    /// over the scale.
    pub fn plan<C: Comm, B: RealBackend>(
        &mut self,
        scale: &C,
        units: &mut Units<B>,
        partners: &[u32],
        exchange: Option<f64>,
    ) -> Result<Option<DueMigration>, TwoScaleError> {
        if let Some(seconds) = exchange {
            self.balancer.observe_exchange(seconds);
        }
        if !self.balancer.is_due() {
            return Ok(None);
        }
        let weights: Vec<f64> = units.histories().0.iter().map(|history| self.weights.weight(history)).collect();
        let bytes: Vec<u64> = (0..units.len()).map(|number| units.packed_bytes(number)).collect();
        let own = UnitLoads { weights: &weights, bytes: &bytes, partners };
        Ok(self.balancer.plan(scale, &self.planner, own, units.histories().0)?)
    }

    /// Moves the RVEs of a plan. Collective over the scale.
    pub fn migrate<C: Comm, B: RealBackend>(
        &mut self,
        scale: &C,
        units: &mut Units<B>,
        due: &DueMigration,
    ) -> Result<Migration, TwoScaleError> {
        let moves = due.moves(scale.rank());
        let mut packed = HashMap::with_capacity(moves.len());
        for &number in moves.iter().flat_map(|(_, numbers)| numbers) {
            packed.insert(number as usize, units.pack(number as usize)?);
        }
        let names: Vec<u64> = units.points().iter().map(|&point| point as u64).collect();
        let (migration, arrived) = migrate(scale, moves, &names, |number| packed.remove(&number).unwrap_or_default())?;
        units.migrate(&migration, &arrived)?;
        units.histories().0.iter_mut().for_each(CostHistory::restart);
        Ok(migration)
    }

    /// Records the seconds that a migration took on this rank, with the update of the couplings. Collective over the
    /// scale.
    pub fn migrated<C: Comm>(&mut self, scale: &C, due: &DueMigration, seconds: f64) -> Result<(), TwoScaleError> {
        Ok(self.balancer.migrated(scale, due, seconds)?)
    }
}
