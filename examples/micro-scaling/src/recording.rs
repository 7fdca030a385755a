//! The recorded costs of the RVEs of a run: `costs.csv`, which `[output] costs = true` of a case writes.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use biotissue::app::results::{CostRow, ResultsError, read_costs};
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
    sweeps: Vec<[usize; 2]>,
    /// One entry per RVE, one sweep after the other; `None` where the RVE does not exist.
    samples: Vec<Option<Sample>>,
}

/// The reason why costs cannot be read.
#[derive(Debug, Error)]
pub enum RecordingError {
    /// The file cannot be read.
    #[error("{0}; a run whose case has `costs = true` in `[output]` writes this file")]
    Read(#[from] ResultsError),
    /// Two rows are about the same RVE and sweep.
    #[error(
        "{}, line {line}: RVE {rve} has a second cost in iteration {iteration} of step {step}; delete one of the two rows",
        .file.display()
    )]
    Twice {
        /// The file.
        file: PathBuf,
        /// The line of the second row, from 1.
        line: usize,
        /// The number of the RVE.
        rve: u64,
        /// The step.
        step: usize,
        /// The iteration of the step.
        iteration: usize,
    },
    /// The costs are those of another run.
    #[error("{}: another run than that of the first file; give recordings of the same case, or leave `--least` out", .file.display())]
    OtherRun {
        /// The file.
        file: PathBuf,
    },
    /// No RVE has any cost.
    #[error("{}: there are no costs; record a run whose body has RVEs", .file.display())]
    Empty {
        /// The file.
        file: PathBuf,
    },
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
        Self::of_rows(file, &read_costs(file)?)
    }

    fn of_rows(file: &Path, rows: &[CostRow]) -> Result<Self, RecordingError> {
        let sweep_of = |row: &CostRow| [row.step, row.iteration];
        let mut order: Vec<usize> = (0..rows.len()).collect();
        // Stable, so that of two rows about the same RVE the second one is reported.
        order.sort_by_key(|&at| (sweep_of(&rows[at]), rows[at].rve));
        let place = |at: usize| (sweep_of(&rows[at]), rows[at].rve);
        if let Some(pair) = order.windows(2).find(|pair| place(pair[0]) == place(pair[1])) {
            let CostRow { step, iteration, rve, .. } = rows[pair[1]];
            // The first line has the names of the columns.
            return Err(RecordingError::Twice { file: file.into(), line: pair[1] + 2, rve, step, iteration });
        }
        let mut numbers: Vec<u64> = rows.iter().map(|row| row.rve).collect();
        numbers.sort_unstable();
        numbers.dedup();
        let mut sweeps: Vec<[usize; 2]> = order.iter().map(|&at| sweep_of(&rows[at])).collect();
        sweeps.dedup();
        if rows.is_empty() {
            return Err(RecordingError::Empty { file: file.into() });
        }
        let mut networks: HashMap<&str, u32> = HashMap::new();
        let (mut classes, mut samples) = (vec![0; numbers.len()], vec![None; numbers.len() * sweeps.len()]);
        let mut sweep = 0;
        for row in order.into_iter().map(|at| &rows[at]) {
            while sweeps[sweep] != sweep_of(row) {
                sweep += 1;
            }
            let (next, rve) = (networks.len() as u32, numbers.partition_point(|&number| number < row.rve));
            classes[rve] = *networks.entry(&row.network).or_insert(next);
            samples[sweep * numbers.len() + rve] = Some(Sample { iterations: row.iterations, seconds: row.seconds });
        }
        Ok(Self { classes, networks: networks.len(), sweeps, samples })
    }

    /// Replaces the seconds of every RVE by those in another recording of the same run, where these are less. What other
    /// programs on the same machine add to the seconds thus disappears, and differences between RVEs remain.
    ///
    /// # Errors
    /// Returns [`RecordingError::OtherRun`] if the recordings differ in more than the seconds.
    pub fn take_least(&mut self, file: &Path, other: &Self) -> Result<(), RecordingError> {
        let work = |recording: &Self| -> Vec<Option<u32>> {
            recording.samples.iter().map(|sample| sample.map(|sample| sample.iterations)).collect()
        };
        if (&self.classes, &self.sweeps, work(self)) != (&other.classes, &other.sweeps, work(other)) {
            return Err(RecordingError::OtherRun { file: file.into() });
        }
        for (own, other) in self.samples.iter_mut().flatten().zip(other.samples.iter().flatten()) {
            own.seconds = own.seconds.min(other.seconds);
        }
        Ok(())
    }

    /// Creates a recording of one network from the seconds of each RVE, by sweep; each step has `sweeps_of_step` sweeps,
    /// and an RVE takes one iteration per millisecond.
    #[cfg(test)]
    pub fn of_seconds(seconds: &[Vec<f64>], sweeps_of_step: usize) -> Self {
        let sample = |&seconds: &f64| Some(Sample { iterations: (1e3 * seconds).round() as u32, seconds });
        let sweep = |sweep: usize| [sweep / sweeps_of_step + 1, sweep % sweeps_of_step + 1];
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
    fn the_least_of_several_recordings_of_a_run_remains() {
        let recording = |seconds: [f64; 3]| {
            let [a, b, c] = seconds;
            read(&format!("{HEADER}1,1,0,a,1,{a}\n1,1,1,b,2,{b}\n2,1,1,b,1,{c}\n")).unwrap()
        };
        let mut least = recording([1.0, 9.0, 3.0]);
        least.take_least(Path::new("2.csv"), &recording([2.0, 5.0, 3.0])).unwrap();
        assert_eq!(least.seconds().collect::<Vec<_>>(), [1.0, 5.0, 3.0]);
        for rows in ["1,1,0,a,1,1\n1,1,1,b,2,1\n2,1,0,b,1,1\n", "1,1,0,a,1,1\n1,1,1,b,3,1\n2,1,1,b,1,1\n"] {
            let other = read(&format!("{HEADER}{rows}")).unwrap();
            let error = least.take_least(Path::new("3.csv"), &other).unwrap_err().to_string();
            assert!(error.starts_with("3.csv: another run"), "{error}");
        }
        assert_eq!(least.seconds().collect::<Vec<_>>(), [1.0, 5.0, 3.0]);
    }

    #[test]
    fn errors_name_file_line_and_cure() {
        let error = |text: &str| read(text).map(|_| ()).unwrap_err();
        let cure = "a run whose case has `costs = true` in `[output]` writes this file";
        let columns = error("step,iteration,rve,iterations,seconds\n");
        assert!(columns.contains("/costs.csv:1: ") && columns.ends_with(cure), "{columns}");
        for cells in ["1,1,1,a,1,-2", "1,x,0,a,1,0.1", "1,1,0,a,1,NaN", "1,1,0"] {
            let invalid = error(&format!("{HEADER}1,1,0,a,1,0.1\n{cells}\n"));
            assert!(invalid.contains("/costs.csv:3: ") && invalid.ends_with(cure), "{invalid}");
        }
        assert_eq!(
            error(&format!("{HEADER}3,2,5,a,1,0.1\n1,1,5,a,1,0.1\n3,2,5,b,1,0.2\n")),
            "/costs.csv, line 4: RVE 5 has a second cost in iteration 2 of step 3; delete one of the two rows"
        );
        assert!(error(HEADER).contains("there are no costs"));
        let missing = Recording::read(Path::new("/nowhere/costs.csv")).unwrap_err().to_string();
        assert!(missing.contains("/nowhere/costs.csv") && missing.ends_with(cure), "{missing}");
    }
}
