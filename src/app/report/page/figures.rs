//! The charts of a page: those for which the directory has data.

use super::Run;
use super::charts::{Labels, Line, extension_and_iterations, lines, lines_by_magnitude, logarithmic, stacked_bars};
use crate::app::report::extension::Kind;
use crate::app::report::units::prefix;
use crate::app::results::loads::LoadRow;
use crate::app::results::log::{NewtonSeconds, RveLog};

/// A chart of the page.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    /// Its name, for the name of a file.
    pub name: String,
    /// What it shows.
    pub caption: String,
    /// The SVG text.
    pub svg: String,
}

impl Figure {
    fn new(name: &str, caption: impl Into<String>, svg: String) -> Self {
        Self { name: name.into(), caption: caption.into(), svg }
    }
}

/// Draws all charts.
pub(super) fn all(run: &Run) -> impl Iterator<Item = Figure> {
    let loads = [force(run), forces_over_time(run), moments(run), pressures(run)];
    let cost = [extension(run), seconds(run), rves(run), convergence(run)];
    loads.into_iter().chain(cost).flatten()
}

/// Returns a chart over pseudo-time of the series of numbers in the rows of loads whose largest value exceeds one
/// thousandth of that of all; `None` if all are zero. `quantity` is their name and `unit` their unit.
fn over_time(
    run: &Run,
    series: impl Iterator<Item = (String, impl Fn(&LoadRow) -> Option<f64>)>,
    (chart, quantity, unit): (&'static str, &str, &str),
) -> Option<String> {
    let points = |value: &dyn Fn(&LoadRow) -> Option<f64>| -> Vec<(f64, f64)> {
        let rows = run.increments.iter().filter_map(|increment| Some((increment.t, increment.row?)));
        std::iter::once((0.0, 0.0)).chain(rows.filter_map(|(t, row)| Some((t, value(row)?)))).collect()
    };
    let mut lines_of: Vec<Line> = series.map(|(name, value)| Line { name, points: points(&value) }).collect();
    let most = |line: &Line| line.points.iter().map(|(_, y)| y.abs()).fold(0.0, f64::max);
    let largest = lines_of.iter().map(most).fold(0.0, f64::max);
    lines_of.retain(|line| most(line) > 1e-3 * largest);
    let (power, prefix) = prefix(largest);
    lines_of.iter_mut().flat_map(|line| &mut line.points).for_each(|(_, y)| *y /= power);
    let y = format!("{quantity} in {prefix}{unit}");
    (!lines_of.is_empty()).then(|| lines(Labels { chart, x: "pseudo-time t", y: &y }, &lines_of))
}

/// The forces of a body that is not pulled.
fn forces_over_time(run: &Run) -> Option<Figure> {
    let names = &run.directory.loads.as_ref().filter(|_| run.extension.is_none())?.names;
    let size = |k: usize| {
        move |row: &LoadRow| Some(row.surfaces.get(k)?.force.iter().map(|part| part * part).sum::<f64>().sqrt())
    };
    let series = names.surfaces.iter().enumerate().map(|(k, name)| (name.clone(), size(k)));
    let chart = over_time(run, series, ("force over time", "size of the force", "N"))?;
    Some(Figure::new("forces", "Size of the force on the body through each loaded surface", chart))
}

fn moments(run: &Run) -> Option<Figure> {
    let names = &run.directory.loads.as_ref()?.names;
    let component = |k: usize, axis: usize| move |row: &LoadRow| Some(row.rigid.get(k)?.moment[axis]);
    let series = names.rigid.iter().enumerate().flat_map(|(k, name)| {
        AXES.into_iter().enumerate().map(move |(axis, of)| (format!("{name}, about {of}"), component(k, axis)))
    });
    let chart = over_time(run, series, ("moment over time", "moment", "N m"))?;
    let caption = "Moment on the body through each rigid surface, about its displaced reference point";
    Some(Figure::new("moments", caption, chart))
}

fn pressures(run: &Run) -> Option<Figure> {
    let names = &run.directory.loads.as_ref()?.names;
    let pressure = |k: usize| move |row: &LoadRow| row.pressures.get(k).copied();
    let series = names.constraints.iter().enumerate().map(|(k, name)| (name.clone(), pressure(k)));
    let chart = over_time(run, series, ("pressure over time", "pressure", "Pa"))?;
    let caption =
        "Pressure of each volume constraint; positive if it presses on the wall of a cavity or expands a region";
    Some(Figure::new("pressures", caption, chart))
}

/// Returns the pairs of increment number, which starts at 1, and `value`, without the increments that have no value.
fn over_increments(run: &Run, value: impl Fn(&super::Increment) -> Option<f64>) -> Vec<(f64, f64)> {
    let numbered = run.increments.iter().enumerate();
    numbered.filter_map(|(k, increment)| Some(((k + 1) as f64, value(increment)?))).collect()
}

const AXES: [&str; 3] = ["x", "y", "z"];

fn is_shear(run: &Run) -> bool {
    run.extension.is_some_and(|extension| extension.kind == Kind::Shear)
}

fn force(run: &Run) -> Option<Figure> {
    let surfaces = run.loaded_surfaces();
    if surfaces.is_empty() || run.extension.is_none() {
        return None;
    }
    let (power, prefix) = run.force_prefix();
    let of_surface = |surface: usize| Line {
        name: run.surface_name(surface).to_owned(),
        // Every curve starts at the origin, which is the undeformed body.
        points: std::iter::once((0.0, 0.0))
            .chain(run.increments.iter().filter_map(|increment| {
                Some((run.extension_of(increment)?, run.force_of(increment, surface)? / power))
            }))
            .collect(),
    };
    let all: Vec<Line> = surfaces.into_iter().map(of_surface).collect();
    let axis = AXES[run.axis()];
    let labels = Labels {
        chart: if is_shear(run) { "force against shear" } else { "force against extension" },
        x: &format!("{} in {}", run.extension_name(), run.extension_unit()),
        y: &format!("force along {axis} in {prefix}N"),
    };
    // Older results do not know where the surfaces are.
    let knows_places = run.directory.start.as_ref().is_some_and(|start| !start.surfaces.is_empty());
    let over = match run.extension_unit() {
        "%" if knows_places => {
            let [axis, over] = run.extension.map_or([0; 2], |extension| [extension.axis, extension.over]);
            format!(" along {} over the distance of the surfaces along {}", AXES[axis], AXES[over])
        }
        "%" => " over the length of the body".into(),
        _ => String::new(),
    };
    let measure = format!("of mean surface displacements{over}");
    let [from, to] = run.extension.map_or([0, 0], |extension| extension.surfaces);
    let caption = format!(
        "Force on the body through each loaded surface against its {} (difference {measure}, {} to {})",
        run.extension_name(),
        run.surface_name(from),
        run.surface_name(to),
    );
    Some(Figure::new("force", caption, lines(labels, &all)))
}

fn extension(run: &Run) -> Option<Figure> {
    let extension = over_increments(run, |increment| run.extension_of(increment));
    let iterations = over_increments(run, |increment| Some(increment.log?.newton.iterations as f64));
    if extension.is_empty() && iterations.is_empty() {
        return None;
    }
    let labels = Labels {
        chart: if is_shear(run) { "shear and Newton iterations" } else { "extension and Newton iterations" },
        x: "load step",
        y: &format!("{} in {} (line)", run.extension_name(), run.extension_unit()),
    };
    let name = match run.extension_name() {
        "shear" => "Shear",
        "extension" => "Extension",
        _ => "Elongation",
    };
    let caption = format!("{name} of the body and Newton iterations per load step");
    Some(Figure::new("extension", caption, extension_and_iterations(labels, &extension, &iterations)))
}

fn seconds(run: &Run) -> Option<Figure> {
    let layer = |name: &str, of: fn(&NewtonSeconds) -> f64| Line {
        name: name.into(),
        points: over_increments(run, |increment| Some(of(&increment.log?.newton.seconds))),
    };
    let phases = [
        layer("stress and tangent at the points", |s| s.point_field),
        layer("assembly", |s| s.assembly),
        layer("factorization", |s| s.factor),
        layer("solution", |s| s.solve),
        layer("other", |s| (s.total - s.point_field - s.assembly - s.factor - s.solve).max(0.0)),
    ];
    if phases.iter().flat_map(|phase| &phase.points).all(|&(_, seconds)| seconds == 0.0) {
        return None;
    }
    let labels = Labels { chart: "wall time by phase", x: "load step", y: "wall time in s" };
    Some(Figure::new("wall-time", "Wall time by phase per load step", stacked_bars(labels, &phases)))
}

fn rves(run: &Run) -> Option<Figure> {
    let line = |name: &str, of: fn(&RveLog) -> Option<f64>| Line {
        name: name.into(),
        points: over_increments(run, |increment| of(increment.log?.rve.as_ref()?)),
    };
    let mut all = vec![
        line("mean", |rve| Some(rve.iterations_mean)),
        line("median", |rve| Some(rve.iterations_median? as f64)),
        line("95th percentile", |rve| Some(rve.iterations_p95? as f64)),
        line("maximum", |rve| Some(rve.iterations_max as f64)),
    ];
    all.retain(|line| !line.points.is_empty());
    if all.is_empty() {
        return None;
    }
    let labels = Labels { chart: "RVE iterations", x: "load step", y: "Newton iterations of an RVE" };
    let caption = "Micro-scale Newton iterations per RVE equilibrium, by load step";
    // A few RVEs that take very many iterations would press all other lines to the ground.
    let largest = |of: &[Line]| of.iter().flat_map(|line| &line.points).map(|&(_, y)| y).fold(0.0, f64::max);
    let (maximum, others) =
        all.split_last().map_or((0.0, 0.0), |(last, others)| (largest(std::slice::from_ref(last)), largest(others)));
    let draw = if maximum > 10.0 * others && others > 0.0 { lines_by_magnitude } else { lines };
    Some(Figure::new("rve-iterations", caption, draw(labels, &all)))
}

fn convergence(run: &Run) -> Option<Figure> {
    let all: Vec<Line> = run
        .increments
        .iter()
        .filter_map(|increment| increment.log)
        .map(|log| Line {
            name: format!("step {}", log.step),
            points: log.newton.relative.iter().enumerate().map(|(k, &residual)| (k as f64, residual)).collect(),
        })
        .collect();
    if all.iter().flat_map(|line| &line.points).all(|&(_, residual)| residual.is_nan() || residual <= 0.0) {
        return None;
    }
    let labels = Labels { chart: "convergence", x: "Newton iteration", y: "relative residual" };
    let caption = "Convergence of Newton's method, one line per load step (dark: first, light: last)";
    Some(Figure::new("convergence", caption, logarithmic(labels, &all)))
}
