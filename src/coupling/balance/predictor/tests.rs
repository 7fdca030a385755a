//! Predictions of synthetic series of costs.

use super::super::weights::{Iterations, Seconds};
use super::super::{Loads, LongestFirst, Planner, max_over_mean};
use super::*;
use crate::coupling::thread;
use crate::las::Comm;
use crate::las::conformance::Random;

const UNITS: usize = 400;
const SWEEPS: usize = 40;
const RANKS: usize = 8;

/// Sweeps of the series by unit.
type Series = Vec<Vec<Cost>>;

/// Returns about normally distributed numbers.
fn normal(random: &mut Random) -> f64 {
    (0..6).map(|_| random.signed()).sum::<f64>() / 2.0_f64.sqrt()
}

/// Units of two classes, of which the second costs three times as much, with costs that vary by `log_cost`.
fn series(seed: u64, mut log_cost: impl FnMut(usize, usize, &mut Random) -> (f64, f64)) -> Series {
    let mut random = Random::new(seed);
    let mut cost = |sweep: usize, unit: usize| {
        let (log_cost, feature) = log_cost(sweep, unit, &mut random);
        let seconds = 1e-3 * if unit % 2 == 1 { 3.0 } else { 1.0 } * log_cost.exp();
        Cost { seconds, iterations: 1e4 * seconds, features: [100.0 * feature, 0.0, 0.0, 0.0] }
    };
    (0..SWEEPS).map(|sweep| (0..UNITS).map(|unit| cost(sweep, unit)).collect()).collect()
}

fn levels(seed: u64, deviation: f64) -> Vec<f64> {
    let mut random = Random::new(seed);
    (0..UNITS).map(|_| deviation * normal(&mut random)).collect()
}

fn constant() -> Series {
    let levels = levels(1, 0.5);
    series(2, |_, unit, random| (levels[unit] + 0.1 * normal(random), 0.0))
}

fn drifting() -> Series {
    let mut levels = levels(3, 0.5);
    series(4, move |_, unit, random| {
        levels[unit] += 0.15 * normal(random);
        (levels[unit], 0.0)
    })
}

fn heavy_tail() -> Series {
    let levels = levels(5, 0.1);
    series(6, |_, unit, random| (levels[unit] + if unit % 33 == 0 { 1.6 } else { 0.0 } + 0.1 * normal(random), 0.0))
}

fn without_persistence() -> Series {
    series(7, |_, _, random| (0.5 * normal(random), 0.0))
}

/// The feature of a sweep determines the next cost.
fn by_feature() -> Series {
    let mut last = vec![0.0; UNITS];
    series(8, move |_, unit, random| {
        let (now, next) = (last[unit], normal(random));
        last[unit] = next;
        (0.5 * now + 0.1 * normal(random), next)
    })
}

/// Returns the mean skill of weights over the last half of the sweeps, and the mean max/mean of sweeps that are
/// balanced by them.
fn quality(weights: &mut dyn Weights, series: &Series) -> [f64; 2] {
    let mut histories: Vec<CostHistory> = (0..UNITS as u32).map(|unit| CostHistory::new(unit % 2)).collect();
    let (mut skill, mut balance) = (0.0, 0.0);
    for (sweep, costs) in series.iter().enumerate() {
        let predicted: Vec<f64> = histories.iter().map(|history| weights.weight(history)).collect();
        let measured: Vec<f64> = costs.iter().map(|cost| cost.seconds).collect();
        if sweep >= SWEEPS / 2 {
            skill += rank_correlation(&predicted, &measured).unwrap_or(0.0) / (SWEEPS - SWEEPS / 2) as f64;
            balance += balanced(&predicted, &measured) / (SWEEPS - SWEEPS / 2) as f64;
        }
        weights.learn(&histories, costs);
        let sums = weights.take_sums();
        weights.add_sums(&sums);
        histories.iter_mut().zip(costs).for_each(|(history, cost)| history.record(cost));
        if sweep % 5 == 4 {
            histories.iter_mut().for_each(CostHistory::restart);
        }
    }
    [skill, balance]
}

/// Returns max/mean of the measured costs if units are placed by the predicted ones.
fn balanced(predicted: &[f64], measured: &[f64]) -> f64 {
    let mut all = vec![Vec::new(); RANKS];
    predicted.iter().enumerate().for_each(|(unit, &weight)| all[unit * RANKS / UNITS].push(weight));
    let loads = Loads::new(&all).unwrap();
    let plan = LongestFirst { stay: 0.0 }.plan(&loads).unwrap();
    let mut sums = [0.0; RANKS];
    let offset = |rank: usize| loads.counts()[..rank].iter().sum::<usize>();
    for (unit, &rank) in loads.rank_of_units().iter().enumerate() {
        let index = (unit - offset(rank as usize)) as u32;
        let moved = plan.of(rank as usize).iter().find(|(_, units)| units.contains(&index));
        sums[moved.map_or(rank as usize, |(to, _)| to)] += measured[unit];
    }
    max_over_mean(&sums)
}

