//! `loads.csv`: forces and displacements of the body, one row per converged step.
//!
//! Columns: `step,t`, then for every surface `NAME.area` (current, m^2), `NAME.fx`, `.fy`, `.fz` (the force exerted on
//! the body through it, N), `NAME.ux`, `.uy`, `.uz` (mean displacement, m), then for every point with a prescribed
//! displacement `NAME.fx`, `.fy`, `.fz` (N), then for every rigid surface `NAME.mx`, `.my`, `.mz` (the moment exerted on
//! the body about the displaced reference point, N m), `NAME.rx`, `.ry`, `.rz` (rotation vector, rad) and `NAME.dx`,
//! `.dy`, `.dz` (displacement of the reference point, m), then for every region, and for every constrained volume that is
//! not a region, `NAME.volume` (current, m^3), then for every volume constraint `NAME.pressure` (Pa). Numbers have 17
//! significant digits, so that reading them is exact.

use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::ResultsError;
use super::replace::{replace, whole_lines};
use crate::checksum::sum_of;

const SURFACE_COLUMNS: [&str; 7] = ["area", "fx", "fy", "fz", "ux", "uy", "uz"];
const POINT_COLUMNS: [&str; 3] = ["fx", "fy", "fz"];
const RIGID_COLUMNS: [&str; 9] = ["mx", "my", "mz", "rx", "ry", "rz", "dx", "dy", "dz"];

/// The state of a surface at one time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SurfaceRow {
    /// Current area, m^2.
    pub area: f64,
    /// Force exerted on the body through the surface (reaction force plus applied load), N.
    pub force: [f64; 3],
    /// Mean displacement, m.
    pub displacement: [f64; 3],
}

/// The state of a rigid surface at one time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RigidRow {
    /// Moment exerted on the body about the displaced reference point, N m.
    pub moment: [f64; 3],
    /// Rotation vector, rad.
    pub rotation: [f64; 3],
    /// Displacement of the reference point, m.
    pub displacement: [f64; 3],
}

/// The row of one converged step.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LoadRow {
    /// The load step.
    pub step: usize,
    /// Pseudo-time.
    pub t: f64,
    /// The states of all surfaces.
    pub surfaces: Vec<SurfaceRow>,
    /// The force on the body at every point condition (reaction force plus applied force), N.
    pub points: Vec<[f64; 3]>,
    /// The states of all rigid surfaces.
    pub rigid: Vec<RigidRow>,
    /// The current volume of every region and of every other constrained volume, m^3.
    pub volumes: Vec<f64>,
    /// The pressure of every volume constraint, Pa.
    pub pressures: Vec<f64>,
}

/// The names of what the columns of a table describe. Point conditions have no names of their own: call them `point0`,
/// `point1`, ...
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LoadNames {
    /// Names of the surfaces.
    pub surfaces: Vec<String>,
    /// Names of the point conditions.
    pub points: Vec<String>,
    /// Names of the rigid surfaces.
    pub rigid: Vec<String>,
    /// Names of the regions and of the other constrained volumes.
    pub regions: Vec<String>,
    /// Names of the volume constraints.
    pub constraints: Vec<String>,
}

impl LoadNames {
    /// Returns the names of each group of columns, in their order, with the quantities that each name has.
    fn groups(&self) -> [(&[String], &'static [&'static str]); 5] {
        [
            (&self.surfaces, &SURFACE_COLUMNS),
            (&self.points, &POINT_COLUMNS),
            (&self.rigid, &RIGID_COLUMNS),
            (&self.regions, &["volume"]),
            (&self.constraints, &["pressure"]),
        ]
    }

    /// Returns the group whose first quantity a column has, with its quantities and the name in the column.
    fn group_of<'c>(&mut self, column: &'c str) -> Option<(&mut Vec<String>, &'static [&'static str], &'c str)> {
        let quantities = self.groups().map(|(_, quantities)| quantities);
        let Self { surfaces, points, rigid, regions, constraints } = self;
        let groups = [surfaces, points, rigid, regions, constraints];
        let (name, quantity) = column.rsplit_once('.')?;
        let (group, quantities) =
            groups.into_iter().zip(quantities).find(|(_, quantities)| quantities[0] == quantity)?;
        Some((group, quantities, name))
    }

    fn header(&self) -> Vec<String> {
        let named = self.groups().into_iter().flat_map(|(names, quantities)| {
            names.iter().flat_map(move |name| quantities.iter().map(move |quantity| format!("{name}.{quantity}")))
        });
        ["step".to_owned(), "t".to_owned()].into_iter().chain(named).collect()
    }
}

