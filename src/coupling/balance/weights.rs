//! Weights of units, from what they cost in former sweeps. A sweep is one evaluation of all units of a scale.

use bytemuck::{Pod, Zeroable};

use super::error::BalanceError;
use crate::las::{Comm, CommError, Message};

/// Number of features of a unit.
pub const FEATURES: usize = 4;

/// What a unit cost in one sweep.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Cost {
    /// Iterations of the unit's solver.
    pub iterations: f64,
    /// Seconds of computation.
    pub seconds: f64,
    /// Numbers known after the sweep that may indicate the next cost, such as the strain increment or the stages that
    /// the solver needed; zeros if there are none.
    pub features: [f64; FEATURES],
}

/// The costs of a unit so far: plain data, so that it migrates with the unit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct CostHistory {
    /// The class of the unit: units of one class, such as the RVEs of one network, cost about the same.
    pub class: u32,
    /// Number of sweeps recorded.
    pub sweeps: u32,
    /// Number of sweeps since the last [`restart`](Self::restart).
    pub recent_sweeps: f64,
    /// Iterations in these sweeps.
    pub recent_iterations: f64,
    /// Seconds in these sweeps.
    pub recent_seconds: f64,
    /// Iterations in the last sweep.
    pub iterations: f64,
    /// Seconds in the last sweep.
    pub seconds: f64,
    /// Exponentially smoothed logarithm of 1 + iterations.
    pub smooth_iterations: f64,
    /// Exponentially smoothed logarithm of the seconds.
    pub smooth_seconds: f64,
    /// The features of the last sweep. The caller may replace them by others that are known before the next sweep; they
    /// must then be replaced before every sweep, ahead of its weights.
    pub features: [f64; FEATURES],
    /// One more than the rank on which the unit would be if the last plan had been declined or, respectively, carried out;
    /// zero if the plan does not contain it.
    other_rank: u64,
}

/// The weight of the last sweep in the smoothed costs; the sweeps before it have 1 - `SMOOTHING` in total.
const SMOOTHING: f64 = 0.3;

impl CostHistory {
    /// Creates the history of a new unit.
    pub fn new(class: u32) -> Self {
        Self { class, ..Self::default() }
    }

    /// Appends the cost of a sweep.
    pub fn record(&mut self, cost: &Cost) {
        let share = if self.sweeps == 0 { 1.0 } else { SMOOTHING };
        self.smooth_iterations += share * (log_iterations(cost.iterations) - self.smooth_iterations);
        self.smooth_seconds += share * (log_seconds(cost.seconds) - self.smooth_seconds);
        self.sweeps = self.sweeps.saturating_add(1);
        self.recent_sweeps += 1.0;
        self.recent_iterations += cost.iterations;
        self.recent_seconds += cost.seconds;
        (self.iterations, self.seconds, self.features) = (cost.iterations, cost.seconds, cost.features);
    }

    /// Returns the cost of the last sweep.
    pub fn last(&self) -> Cost {
        Cost { iterations: self.iterations, seconds: self.seconds, features: self.features }
    }

    /// Starts the sums of recent sweeps again; call it after a migration.
    pub fn restart(&mut self) {
        (self.recent_sweeps, self.recent_iterations, self.recent_seconds) = (0.0, 0.0, 0.0);
    }

    /// Sets the rank on which the unit would be if the last plan had been declined or, respectively, carried out.
    pub(super) fn set_other_rank(&mut self, rank: Option<usize>) {
        self.other_rank = rank.map_or(0, |rank| rank as u64 + 1);
    }

    pub(super) fn take_other_rank(&mut self) -> Option<usize> {
        std::mem::take(&mut self.other_rank).checked_sub(1).map(|rank| rank as usize)
    }

    /// Returns a mean of recent sweeps, or the value of the last sweep if there are none; NaN for a new unit.
    fn mean(&self, sum: f64, last: f64) -> f64 {
        match self.sweeps {
            0 => f64::NAN,
            _ if self.recent_sweeps > 0.0 => sum / self.recent_sweeps,
            _ => last,
        }
    }
}

pub(super) fn log_iterations(iterations: f64) -> f64 {
    iterations.max(0.0).ln_1p()
}

/// The floor is below the resolution of the clock.
pub(super) fn log_seconds(seconds: f64) -> f64 {
    seconds.max(1e-9).ln()
}

