//! A predictor of costs.

use nalgebra::{SMatrix, SVector};

use super::weights::{Cost, CostHistory, FEATURES, Weights, log_iterations, log_seconds, rank_correlation};

/// The quantity that a predictor predicts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Quantity {
    /// Seconds of computation.
    #[default]
    Seconds,
    /// Iterations, the same in every run of the same case; a unit costs one iteration at least.
    Iterations,
}

/// The variables of the regression: 1, smoothed and last logarithm of the cost relative to its class, and the features.
const VARIABLES: usize = 3 + FEATURES;

type Vector = SVector<f64, VARIABLES>;
type Matrix = SMatrix<f64, VARIABLES, VARIABLES>;

/// Predicts the next cost of a unit from its history, by a regression that it learns while the units are computed:
///
/// ```text
/// log c' - m = b0 + b1 (s - m) + b2 (log c - m) + b3 f1 + .. + b6 f4
/// ```
///
/// where `c` and `c'` are the last and the next cost of the unit, `s` is its smoothed log cost, `f1` to `f4` are its
/// features, and `m` is the mean log cost of its class. A new unit gets the mean of its class. Where costs persist,
/// `b1` and `b2` become 1 in total, and the weight tends to the cost of the unit; where they do not, the coefficients
/// tend to zero, and all units of a class get equal weights, so that nothing is gained by moving them. The coefficients
/// are those of weighted least squares; each sweep has `FORGETTING` times the weight of the next one, and a ridge holds
/// them at a start value, `b1 = b2 = 1/2`, until there are observations.
#[derive(Clone, Debug)]
pub struct Predictor {
    quantity: Quantity,
    classes: usize,
    /// The weighted sums over all ranks: see `Sums`.
    learned: Vec<f64>,
    /// The sums of the costs on this rank since they were taken last.
    pending: Vec<f64>,
    coefficients: Vector,
    skill: Option<f64>,
}

const FORGETTING: f64 = 0.85;

/// The weight of the start value, in observations.
const RIDGE: f64 = 10.0;

/// Relative differences of costs far below this one predict nothing.
const RESOLUTION: f64 = 1e-3;

/// By how much, in log costs, a prediction may lie beyond the mean of the class, the smoothed and the last cost: a factor
/// of ten. After a jump of all costs, the regression may be far off for a sweep.
const EXTRAPOLATION: f64 = std::f64::consts::LN_10;

/// The positions in the sums: products of variables, products of the variables with the result, number of observations,
/// and then the log cost and the number of costs of each class.
const MOMENTS: usize = VARIABLES * VARIABLES;
const OBSERVATIONS: usize = MOMENTS + VARIABLES;
const CLASSES: usize = OBSERVATIONS + 1;

fn start() -> Vector {
    let mut start = Vector::zeros();
    (start[1], start[2]) = (0.5, 0.5);
    start
}

impl Predictor {
    /// Creates a predictor for units of classes below `classes`; units of higher classes count as the last one.
    pub fn new(quantity: Quantity, classes: usize) -> Self {
        let classes = classes.max(1);
        let sums = vec![0.0; CLASSES + 2 * classes];
        Self { quantity, classes, learned: sums.clone(), pending: sums, coefficients: start(), skill: None }
    }

    /// Returns the skill of the last sweep on this rank: the [rank correlation](rank_correlation) of predicted and
    /// measured costs; `None` if all are equal. [`skill`](super::skill) returns that of the scale.
    pub fn skill(&self) -> Option<f64> {
        self.skill
    }

    fn log_cost(&self, cost: &Cost) -> f64 {
        match self.quantity {
            Quantity::Seconds => log_seconds(cost.seconds),
            Quantity::Iterations => log_iterations(cost.iterations),
        }
    }

    /// Returns the smoothed and the last log cost of a unit.
    fn log_costs(&self, history: &CostHistory) -> (f64, f64) {
        match self.quantity {
            Quantity::Seconds => (history.smooth_seconds, log_seconds(history.seconds)),
            Quantity::Iterations => (history.smooth_iterations, log_iterations(history.iterations)),
        }
    }