/// The whole table, as read from a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Loads {
    /// What the columns describe.
    pub names: LoadNames,
    /// The rows, in the order of the file.
    pub rows: Vec<LoadRow>,
}

/// Length and hash of a line of the table as written (the header or a row).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct LineChecksum {
    bytes: u64,
    hash: u64,
}

impl LineChecksum {
    fn of(line: &[u8]) -> Self {
        Self { bytes: line.len() as u64, hash: sum_of(line) }
    }
}

/// Appends rows to the table during a run.
#[derive(Debug)]
pub struct LoadsWriter {
    path: PathBuf,
    file: File,
    names: LoadNames,
    /// The checksum of the header, then of every row.
    marks: Vec<LineChecksum>,
}

impl LoadsWriter {
    /// Creates a new table and replaces an existing one.
    ///
    /// # Errors
    /// Returns [`ResultsError::Write`] if the file cannot be written.
    pub fn create(path: &Path, names: LoadNames) -> Result<Self, ResultsError> {
        let header = line(path, names.header())?;
        replace(path, &header)?;
        Self::open(path, names, vec![LineChecksum::of(&header)])
    }

    /// Continues the table of an interrupted run after step `completed_steps`. All steps up to this one must be there,
    /// each once and in order. Later rows are removed, because the run computes them again.
    ///
    /// # Errors
    /// Returns [`ResultsError::Damaged`] if the table is missing, has other columns, or lacks a step;
    /// [`ResultsError::Read`] or [`ResultsError::Write`] if the file cannot be read or written.
    pub fn resume(path: &Path, names: LoadNames, completed_steps: usize) -> Result<Self, ResultsError> {
        let (loads, lines) = Loads::up_to(path, completed_steps)?;
        if loads.names != names {
            let what = "has the columns of another case";
            let expected = "the surfaces, points, rigid surfaces, regions and volume constraints of this case";
            return Err(ResultsError::damaged(path, Some(1), what, expected));
        }
        replace(path, &lines.concat())?;
        let marks = lines.iter().map(|line| LineChecksum::of(line)).collect();
        Self::open(path, names, marks)
    }

    fn open(path: &Path, names: LoadNames, marks: Vec<LineChecksum>) -> Result<Self, ResultsError> {
        let file = OpenOptions::new().append(true).open(path).map_err(ResultsError::write(path))?;
        Ok(Self { path: path.into(), file, names, marks })
    }

    /// Returns the checksums of the header and of all rows.
    pub fn marks(&self) -> &[LineChecksum] {
        &self.marks
    }

    /// Flushes all rows to the disk.
    ///
    /// # Errors
    /// Returns [`ResultsError::Write`] if the file cannot be flushed.
    pub fn sync(&self) -> Result<(), ResultsError> {
        self.file.sync_data().map_err(ResultsError::write(&self.path))
    }

    /// Appends one row and passes it to the operating system before returning.
    ///
    /// # Errors
    /// Returns [`ResultsError::Length`] if the row does not have the columns of the table, or [`ResultsError::Write`]
    /// if it cannot be written.
    pub fn row(&mut self, row: &LoadRow) -> Result<(), ResultsError> {
        for (name, found, expected) in [
            ("surfaces", row.surfaces.len(), self.names.surfaces.len()),
            ("points", row.points.len(), self.names.points.len()),
            ("rigid surfaces", row.rigid.len(), self.names.rigid.len()),
            ("regions", row.volumes.len(), self.names.regions.len()),
            ("volume constraints", row.pressures.len(), self.names.constraints.len()),
        ] {
            ResultsError::check_length(&self.path, name, found, expected)?;
        }
        let bytes = line(&self.path, row.fields())?;
        self.file.write_all(&bytes).map_err(ResultsError::write(&self.path))?;
        self.marks.push(LineChecksum::of(&bytes));
        Ok(())
    }
}

