//! The report: one self-contained HTML page that needs no network access.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use super::directory::{Directory, Increment};
use super::extension::{Extension, Kind, row_at};
use super::picture::{PictureOptions, draw_from};
use super::units::{escape, prefix, quantity, significant};
use super::{ReportError, charts, viewer};
use crate::app::results::{Fields, ResultsError, is_report};
use crate::output;

mod figures;
mod ranks;
mod values;

pub use crate::app::results::REPORT_FILE;
pub use figures::Figure;

/// Writes the page of a result directory to `file`, with [`output::write`], or to `report.html` in that directory, and
/// returns its path.
///
/// # Errors
/// Returns [`ResultsError::UnknownOrigin`] for a `report.html` that this program has not written,
/// [`ResultsError::Write`] if the page cannot be written, and the errors of [`page()`].
pub fn write(dir: &Path, file: Option<&Path>, options: &PictureOptions) -> Result<PathBuf, ReportError> {
    let file = match file {
        Some(file) => file.to_path_buf(),
        None => {
            let path = dir.join(REPORT_FILE);
            if path.symlink_metadata().is_ok() && !is_report(&path)? {
                return Err(ResultsError::UnknownOrigin(path, "is not a page that this command has written").into());
            }
            path
        }
    };
    let page = page(dir, options)?;
    output::write(&file, page.as_bytes()).map_err(|source| ResultsError::Write(file.clone(), source))?;
    Ok(file)
}

/// Returns the HTML text of the page. Parts whose files are missing are omitted.
///
/// # Errors
/// Returns [`ReportError`] if the directory is not a result directory, a file in it is damaged, or a requested step or
/// field does not exist.
pub fn page(dir: &Path, options: &PictureOptions) -> Result<String, ReportError> {
    let directory = Directory::open(dir)?;
    let run = Run::of(&directory)?;
    let mut html = String::from(HEAD);
    let title = escape(&directory.title());
    html.push_str(&format!(
        "<title>{title}</title>\n<style>{STYLE}{}</style>\n</head>\n<body>\n<main>\n",
        viewer::STYLE
    ));
    html.push_str(&format!("<h1>{title}</h1>\n"));
    html.push_str(&outcome(&directory, &run));
    match draw_from(&directory, options) {
        Ok(picture) => match &run.last_fields {
            Some(fields) => html.push_str(&viewer::html(&directory, fields, options, &picture)?),
            None => html.push_str(&format!("<figure class=\"picture\">{picture}</figure>\n")),
        },
        // Without fields there is no picture, but a requested step or field must exist.
        Err(ReportError::NoFields { .. }) => {}
        Err(error) => return Err(error),
    }
    let rows = values::rows(&run);
    html.push_str(&facts(&directory, &run, &rows));
    html.push_str("<section class=\"charts\">\n");
    figures::all(&run).for_each(|chart| html.push_str(&figure(&chart)));
    html.push_str("</section>\n");
    html.push_str(&values::table(&run, &rows));
    html.push_str(&ranks(&directory));
    html.push_str(&table(&directory, &run));
    html.push_str("</main>\n</body>\n</html>\n");
    Ok(html)
}

/// Returns the charts of the page.
///
/// # Errors
/// Returns [`ReportError`] if the directory is not a result directory, or a file in it is damaged.
pub fn charts(dir: &Path) -> Result<Vec<Figure>, ReportError> {
    let directory = Directory::open(dir)?;
    let mut all: Vec<Figure> = figures::all(&Run::of(&directory)?).collect();
    all.extend(ranks::figures(&directory));
    Ok(all)
}

/// Returns the HTML text of a chart with its caption.
fn figure(Figure { name, svg, caption }: &Figure) -> String {
    // Wider than the other charts.
    let class = if name.starts_with(ranks::STATUS) { " class=\"row\"" } else { "" };
    format!("<figure{class}>{svg}<figcaption>{}</figcaption></figure>\n", escape(caption))
}

/// Returns the charts and the table of the ranks; empty for runs in one process.
fn ranks(directory: &Directory) -> String {
    let (charts, table) = (ranks::figures(directory), ranks::table(directory));
    if charts.is_empty() && table.is_empty() {
        return String::new();
    }
    format!(
        "<h2>Ranks</h2>\n<section class=\"charts\">\n{}</section>\n{table}",
        charts.iter().map(figure).collect::<String>()
    )
}