/// Run with `--nocapture` to see the table of `docs/coupling.md`.
#[test]
fn predictions_are_at_least_as_good_as_means_and_last_costs() {
    let last = |history: &CostHistory| history.seconds;
    println!("| series | predictor | mean since migration | last cost | (skill, max/mean)");
    for (name, series, margin) in [
        ("constant", constant(), -0.02),
        ("drifting", drifting(), -0.01),
        ("heavy tail", heavy_tail(), -0.02),
        ("by feature", by_feature(), 0.3),
        ("without persistence", without_persistence(), 0.02),
    ] {
        let predicted = quality(&mut Predictor::new(Quantity::Seconds, 2), &series);
        let (mean, last) = (quality(&mut Seconds, &series), quality(&mut last.clone(), &series));
        println!("| {name} | {predicted:.3?} | {mean:.3?} | {last:.3?} |");
        assert!(predicted[0] > mean[0].max(last[0]) + margin, "{name}: skill");
        assert!(predicted[1] < mean[1].min(last[1]) + 0.01, "{name}: balance");
    }
}

#[test]
fn units_whose_costs_do_not_persist_get_equal_weights() {
    let mut predictor = Predictor::new(Quantity::Iterations, 2);
    let series = without_persistence();
    quality(&mut predictor, &series);
    let mut histories = [CostHistory::new(0), CostHistory::new(0)];
    histories[0].record(&Cost { iterations: 4.0, ..Cost::default() });
    histories[1].record(&Cost { iterations: 25.0, ..Cost::default() });
    let weights = histories.each_ref().map(|history| predictor.weight(history));
    assert!((weights[0] / weights[1] - 1.0).abs() < 0.25, "{weights:?}");
    assert!(Iterations.weight(&histories[1]) > 6.0 * Iterations.weight(&histories[0]));
}

#[test]
fn new_units_get_the_mean_of_their_class() {
    let mut predictor = Predictor::new(Quantity::Seconds, 3);
    assert!(predictor.weight(&CostHistory::new(0)).is_nan(), "nothing is known");
    let mut lone = CostHistory::new(0);
    lone.record(&Cost { seconds: 0.25, ..Cost::default() });
    assert!((predictor.weight(&lone) - 0.25).abs() < 1e-12);
    quality(&mut predictor, &constant());
    let of_class = |class| predictor.weight(&CostHistory::new(class));
    assert!((of_class(1) / of_class(0) / 3.0 - 1.0).abs() < 0.1, "{} {}", of_class(1), of_class(0));
    assert!((of_class(2) / (of_class(0) * of_class(1)).sqrt() - 1.0).abs() < 0.01, "the mean of all classes");
    assert_eq!(of_class(7), of_class(2), "higher classes count as the last one");
    assert!(predictor.skill().is_some_and(|skill| skill > 0.9), "{:?}", predictor.skill());
}

#[test]
fn all_ranks_learn_the_same() {
    let series = constant();
    let predicted = thread::run(4, |comm| {
        let mut predictor = Predictor::new(Quantity::Seconds, 2);
        let own = (UNITS / 4 * comm.rank())..(UNITS / 4 * (comm.rank() + 1));
        let mut histories: Vec<CostHistory> = own.clone().map(|unit| CostHistory::new(unit as u32 % 2)).collect();
        for costs in &series[..10] {
            super::super::record(&comm, &mut predictor, &mut histories, &costs[own.clone()])?;
        }
        Ok::<_, super::super::BalanceError>(predictor.coefficients)
    });
    let mut predictor = Predictor::new(Quantity::Seconds, 2);
    let mut histories: Vec<CostHistory> = (0..UNITS as u32).map(|unit| CostHistory::new(unit % 2)).collect();
    for costs in &series[..10] {
        predictor.learn(&histories, costs);
        let sums = predictor.take_sums();
        predictor.add_sums(&sums);
        histories.iter_mut().zip(costs).for_each(|(history, cost)| history.record(cost));
    }
    for coefficients in predicted.unwrap() {
        assert!((coefficients - predictor.coefficients).norm() < 1e-9, "{coefficients}");
    }
}

#[test]
fn weights_stay_near_the_costs_when_all_of_them_jump() {
    let mut predictor = Predictor::new(Quantity::Seconds, 2);
    let mut histories: Vec<CostHistory> = (0..60).map(|unit| CostHistory::new(unit % 2)).collect();
    for factor in [1.0, 1.0, 1.0, 1.7, 1.7, 0.6, 1.0] {
        let cost = |class: u32| Cost { seconds: factor * [1e-3, 3.3e-3][class as usize], ..Cost::default() };
        let costs: Vec<Cost> = histories.iter().map(|history| cost(history.class)).collect();
        predictor.learn(&histories, &costs);
        let sums = predictor.take_sums();
        predictor.add_sums(&sums);
        histories.iter_mut().zip(&costs).for_each(|(history, cost)| history.record(cost));
        let weights = histories.iter().map(|history| predictor.weight(history));
        let largest = weights.fold(0.0, f64::max);
        assert!((1e-3..7e-2).contains(&largest), "{largest} after a factor of {factor}");
    }
}