impl LoadRow {
    /// Returns the numbers of all columns after the first.
    fn numbers(&self) -> impl Iterator<Item = f64> {
        let of_surface = |row: &SurfaceRow| {
            let ([fx, fy, fz], [ux, uy, uz]) = (row.force, row.displacement);
            [row.area, fx, fy, fz, ux, uy, uz]
        };
        let of_rigid = |row: &RigidRow| [row.moment, row.rotation, row.displacement].into_iter().flatten();
        std::iter::once(self.t)
            .chain(self.surfaces.iter().flat_map(of_surface))
            .chain(self.points.as_flattened().iter().copied())
            .chain(self.rigid.iter().flat_map(of_rigid))
            .chain(self.volumes.iter().copied())
            .chain(self.pressures.iter().copied())
    }

    fn fields(&self) -> Vec<String> {
        std::iter::once(self.step.to_string()).chain(self.numbers().map(|number| format!("{number:.16e}"))).collect()
    }
}

fn line(path: &Path, fields: Vec<String>) -> Result<Vec<u8>, ResultsError> {
    let unwritten = |error: csv::Error| ResultsError::Write(path.into(), error.into());
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(fields).map_err(unwritten)?;
    writer.into_inner().map_err(|error| ResultsError::Write(path.into(), error.into_error()))
}

impl Loads {
    /// Returns the columns after `step`, each with its name and the values of all rows, in the order of the file.
    pub fn columns(&self) -> Vec<(String, Vec<f64>)> {
        let names = self.names.header().into_iter().skip(1);
        let mut columns: Vec<(String, Vec<f64>)> = names.map(|name| (name, Vec::new())).collect();
        for row in &self.rows {
            for ((_, values), number) in columns.iter_mut().zip(row.numbers()) {
                values.push(number);
            }
        }
        columns
    }

    /// Reads a table. An unfinished last row is ignored.
    ///
    /// # Errors
    /// Returns [`ResultsError::Read`] if the file cannot be read, or [`ResultsError::Damaged`] with the line if the
    /// text is not such a table.
    pub fn read(path: &Path) -> Result<Self, ResultsError> {
        Self::parse_rows(path, &whole_lines(path)?, None).map(|(loads, _)| loads)
    }

    /// Reads the steps from 1 to `completed_steps`, which must be there, each once and in order, with the text of the
    /// header and of each row. Later rows are not read.
    ///
    /// # Errors
    /// Returns [`ResultsError::Damaged`] with the first invalid line, or [`ResultsError::Read`] if the file cannot be
    /// read.
    pub fn up_to(path: &Path, completed_steps: usize) -> Result<(Self, Vec<Vec<u8>>), ResultsError> {
        if !path.exists() {
            return Err(ResultsError::damaged(path, None, "is missing", "the rows of all load steps that converged"));
        }
        let text = whole_lines(path)?;
        let (loads, ends) = Self::parse_rows(path, &text, Some(completed_steps))?;
        if loads.rows.len() < completed_steps {
            let (rows, line) = (loads.rows.len(), text.lines().count());
            let what = format!("ends after load step {rows}");
            return Err(ResultsError::damaged(path, Some(line), what, "a row for every load step that converged"));
        }
        let starts = std::iter::once(0).chain(ends.iter().copied());
        let lines = starts.zip(&ends).map(|(start, &end)| text.as_bytes()[start..end].to_vec()).collect();
        Ok((loads, lines))
    }

    /// Checks that the table begins with the lines that have these checksums.
    ///
    /// # Errors
    /// See [`Loads::up_to`]; also returns [`ResultsError::Damaged`] for a line that was changed.
    pub(super) fn check(path: &Path, marks: &[LineChecksum]) -> Result<(), ResultsError> {
        let (_, lines) = Self::up_to(path, marks.len().saturating_sub(1))?;
        let mut number = 1;
        for (line, mark) in lines.iter().zip(marks) {
            if LineChecksum::of(line) != *mark {
                let expected = "the line as it was written";
                return Err(ResultsError::damaged(path, Some(number), "was changed since the run", expected));
            }
            number += line.iter().filter(|&&byte| byte == b'\n').count();
        }
        Ok(())
    }

