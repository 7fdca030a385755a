//! How the ranks of both scales share the work, in `log.jsonl`.

use serde::{Deserialize, Serialize};

/// How the ranks of both scales shared the work of a step or of a run, cuts included.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct ScalesLog {
    /// The ranks of the body.
    #[serde(rename = "macro")]
    pub macro_scale: ScaleLog,
    /// The ranks of the RVEs.
    #[serde(rename = "micro")]
    pub micro_scale: ScaleLog,
    /// Number of migrations of RVEs.
    pub migrations: usize,
    /// RVEs that moved.
    pub moved: usize,
    /// Bytes of their states.
    pub bytes: u64,
    /// Seconds that the slowest rank spent planning and carrying out migrations.
    pub seconds_balancing: f64,
    /// The rank correlation of the expected and the measured costs of all RVEs in the last evaluation of a step; the mean of
    /// several steps.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub skill: Option<f64>,
}

impl ScalesLog {
    /// Summarizes steps.
    pub fn total<'a>(steps: impl IntoIterator<Item = &'a Self>) -> Self {
        let (mut total, mut skills, mut times) = (Self::default(), Vec::new(), [[0.0; 2]; 2]);
        for step in steps {
            let scales = [(&mut total.macro_scale, &step.macro_scale), (&mut total.micro_scale, &step.micro_scale)];
            for ((sum, scale), [any, mean]) in scales.into_iter().zip(&mut times) {
                (sum.sweeps, sum.seconds) = (sum.sweeps + scale.sweeps, sum.seconds + scale.seconds);
                *any += scale.seconds * scale.idle_any;
                *mean += scale.seconds * scale.idle_mean;
            }
            total.migrations += step.migrations;
            total.moved += step.moved;
            total.bytes += step.bytes;
            total.seconds_balancing += step.seconds_balancing;
            skills.extend(step.skill);
        }
        for (scale, [any, mean]) in [&mut total.macro_scale, &mut total.micro_scale].into_iter().zip(times) {
            if scale.seconds > 0.0 {
                (scale.idle_any, scale.idle_mean) = (any / scale.seconds, mean / scale.seconds);
                scale.max_over_mean = 1.0 / (1.0 - scale.idle_mean);
            }
        }
        total.skill = (!skills.is_empty()).then(|| skills.iter().sum::<f64>() / skills.len() as f64);
        total
    }
}

/// How the ranks of one scale shared its work. A sweep is one evaluation of all points; it lasts as long as its slowest
/// rank computes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct ScaleLog {
    /// Number of sweeps.
    pub sweeps: usize,
    /// Their duration in total, s.
    pub seconds: f64,
    /// The share of this time in which at least one rank is idle.
    pub idle_any: f64,
    /// The share of this time that a rank is idle, on average over the ranks.
    pub idle_mean: f64,
    /// The load of the most loaded rank over the mean, averaged over the sweeps by their load.
    pub max_over_mean: f64,
}

impl ScaleLog {
    /// Summarizes sweeps, each given by the seconds that every rank computed.
    pub fn of(sweeps: impl Iterator<Item = Vec<f64>>) -> Self {
        let (mut log, mut least, mut mean) = (Self::default(), 0.0, 0.0);
        for busy in sweeps.filter(|busy| !busy.is_empty()) {
            log.sweeps += 1;
            log.seconds += busy.iter().copied().fold(0.0, f64::max);
            least += busy.iter().copied().fold(f64::INFINITY, f64::min);
            mean += busy.iter().sum::<f64>() / busy.len() as f64;
        }
        if mean > 0.0 {
            log.idle_any = 1.0 - least / log.seconds;
            log.idle_mean = 1.0 - mean / log.seconds;
            log.max_over_mean = log.seconds / mean;
        }
        log
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The total of steps equals the shares of all their evaluations.
    #[test]
    fn the_total_weights_steps_by_their_time() {
        let sweeps = [vec![1.0, 3.0], vec![2.0, 2.0], vec![5.0, 10.0]];
        let of_step = |sweeps: &[Vec<f64>]| ScalesLog {
            micro_scale: ScaleLog::of(sweeps.iter().cloned()),
            migrations: 1,
            bytes: 5,
            skill: Some(sweeps.len() as f64 / 2.0),
            ..ScalesLog::default()
        };
        let total = ScalesLog::total([&of_step(&sweeps[..2]), &of_step(&sweeps[2..])]);
        let (found, all) = (total.micro_scale, ScaleLog::of(sweeps.into_iter()));
        let numbers = |scale: ScaleLog| [scale.seconds, scale.idle_any, scale.idle_mean, scale.max_over_mean];
        for (a, b) in numbers(found).into_iter().zip(numbers(all)) {
            assert!((a - b).abs() < 1e-12, "{found:?} {all:?}");
        }
        assert_eq!((found.sweeps, total.migrations, total.bytes, total.skill), (3, 2, 10, Some(0.75)));
        assert_eq!(total.macro_scale, ScaleLog::default());
    }
}