/// The weights by which units are balanced. A function of the history is a weight too.
pub trait Weights {
    /// Returns the expected cost of a unit in the next sweep, in any unit of measurement; NaN if it is unknown.
    fn weight(&self, history: &CostHistory) -> f64;

    /// Learns from the costs of a sweep; `histories` do not contain this sweep yet.
    fn learn(&mut self, _histories: &[CostHistory], _costs: &[Cost]) {}

    /// Returns what was learned on this rank since the last call, as numbers that add up over the ranks.
    fn take_sums(&mut self) -> Vec<f64> {
        Vec::new()
    }

    /// Adds what was learned on all ranks.
    fn add_sums(&mut self, _sums: &[f64]) {}
}

/// Learns from the costs of a sweep on all ranks and appends them to the histories. Collective over the scale.
///
/// # Errors
/// Returns [`BalanceError`] if the numbers of histories and costs differ, or the communication fails.
pub fn record<C: Comm>(
    scale: &C,
    weights: &mut (impl Weights + ?Sized),
    histories: &mut [CostHistory],
    costs: &[Cost],
) -> Result<(), BalanceError> {
    check_count(scale, histories.len(), costs.len(), "costs")?;
    weights.learn(histories, costs);
    let mut sums = weights.take_sums();
    if !sums.is_empty() {
        scale.sum(&mut sums)?;
        weights.add_sums(&sums);
    }
    histories.iter_mut().zip(costs).for_each(|(history, cost)| history.record(cost));
    Ok(())
}

/// Checks that there are as many values as units on this rank.
pub(super) fn check_count<C: Comm>(
    scale: &C,
    units: usize,
    found: usize,
    what: &'static str,
) -> Result<(), BalanceError> {
    if found == units { Ok(()) } else { Err(BalanceError::Count { rank: scale.rank(), units, found, what }) }
}

/// All units have the weight 1.
#[derive(Clone, Copy, Debug, Default)]
pub struct Unit;

impl Weights for Unit {
    fn weight(&self, _: &CostHistory) -> f64 {
        1.0
    }
}

/// The mean number of iterations since the last migration, as in section 4.5 of the reference text.
#[derive(Clone, Copy, Debug, Default)]
pub struct Iterations;

impl Weights for Iterations {
    fn weight(&self, history: &CostHistory) -> f64 {
        history.mean(history.recent_iterations, history.iterations)
    }
}

/// The mean seconds since the last migration.
#[derive(Clone, Copy, Debug, Default)]
pub struct Seconds;

impl Weights for Seconds {
    fn weight(&self, history: &CostHistory) -> f64 {
        history.mean(history.recent_seconds, history.seconds)
    }
}

/// User-defined weights.
impl<F: Fn(&CostHistory) -> f64> Weights for F {
    fn weight(&self, history: &CostHistory) -> f64 {
        self(history)
    }
}

/// Above this number of units, their skill is that of a sample of about this size. Its error, about 1 %, does not matter,
/// whereas sorting all units of many ranks would take longer than everything else after a sweep.
pub const SKILL_SAMPLE: usize = 10_000;

/// Returns the skill of weights: the [rank correlation](rank_correlation) of the weights and the measured costs of the
/// units of a scale, or of about every n-th one, so that [`SKILL_SAMPLE`] remain. Collective over the scale; the result is
/// the same on all ranks.
///
/// # Errors
/// Returns [`CommError`] if the communication fails.
pub fn skill<C: Comm>(scale: &C, weights: &[f64], measured: &[f64]) -> Result<Option<f64>, CommError> {
    let mut units = [weights.len() as f64];
    scale.sum(&mut units)?;
    let stride = (units[0] as usize).div_ceil(SKILL_SAMPLE).max(1);
    // Each rank has its share of the sample, from another unit on.
    let is_in_sample = |&(unit, _): &(usize, _)| (unit + scale.rank()).is_multiple_of(stride);
    let pairs = weights.iter().zip(measured).enumerate().filter(is_in_sample);
    let pairs: Vec<[f64; 2]> = pairs.map(|(_, (&weight, &cost))| [weight, cost]).collect();
    let all = scale.gather_all(Message::of(&pairs))?;
    let pairs = all.iter().filter_map(|message| message.values::<[f64; 2]>()).flatten();
    let (weights, measured): (Vec<f64>, Vec<f64>) = pairs.map(|&[weight, cost]| (weight, cost)).unzip();
    Ok(rank_correlation(&weights, &measured))
}

