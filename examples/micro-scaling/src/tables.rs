//! Tables in Markdown.

use crate::output::line;
use crate::simulation::{Scheme, Totals};
use crate::study::Row;

/// Prints the times of runs. Efficiencies are relative to the first run of the same scheme.
pub fn times(rows: &[Row]) {
    line!(
        "| micro ranks x threads | macro ranks | RVEs per core | scheme | iteration, s | efficiency | efficiency of the RVEs \
         | idle_any | idle_mean | max/mean | bound | largest loss |"
    );
    line!("|{}", "---|".repeat(12));
    for row in rows {
        let Row { rves, ranks, scheme, totals } = row;
        let first = rows.iter().find(|first| first.scheme == *scheme).unwrap_or(row);
        line!(
            "| {} | {} | {:.1} | {} | {} | {:.2} | {:.2} | {:.1} % | {:.1} % | {:.3} | {:.3} | {} |",
            of_ranks(row),
            ranks.macro_ranks,
            *rves as f64 / row.cores() as f64,
            scheme.name(),
            digits(totals.iteration()),
            row.efficiency(first, Totals::iteration),
            row.efficiency(first, |totals| totals.longest),
            100.0 * totals.idle_any(),
            100.0 * totals.idle_mean(),
            totals.max_over_mean(),
            totals.bound / totals.mean,
            totals.largest_loss().name(),
        );
    }
    line!();
}

/// Prints what the time of an iteration is spent on.
pub fn parts(rows: &[Row]) {
    line!(
        "| micro ranks x threads | scheme | RVEs, mean per core, s | largest RVE, s | imbalance, s | exchange, s \
         | macro scale, s | balancing, s | observing, s per sweep | planning, s per plan | synchronizing, s per migration \
         | plans | migrations | RVEs moved by each |"
    );
    line!("|{}", "---|".repeat(14));
    for row in rows {
        let Totals { plans, migrations, sweeps, .. } = row.totals;
        let parts = row.totals.parts().map(|(_, seconds)| digits(seconds)).join(" | ");
        let per = |sum: f64, count: usize| if count > 0 { digits(sum / count as f64) } else { String::new() };
        let moved = if migrations > 0 {
            percent(row.totals.moved as f64 / (migrations * row.rves) as f64)
        } else {
            String::new()
        };
        line!(
            "| {} | {} | {parts} | {} | {} | {} | {plans} | {migrations} | {moved} |",
            of_ranks(row),
            row.scheme.name(),
            per(row.totals.observing, sweeps),
            per(row.totals.planning, plans),
            per(row.totals.synchronizing, migrations),
        );
    }
    line!();
}

/// Prints for each scheme up to how many ranks its efficiency is at least one half, and why it is not beyond.
pub fn limits(rows: &[Row]) {
    let mut schemes: Vec<Scheme> = Vec::new();
    rows.iter().for_each(|row| {
        if !schemes.contains(&row.scheme) {
            schemes.push(row.scheme);
        }
    });
    for scheme in schemes {
        line!("* {}", limit(scheme, rows));
    }
    line!();
}

/// Returns the sentence of a scheme.
fn limit(scheme: Scheme, rows: &[Row]) -> String {
    let own: Vec<&Row> = rows.iter().filter(|row| row.scheme == scheme).collect();
    let efficiency = |row: &Row| row.efficiency(own[0], Totals::iteration);
    let Some(beyond) = own.iter().find(|row| efficiency(row) < 0.5) else {
        let last = own[own.len() - 1];
        return format!("{}: efficiency {:.2} at {} cores", scheme.name(), efficiency(last), last.cores());
    };
    let lost = beyond.totals.largest_loss();
    let seconds = beyond.totals.parts().iter().find(|(part, _)| *part == lost).map_or(0.0, |(_, seconds)| *seconds);
    format!(
        "{}: efficiency {:.2}, below one half, at {} cores; largest loss: {} ({} of an iteration)",
        scheme.name(),
        efficiency(beyond),
        beyond.cores(),
        lost.name(),
        percent(seconds / beyond.totals.iteration())
    )
}