const HEAD: &str = "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
                    <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
                    <meta name=\"generator\" content=\"biotissue\">\n";

const STYLE: &str = include_str!("page.css");

/// The data shared by the charts, the facts and the table.
struct Run<'a> {
    directory: &'a Directory,
    increments: Vec<Increment<'a>>,
    extension: Option<Extension>,
    last_fields: Option<Fields>,
}

impl<'a> Run<'a> {
    fn of(directory: &'a Directory) -> Result<Self, ReportError> {
        let last = directory.fields.last();
        let last_fields = last.map(|entry| directory.read_fields(entry)).transpose()?;
        // A state within a step that failed has no row of loads with which its fields could be compared.
        let of_row = directory
            .loads
            .as_ref()
            .and_then(|loads| directory.fields.iter().rev().find(|entry| row_at(loads, entry.time).is_some()));
        let other =
            of_row.filter(|entry| Some(*entry) != last).map(|entry| directory.read_fields(entry)).transpose()?;
        let of_time = of_row.zip(other.as_ref().or(last_fields.as_ref())).map(|(entry, fields)| (fields, entry.time));
        let of_time = of_time.or_else(|| last.zip(last_fields.as_ref()).map(|(entry, fields)| (fields, entry.time)));
        let extension = directory.extension(of_time);
        Ok(Self { directory, increments: directory.increments(), extension, last_fields })
    }

    /// Returns the extension or shear in percent if the reference length is known, otherwise the elongation in mm.
    fn extension_of(&self, increment: &Increment) -> Option<f64> {
        let (extension, row) = (self.extension.as_ref()?, increment.row?);
        Some(extension.fraction(row).map_or_else(|| 1e3 * extension.elongation(row), |fraction| 100.0 * fraction))
    }

    fn extension_unit(&self) -> &'static str {
        if self.extension.is_some_and(|extension| extension.length.is_some()) { "%" } else { "mm" }
    }

    fn extension_name(&self) -> &'static str {
        match (self.extension.map(|extension| extension.kind), self.extension_unit()) {
            (Some(Kind::Shear), _) => "shear",
            (_, "%") => "extension",
            _ => "elongation",
        }
    }

    /// Returns the axis of the pull or shear; x if there is none.
    fn axis(&self) -> usize {
        self.extension.map_or(0, |extension| extension.axis)
    }

    /// Returns the force through a surface along the axis of the pull, N.
    fn force_of(&self, increment: &Increment, surface: usize) -> Option<f64> {
        Some(increment.row?.surfaces.get(surface)?.force[self.axis()])
    }

    /// Returns the surfaces whose largest force along the pull exceeds one thousandth of that of all surfaces.
    fn loaded_surfaces(&self) -> Vec<usize> {
        let surfaces = self.directory.loads.as_ref().map_or(0, |loads| loads.names.surfaces.len());
        let most = |surface: usize| {
            let forces = self.increments.iter().filter_map(|increment| self.force_of(increment, surface));
            forces.map(f64::abs).fold(0.0, f64::max)
        };
        let largest = (0..surfaces).map(most).fold(0.0, f64::max);
        (0..surfaces).filter(|&surface| largest > 0.0 && most(surface) > 1e-3 * largest).collect()
    }

    /// Returns the largest force on the body through a surface, N; 0 without a table of loads.
    fn largest_force(&self) -> f64 {
        let surfaces = self.increments.iter().filter_map(|increment| increment.row).flat_map(|row| &row.surfaces);
        let sizes = surfaces.map(|surface| surface.force.iter().map(|part| part * part).sum::<f64>().sqrt());
        sizes.fold(0.0, f64::max)
    }

    /// Returns the power of ten and the prefix of the unit of all forces of the page.
    fn force_prefix(&self) -> (f64, &'static str) {
        prefix(self.largest_force())
    }

    fn surface_name(&self, surface: usize) -> &str {
        self.directory.loads.as_ref().and_then(|loads| loads.names.surfaces.get(surface)).map_or("", String::as_str)
    }
}