    fn class_at(&self, history: &CostHistory) -> usize {
        CLASSES + 2 * (history.class as usize).min(self.classes - 1)
    }

    /// Returns the mean log cost of the class, of all classes if this one is new, or NaN.
    fn class_mean(&self, history: &CostHistory) -> f64 {
        let at = self.class_at(history);
        if self.learned[at + 1] > 0.0 {
            return self.learned[at] / self.learned[at + 1];
        }
        let classes = self.learned[CLASSES..].chunks_exact(2);
        let [sum, count] = classes.fold([0.0, 0.0], |[sum, count], class| [sum + class[0], count + class[1]]);
        sum / count
    }

    fn variables(&self, history: &CostHistory, mean: f64) -> Vector {
        let (smooth, last) = self.log_costs(history);
        let mut variables = Vector::zeros();
        (variables[0], variables[1], variables[2]) = (1.0, smooth - mean, last - mean);
        (0..FEATURES).for_each(|k| variables[3 + k] = history.features[k]);
        variables
    }

    /// Solves the normal equations of the difference to the start value. The ridge is relative to the size of each
    /// variable, so that features may have any unit. That of the log costs is at least the one of differences by
    /// `RESOLUTION`: where all units of a class cost the same, their differences are rounding errors.
    fn fit(&mut self) {
        let count = self.learned[OBSERVATIONS];
        if count <= 0.0 {
            return;
        }
        let mut moments = Matrix::from_column_slice(&self.learned[..MOMENTS]);
        let results = Vector::from_column_slice(&self.learned[MOMENTS..OBSERVATIONS]);
        let residual = results - moments * start();
        for k in 0..VARIABLES {
            moments[(k, k)] += RIDGE / count * moments[(k, k)] + f64::MIN_POSITIVE.sqrt();
        }
        for k in 1..=2 {
            moments[(k, k)] += count * RESOLUTION * RESOLUTION;
        }
        if let Some(factor) = moments.cholesky() {
            self.coefficients = start() + factor.solve(&residual);
        }
    }
}

impl Weights for Predictor {
    fn weight(&self, history: &CostHistory) -> f64 {
        let mean = self.class_mean(history);
        if history.sweeps == 0 {
            return mean.exp();
        }
        // Without any class mean, the history of the unit is all that is known.
        let mean = if mean.is_nan() { self.log_costs(history).0 } else { mean };
        let (smooth, last) = self.log_costs(history);
        let (least, largest) = (mean.min(smooth).min(last), mean.max(smooth).max(last));
        let predicted = mean + self.coefficients.dot(&self.variables(history, mean));
        predicted.clamp(least - EXTRAPOLATION, largest + EXTRAPOLATION).exp()
    }

    fn learn(&mut self, histories: &[CostHistory], costs: &[Cost]) {
        let predicted: Vec<f64> = histories.iter().map(|history| self.weight(history).ln()).collect();
        let measured: Vec<f64> = costs.iter().map(|cost| self.log_cost(cost)).collect();
        self.skill = rank_correlation(&predicted, &measured);
        for (history, &log_cost) in histories.iter().zip(&measured) {
            let at = self.class_at(history);
            self.pending[at] += log_cost;
            self.pending[at + 1] += 1.0;
            let mean = self.class_mean(history);
            if history.sweeps == 0 || mean.is_nan() {
                continue;
            }
            let variables = self.variables(history, mean);
            let products = variables * variables.transpose();
            self.pending[..MOMENTS].iter_mut().zip(products.iter()).for_each(|(sum, product)| *sum += product);
            let results = variables * (log_cost - mean);
            self.pending[MOMENTS..OBSERVATIONS].iter_mut().zip(results.iter()).for_each(|(sum, value)| *sum += value);
            self.pending[OBSERVATIONS] += 1.0;
        }
    }

    fn take_sums(&mut self) -> Vec<f64> {
        let empty = vec![0.0; self.pending.len()];
        std::mem::replace(&mut self.pending, empty)
    }

    fn add_sums(&mut self, sums: &[f64]) {
        self.learned.iter_mut().zip(sums).for_each(|(learned, sum)| *learned = FORGETTING * *learned + sum);
        self.fit();
    }
}

#[cfg(test)]
mod tests;