/// Prints the seconds of an iteration over the macro ranks and the ratio, and the efficiency relative to the first run.
pub fn ratios(rows: &[Row], ratios: &[usize]) {
    let head: Vec<String> = ratios.iter().map(|ratio| format!("1:{ratio}")).collect();
    line!("| scheme | macro ranks | {} |", head.join(" | "));
    line!("|{}", "---|".repeat(2 + ratios.len()));
    let mut lines: Vec<(Scheme, usize)> = Vec::new();
    rows.iter().for_each(|row| {
        if !lines.contains(&(row.scheme, row.ranks.macro_ranks)) {
            lines.push((row.scheme, row.ranks.macro_ranks));
        }
    });
    lines.sort_by_key(|&(scheme, macro_ranks)| (scheme as usize, macro_ranks));
    for (scheme, macro_ranks) in lines {
        let cell = |&ratio: &usize| {
            let is_here = |row: &&Row| {
                (row.scheme, row.ranks.macro_ranks, row.ranks.micro) == (scheme, macro_ranks, macro_ranks * ratio)
            };
            let first = rows.iter().find(|row| row.scheme == scheme);
            let cell = rows.iter().find(is_here).zip(first).map(|(row, first)| {
                format!("{} ({:.2})", digits(row.totals.iteration()), row.efficiency(first, Totals::iteration))
            });
            cell.unwrap_or_default()
        };
        let cells: Vec<String> = ratios.iter().map(cell).collect();
        line!("| {} | {macro_ranks} | {} |", scheme.name(), cells.join(" | "));
    }
    line!();
}

/// The columns of a CSV file of all runs.
pub const CSV_HEADER: &str = "table,rves,micro_ranks,threads,macro_ranks,scheme,sweeps,iteration_s,mean_s,largest_rve_s,\
imbalance_s,exchange_s,macro_s,balancing_s,idle_any,idle_mean,observing_s,planning_s,synchronizing_s,plans,migrations,moved";

/// Returns the line of a run in the CSV file; its seconds are those per iteration.
pub fn csv_line(table: &str, row: &Row) -> String {
    let Row { rves, ranks, scheme, totals } = row;
    let per_sweep = |seconds: f64| format!("{:e}", seconds / totals.sweeps as f64);
    let mut cells = vec![table.to_owned()];
    cells.extend([*rves, ranks.micro, ranks.threads, ranks.macro_ranks].map(|number| number.to_string()));
    cells.extend([scheme.name().to_owned(), totals.sweeps.to_string(), format!("{:e}", totals.iteration())]);
    cells.extend(totals.parts().map(|(_, seconds)| format!("{seconds:e}")));
    cells.extend([totals.idle_any(), totals.idle_mean()].map(|share| format!("{share:e}")));
    cells.extend([totals.observing, totals.planning, totals.synchronizing].map(per_sweep));
    cells.extend([totals.plans, totals.migrations, totals.moved].map(|number| number.to_string()));
    cells.join(",")
}

fn of_ranks(row: &Row) -> String {
    let Row { ranks, .. } = row;
    if ranks.threads == 1 { ranks.micro.to_string() } else { format!("{} x {}", ranks.micro, ranks.threads) }
}

fn percent(share: f64) -> String {
    format!("{:.1} %", 100.0 * share)
}

/// Returns a number with three significant digits.
pub fn digits(value: f64) -> String {
    let value = if value.abs() < 1e-12 { 0.0 } else { value };
    if value == 0.0 {
        return "0".into();
    }
    let exponent = value.abs().log10().floor() as i32;
    if (-4..6).contains(&exponent) {
        format!("{value:.*}", (2 - exponent).max(0) as usize)
    } else {
        format!("{value:.2e}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::Ranks;

    fn row(micro: usize, longest: f64, solution: f64) -> Row {
        let totals =
            Totals { sweeps: 2, longest, least: longest, mean: longest, bound: longest, solution, ..Totals::default() };
        Row { rves: 1000, ranks: Ranks { micro, threads: 1, macro_ranks: 1 }, scheme: Scheme::Text, totals }
    }

    #[test]
    fn the_limit_is_the_first_run_below_one_half() {
        let rows = [row(10, 16.0, 4.0), row(20, 8.0, 4.0), row(40, 4.0, 4.0)];
        // 20 on 10, 8 on 40: 20 * 10 / (8 * 40) = 0.625.
        assert_eq!(limit(Scheme::Text, &rows), "text: efficiency 0.62 at 40 cores");
        let rows = [row(10, 16.0, 4.0), row(80, 2.0, 4.0), row(160, 1.0, 4.0)];
        assert_eq!(
            limit(Scheme::Text, &rows),
            "text: efficiency 0.42, below one half, at 80 cores; largest loss: macro scale (66.7 % of an iteration)"
        );
    }

    #[test]
    fn numbers_have_three_digits() {
        let all = [0.0, 12_345.6, 123.456, 1.5, 0.012_345, 1.234e-6, 1.234e7];
        assert_eq!(all.map(digits), ["0", "12346", "123", "1.50", "0.0123", "1.23e-6", "1.23e7"]);
    }

    #[test]
    fn lines_have_the_columns_of_their_head() {
        let line = csv_line("strong", &row(10, 16.0, 4.0));
        assert_eq!(line.split(',').count(), CSV_HEADER.split(',').count(), "{line}");
        assert!(line.starts_with("strong,1000,10,1,1,text,2,1e1,8e0,"), "{line}");
    }
}
