//! `loads.csv`: the forces on the body and the displacements that go with them, a row a converged step.
//!
//! Columns: `step,t`, then for every surface `NAME.area` (current, m^2), `NAME.fx`, `.fy`, `.fz` (the force exerted on
//! the body through it, N), `NAME.ux`, `.uy`, `.uz` (mean displacement, m), then for every held point
//! `NAME.fx`, `.fy`, `.fz` (N), then for every region `NAME.volume` (current, m^3). Numbers have 17 digits, so that they
//! are read back exactly.

use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};

use super::ResultsError;
use super::replace::{replace, whole_lines};

const SURFACE_COLUMNS: [&str; 7] = ["area", "fx", "fy", "fz", "ux", "uy", "uz"];
const POINT_COLUMNS: [&str; 3] = ["fx", "fy", "fz"];

/// What happens on a surface at one time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SurfaceRow {
    /// Current area, m^2.
    pub area: f64,
    /// Force exerted on the body through the surface (reaction plus applied load), N.
    pub force: [f64; 3],
    /// Mean displacement, m.
    pub displacement: [f64; 3],
}

/// A row: one converged step.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LoadRow {
    /// The load step.
    pub step: usize,
    /// Pseudo-time.
    pub t: f64,
    /// Surface by surface.
    pub surfaces: Vec<SurfaceRow>,
    /// The force at every held point, N.
    pub points: Vec<[f64; 3]>,
    /// The current volume of every region, m^3.
    pub volumes: Vec<f64>,
}

/// The whole table, read back.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Loads {
    /// Names of the surfaces.
    pub surfaces: Vec<String>,
    /// Names of the held points.
    pub points: Vec<String>,
    /// Names of the regions.
    pub regions: Vec<String>,
    /// The rows, as they were written.
    pub rows: Vec<LoadRow>,
}

/// Writes the table while the run goes on.
#[derive(Debug)]
pub struct LoadsWriter {
    path: PathBuf,
    file: File,
    counts: [usize; 3],
}

impl LoadsWriter {
    /// Starts a new table; one that is there is replaced. Held points have no names of their own: call them
    /// `point0`, `point1`, ...
    ///
    /// # Errors
    /// [`ResultsError::Write`].
    pub fn create(path: &Path, surfaces: &[&str], points: &[&str], regions: &[&str]) -> Result<Self, ResultsError> {
        replace(path, &line(path, header(surfaces, points, regions))?)?;
        Self::open(path, [surfaces.len(), points.len(), regions.len()])
    }

    /// Goes on with the table of an interrupted run: rows after `t` are removed, for they will be computed again.
    /// A table that is not there is started.
    ///
    /// # Errors
    /// [`ResultsError::Damaged`] where the table has other columns or is none; [`ResultsError::Write`].
    pub fn resume(
        path: &Path,
        surfaces: &[&str],
        points: &[&str],
        regions: &[&str],
        t: f64,
    ) -> Result<Self, ResultsError> {
        if !path.exists() {
            return Self::create(path, surfaces, points, regions);
        }
        let loads = Loads::read(path)?;
        if loads.surfaces != surfaces || loads.points != points || loads.regions != regions {
            let what = "has the columns of another case";
            return Err(ResultsError::damaged(path, Some(1), what, "the surfaces, points and regions of this case"));
        }
        let mut bytes = line(path, header(surfaces, points, regions))?;
        for row in loads.rows.iter().filter(|row| row.t <= t) {
            bytes.extend(line(path, fields(row.step, row.t, &row.surfaces, &row.points, &row.volumes))?);
        }
        replace(path, &bytes)?;
        Self::open(path, [surfaces.len(), points.len(), regions.len()])
    }

    fn open(path: &Path, counts: [usize; 3]) -> Result<Self, ResultsError> {
        let file = OpenOptions::new().append(true).open(path).map_err(ResultsError::write(path))?;
        Ok(Self { path: path.into(), file, counts })
    }

    /// Appends one row; it is with the operating system when this returns.
    ///
    /// # Errors
    /// [`ResultsError::Length`] where the row has other columns than the table; [`ResultsError::Write`].
    pub fn row(
        &mut self,
        step: usize,
        t: f64,
        surfaces: &[SurfaceRow],
        points: &[[f64; 3]],
        volumes: &[f64],
    ) -> Result<(), ResultsError> {
        let [of_surfaces, of_points, of_regions] = self.counts;
        for (name, found, expected) in [
            ("surfaces", surfaces.len(), of_surfaces),
            ("points", points.len(), of_points),
            ("regions", volumes.len(), of_regions),
        ] {
            if found != expected {
                return Err(ResultsError::Length { path: self.path.clone(), name: name.into(), found, expected });
            }
        }
        let bytes = line(&self.path, fields(step, t, surfaces, points, volumes))?;
        self.file.write_all(&bytes).map_err(ResultsError::write(&self.path))
    }
}

fn header(surfaces: &[&str], points: &[&str], regions: &[&str]) -> Vec<String> {
    let mut columns = vec!["step".to_owned(), "t".to_owned()];
    for (names, quantities) in [(surfaces, &SURFACE_COLUMNS[..]), (points, &POINT_COLUMNS), (regions, &["volume"])] {
        columns
            .extend(names.iter().flat_map(|name| quantities.iter().map(move |quantity| format!("{name}.{quantity}"))));
    }
    columns
}

