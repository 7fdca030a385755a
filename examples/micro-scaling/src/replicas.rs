//! Bodies of any number of RVEs whose costs are those of the recorded ones.

use std::f64::consts::TAU;

use biotissue::las::conformance::Random;
use clap::ValueEnum;

use crate::recording::{Recording, Sample};

/// Which recorded RVE each RVE of the simulated body copies. RVEs are numbered along the sequence that is divided among
/// the ranks at first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Layout {
    /// The recorded body with a finer or coarser mesh: copies of an RVE follow each other, or some RVEs are left out.
    Refine,
    /// Recorded bodies one after the other, each complete but the last; a body with fewer RVEs than recorded is a coarser mesh.
    Tile,
}

/// By what copies differ from the recorded RVE at their place. Factors have mean 1 and a log-normal distribution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Perturbation {
    /// Determines all random numbers.
    pub seed: u64,
    /// An RVE copies a random recorded one at most so many places away in the sequence. Copies of one RVE, which are slow
    /// in the same sweeps, are then not on the same rank.
    pub window: usize,
    /// Standard deviation of the logarithm of the factor that an RVE keeps in all sweeps.
    pub spread: f64,
    /// Standard deviation of the logarithm of the factor of one sweep.
    pub noise: f64,
}

/// The RVEs of a simulated body: each has the whole series of costs of a recorded one.
#[derive(Clone, Copy, Debug)]
pub struct Replicas<'a> {
    /// The recorded costs.
    pub recording: &'a Recording,
    /// Number of RVEs.
    pub units: usize,
    /// Which recorded RVE each one copies.
    pub layout: Layout,
    /// By what its seconds differ from those recorded.
    pub perturbation: Perturbation,
    /// A factor of all seconds, for other networks or cores.
    pub factor: f64,
}

impl Replicas<'_> {
    /// Returns the recorded RVE that an RVE copies.
    pub fn source(&self, unit: usize) -> usize {
        let recorded = self.recording.rves();
        let place = match self.layout {
            Layout::Tile if self.units >= recorded => unit % recorded,
            _ => (unit as u128 * recorded as u128 / self.units as u128) as usize,
        };
        let Perturbation { seed, window, .. } = self.perturbation;
        if window == 0 {
            return place;
        }
        let (first, end) = (place.saturating_sub(window), (place + window + 1).min(recorded));
        first + random([seed, unit as u64, u64::MAX - 1]).below(end - first)
    }

    /// Returns the number of the network of an RVE.
    pub fn class(&self, unit: usize) -> u32 {
        self.recording.class(self.source(unit))
    }

    /// Returns the cost of an RVE in a sweep; `None` if it does not exist then.
    pub fn sample(&self, unit: usize, sweep: usize) -> Option<Sample> {
        let sample = self.recording.sample(self.source(unit), sweep)?;
        let Perturbation { seed, spread, noise, .. } = self.perturbation;
        let mut factor = self.factor;
        if spread > 0.0 {
            factor *= log_normal(spread, [seed, unit as u64, u64::MAX]);
        }
        if noise > 0.0 {
            factor *= log_normal(noise, [seed, unit as u64, sweep as u64]);
        }
        Some(Sample { seconds: factor * sample.seconds, ..sample })
    }
}

/// Returns random numbers that depend on a key only.
fn random(key: [u64; 3]) -> Random {
    Random::new(key.into_iter().fold(0, |mixed, part| Random::new(mixed ^ part).bits()))
}

/// Returns a log-normal number of mean 1 that depends on a key only.
fn log_normal(deviation: f64, key: [u64; 3]) -> f64 {
    let mut random = random(key);
    let mut uniform = || (random.bits() >> 11) as f64 / (1_u64 << 53) as f64;
    // Box-Muller.
    let normal = (-2.0 * (1.0 - uniform()).ln()).sqrt() * (TAU * uniform()).cos();
    (deviation * normal - 0.5 * deviation * deviation).exp()
}

#[cfg(test)]
pub const UNPERTURBED: Perturbation = Perturbation { seed: 1, window: 0, spread: 0.0, noise: 0.0 };

