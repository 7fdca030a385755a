//! The recorded costs of the RVEs of a run: `costs.csv`, which `[output] costs = true` of a case writes.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use biotissue::coupling::balance::rank_correlation;
use thiserror::Error;

/// What an RVE cost in one sweep, that is, in one evaluation of all RVEs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Newton iterations.
    pub iterations: u32,
    /// Measured seconds.
    pub seconds: f64,
}

/// The costs of all RVEs of a run in all its sweeps.
#[derive(Clone, Debug)]
pub struct Recording {
    /// The number of the network of each RVE; RVEs are in the order of their points.
    classes: Vec<u32>,
    networks: usize,
    /// The step and the iteration of each sweep.
    sweeps: Vec<[u32; 2]>,
    /// One entry per RVE, one sweep after the other; `None` where the RVE does not exist.
    samples: Vec<Option<Sample>>,
}

/// The reason why costs cannot be read.
#[derive(Debug, Error)]
pub enum RecordingError {
    /// The file cannot be read.
    #[error("{}: {reason}; a run whose case has `costs = true` in `[output]` writes this file", .file.display())]
    Read {
        /// The file.
        file: PathBuf,
        /// The error of the reader.
        reason: csv::Error,
    },
    /// A column is missing.
    #[error("{}, line 1: there is no column `{column}`; the first line must be `{}`", .file.display(), COLUMNS.join(","))]
    Column {
        /// The file.
        file: PathBuf,
        /// The name of the column.
        column: &'static str,
    },
    /// A value is invalid.
    #[error(
        "{}, line {line}: `{column}` is `{found}`, expected {expected}; correct the line, or record the run again",
        .file.display()
    )]
    Value {
        /// The file.
        file: PathBuf,
        /// The line, from 1.
        line: u64,
        /// The name of the column.
        column: &'static str,
        /// The value.
        found: String,
        /// What the column contains.
        expected: &'static str,
    },
    /// Two rows are about the same RVE and sweep.
    #[error(
        "{}, line {line}: RVE {rve} has a second cost in iteration {iteration} of step {step}; delete one of the two rows",
        .file.display()
    )]
    Twice {
        /// The file.
        file: PathBuf,
        /// The line of the second row, from 1.
        line: u64,
        /// The number of the RVE.
        rve: u64,
        /// The step.
        step: u32,
        /// The iteration of the step.
        iteration: u32,
    },
    /// No RVE has any cost.
    #[error("{}: there are no costs; record a run whose body has RVEs", .file.display())]
    Empty {
        /// The file.
        file: PathBuf,
    },
}

const COLUMNS: [&str; 6] = ["step", "iteration", "rve", "network", "iterations", "seconds"];

/// A row of the file.
struct Row {
    sweep: [u32; 2],
    rve: u64,
    class: u32,
    sample: Sample,
    line: u64,
}

impl Recording {
    /// Reads a file of costs, or that of a result directory. Its rows may have any order, and an RVE may be missing in any
    /// sweep. An unfinished last line, which a run in progress leaves, is ignored.
    ///
    /// # Errors
    /// Returns [`RecordingError`] if the file cannot be read or a row is invalid.
    pub fn read(file: &Path) -> Result<Self, RecordingError> {
        let in_folder = file.join("costs.csv");
        let file = if file.is_dir() { &in_folder } else { file };
        let read = |reason| RecordingError::Read { file: file.into(), reason };
        let text = std::fs::read(file).map_err(|error| read(error.into()))?;
        let end = text.iter().rposition(|&byte| byte == b'\n').map_or(0, |last| last + 1);
        let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(&text[..end]);
        let header = reader.headers().map_err(read)?.clone();
        let mut positions = [0; COLUMNS.len()];
        for (position, column) in positions.iter_mut().zip(COLUMNS) {
            let found = header.iter().position(|name| name.trim_start_matches('\u{feff}') == column);
            *position = found.ok_or_else(|| RecordingError::Column { file: file.into(), column })?;
        }
        let (mut rows, mut classes) = (Vec::new(), HashMap::new());
        let mut record = csv::StringRecord::new();
        while reader.read_record(&mut record).map_err(read)? {
            rows.push(row(file, &record, positions, &mut classes)?);
        }
        Self::of_rows(file, rows, classes.len())
    }

