//! Load balancing of the micro scale: RVEs move between its ranks, and the couplings to the macro scale follow.

use std::collections::HashMap;

use serde::{Deserialize, Serialize};

use super::TwoScaleError;
use crate::coupling::balance::{
    self, BalanceError, Cost, CostHistory, Diffusive, Estimate, Greedy, Iterations, Loads, LongestFirst, Migration,
    MigrationPlan, Predictor, Quantity, Seconds, Trigger, TriggerParams, Unit, Weights, max_over_mean, migrate,
};
use crate::las::{Comm, Message, RealBackend};
use crate::tissue::micro_scale::Units;

/// How the micro scale balances its load.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BalanceParams {
    /// The algorithm that plans which RVEs move.
    pub planner: PlannerName,
    /// What an RVE is expected to cost.
    pub weights: WeightsName,
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

    fn plan<C: Comm>(self, scale: &C, weights: &[f64], bytes: &[u64]) -> Result<(Loads, MigrationPlan), BalanceError> {
        match self {
            Self::Greedy => balance::plan(scale, &Greedy, weights, bytes),
            Self::LongestFirst => balance::plan(scale, &LongestFirst::default(), weights, bytes),
            Self::Diffusive => balance::plan(scale, &Diffusive::default(), weights, bytes),
            #[cfg(feature = "metis")]
            Self::Metis => balance::plan(scale, &balance::Metis::default(), weights, bytes),
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

/// The weights of a run.
enum AnyWeights {
    Unit(Unit),
    Iterations(Iterations),
    Seconds(Seconds),
    Predictor(Box<Predictor>),
}

impl Weights for AnyWeights {
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
pub(super) struct Balancer {
    params: BalanceParams,
    weights: AnyWeights,
    trigger: Trigger,
    is_due: bool,
    /// Seconds of the last sweep on the slowest rank.
    sweep_seconds: f64,
    /// The weight of each RVE before the last sweep, and what it cost then.
    compared: Vec<[f64; 2]>,
}

/// A migration that pays.
pub(super) struct DueMigration {
    loads: Loads,
    plan: MigrationPlan,
    estimate: Estimate,
}

impl DueMigration {
    pub fn report(&self) -> MigrationReport {
        let of_rank = |rank: usize| {
            let units = self.plan.of(rank).iter().flat_map(|(_, units)| units);
            units.map(|&unit| self.loads.bytes(rank, unit)).sum::<u64>()
        };
        MigrationReport {
            iteration: 0,
            units: self.plan.len(),
            bytes: (0..self.plan.ranks()).map(of_rank).sum(),
            max_over_mean: [self.loads.max_over_mean(), self.estimate.max_over_mean],
        }
    }
}

impl Balancer {
    /// Creates a balancer for RVEs of so many networks.
    pub fn new(params: BalanceParams, networks: usize) -> Self {
        let weights = match params.weights {
            WeightsName::Unit => AnyWeights::Unit(Unit),
            WeightsName::Iterations => AnyWeights::Iterations(Iterations),
            WeightsName::Seconds => AnyWeights::Seconds(Seconds),
            // The last class is that of RVEs without a network.
            WeightsName::Predictor => AnyWeights::Predictor(Box::new(Predictor::new(Quantity::Seconds, networks + 1))),
        };
        let trigger = Trigger::new(params.trigger);
        Self { params, weights, trigger, is_due: false, sweep_seconds: 0.0, compared: Vec::new() }
    }

    /// Learns from the costs of a sweep that took `seconds` on this rank. Collective over the scale.
    pub fn observe<C: Comm, B: RealBackend>(
        &mut self,
        scale: &C,
        units: &mut Units<B>,
        seconds: f64,
    ) -> Result<(), TwoScaleError> {
        let (histories, costs) = units.histories();
        let of_cost = |cost: &Cost| match self.params.weights {
            WeightsName::Iterations => cost.iterations,
            _ => cost.seconds,
        };
        let pairs = histories.iter().zip(costs);
        self.compared = pairs.map(|(history, cost)| [self.weights.weight(history), of_cost(cost)]).collect();
        balance::record(scale, &mut self.weights, histories, costs)?;
        let all = scale.gather_all(Message::of(&[seconds]))?;
        let all = all.iter().map(|message| message.values::<f64>().and_then(|values| values.first().copied()));
        let all = all.collect::<Option<Vec<f64>>>().ok_or(TwoScaleError::Protocol)?;
        self.sweep_seconds = all.iter().copied().fold(0.0, f64::max);
        self.is_due |= self.trigger.observe(max_over_mean(&all));
        Ok(())
    }

    /// Returns the skill of the weights in the last sweep. Collective over the scale.
    pub fn skill<C: Comm>(&self, scale: &C) -> Result<Option<f64>, TwoScaleError> {
        let (weights, costs): (Vec<f64>, Vec<f64>) = self.compared.iter().map(|&[weight, cost]| (weight, cost)).unzip();
        Ok(balance::skill(scale, &weights, &costs)?)
    }

    /// Plans a migration if one is due; `None` if it is not or does not pay. Collective over the scale.
    pub fn plan<C: Comm, B: RealBackend>(
        &mut self,
        scale: &C,
        units: &mut Units<B>,
    ) -> Result<Option<DueMigration>, TwoScaleError> {
        if !std::mem::take(&mut self.is_due) {
            return Ok(None);
        }
        let weights: Vec<f64> = units.histories().0.iter().map(|history| self.weights.weight(history)).collect();
        let bytes: Vec<u64> = (0..units.len()).map(|number| units.packed_bytes(number)).collect();
        let (loads, plan) = self.params.planner.plan(scale, &weights, &bytes)?;
        let accepted = self.trigger.accept(&loads, &plan, self.sweep_seconds)?;
        Ok(accepted.map(|estimate| DueMigration { loads, plan, estimate }))
    }

    /// Moves the RVEs of a plan. Collective over the scale.
    pub fn migrate<C: Comm, B: RealBackend>(
        &mut self,
        scale: &C,
        units: &mut Units<B>,
        due: &DueMigration,
    ) -> Result<Migration, TwoScaleError> {
        let moves = due.plan.of(scale.rank());
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
        let mut slowest = [seconds];
        scale.max(&mut slowest)?;
        self.trigger.migrated(&due.loads, &due.plan, &due.estimate, slowest[0]);
        Ok(())
    }
}