/// Returns Spearman's rank correlation of two quantities, from -1 to 1; equal values have the mean of their ranks.
/// Pairs with a NaN do not count. `None` if one of the quantities is constant.
pub fn rank_correlation(a: &[f64], b: &[f64]) -> Option<f64> {
    let known = |(a, b): &(&f64, &f64)| !a.is_nan() && !b.is_nan();
    let (a, b): (Vec<f64>, Vec<f64>) = a.iter().zip(b).filter(known).map(|(&a, &b)| (a, b)).unzip();
    let (a, b) = (ranks(&a), ranks(&b));
    // The sum of the mean ranks is that of the ranks.
    let mean = (a.len() as f64 - 1.0) / 2.0;
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - mean) * (b - mean)).sum::<f64>();
    let scale = (product(&a, &a) * product(&b, &b)).sqrt();
    (scale > 0.0).then(|| product(&a, &b) / scale)
}

/// Returns the rank of each value in ascending order, from 0.
fn ranks(values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
    let (mut ranks, mut first) = (vec![0.0; values.len()], 0);
    for equal in order.chunk_by(|&a, &b| values[a] == values[b]) {
        let mean = first as f64 + (equal.len() as f64 - 1.0) / 2.0;
        equal.iter().for_each(|&at| ranks[at] = mean);
        first += equal.len();
    }
    ranks
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coupling::thread;
    use crate::las::conformance::Random;

    #[test]
    fn weights_are_means_since_the_last_restart() {
        let mut history = CostHistory::new(3);
        assert!(Iterations.weight(&history).is_nan() && Seconds.weight(&history).is_nan());
        assert_eq!(Unit.weight(&history), 1.0);
        for iterations in [2.0, 4.0] {
            history.record(&Cost { iterations, seconds: 0.5, ..Cost::default() });
        }
        assert_eq!((Iterations.weight(&history), Seconds.weight(&history)), (3.0, 0.5));
        history.restart();
        assert_eq!(Iterations.weight(&history), 4.0);
        let moved: CostHistory = bytemuck::pod_read_unaligned(bytemuck::bytes_of(&history));
        assert_eq!(moved, history);
        assert_eq!((|history: &CostHistory| 2.0 * history.iterations).weight(&history), 8.0);
    }

    #[test]
    fn rank_correlation_is_that_of_spearman() {
        assert_eq!(rank_correlation(&[1.0, 2.0, 3.0], &[1.0, 8.0, 27.0]), Some(1.0));
        assert_eq!(rank_correlation(&[1.0, 2.0, 3.0], &[3.0, 2.0, 1.0]), Some(-1.0));
        assert_eq!(rank_correlation(&[1.0, 1.0], &[3.0, 2.0]), None);
        assert_eq!(rank_correlation(&[], &[]), None);
        // Ranks 0, 1.5, 1.5, 3 and 0, 1, 2, 3.
        let tied = rank_correlation(&[1.0, 2.0, 2.0, 3.0, f64::NAN], &[1.0, 2.0, 3.0, 4.0, 0.0]).unwrap();
        assert!((tied - 4.5 / (4.5_f64 * 5.0).sqrt()).abs() < 1e-15);
        let skills = thread::run(3, |comm| {
            let value = comm.rank() as f64;
            skill(&comm, &[value, -value], &[10.0 * value, -20.0 * value])
        });
        assert_eq!(skills.unwrap(), [Some(1.0); 3]);
    }

    /// The weights of half of the units say nothing, whatever their number: those of rank 1.
    #[test]
    fn the_skill_of_many_units_is_that_of_a_sample() {
        let skill_of = |units: usize| {
            let skills = thread::run(2, |comm| {
                let mut random = Random::new(comm.rank() as u64);
                let weights: Vec<f64> = (0..units).map(|_| random.signed()).collect();
                let cost = |&weight: &f64| if comm.rank() == 0 { weight } else { random.signed() };
                skill(&comm, &weights, &weights.iter().map(cost).collect::<Vec<f64>>())
            });
            skills.unwrap()[0].unwrap()
        };
        // Of 20 000 units, every second one is in the sample.
        let (exact, sampled) = (skill_of(SKILL_SAMPLE / 2), skill_of(SKILL_SAMPLE));
        assert!((exact - 0.5).abs() < 0.03 && (sampled - 0.5).abs() < 0.03, "{exact} {sampled}");
    }
}