    /// Parses the table and returns it with the end offsets of its header and rows: all rows in the order of the file,
    /// or only those of the steps from 1 to `steps`, which must be in order.
    fn parse_rows(path: &Path, text: &str, steps: Option<usize>) -> Result<(Self, Vec<usize>), ResultsError> {
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
        let mut ends = vec![reader.position().byte() as usize];
        let mut record = csv::StringRecord::new();
        while steps.is_none_or(|steps| loads.rows.len() < steps) && reader.read_record(&mut record).map_err(damaged)? {
            let line = record.position().map(|position| position.line() as usize);
            let row = loads.parse(&record).map_err(|field| {
                ResultsError::damaged(path, line, format!("`{field}` is not a number"), "a number in every column")
            })?;
            let (step, next) = (row.step, loads.rows.len() + 1);
            if steps.is_some() && step != next {
                let what = format!("has load step {step} where step {next} belongs");
                return Err(ResultsError::damaged(path, line, what, "every load step once, in order"));
            }
            loads.rows.push(row);
            ends.push(reader.position().byte() as usize);
        }
        Ok((loads, ends))
    }

    /// Returns true if a text begins with the header of such a table.
    pub(super) fn is_header(text: &[u8]) -> bool {
        let mut reader = csv::Reader::from_reader(text);
        reader.headers().is_ok_and(|header| {
            let is_of_run = |loads: Self| !loads.names.surfaces.is_empty() || !loads.names.regions.is_empty();
            Self::of_header(header).is_ok_and(is_of_run)
        })
    }

    /// Parses the names in the header; the error is the first invalid column and the expected one.
    fn of_header(header: &csv::StringRecord) -> Result<Self, (String, &'static str)> {
        let columns: Vec<&str> = header.iter().collect();
        let mut loads = Self::default();
        let mut rest = match columns.as_slice() {
            ["step", "t", rest @ ..] => rest,
            [first, ..] => return Err(((*first).into(), "`step,t` first")),
            [] => return Err((String::new(), "`step,t` first")),
        };
        while let Some(&column) = rest.first() {
            let Some((names, quantities, name)) = loads.names.group_of(column) else {
                return Err((column.into(), "`NAME.area`, `NAME.fx`, `NAME.mx`, `NAME.volume` or `NAME.pressure`"));
            };
            for (k, quantity) in quantities.iter().enumerate() {
                let found = rest.get(k).copied().unwrap_or_default();
                if found.strip_prefix(name).and_then(|found| found.strip_prefix('.')) != Some(quantity) {
                    return Err((found.into(), "all columns of a surface, point or rigid surface in a row"));
                }
            }
            names.push(name.into());
            rest = rest.get(quantities.len()..).unwrap_or_default();
        }
        Ok(loads)
    }

    /// Parses one row, which has as many fields as the header; the error is the field that is not a number.
    fn parse(&self, record: &csv::StringRecord) -> Result<LoadRow, String> {
        let mut fields = record.iter();
        let step = fields.next().unwrap_or_default();
        let step = step.parse().map_err(|_| step.to_owned())?;
        let numbers: Vec<f64> =
            fields.map(|field| field.parse().map_err(|_| field.to_owned())).collect::<Result<_, _>>()?;
        let mut numbers = numbers.into_iter();
        let mut next = || numbers.next().unwrap_or_default();
        let mut row = LoadRow { step, t: next(), ..LoadRow::default() };
        for _ in &self.names.surfaces {
            row.surfaces.push(SurfaceRow { area: next(), force: vector(&mut next), displacement: vector(&mut next) });
        }
        row.points = self.names.points.iter().map(|_| vector(&mut next)).collect();
        for _ in &self.names.rigid {
            let (moment, rotation, displacement) = (vector(&mut next), vector(&mut next), vector(&mut next));
            row.rigid.push(RigidRow { moment, rotation, displacement });
        }
        row.volumes = self.names.regions.iter().map(|_| next()).collect();
        row.pressures = self.names.constraints.iter().map(|_| next()).collect();
        Ok(row)
    }
}

fn vector(mut next: impl FnMut() -> f64) -> [f64; 3] {
    [next(), next(), next()]
}

fn position(header: &csv::StringRecord, column: &str) -> usize {
    header.iter().position(|other| other == column).map_or(header.len() + 1, |position| position + 1)
}
