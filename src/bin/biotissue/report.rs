//! `biotissue report DIR`: turns a result directory into one report page, one picture, or charts.

use std::path::{Path, PathBuf};

use biotissue::app::report::page::Figure;
use biotissue::app::report::picture::{self, PictureOptions};
use biotissue::app::report::{ReportError, page};
use biotissue::app::results::ResultsError;
use biotissue::input::InputError;
use clap::{Args, ValueEnum};

use crate::failure::Failure;
use crate::number::count;
use crate::output;

/// Turn a result directory into one self-contained page of figures
#[derive(Args)]
pub struct ReportCommand {
    /// The result directory of a run, finished or in progress
    dir: PathBuf,
    /// Write only the picture of the deformed body, as SVG, to this file
    #[arg(long, value_name = "FILE.svg", conflicts_with = "output")]
    picture: Option<PathBuf>,
    /// Write only the charts of the page, each as an SVG file, to this folder
    #[arg(long, value_name = "FOLDER", conflicts_with_all = ["output", "picture", "step", "field", "axis", "view", "range"])]
    charts: Option<PathBuf>,
    /// Draw this load step [default: the last one with fields]
    #[arg(long, value_name = "N", value_parser = count, allow_hyphen_values = true)]
    step: Option<usize>,
    /// Color by this field [default: von_mises_stress]
    #[arg(long, value_name = "NAME")]
    field: Option<String>,
    /// Look along this axis [default: the shortest edge of the body]
    #[arg(long, value_enum)]
    axis: Option<Axis>,
    /// Look from this direction, from the body to the viewer, with z upward [example: 1,-2,1]
    #[arg(long, value_name = "X,Y,Z", value_parser = numbers::<3>, allow_hyphen_values = true, conflicts_with = "axis")]
    view: Option<[f64; 3]>,
    /// Values at the ends of the colors of the picture, in the SI unit of the field [default: the least and the greatest that are drawn]
    #[arg(long, value_name = "LOW,HIGH", value_parser = numbers::<2>, allow_hyphen_values = true)]
    range: Option<[f64; 2]>,
    /// Write the page to this file [default: DIR/report.html]
    #[arg(short, long, value_name = "FILE.html")]
    output: Option<PathBuf>,
}

/// An axis to look along.
#[derive(Clone, Copy, ValueEnum)]
pub enum Axis {
    X,
    Y,
    Z,
}

/// Runs the command and prints the paths of the written files.
pub fn run(command: &ReportCommand) -> Result<(), Failure> {
    let ReportCommand { dir, picture, charts, step, field, axis, view, range, output: page_file } = command;
    let axis = axis.map(|axis| axis as usize);
    check_view_and_range(*view, *range)?;
    let options = PictureOptions {
        step: *step,
        field: field.clone(),
        axis,
        toward: *view,
        range: *range,
        ..PictureOptions::default()
    };
    let failure = |error| failure(dir, error);
    if let Some(folder) = charts {
        return write_charts(folder, &page::charts(dir).map_err(failure)?);
    }
    let written = match picture {
        Some(file) => {
            check_is_svg(file)?;
            let svg = picture::draw(dir, &options).map_err(failure)?;
            write_svg(file, &svg)?;
            file.clone()
        }
        None => page::write(dir, page_file.as_deref(), &options).map_err(failure)?,
    };
    output::print(&written.display().to_string())
}

/// Parses `N` numbers with commas between them.
fn numbers<const N: usize>(text: &str) -> Result<[f64; N], String> {
    let parsed: Option<Vec<f64>> = text.split(',').map(|number| number.trim().parse().ok()).collect();
    let numbers = parsed.and_then(|numbers| <[f64; N]>::try_from(numbers).ok());
    let finite = numbers.filter(|numbers| numbers.iter().all(|number| number.is_finite()));
    finite.ok_or_else(|| format!("expected {N} numbers with commas between them"))
}

fn check_view_and_range(view: Option<[f64; 3]>, range: Option<[f64; 2]>) -> Result<(), Failure> {
    if view == Some([0.0; 3]) {
        let cure = "name the direction in which the viewer is, as in --view 1,-2,1";
        return Err(Failure::arguments("invalid --view 0,0,0", "a direction", cure));
    }
    match range {
        Some([low, high]) if low >= high => {
            let what = format!("invalid --range {low},{high}");
            Err(Failure::arguments(what, "a lower value, then a higher one", "exchange the two values"))
        }
        _ => Ok(()),
    }
}

/// Writes each chart to a file of its name and prints the paths.
fn write_charts(folder: &Path, charts: &[Figure]) -> Result<(), Failure> {
    let mut written = Vec::with_capacity(charts.len());
    for chart in charts {
        let file = folder.join(format!("{}.svg", chart.name));
        write_svg(&file, &chart.svg)?;
        written.push(file.display().to_string());
    }
    if written.is_empty() {
        output::message("nothing to draw yet: no load step has converged");
        return Ok(());
    }
    output::print(&written.join("\n"))
}

fn write_svg(file: &Path, svg: &str) -> Result<(), Failure> {
    output::make_folder_of(file)?;
    biotissue::output::write(file, svg.as_bytes()).map_err(|error| Failure::unwritable(file, &error))
}

fn check_is_svg(file: &Path) -> Result<(), Failure> {
    match file.extension() {
        Some(extension) if !extension.eq_ignore_ascii_case("svg") => Err(Failure::arguments(
            format!("invalid --picture {}", file.display()),
            "the name of an SVG file",
            "let it end in .svg; Inkscape, rsvg-convert and web browsers convert SVG to other formats",
        )),
        _ => Ok(()),
    }
}

fn failure(dir: &Path, error: ReportError) -> Failure {
    let arguments = |expected: &str, cure: &str| Failure::arguments(error.to_string(), expected, cure);
    match &error {
        ReportError::Results(ResultsError::Write(path, source)) => Failure::unwritable(path, source),
        ReportError::Results(ResultsError::Read(path, source)) => InputError::unreadable(path, source).into(),
        ReportError::Results(ResultsError::UnknownOrigin { .. }) => arguments(
            "no file of that name, or a page of an earlier report",
            "name another file with -o, or move that one",
        ),
        ReportError::Results(error) => {
            let expected = "a file as `biotissue run` writes it";
            Failure::arguments(error.to_string(), expected, "run the case again, or remove the file to do without it")
        }
        ReportError::NoResults { .. } if !dir.exists() => {
            let (what, expected) = ("there is no such directory", "the result directory of a run");
            InputError::in_file(dir, what, expected, "check the name; a case says where it puts its results").into()
        }
        ReportError::NoResults { .. } | ReportError::NoFields { .. } | ReportError::EmptyMesh { .. } => {
            arguments("the result directory of a run", "name the directory that `biotissue run` wrote to")
        }
        ReportError::NoStep { .. } => arguments("a step with fields", "leave out --step for the last one"),
        ReportError::NoField { .. } => arguments("a field of the elements", "leave out --field for the stress"),
    }
}
