//! `costs.csv`: what every RVE cost in every sweep, for studies of load balancing.
//!
//! Columns: `step` (from 1), `iteration` (the trial state within the step, from 1; those of cut attempts and
//! verifications count), `rve` (the integration point, from 0, in the order of the elements), `network`
//! (the name of its network, empty for an RVE without one), `iterations` (of Newton's method) and `seconds` (of
//! computation on one thread). A sleeping RVE, and one whose deformation gradient has not changed, costs nothing. Where
//! an RVE fails, the rows of the points above it are missing, except those of other ranks, which solved theirs.

use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::ResultsError;
use super::replace::{replace, whole_lines};

/// The first line of the file.
pub(super) const HEADER: &str = "step,iteration,rve,network,iterations,seconds\n";

/// The cost of an RVE in one sweep.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CostRow {
    /// The load step, from 1.
    pub step: usize,
    /// The trial state within the step, from 1.
    pub iteration: usize,
    /// The integration point, from 0.
    pub rve: u64,
    /// The name of its network, empty for an RVE without one.
    pub network: String,
    /// Iterations of Newton's method.
    pub iterations: u32,
    /// Seconds of computation on one thread.
    pub seconds: f64,
}

/// Appends rows to the table during a run.
#[derive(Debug)]
pub struct CostsWriter {
    path: PathBuf,
    file: File,
    /// The last step and its number of sweeps so far.
    sweeps: (usize, usize),
}

impl CostsWriter {
    /// Creates a new table and replaces an existing one.
    ///
    /// # Errors
    /// Returns [`ResultsError::Write`] if the file cannot be written.
    pub fn create(path: &Path) -> Result<Self, ResultsError> {
        replace(path, HEADER.as_bytes())?;
        let file = OpenOptions::new().append(true).open(path).map_err(ResultsError::write(path))?;
        Ok(Self { path: path.into(), file, sweeps: (0, 0) })
    }

    /// Continues the table of an interrupted run: removes the rows of the steps after step `steps`, which the run
    /// repeats. Creates the table if it does not exist.
    ///
    /// # Errors
    /// Returns [`ResultsError::Read`] or [`ResultsError::Write`] if the file cannot be read or written.
    pub fn resume(path: &Path, steps: usize) -> Result<Self, ResultsError> {
        if !path.exists() {
            return Self::create(path);
        }
        let text = whole_lines(path)?;
        let step_of = |line: &str| line.split(',').next().and_then(|step| step.parse::<usize>().ok());
        let is_kept = |line: &&str| step_of(line).is_none_or(|step| step <= steps);
        replace(path, text.split_inclusive('\n').filter(is_kept).collect::<String>().as_bytes())?;
        let file = OpenOptions::new().append(true).open(path).map_err(ResultsError::write(path))?;
        Ok(Self { path: path.into(), file, sweeps: (0, 0) })
    }

    /// Returns the number of the next sweep of a step.
    pub fn next_iteration(&mut self, step: usize) -> usize {
        let (last, sweeps) = self.sweeps;
        self.sweeps = (step, if last == step { sweeps + 1 } else { 1 });
        self.sweeps.1
    }

    /// Appends rows and passes them to the operating system before returning.
    ///
    /// # Errors
    /// Returns [`ResultsError::Write`] if they cannot be written.
    pub fn write(&mut self, rows: impl IntoIterator<Item = CostRow>) -> Result<(), ResultsError> {
        let unwritten = |error: csv::Error| ResultsError::Write(self.path.clone(), error.into());
        let mut writer = csv::WriterBuilder::new().has_headers(false).from_writer(Vec::new());
        rows.into_iter().try_for_each(|row| writer.serialize(row)).map_err(unwritten)?;
        let bytes = writer.into_inner().map_err(|error| ResultsError::Write(self.path.clone(), error.into_error()))?;
        self.file.write_all(&bytes).map_err(ResultsError::write(&self.path))
    }
}

/// Reads the rows of a table, in the order of the file. An unfinished last row is ignored.
///
/// # Errors
/// Returns [`ResultsError::Read`] if the file cannot be read, or [`ResultsError::Damaged`] with the line if the text is
/// not such a table, or if seconds are negative or not finite.
pub fn read_costs(path: &Path) -> Result<Vec<CostRow>, ResultsError> {
    let text = whole_lines(path)?;
    if !text.starts_with(HEADER) {
        let what = "does not begin with the columns of such a table";
        return Err(ResultsError::damaged(path, Some(1), what, HEADER.trim_end()));
    }
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    let damaged = |line: Option<u64>, what: String| {
        ResultsError::damaged(path, line.map(|line| line as usize), what, HEADER.trim_end())
    };
    let of_csv = |error: csv::Error| damaged(error.position().map(csv::Position::line), error.to_string());
    let columns = reader.headers().map_err(of_csv)?.clone();
    let rows = reader.records().map(|record| {
        let record = record.map_err(of_csv)?;
        let row: CostRow = record.deserialize(Some(&columns)).map_err(of_csv)?;
        if row.seconds >= 0.0 && row.seconds.is_finite() {
            return Ok(row);
        }
        let line = record.position().map(csv::Position::line);
        Err(damaged(line, format!("{} seconds are not a cost", row.seconds)))
    });
    rows.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(step: usize, rve: u64, seconds: f64) -> CostRow {
        CostRow { step, iteration: 1, rve, network: "a, \"b\"".into(), iterations: 3, seconds }
    }

    #[test]
    fn a_table_is_read_as_it_was_written_and_resumed_after_a_step() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("costs.csv");
        let rows = [row(1, 0, 0.1), row(2, 7, 1.0 / 3.0), row(2, 8, 5e-324)];
        CostsWriter::create(&path).unwrap().write(rows.clone()).unwrap();
        assert_eq!(read_costs(&path).unwrap(), rows);
        CostsWriter::resume(&path, 1).unwrap().write([row(2, 9, 2.0)]).unwrap();
        assert_eq!(read_costs(&path).unwrap(), [rows[0].clone(), row(2, 9, 2.0)]);
    }

    #[test]
    fn a_run_is_resumed_without_its_table() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("costs.csv");
        CostsWriter::resume(&path, 1).unwrap();
        assert_eq!(read_costs(&path).unwrap(), []);
    }

    #[test]
    fn other_tables_are_rejected_with_the_line() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("costs.csv");
        let rows = ["1,1,x,n,1,1", "1,1,0,n,1,-1", "1,1,0,n,1,NaN", "1,1,0,n,1,inf", "1,1,0"];
        let rows = rows.map(|row| (format!("{HEADER}1,1,1,n,1,1\n{row}\n"), 3));
        for (text, line) in [("step,t\n1,2\n".to_owned(), 1)].into_iter().chain(rows) {
            std::fs::write(&path, text).unwrap();
            let error = read_costs(&path).unwrap_err().to_string();
            assert!(error.contains(&format!("costs.csv:{line}")), "{error}");
        }
    }
}
