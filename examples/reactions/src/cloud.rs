//! A cloud of cells in each of which a reactant is used up and gives heat.
//!
//! The reaction is of first order, its rate Arrhenius's: `dc/dt = -k(T) c` with `k(T) = A exp(-T_a / T)`. A cell takes
//! its temperature as given for the length of a step. Hot, it reacts many times faster than heat moves, so it divides
//! the step by its own rate.

/// `A`, 1/s.
const FREQUENCY: f64 = 1.0e6;
/// `T_a`, the activation energy over the gas constant, K.
const ACTIVATION: f64 = 6000.0;
/// Heat of reaction, J/mol.
const HEAT: f64 = 2.0e5;
/// The longest sub-step, in units of `1 / k`.
const LONGEST: f64 = 0.05;

/// `k`, 1/s, at a temperature in K. Nothing reacts at absolute zero.
pub fn rate(temperature: f64) -> f64 {
    if temperature > 0.0 { FREQUENCY * (-ACTIVATION / temperature).exp() } else { 0.0 }
}

/// One reaction.
#[derive(Clone, Debug)]
pub struct Cell {
    /// What is left of the reactant, mol/m^3.
    pub reactant: f64,
}

impl Cell {
    /// A cell before the reaction. Not all are filled alike; the number says how.
    pub fn new(number: u64) -> Self {
        Self { reactant: 800.0 + 200.0 * (number % 4) as f64 }
    }

    /// Reacts for `dt` (s, positive) at a temperature (K). Gives the heat of a volume, W/m^3, the mean over `dt`.
    pub fn step(&mut self, temperature: f64, dt: f64) -> f64 {
        let (extent, before) = (rate(temperature) * dt, self.reactant);
        let steps = (extent / LONGEST).ceil().max(1.0);
        let part = extent / steps;
        for _ in 0..steps as usize {
            // The explicit midpoint rule, of second order.
            let middle = self.reactant - 0.5 * part * self.reactant;
            self.reactant -= part * middle;
        }
        HEAT * (before - self.reactant) / dt
    }
}

/// Cells that do not know of each other.
#[derive(Clone, Debug)]
pub struct Cloud {
    /// The cells, in order.
    pub cells: Vec<Cell>,
}

impl Cloud {
    /// The cells of these numbers.
    pub fn of(numbers: &[u64]) -> Self {
        Self { cells: numbers.iter().map(|&number| Cell::new(number)).collect() }
    }

    /// All cells react for `dt` (s), each at its temperature (K). Gives the heat of each, W/m^3.
    pub fn step(&mut self, temperatures: &[f64], dt: f64) -> Vec<f64> {
        self.cells.iter_mut().zip(temperatures).map(|(cell, &temperature)| cell.step(temperature, dt)).collect()
    }

    /// What is left of each cell's reactant, mol/m^3.
    pub fn left(&self) -> Vec<f64> {
        self.cells.iter().map(|cell| cell.reactant).collect()
    }
}

/// Runs the cells for so many steps of `dt` (s) at one temperature (K). Gives the heat that each has released, J/m^3.
pub fn run(cloud: &mut Cloud, temperature: f64, steps: usize, dt: f64) -> Vec<f64> {
    let temperatures = vec![temperature; cloud.cells.len()];
    let mut released = vec![0.0; cloud.cells.len()];
    for _ in 0..steps {
        let heat = cloud.step(&temperatures, dt);
        released.iter_mut().zip(heat).for_each(|(released, heat)| *released += heat * dt);
    }
    released
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By how much of itself the reactant that is left misses the exponential.
    fn error(temperature: f64, steps: usize, dt: f64) -> f64 {
        let mut cloud = Cloud::of(&[3]);
        let start = cloud.left()[0];
        run(&mut cloud, temperature, steps, dt);
        let exact = start * (-rate(temperature) * dt * steps as f64).exp();
        cloud.left()[0] / exact - 1.0
    }

    /// A sub-step `z` of the midpoint rule misses `exp(-z)` by `z^3 / 6`; a fifth more for what follows in the series.
    #[test]
    fn the_reactant_decays_exponentially() {
        for temperature in [350.0, 400.0, 450.0, 500.0] {
            let (steps, dt) = (4, 0.5);
            let bound = 1.2 * rate(temperature) * dt * steps as f64 * LONGEST.powi(2) / 6.0;
            let error = error(temperature, steps, dt);
            assert!(error.abs() < bound, "{temperature} K: {error} above {bound}");
        }
    }

    #[test]
    fn the_error_is_of_second_order_in_the_sub_step() {
        let dt = 0.8 * LONGEST / rate(400.0);
        let ratio = error(400.0, 1, dt) / error(400.0, 2, 0.5 * dt);
        assert!((3.8..4.2).contains(&ratio), "{ratio}");
    }

    #[test]
    fn heat_is_the_reactant_used_up_times_the_heat_of_reaction() {
        for temperature in [0.0, 350.0, 450.0, 550.0] {
            let mut cloud = Cloud::of(&[0, 1, 2, 3, 4]);
            let start = cloud.left();
            let released = run(&mut cloud, temperature, 10, 0.5);
            for ((start, left), released) in start.iter().zip(cloud.left()).zip(released) {
                let expected = HEAT * (start - left);
                assert!((released - expected).abs() < 1e-12 * HEAT * start, "{temperature} K: {released} {expected}");
                assert!((0.0..=*start).contains(&left), "{temperature} K: {left} left of {start}");
            }
        }
    }
}
