//! Heat conduction in a rod: one dimension, prescribed temperatures at both ends.
//!
//! The discretization uses finite differences in space and implicit Euler in time, with the heat capacity `c` per
//! volume, the conductivity `k`, the node distance `h` and the heat `q` of a source per volume and time:
//!
//! ```text
//! c (T_i' - T_i) / dt = k (T_{i-1}' - 2 T_i' + T_{i+1}') / h^2 + q_i
//! ```

use std::convert::Infallible;

/// A rod with its current temperatures.
#[derive(Clone, Debug)]
pub struct Rod {
    /// Conductivity `k`, W/(m K).
    pub conductivity: f64,
    /// Heat capacity `c`, J/(m^3 K).
    pub capacity: f64,
    /// Length, m.
    pub length: f64,
    /// Temperatures of the two ends, K.
    pub ends: [f64; 2],
    /// Temperatures of the equidistant inner nodes, K.
    pub inner: Vec<f64>,
    /// Time step, s.
    pub dt: f64,
}

impl Rod {
    /// Returns the numbers of the inner nodes; node 0 is an end.
    pub fn nodes(&self) -> Vec<u64> {
        (1..=self.inner.len() as u64).collect()
    }

    /// Returns the positions of the inner nodes, m.
    pub fn places(&self) -> impl Iterator<Item = f64> {
        let spacing = self.spacing();
        (1..=self.inner.len()).map(move |node| node as f64 * spacing)
    }

    /// Returns the distance between neighboring nodes, m.
    fn spacing(&self) -> f64 {
        self.length / (self.inner.len() + 1) as f64
    }

    /// Takes one time step; `heat` is the source at each inner node, W/m^3.
    pub fn step(&mut self, heat: &[f64]) {
        let r = self.conductivity * self.dt / (self.capacity * self.spacing().powi(2));
        for (temperature, heat) in self.inner.iter_mut().zip(heat) {
            *temperature += self.dt / self.capacity * heat;
        }
        // The prescribed end temperatures go to the right-hand side.
        if let Some(first) = self.inner.first_mut() {
            *first += r * self.ends[0];
        }
        if let Some(last) = self.inner.last_mut() {
            *last += r * self.ends[1];
        }
        solve(r, &mut self.inner);
    }
}

/// Solves in place the tridiagonal system with rows `-r, 1 + 2 r, -r` by the Thomas algorithm.
fn solve(r: f64, values: &mut [f64]) {
    // After the forward elimination, each unknown is its value plus `gain` times the next unknown.
    let mut gains = Vec::with_capacity(values.len());
    let (mut gain, mut before) = (0.0, 0.0);
    for value in values.iter_mut() {
        let pivot = 1.0 + r * (2.0 - gain);
        *value = (*value + r * before) / pivot;
        (gain, before) = (r / pivot, *value);
        gains.push(gain);
    }
    let mut after = 0.0;
    for (value, gain) in values.iter_mut().zip(&gains).rev() {
        *value += gain * after;
        after = *value;
    }
}

/// Runs the rod for `steps` steps. At the start of each step, `source` returns the heat during the step (W/m^3) for the
/// temperatures of the inner nodes (K).
///
/// # Errors
/// Returns the error of `source`.
pub fn run<E>(mut rod: Rod, steps: usize, mut source: impl FnMut(&[f64]) -> Result<Vec<f64>, E>) -> Result<Rod, E> {
    for _ in 0..steps {
        let heat = source(&rod.inner)?;
        rod.step(&heat);
    }
    Ok(rod)
}

/// Returns the source of an uncoupled rod: no heat at any node.
pub fn no_source(temperatures: &[f64]) -> Result<Vec<f64>, Infallible> {
    Ok(vec![0.0; temperatures.len()])
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    const AMPLITUDE: f64 = 50.0;

    fn rod(intervals: usize, dt: f64) -> Rod {
        let inner = vec![300.0; intervals - 1];
        Rod { conductivity: 20.0, capacity: 2.0e6, length: 0.05, ends: [300.0, 300.0], inner, dt }
    }

    /// Returns the decay rate of the longest wave between ends of equal temperature, 1/s.
    fn decay(rod: &Rod) -> f64 {
        rod.conductivity / rod.capacity * (PI / rod.length).powi(2)
    }

    /// Returns the amplitude of that wave after the time in which it decays to 1/e, relative to the initial amplitude.
    /// The number of intervals must be even, so that the maximum is at a node.
    fn remaining_amplitude(intervals: usize, steps: usize) -> f64 {
        let mut rod = rod(intervals, 1.0);
        rod.dt = 1.0 / (decay(&rod) * steps as f64);
        let wave: Vec<f64> = rod.places().map(|place| 300.0 + AMPLITUDE * (PI * place / rod.length).sin()).collect();
        rod.inner = wave;
        let Ok(rod) = run(rod, steps, no_source);
        (rod.inner[intervals / 2 - 1] - 300.0) / AMPLITUDE
    }

    /// Second-order differences are exact for a line and for a parabola.
    #[test]
    fn the_steady_state_is_exact() {
        let mut rod = rod(20, 100.0);
        rod.ends = [450.0, 350.0];
        for heat in [0.0, 1.0e6] {
            let Ok(steady) = run(rod.clone(), 200, |inner| Ok::<_, Infallible>(vec![heat; inner.len()]));
            for (place, found) in steady.places().zip(&steady.inner) {
                let line = 450.0 - 100.0 * place / rod.length;
                let expected = line + heat * place * (rod.length - place) / (2.0 * rod.conductivity);
                assert!((found - expected).abs() < 1e-9, "at {place} m: {found} K, not {expected} K");
            }
        }
    }

    #[test]
    fn a_wave_decays_at_its_rate_to_first_order_in_time() {
        let errors = [20, 40, 80].map(|steps| remaining_amplitude(200, steps) - (-1.0_f64).exp());
        assert!(errors[2].abs() < 3e-3, "{errors:?}");
        for pair in errors.windows(2) {
            assert!((1.9..2.1).contains(&(pair[0] / pair[1])), "{errors:?}");
        }
    }

    #[test]
    fn a_wave_decays_at_its_rate_to_second_order_in_space() {
        // The result of implicit Euler with this number of steps and without spatial error.
        let exact = (1.0 + 1.0 / 50.0_f64).powi(-50);
        let errors = [10, 20, 40].map(|intervals| remaining_amplitude(intervals, 50) - exact);
        assert!(errors[2].abs() < 3e-4, "{errors:?}");
        for pair in errors.windows(2) {
            assert!((3.8..4.2).contains(&(pair[0] / pair[1])), "{errors:?}");
        }
    }
}