/// Returns the paragraph that says whether the run converged, failed or has not ended yet.
fn outcome(directory: &Directory, run: &Run) -> String {
    let increments = run.increments.len();
    let plural = if increments == 1 { "" } else { "s" };
    let (class, words) = match &directory.end {
        Some(end) if end.converged => {
            let resumed_from = directory.start.as_ref().map_or(0, |start| start.resumed_from);
            let since = if resumed_from > 0 { format!(" since step {resumed_from}") } else { String::new() };
            let time = duration(end.seconds);
            let words = match directory.steps.last() {
                Some(last) if last.step == resumed_from => {
                    "there was nothing left to do when the run was resumed".into()
                }
                _ => format!("{time} of wall time{since}"),
            };
            ("state", format!("Converged: {increments} load step{plural}; {words}."))
        }
        Some(end) => {
            let reason = end.reason.as_deref().unwrap_or("no reason was written");
            ("state failed", format!("Failed after {increments} converged load step{plural}: {reason}."))
        }
        None => {
            ("state", format!("{increments} load step{plural} so far; the run has not ended yet, or was interrupted."))
        }
    };
    format!("<p class=\"{class}\">{}</p>\n", escape(&words))
}

/// Formats a duration: `1 h 02 min`, `3 min 20 s`, `4.20 s`.
fn duration(seconds: f64) -> String {
    if !(60.0..1e9).contains(&seconds) {
        return format!("{}\u{a0}s", significant(seconds));
    }
    let whole = seconds.round() as u64;
    if whole >= 3600 {
        format!("{}\u{a0}h {:02}\u{a0}min", whole / 3600, whole % 3600 / 60)
    } else {
        format!("{}\u{a0}min {:02}\u{a0}s", whole / 60, whole % 60)
    }
}

/// Returns the list of sizes, settings and largest values of the run.
fn facts(directory: &Directory, run: &Run, rows: &[values::Row]) -> String {
    let mut facts: Vec<(&str, String)> = Vec::new();
    if let Some(start) = &directory.start {
        facts.extend([
            ("elements", start.elements.to_string()),
            ("nodes", start.nodes.to_string()),
            ("unknowns", start.unknowns.to_string()),
        ]);
        if start.rves > 0 {
            facts.extend([("fiber RVEs", start.rves.to_string()), ("networks", start.networks.to_string())]);
        }
        facts.extend([("backend", start.backend.clone()), ("threads", start.threads.to_string())]);
        facts.push(("version", start.version.clone()));
    } else if let Some(fields) = &run.last_fields {
        facts.extend([("elements", fields.elements.len().to_string()), ("nodes", fields.points.len().to_string())]);
    }
    if let Some(extension) = run.increments.iter().rev().find_map(|increment| run.extension_of(increment)) {
        facts.push((run.extension_name(), format!("{}\u{a0}{}", significant(extension), run.extension_unit())));
    }
    let force = run.largest_force();
    if force > 0.0 {
        facts.push(("largest force on a surface", quantity(force, "N")));
    }
    let stress = |fields: &Fields| fields.cell_scalar("von_mises_stress")?.iter().copied().max_by(f64::total_cmp);
    if let Some(stress) = run.last_fields.as_ref().and_then(stress) {
        let (power, prefix) = values::prefix_of_unit(rows, "Pa");
        facts.push(("largest von Mises stress", format!("{}\u{a0}{prefix}Pa", significant(stress / power))));
    }
    let iterations: usize = directory.steps.iter().map(|step| step.newton.iterations).sum();
    if !directory.steps.is_empty() {
        facts.push(("Newton iterations", iterations.to_string()));
    }
    if !directory.cuts.is_empty() {
        facts.push(("failed attempts", directory.cuts.len().to_string()));
    }
    let cell = |(name, value): &(&str, String)| format!("<div><dt>{name}</dt><dd>{}</dd></div>", escape(value));
    format!("<dl>{}</dl>\n", facts.iter().map(cell).collect::<Vec<_>>().join(""))
}

