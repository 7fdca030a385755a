//! The time of an evaluation on ranks, forecast from a measurement.

use serde::Serialize;

use super::measurement::Measurement;

/// Bytes that an RVE receives and sends in one evaluation: deformation gradient, stress and tangent.
const BYTES_PER_RVE: f64 = 816.0;
/// Bytes per second that a macro rank sends and receives.
const BANDWIDTH: f64 = 1e9;
/// Seconds that a macro rank takes for each micro rank that it exchanges messages with.
const LATENCY: f64 = 5e-6;
/// The share of the work on the body that several macro ranks cannot divide.
const SERIAL_SHARE: f64 = 0.1;
/// Twice as many ranks pay if they shorten an evaluation to at most this fraction.
const PAYS: f64 = 0.8;

/// A number of ranks for each scale.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct RankSplit {
    /// Ranks of the macro scale.
    #[serde(rename = "macro")]
    pub macro_ranks: usize,
    /// Ranks of the micro scale.
    #[serde(rename = "micro")]
    pub micro_ranks: usize,
    /// The forecast time of one evaluation of the body and its RVEs, s.
    pub seconds: f64,
    /// The share of it that the macro ranks work on the body.
    pub body_share: f64,
}

/// How the time of an evaluation falls with the number of ranks.
///
/// A micro rank is taken as one thread, and its load as balanced; no evaluation is shorter than the longest solution of
/// an RVE. Only backends that distribute the body divide the work on it among macro ranks, but for a tenth. A macro rank
/// exchanges 1 GB/s, and needs 5 us per micro rank.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Forecast {
    /// The best split for 2, 4, 8, ... ranks, up to the first number of ranks that no longer pays.
    pub splits: Vec<RankSplit>,
    /// The time of an evaluation in this process, without ranks, s.
    pub alone_seconds: f64,
    /// The time of a step in this process, if all take as many evaluations as the first one, s.
    pub step_seconds: f64,
    /// The split of the largest number of ranks that pays: twice as many would save less than a fifth of the time. `None` if
    /// ranks do not pay at all, because there are no RVEs.
    pub proposal: Option<RankSplit>,
    /// The split of the case, if it has several ranks.
    pub of_case: Option<RankSplit>,
}

impl Forecast {
    /// Forecasts from a measurement; `distributes` tells whether the backend divides the body among several macro ranks, and
    /// `of_case` has the numbers of macro and micro ranks of the case.
    pub fn new(measurement: &Measurement, distributes: bool, of_case: [usize; 2]) -> Self {
        let alone_seconds = measurement.body_seconds
            + (measurement.rve_seconds() / measurement.threads as f64).max(measurement.longest());
        let step_seconds = measurement.evaluations.max(1) as f64 * alone_seconds;
        let (rves, [macro_ranks, micro_ranks]) = (measurement.rves(), of_case);
        if rves == 0 {
            return Self { splits: Vec::new(), alone_seconds, step_seconds, proposal: None, of_case: None };
        }
        let of_case = (micro_ranks > 0).then(|| {
            let split = split(measurement, if distributes { macro_ranks } else { 1 }, micro_ranks);
            RankSplit { macro_ranks, ..split }
        });
        let mut splits: Vec<RankSplit> = vec![best_split(measurement, 2, distributes)];
        let pays = |before: &RankSplit, after: &RankSplit| after.seconds <= PAYS * before.seconds;
        while let Some(&last) = splits.last()
            && last.micro_ranks < rves
        {
            let next = best_split(measurement, 2 * (last.macro_ranks + last.micro_ranks), distributes);
            splits.push(next);
            if !pays(&last, &next) {
                break;
            }
        }
        let proposal = splits.windows(2).take_while(|pair| pays(&pair[0], &pair[1])).count();
        let proposal = splits.get(proposal).copied();
        Self { splits, alone_seconds, step_seconds, proposal, of_case }
    }
}