    fn of_rows(file: &Path, mut rows: Vec<Row>, networks: usize) -> Result<Self, RecordingError> {
        rows.sort_by_key(|row| (row.sweep, row.rve));
        let twice = rows.windows(2).find(|pair| (pair[0].sweep, pair[0].rve) == (pair[1].sweep, pair[1].rve));
        if let Some([_, Row { sweep: [step, iteration], rve, line, .. }]) = twice {
            let (line, rve, step, iteration) = (*line, *rve, *step, *iteration);
            return Err(RecordingError::Twice { file: file.into(), line, rve, step, iteration });
        }
        let mut numbers: Vec<u64> = rows.iter().map(|row| row.rve).collect();
        numbers.sort_unstable();
        numbers.dedup();
        let mut sweeps: Vec<[u32; 2]> = rows.iter().map(|row| row.sweep).collect();
        sweeps.dedup();
        if rows.is_empty() {
            return Err(RecordingError::Empty { file: file.into() });
        }
        let mut recording = Self {
            classes: vec![0; numbers.len()],
            networks,
            samples: vec![None; numbers.len() * sweeps.len()],
            sweeps,
        };
        let mut sweep = 0;
        for row in rows {
            while recording.sweeps[sweep] != row.sweep {
                sweep += 1;
            }
            let rve = numbers.partition_point(|&number| number < row.rve);
            recording.classes[rve] = row.class;
            recording.samples[sweep * numbers.len() + rve] = Some(row.sample);
        }
        Ok(recording)
    }

    /// Replaces the seconds of every RVE by the median of those with the same network and number of iterations. This
    /// removes what other programs on the same cores took, and also all differences between such RVEs.
    pub fn take_medians(&mut self) {
        let (rves, classes) = (self.rves(), &self.classes);
        let mut groups: HashMap<(u32, u32), Vec<f64>> = HashMap::new();
        let class = |at: usize| classes[at % rves];
        for (at, sample) in self.samples.iter().enumerate() {
            if let Some(Sample { iterations, seconds }) = *sample {
                groups.entry((class(at), iterations)).or_default().push(seconds);
            }
        }
        for seconds in groups.values_mut() {
            seconds.sort_unstable_by(f64::total_cmp);
        }
        for (at, sample) in self.samples.iter_mut().enumerate() {
            if let Some(sample) = sample
                && let Some(group) = groups.get(&(class(at), sample.iterations))
            {
                sample.seconds = group[group.len() / 2];
            }
        }
    }

    /// Creates a recording of one network from the seconds of each RVE, by sweep; each step has `sweeps_of_step` sweeps,
    /// and an RVE takes one iteration per millisecond.
    #[cfg(test)]
    pub fn of_seconds(seconds: &[Vec<f64>], sweeps_of_step: usize) -> Self {
        let sample = |&seconds: &f64| Some(Sample { iterations: (1e3 * seconds).round() as u32, seconds });
        let sweep = |sweep: usize| [(sweep / sweeps_of_step) as u32 + 1, (sweep % sweeps_of_step) as u32 + 1];
        Self {
            classes: vec![0; seconds[0].len()],
            networks: 1,
            sweeps: (0..seconds.len()).map(sweep).collect(),
            samples: seconds.iter().flatten().map(sample).collect(),
        }
    }

    /// Returns the number of RVEs.
    pub fn rves(&self) -> usize {
        self.classes.len()
    }

    /// Returns the number of sweeps.
    pub fn sweeps(&self) -> usize {
        self.sweeps.len()
    }