#[cfg(test)]
mod tests {
    use super::*;

    fn recording() -> Recording {
        Recording::of_seconds(&[vec![1.0, 2.0, 3.0], vec![4.0, 5.0, 6.0]], 1)
    }

    fn replicas(recording: &Recording, units: usize, layout: Layout) -> Replicas<'_> {
        Replicas { recording, units, layout, perturbation: UNPERTURBED, factor: 1.0 }
    }

    #[test]
    fn copies_follow_each_other_in_a_finer_mesh_and_bodies_in_tiles() {
        let recording = recording();
        let sources = |units: usize, layout: Layout| -> Vec<usize> {
            let replicas = replicas(&recording, units, layout);
            (0..units).map(|unit| replicas.source(unit)).collect()
        };
        assert_eq!(sources(7, Layout::Refine), [0, 0, 0, 1, 1, 2, 2]);
        assert_eq!(sources(7, Layout::Tile), [0, 1, 2, 0, 1, 2, 0]);
        assert_eq!(sources(2, Layout::Refine), [0, 1]);
        assert_eq!(sources(2, Layout::Tile), [0, 1]);
        assert_eq!(sources(3, Layout::Refine), sources(3, Layout::Tile));
    }

    #[test]
    fn a_copy_has_the_series_of_one_rve() {
        let recording = recording();
        let replicas = Replicas { factor: 0.5, ..replicas(&recording, 6, Layout::Refine) };
        for unit in 0..6 {
            let series = [0, 1].map(|sweep| replicas.sample(unit, sweep).unwrap().seconds);
            let source = unit / 2;
            assert_eq!(series, [0.5 * (source + 1) as f64, 0.5 * (source + 4) as f64]);
            assert_eq!(replicas.sample(unit, 1).unwrap().iterations, 1000 * (source as u32 + 4));
        }
    }

    #[test]
    fn perturbations_depend_on_the_seed_only_and_keep_the_mean() {
        let recording = Recording::of_seconds(&vec![vec![1.0]; 4], 1);
        let with = |perturbation| Replicas { perturbation, ..replicas(&recording, 10_000, Layout::Refine) };
        let seconds = |replicas: &Replicas, sweep| -> Vec<f64> {
            (0..10_000).map(|unit| replicas.sample(unit, sweep).unwrap().seconds).collect()
        };
        let spread = Perturbation { seed: 3, window: 0, spread: 0.4, noise: 0.0 };
        let first = seconds(&with(spread), 0);
        assert_eq!((&first, &first), (&seconds(&with(spread), 0), &seconds(&with(spread), 3)), "kept in all sweeps");
        assert_ne!(first, seconds(&with(Perturbation { seed: 4, ..spread }), 0));
        let mean = first.iter().sum::<f64>() / 1e4;
        let variance = first.iter().map(|value| (value.ln() + 0.08).powi(2)).sum::<f64>() / 1e4;
        assert!((mean - 1.0).abs() < 0.02 && (variance.sqrt() - 0.4).abs() < 0.02, "{mean}, {variance}");
        let noise = with(Perturbation { spread: 0.0, noise: 0.4, ..spread });
        assert_ne!(seconds(&noise, 0), seconds(&noise, 1));
    }

    #[test]
    fn copies_of_random_neighbors_stay_in_the_window() {
        let recording = Recording::of_seconds(&[vec![1.0; 50]], 1);
        let perturbation = Perturbation { window: 3, ..UNPERTURBED };
        let replicas = Replicas { perturbation, ..replicas(&recording, 5000, Layout::Refine) };
        let distances: Vec<i64> = (0..5000).map(|unit| replicas.source(unit) as i64 - unit as i64 / 100).collect();
        assert!((-3..=3).all(|distance| distances.contains(&distance)) && distances.iter().all(|d| d.abs() <= 3));
        assert!((0..5000).all(|unit| replicas.source(unit) == replicas.source(unit) && replicas.source(unit) < 50));
        let inside = &distances[500..4500];
        let mean = inside.iter().sum::<i64>() as f64 / inside.len() as f64;
        assert!(mean.abs() < 0.1, "{mean}");
    }
}