/// Returns the split of `ranks` ranks with the shortest evaluation; of equals, that with the fewest macro ranks.
fn best_split(measurement: &Measurement, ranks: usize, distributes: bool) -> RankSplit {
    let powers = std::iter::successors(Some(1_usize), |&ranks| Some(2 * ranks));
    let macro_ranks = powers.take_while(|&macro_ranks| macro_ranks == 1 || distributes && 2 * macro_ranks <= ranks);
    let splits = macro_ranks.map(|macro_ranks| split(measurement, macro_ranks, ranks - macro_ranks));
    splits.min_by(|a, b| a.seconds.total_cmp(&b.seconds)).unwrap_or_else(|| split(measurement, 1, 1))
}

fn split(measurement: &Measurement, macro_ranks: usize, micro_ranks: usize) -> RankSplit {
    let body = measurement.body_seconds * (SERIAL_SHARE + (1.0 - SERIAL_SHARE) / macro_ranks as f64);
    let of_ranks = micro_ranks.min(measurement.rves()) as f64;
    let rves = (measurement.rve_seconds() / of_ranks).max(measurement.longest());
    let exchange = (measurement.rves() as f64 * BYTES_PER_RVE / BANDWIDTH + of_ranks * LATENCY) / macro_ranks as f64;
    let seconds = body + rves + exchange;
    RankSplit { macro_ranks, micro_ranks, seconds, body_share: body / seconds }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::app::run::NetworkCost;

    fn measurement(body_seconds: f64, rves: usize, seconds: f64, longest: f64) -> Measurement {
        let network = NetworkCost { name: "a".into(), rves, samples: 3, seconds, longest, iterations: 4.0 };
        Measurement { evaluations: 4, converged: true, body_seconds, threads: 1, networks: vec![network], failures: 0 }
    }

    #[test]
    fn ranks_pay_until_the_body_takes_most_of_the_time() {
        // 100 s of RVEs, 1 s for the body, 0.08 s of exchange: 128 ranks take 1.87 s, 256 take 1.48 s, 512 take 1.28 s.
        let forecast = Forecast::new(&measurement(1.0, 100_000, 1e-3, 2e-3), false, [1, 0]);
        let proposed = forecast.proposal.unwrap();
        assert_eq!([proposed.macro_ranks, proposed.micro_ranks], [1, 255]);
        assert!((forecast.alone_seconds - 101.0).abs() < 1e-9);
        let [.., before, last] = &forecast.splits[..] else { panic!() };
        assert_eq!(*before, proposed);
        assert!(last.seconds > PAYS * before.seconds && last.seconds < before.seconds);
        let divided = Forecast::new(&measurement(1.0, 100_000, 1e-3, 2e-3), true, [2, 6]);
        let proposed = divided.proposal.unwrap();
        assert!(proposed.macro_ranks > 1 && proposed.micro_ranks > 255, "{proposed:?}");
        let of_case = divided.of_case.unwrap();
        assert_eq!([of_case.macro_ranks, of_case.micro_ranks], [2, 6]);
        assert!((of_case.seconds - (0.55 + 100.0 / 6.0 + 0.0408)).abs() < 1e-3, "{of_case:?}");
        assert_eq!(forecast.of_case, None);
    }

    #[test]
    fn no_evaluation_is_shorter_than_the_longest_rve() {
        let forecast = Forecast::new(&measurement(0.0, 1000, 1e-3, 0.5), false, [1, 0]);
        assert!(forecast.splits.iter().all(|split| split.seconds >= 0.5));
        let proposed = forecast.proposal.unwrap();
        assert!(proposed.micro_ranks < 4, "one RVE takes as long as 500 others: {proposed:?}");
    }

    #[test]
    fn ranks_never_outnumber_the_rves_and_no_rves_need_no_ranks() {
        let forecast = Forecast::new(&measurement(0.0, 5, 1.0, 1.0), false, [1, 0]);
        assert!(forecast.proposal.unwrap().micro_ranks <= 8);
        assert_eq!(Forecast::new(&measurement(1.0, 0, 0.0, 0.0), true, [1, 3]).proposal, None);
    }
}