    /// Returns the number of steps.
    pub fn steps(&self) -> usize {
        (0..self.sweeps()).filter(|&sweep| self.starts_step(sweep)).count()
    }

    /// Returns the number of networks.
    pub fn networks(&self) -> usize {
        self.networks
    }

    /// Returns the number of the network of an RVE.
    pub fn class(&self, rve: usize) -> u32 {
        self.classes[rve]
    }

    /// Returns true if a sweep is the first one of its step.
    pub fn starts_step(&self, sweep: usize) -> bool {
        sweep == 0 || self.sweeps[sweep][0] != self.sweeps[sweep - 1][0]
    }

    /// Returns the cost of an RVE in a sweep; `None` if it does not exist then.
    pub fn sample(&self, rve: usize, sweep: usize) -> Option<Sample> {
        self.samples[sweep * self.rves() + rve]
    }

    /// Returns the seconds of all RVEs in all sweeps.
    pub fn seconds(&self) -> impl Iterator<Item = f64> {
        self.samples.iter().flatten().map(|sample| sample.seconds)
    }

    /// Returns the mean over the sweeps of the rank correlation with the sweep before; `None` if there is none.
    pub fn persistence(&self) -> Option<f64> {
        let seconds = |sweep: usize| -> Vec<f64> {
            (0..self.rves()).map(|rve| self.sample(rve, sweep).map_or(f64::NAN, |sample| sample.seconds)).collect()
        };
        let all: Vec<f64> =
            (1..self.sweeps()).filter_map(|sweep| rank_correlation(&seconds(sweep - 1), &seconds(sweep))).collect();
        (!all.is_empty()).then(|| all.iter().sum::<f64>() / all.len() as f64)
    }
}

