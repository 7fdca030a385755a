//! A cloud of cells, each with a reaction that consumes a reactant and releases heat.
//!
//! The reaction is of first order with an Arrhenius rate: `dc/dt = -k(T) c` with `k(T) = A exp(-T_a / T)`. The
//! temperature of a cell is constant during a step. At high temperature the reaction is many times faster than heat
//! conduction, so each cell subdivides the step according to its own rate.

/// `A`, 1/s.
const FREQUENCY: f64 = 1.0e6;
/// `T_a`, the activation energy over the gas constant, K.
const ACTIVATION: f64 = 6000.0;
/// Heat of reaction, J/mol.
const HEAT: f64 = 2.0e5;
/// The longest substep, in units of `1 / k`.
const MAX_SUBSTEP: f64 = 0.05;

/// Returns `k`, 1/s, at a temperature in K; it is zero at absolute zero.
pub fn rate(temperature: f64) -> f64 {
    if temperature > 0.0 { FREQUENCY * (-ACTIVATION / temperature).exp() } else { 0.0 }
}

/// One cell of the cloud.
#[derive(Clone, Debug)]
pub struct Cell {
    /// The remaining reactant, mol/m^3.
    pub reactant: f64,
}

impl Cell {
    /// Creates a cell before the reaction. The initial amount depends on the number of the cell.
    pub fn new(number: u64) -> Self {
        Self { reactant: 800.0 + 200.0 * (number % 4) as f64 }
    }

    /// Advances the reaction by `dt` (s, positive) at a temperature (K). Returns the heat per volume and time, averaged
    /// over `dt`, W/m^3.
    pub fn step(&mut self, temperature: f64, dt: f64) -> f64 {
        let (extent, before) = (rate(temperature) * dt, self.reactant);
        let steps = (extent / MAX_SUBSTEP).ceil().max(1.0);
        let part = extent / steps;
        for _ in 0..steps as usize {
            // The explicit midpoint rule is of second order.
            let middle = self.reactant - 0.5 * part * self.reactant;
            self.reactant -= part * middle;
        }
        HEAT * (before - self.reactant) / dt
    }
}

/// Independent cells.
#[derive(Clone, Debug)]
pub struct Cloud {
    /// The cells, in order.
    pub cells: Vec<Cell>,
}

impl Cloud {
    /// Creates the cells with the given numbers.
    pub fn of(numbers: &[u64]) -> Self {
        Self { cells: numbers.iter().map(|&number| Cell::new(number)).collect() }
    }

    /// Advances all cells by `dt` (s), each at its own temperature (K). Returns the heat of each cell per volume and
    /// time, W/m^3.
    pub fn step(&mut self, temperatures: &[f64], dt: f64) -> Vec<f64> {
        self.cells.iter_mut().zip(temperatures).map(|(cell, &temperature)| cell.step(temperature, dt)).collect()
    }

    /// Returns the remaining reactant of each cell, mol/m^3.
    pub fn left(&self) -> Vec<f64> {
        self.cells.iter().map(|cell| cell.reactant).collect()
    }
}

/// Runs the cells for `steps` steps of `dt` (s) at one temperature (K). Returns the heat released by each cell per
/// volume, J/m^3.
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

    /// Returns the error of the remaining reactant relative to the exact exponential.
    fn error(temperature: f64, steps: usize, dt: f64) -> f64 {
        let mut cloud = Cloud::of(&[3]);
        let start = cloud.left()[0];
        run(&mut cloud, temperature, steps, dt);
        let exact = start * (-rate(temperature) * dt * steps as f64).exp();
        cloud.left()[0] / exact - 1.0
    }

    /// A substep `z` of the midpoint rule differs from `exp(-z)` by `z^3 / 6`; the bound adds 20 % for the terms of
    /// higher order.
    #[test]
    fn the_reactant_decays_exponentially() {
        for temperature in [350.0, 400.0, 450.0, 500.0] {
            let (steps, dt) = (4, 0.5);
            let bound = 1.2 * rate(temperature) * dt * steps as f64 * MAX_SUBSTEP.powi(2) / 6.0;
            let error = error(temperature, steps, dt);
            assert!(error.abs() < bound, "{temperature} K: {error} above {bound}");
        }
    }

    #[test]
    fn the_error_is_of_second_order_in_the_substep() {
        let dt = 0.8 * MAX_SUBSTEP / rate(400.0);
        let ratio = error(400.0, 1, dt) / error(400.0, 2, 0.5 * dt);
        assert!((3.8..4.2).contains(&ratio), "{ratio}");
    }

    #[test]
    fn heat_is_the_consumed_reactant_times_the_heat_of_reaction() {
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