fn fields(step: usize, t: f64, surfaces: &[SurfaceRow], points: &[[f64; 3]], volumes: &[f64]) -> Vec<String> {
    let of_surface = |row: &SurfaceRow| {
        let ([fx, fy, fz], [ux, uy, uz]) = (row.force, row.displacement);
        [row.area, fx, fy, fz, ux, uy, uz]
    };
    let numbers = std::iter::once(t)
        .chain(surfaces.iter().flat_map(of_surface))
        .chain(points.as_flattened().iter().copied())
        .chain(volumes.iter().copied());
    std::iter::once(step.to_string()).chain(numbers.map(|number| format!("{number:.16e}"))).collect()
}

fn line(path: &Path, fields: Vec<String>) -> Result<Vec<u8>, ResultsError> {
    let unwritten = |error: csv::Error| ResultsError::Write { path: path.into(), source: error.into() };
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(fields).map_err(unwritten)?;
    writer.into_inner().map_err(|error| ResultsError::Write { path: path.into(), source: error.into_error() })
}

impl Loads {
    /// Reads a table back. A last row that was not finished is left out.
    ///
    /// # Errors
    /// [`ResultsError::Read`]; [`ResultsError::Damaged`] with the line where the text is no such table.
    pub fn read(path: &Path) -> Result<Self, ResultsError> {
        let text = whole_lines(path)?;
        let mut reader = csv::Reader::from_reader(text.as_bytes());
        let damaged = |error: csv::Error| {
            let line = error.position().map(|position| position.line() as usize);
            ResultsError::damaged(path, line, error.to_string(), "as many columns as the header names")
        };
        let header = reader.headers().map_err(damaged)?.clone();
        let mut loads = Self::of_header(&header).map_err(|(column, expected)| {
            ResultsError::damaged(
                path,
                Some(1),
                format!("column {} is `{column}`", position(&header, &column)),
                expected,
            )
        })?;
        for record in reader.records() {
            let record = record.map_err(damaged)?;
            let row = loads.parse(&record).map_err(|field| {
                let line = record.position().map(|position| position.line() as usize);
                ResultsError::damaged(path, line, format!("`{field}` is no number"), "a number in every column")
            })?;
            loads.rows.push(row);
        }
        Ok(loads)
    }

    /// The names, from the header; or the column that does not fit and what should stand there.
    fn of_header(header: &csv::StringRecord) -> Result<Self, (String, &'static str)> {
        let columns: Vec<&str> = header.iter().collect();
        let mut loads = Self::default();
        let mut rest = match columns.as_slice() {
            ["step", "t", rest @ ..] => rest,
            [first, ..] => return Err(((*first).into(), "`step,t` first")),
            [] => return Err((String::new(), "`step,t` first")),
        };
        while let Some(&column) = rest.first() {
            let (names, quantities, name) = if let Some(name) = column.strip_suffix(".area") {
                (&mut loads.surfaces, &SURFACE_COLUMNS[..], name)
            } else if let Some(name) = column.strip_suffix(".fx") {
                (&mut loads.points, &POINT_COLUMNS[..], name)
            } else if let Some(name) = column.strip_suffix(".volume") {
                (&mut loads.regions, &["volume"][..], name)
            } else {
                return Err((column.into(), "`NAME.area`, `NAME.fx` or `NAME.volume`"));
            };
            for (k, quantity) in quantities.iter().enumerate() {
                let found = rest.get(k).copied().unwrap_or_default();
                if found.strip_prefix(name).and_then(|found| found.strip_prefix('.')) != Some(quantity) {
                    return Err((found.into(), "`NAME.area,NAME.fx,NAME.fy,NAME.fz,NAME.ux,NAME.uy,NAME.uz` in a row"));
                }
            }
            names.push(name.into());
            rest = rest.get(quantities.len()..).unwrap_or_default();
        }
        Ok(loads)
    }

    /// One row; or the field that is no number.
    fn parse(&self, record: &csv::StringRecord) -> Result<LoadRow, String> {
        let mut fields = record.iter();
        let step = fields.next().unwrap_or_default();
        let step = step.parse().map_err(|_| step.to_owned())?;
        let mut number = || -> Result<f64, String> {
            let field = fields.next().unwrap_or_default();
            field.parse().map_err(|_| field.to_owned())
        };
        let mut row = LoadRow { step, t: number()?, ..LoadRow::default() };
        for _ in &self.surfaces {
            row.surfaces.push(SurfaceRow {
                area: number()?,
                force: [number()?, number()?, number()?],
                displacement: [number()?, number()?, number()?],
            });
        }
        for _ in &self.points {
            row.points.push([number()?, number()?, number()?]);
        }
        for _ in &self.regions {
            row.volumes.push(number()?);
        }
        Ok(row)
    }
}

fn position(header: &csv::StringRecord, column: &str) -> usize {
    header.iter().position(|other| other == column).map_or(header.len() + 1, |position| position + 1)
}