/// Reads a row; a network that is not among `classes` is added to them.
fn row(
    file: &Path,
    record: &csv::StringRecord,
    positions: [usize; COLUMNS.len()],
    classes: &mut HashMap<String, u32>,
) -> Result<Row, RecordingError> {
    let line = record.position().map_or(0, csv::Position::line);
    let cell = |column: usize| record.get(positions[column]).unwrap_or_default();
    let invalid = |column: usize, expected| {
        let (column, found) = (COLUMNS[column], cell(column).to_owned());
        RecordingError::Value { file: file.into(), line, column, found, expected }
    };
    fn parse<T: FromStr>(cell: &str, error: impl FnOnce() -> RecordingError) -> Result<T, RecordingError> {
        cell.parse().map_err(|_| error())
    }
    let step = parse(cell(0), || invalid(0, "the number of a step, from 1"))?;
    let iteration = parse(cell(1), || invalid(1, "the number of an evaluation in the step, from 1"))?;
    let rve = parse(cell(2), || invalid(2, "the number of an integration point, from 0"))?;
    let iterations = parse(cell(4), || invalid(4, "a number of Newton iterations"))?;
    let seconds: f64 = parse(cell(5), || invalid(5, "a number of seconds"))?;
    if !(seconds >= 0.0 && seconds.is_finite()) {
        return Err(invalid(5, "a finite number of seconds, not below 0"));
    }
    let next = classes.len() as u32;
    let class = *classes.entry(cell(3).to_owned()).or_insert(next);
    Ok(Row { sweep: [step, iteration], rve, class, sample: Sample { iterations, seconds }, line })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Recording, String> {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("costs.csv");
        std::fs::write(&file, text).unwrap();
        Recording::read(&file).map_err(|error| error.to_string().replace(&format!("{}", folder.path().display()), ""))
    }

    const HEADER: &str = "step,iteration,rve,network,iterations,seconds\n";

    #[test]
    fn rows_in_any_order_and_rves_that_come_and_go_are_read() {
        let text = format!("{HEADER}2,1,40,b,3,0.5\n1,2,7,a,1,0.25\n1,1,7,a,2,1e-3\n2,1,7,a,1,0.125\n2,1,3,,0,0\n");
        let recording = read(&text).unwrap();
        assert_eq!((recording.rves(), recording.sweeps(), recording.steps(), recording.networks()), (3, 3, 2, 3));
        let starts: Vec<bool> = (0..3).map(|sweep| recording.starts_step(sweep)).collect();
        assert_eq!(starts, [true, false, true]);
        let seconds = |sweep: usize| -> Vec<Option<f64>> {
            (0..3).map(|rve| recording.sample(rve, sweep).map(|sample| sample.seconds)).collect()
        };
        assert_eq!(seconds(0), [None, Some(1e-3), None]);
        assert_eq!(seconds(1), [None, Some(0.25), None]);
        assert_eq!(seconds(2), [Some(0.0), Some(0.125), Some(0.5)]);
        assert_eq!(recording.sample(2, 2).map(|sample| sample.iterations), Some(3));
        assert!(recording.class(1) != recording.class(2) && recording.class(0) != recording.class(1));
    }

    #[test]
    fn the_file_of_a_directory_is_read_up_to_its_last_whole_line() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("costs.csv"), format!("{HEADER}1,1,0,a,2,0.125\n1,1,1,a,2,0.12")).unwrap();
        let recording = Recording::read(folder.path()).unwrap();
        assert_eq!((recording.rves(), recording.seconds().collect::<Vec<_>>()), (1, vec![0.125]));
    }

    #[test]
    fn medians_are_those_of_a_network_and_a_number_of_iterations() {
        let rows =
            "1,1,0,a,1,1\n1,1,1,a,1,9\n1,1,2,b,1,5\n1,2,0,a,1,2\n1,2,1,a,2,8\n2,1,2,b,1,4\n2,1,1,a,2,3\n2,1,0,a,2,6\n";
        let mut recording = read(&format!("{HEADER}{rows}")).unwrap();
        recording.take_medians();
        let seconds = |sweep: usize| -> Vec<Option<f64>> {
            (0..3).map(|rve| recording.sample(rve, sweep).map(|sample| sample.seconds)).collect()
        };
        assert_eq!(seconds(0), [Some(2.0), Some(2.0), Some(5.0)]);
        assert_eq!(seconds(1), [Some(2.0), Some(6.0), None]);
        assert_eq!(seconds(2), [Some(6.0), Some(6.0), Some(5.0)]);
    }

    #[test]
    fn errors_name_file_line_and_cure() {
        let error = |text: &str| read(text).map(|_| ()).unwrap_err();
        assert_eq!(
            error("step,iteration,rve,iterations,seconds\n"),
            "/costs.csv, line 1: there is no column `network`; the first line must be \
             `step,iteration,rve,network,iterations,seconds`"
        );
        assert_eq!(
            error(&format!("{HEADER}1,1,0,a,1,0.1\n1,1,1,a,1,-2\n")),
            "/costs.csv, line 3: `seconds` is `-2`, expected a finite number of seconds, not below 0; correct the line, or \
             record the run again"
        );
        assert!(error(&format!("{HEADER}1,x,0,a,1,0.1\n")).contains("line 2: `iteration` is `x`"));
        assert!(error(&format!("{HEADER}1,1,0,a,1,NaN\n")).contains("line 2: `seconds` is `NaN`"));
        assert_eq!(
            error(&format!("{HEADER}3,2,5,a,1,0.1\n1,1,5,a,1,0.1\n3,2,5,b,1,0.2\n")),
            "/costs.csv, line 4: RVE 5 has a second cost in iteration 2 of step 3; delete one of the two rows"
        );
        assert!(error(HEADER).contains("there are no costs"));
        assert!(error(&format!("{HEADER}1,1,0\n")).contains("/costs.csv: CSV error"));
        let missing = Recording::read(Path::new("/nowhere/costs.csv")).unwrap_err().to_string();
        assert!(missing.contains("/nowhere/costs.csv") && missing.contains("`costs = true`"), "{missing}");
    }
}
