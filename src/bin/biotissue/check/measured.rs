//! The output of `biotissue check --measure`.

use biotissue::app::run::{Forecast, Measurement, RankSplit};
use serde::Serialize;

/// With more networks than this, only the cheapest and the most expensive are printed.
const MOST_NETWORKS: usize = 12;

/// What an evaluation of the body and its RVEs costs here, and on how many ranks.
#[derive(Serialize)]
pub struct Measured {
    #[serde(flatten)]
    pub measurement: Measurement,
    /// `None` if networks of the case have motions that no fiber resists and an RVE found no equilibrium: the times of the
    /// first step then say nothing about those of the others.
    pub forecast: Option<Forecast>,
    /// Whether networks of the case have motions that no fiber resists, so that the forecast is a lower limit.
    #[serde(rename = "forecast_is_least")]
    pub is_floppy: bool,
}

impl Measured {
    /// Returns the lines of the plan.
    pub fn text(&self, steps: usize) -> Vec<String> {
        let Self { measurement, forecast, is_floppy } = self;
        let (body, on) = (duration(measurement.body_seconds), plural(measurement.threads, "thread"));
        let mut lines = vec![format!("measured   {body} per evaluation for assembly and linear solution, on {on}")];
        if measurement.rves() > 0 {
            let (sum, longest) = (duration(measurement.rve_seconds()), duration(measurement.longest()));
            lines.push(format!(
                "           {sum} per evaluation for all RVEs, on one thread; {longest} for the longest RVE"
            ));
            lines.extend(self.networks());
        }
        if measurement.failures > 0 {
            let (failures, evaluations) = (measurement.failures, measurement.evaluations);
            lines.push(format!("           in {failures} of {evaluations} evaluations, an RVE found no equilibrium"));
        }
        if !measurement.converged {
            lines.push("           the first load step did not converge with linear networks".into());
        }
        let Some(forecast) = forecast else {
            lines.push(
                "forecast   none: an RVE or the body found no equilibrium in the first load step; the networks of the warning have motions that no fiber resists".into(),
            );
            return lines;
        };
        let evaluations = plural(measurement.evaluations, "evaluation");
        let (step, run) = (duration(forecast.step_seconds), duration(steps as f64 * forecast.step_seconds));
        lines.push(format!("forecast   {step} per step and {run} for the run in this process, without ranks, on cores that do nothing else"));
        lines.push(format!(
            "           if all steps are like the first, with {evaluations}, and without writing results; steps in which networks \
             lose stability take longer"
        ));
        if *is_floppy {
            lines.push(
                "           at least: the networks of the warning have motions that no fiber resists; under load, their RVEs may take \
                 much longer than here, or find no equilibrium"
                    .into(),
            );
        }
        lines.extend(forecast.splits.iter().map(|split| format!("           {}", line(split))));
        lines.extend(forecast.of_case.iter().map(|split| format!("this case  {}", line(split))));
        lines.push(proposal(forecast));
        lines
    }

    fn networks(&self) -> Vec<String> {
        let mut networks: Vec<_> = self.measurement.networks.iter().collect();
        let left_out = networks.len().saturating_sub(MOST_NETWORKS);
        if left_out > 0 {
            networks.sort_by(|a, b| a.seconds.total_cmp(&b.seconds));
            networks.drain(MOST_NETWORKS / 2..MOST_NETWORKS / 2 + left_out);
        }
        let mut lines: Vec<String> = networks
            .into_iter()
            .map(|network| {
                let name = if network.name.is_empty() { "no network" } else { &network.name };
                let (mean, longest) = (duration(network.seconds), duration(network.longest));
                let (iterations, samples) = (network.iterations, network.samples);
                format!("  {name:<24} {mean} (longest {longest}), {iterations:.1} iterations, {samples} RVEs solved")
            })
            .collect();
        if left_out > 0 {
            lines.insert(MOST_NETWORKS / 2, format!("  ... {left_out} networks between these two ..."));
        }
        lines
    }
}

/// Describes the proposed numbers of ranks.
fn proposal(forecast: &Forecast) -> String {
    let Some(RankSplit { macro_ranks, micro_ranks, .. }) = forecast.proposal else {
        return "proposal   no ranks: there are no RVEs to divide among them".into();
    };
    format!(
        "proposal   macro = {macro_ranks} and micro = {micro_ranks} in [scales], with a core for each rank; more than {} cores are \
         not worth it\n           On one machine, use threads without ranks; on several, one micro rank on each, with a thread per \
         core.",
        macro_ranks + micro_ranks
    )
}

/// Describes a split.
fn line(split: &RankSplit) -> String {
    let RankSplit { macro_ranks, micro_ranks, seconds, body_share } = split;
    let (seconds, share) = (duration(*seconds), 100.0 * body_share);
    format!(
        "{macro_ranks:>3} macro + {micro_ranks:>6} micro ranks: {seconds} per evaluation, {share:.0} % of it for the body"
    )
}

fn plural(count: usize, what: &str) -> String {
    format!("{count} {what}{}", if count == 1 { "" } else { "s" })
}

/// Formats a time with three digits and a unit.
fn duration(seconds: f64) -> String {
    let units = [(86_400.0, "d"), (3600.0, "h"), (60.0, "min"), (1.0, "s"), (1e-3, "ms"), (1e-6, "us")];
    let (size, unit) = units.into_iter().find(|(size, _)| seconds >= *size).unwrap_or((1e-6, "us"));
    let value = seconds / size;
    let digits = if value < 9.995 { 2 } else { usize::from(value < 99.95) };
    format!("{value:.digits$} {unit}")
}

#[cfg(test)]
mod tests {
    use super::duration;

    #[test]
    fn durations_have_three_digits_and_a_unit() {
        let cases = [
            (0.0, "0.00 us"),
            (1.2345e-5, "12.3 us"),
            (0.0123, "12.3 ms"),
            (9.996, "10.0 s"),
            (75.0, "1.25 min"),
            (7200.0, "2.00 h"),
            (864_000.0, "10.0 d"),
        ];
        for (seconds, text) in cases {
            assert_eq!(duration(seconds), text);
        }
    }
}