/// Returns the table of load steps and, below it, that of failed attempts.
fn table(directory: &Directory, run: &Run) -> String {
    if run.increments.is_empty() {
        return cuts(directory);
    }
    let surfaces = run.loaded_surfaces();
    let with_rves = directory.steps.iter().any(|step| step.rve.is_some());
    let with_log = !directory.steps.is_empty();
    let mut head = vec!["step".to_owned(), "t".to_owned()];
    if run.extension.is_some() {
        head.push(format!("{}, {}", run.extension_name(), run.extension_unit()));
    }
    let axis = ["x", "y", "z"][run.axis()];
    let (power, unit) = run.force_prefix();
    head.extend(surfaces.iter().map(|&surface| format!("force {axis} on {}, {unit}N", run.surface_name(surface))));
    if with_log {
        head.extend(["Newton iterations", "relative residual", "cuts", "seconds"].map(str::to_owned));
    }
    if with_rves {
        head.extend(
            [
                "RVE solves",
                "RVE iterations: mean",
                "RVE iterations: median",
                "RVE iterations: 95th percentile",
                "RVE iterations: largest",
            ]
            .map(str::to_owned),
        );
    }
    let mut html = String::from("<h2>Load steps</h2>\n<div class=\"scroll wide\"><table><thead><tr>");
    for column in head {
        let _ = write!(html, "<th>{}</th>", escape(&column));
    }
    html.push_str("</tr></thead>\n<tbody>\n");
    for increment in &run.increments {
        let number = |value: Option<f64>| value.map_or_else(String::new, significant);
        let mut cells = vec![increment.step.to_string(), significant(increment.t)];
        if run.extension.is_some() {
            cells.push(number(run.extension_of(increment)));
        }
        cells.extend(
            surfaces.iter().map(|&surface| number(run.force_of(increment, surface).map(|force| force / power))),
        );
        let newton = increment.log.map(|log| &log.newton);
        if with_log {
            cells.push(newton.map_or_else(String::new, |newton| newton.iterations.to_string()));
            cells.push(
                newton.and_then(|newton| newton.relative.last()).map_or_else(String::new, |r| format!("{r:.1e}")),
            );
            cells.push(increment.log.map_or_else(String::new, |log| log.cuts.to_string()));
            cells.push(number(newton.map(|newton| newton.seconds.total)));
        }
        if with_rves {
            let rve = increment.log.and_then(|log| log.rve.as_ref());
            cells.push(rve.map_or_else(String::new, |rve| rve.solves.to_string()));
            cells.push(number(rve.map(|rve| rve.iterations_mean)));
            for percentile in [rve.and_then(|rve| rve.iterations_median), rve.and_then(|rve| rve.iterations_p95)] {
                cells.push(percentile.map_or_else(String::new, |iterations| iterations.to_string()));
            }
            cells.push(rve.map_or_else(String::new, |rve| rve.iterations_max.to_string()));
        }
        let _ = writeln!(html, "<tr><td>{}</td></tr>", cells.join("</td><td>"));
    }
    html.push_str("</tbody></table></div>\n");
    html + &cuts(directory)
}

fn cuts(directory: &Directory) -> String {
    if directory.cuts.is_empty() {
        return String::new();
    }
    let mut html = String::from(
        "<h2>Failed attempts</h2>\n<div class=\"scroll\"><table><thead><tr><th>step</th><th>target t</th>\
         <th>Newton iterations</th><th class=\"text\">reason</th></tr></thead>\n<tbody>\n",
    );
    for cut in &directory.cuts {
        let (t, reason) = (significant(cut.t), escape(&cut.reason));
        let (step, iterations) = (cut.step, cut.newton.iterations);
        let _ =
            writeln!(html, "<tr><td>{step}</td><td>{t}</td><td>{iterations}</td><td class=\"text\">{reason}</td></tr>");
    }
    html + "</tbody></table></div>\n"
}

#[cfg(test)]
mod tests {
    use super::duration;

    #[test]
    fn durations_have_suitable_units() {
        assert_eq!(duration(4.2), "4.20\u{a0}s");
        assert_eq!(duration(200.2), "3\u{a0}min 20\u{a0}s");
        assert_eq!(duration(3725.0), "1\u{a0}h 02\u{a0}min");
    }
}
