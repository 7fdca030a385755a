//! Writes the result directory during a run.

use std::path::{Path, PathBuf};

use nalgebra::Matrix3;

use super::case::Case;
use super::checkpoint;
use super::results::collection::{Entry, field_file, index_file, partial};
use super::results::log::{
    Balance, Cut, Event, Factorizations, LogWriter, NewtonLog, NewtonSeconds, RankSeconds, Ranks, RveLog, Step,
};
use super::results::{
    self, CASE_FILE, Collection, Done, FIELDS_FILE, FieldFile, FieldSet, LOADS_FILE, LOG_FILE, LoadsWriter, Pieces,
    ResultsError, ResultsRecord, SurfaceRow, write_vtu,
};
use super::rve_files::NetworkFiles;
use crate::app::stress::CauchyStress;
use crate::fem::equilibrium::BodyState;
use crate::fem::mesh::Mesh;
use crate::fem::reactions::BoundaryForces;
use crate::fem::stepping::{ConvergedStep, FailedAttempt, StepReport};
use crate::las::NewtonReport;
use crate::output;
use crate::tensor::{row_major, von_mises};
use crate::tissue::micro_scale::{FailedRve, Life, PointSummary, RveStats, TissueMaterial};
use crate::tissue::replay::lost_file;

/// An observer of the progress of a run.
pub trait Progress {
    /// Called after a load step has converged.
    fn converged(&mut self, step: &Step);

    /// Called after an attempt has failed; the increment is then halved, if there are halvings left.
    fn failed(&mut self, cut: &Cut);
}

/// Ignores progress.
impl Progress for () {
    fn converged(&mut self, _: &Step) {}

    fn failed(&mut self, _: &Cut) {}
}

/// The state from which a resumed run continues.
pub(super) struct ResumePoint {
    /// The completed steps.
    pub done: Done,
    /// The results that the run had written until then.
    pub written: ResultsRecord,
}

/// The result directory of a run in progress.
pub(super) struct Recorder<'a> {
    dir: PathBuf,
    every: usize,
    loads: LoadsWriter,
    log: LogWriter,
    fields: Collection,
    networks: NetworkFiles,
    /// Reference volume of every element.
    volumes: Vec<f64>,
    stress: CauchyStress,
    /// The field files in the collection.
    written: Vec<FieldFile>,
    progress: &'a mut dyn Progress,
    started: std::time::Instant,
    /// The dump of the RVE that made the last attempt fail, if one did.
    lost: Option<PathBuf>,
}

impl<'a> Recorder<'a> {
    /// Creates the directory and its files. A run from the beginning removes the results of an earlier run; a resumed
    /// one keeps those up to the step that it continues from. `elements` are those whose networks are written.
    pub fn open(
        dir: &Path,
        case: &Case,
        mesh: &Mesh,
        elements: &[usize],
        resumed: Option<&ResumePoint>,
        progress: &'a mut dyn Progress,
    ) -> Result<Self, ResultsError> {
        std::fs::create_dir_all(dir).map_err(ResultsError::write(dir))?;
        match resumed {
            // The run may have been killed before it removed the oldest checkpoints.
            Some(on) => checkpoint::keep_last(dir, on.done.steps)?,
            None => {
                // Checkpoints first: no checkpoint may exist without its results.
                checkpoint::clear(dir)?;
                results::clear(dir)?;
            }
        }
        results::clear_unfinished(dir)?;
        results::replace(&dir.join(CASE_FILE), results::case_copy(case).as_bytes())?;
        let surfaces: Vec<&str> = mesh.surface_names().collect();
        let regions: Vec<&str> = mesh.regions().iter().map(String::as_str).collect();
        let points: Vec<String> = (0..case.points.len()).map(|k| format!("point{k}")).collect();
        let points: Vec<&str> = points.iter().map(String::as_str).collect();
        let (loads_file, log_file) = (dir.join(LOADS_FILE), dir.join(LOG_FILE));
        let (loads, log, fields) = match resumed {
            None => (
                LoadsWriter::create(&loads_file, &surfaces, &points, &regions)?,
                LogWriter::create(&log_file)?,
                Collection::new(dir),
            ),
            Some(ResumePoint { done, written }) => {
                let known: Vec<Entry> = written.fields.iter().map(FieldFile::entry).collect();
                (
                    LoadsWriter::resume(&loads_file, &surfaces, &points, &regions, done.steps)?,
                    LogWriter::resume(&log_file)?,
                    Collection::resume(dir.join(FIELDS_FILE), done.t(), &known)?,
                )
            }
        };
        let listed = fields.entries().iter().map(|entry| FieldFile::new(dir, entry.time, &entry.file));
        let written = listed.collect::<Result<_, ResultsError>>()?;
        Ok(Self {
            dir: dir.to_owned(),
            every: case.output.every,
            loads,
            log,
            fields,
            networks: NetworkFiles::open(dir, elements, resumed.map(|on| on.done))?,
            volumes: (0..mesh.elements().len()).map(|element| mesh.element_volume(element)).collect(),
            stress: CauchyStress::new(case, mesh),
            progress,
            started: std::time::Instant::now(),
            lost: None,
            written,
        })
    }

    /// Flushes the results to disk, so that a checkpoint may refer to them, and returns their description.
    pub fn flush(&self) -> Result<ResultsRecord, ResultsError> {
        self.loads.sync()?;
        self.log.sync()?;
        // The content of a file is flushed before it is renamed; this flushes the names in the folders.
        output::sync_folder(&self.dir).map_err(ResultsError::write(&self.dir))?;
        if let Some(folder) = self.networks.folder() {
            output::sync_folder(folder).map_err(ResultsError::write(folder))?;
        }
        Ok(ResultsRecord { loads: self.loads.marks().to_vec(), fields: self.written.clone() })
    }

    pub fn log(&mut self, event: &Event) -> Result<(), ResultsError> {
        self.log.write(event)
    }

    fn write_loads<P>(&mut self, step: &ConvergedStep<'_, P>) -> Result<(), ResultsError> {
        let surfaces: Vec<SurfaceRow> = step
            .forces
            .surfaces
            .iter()
            .map(|s| SurfaceRow { area: s.area, force: s.force, displacement: s.displacement })
            .collect();
        let points: Vec<[f64; 3]> = step.forces.points.iter().map(|point| point.force).collect();
        let mut volumes = vec![0.0; step.mesh.regions().len()];
        for ((f, volume), &region) in step.state.gradients.iter().zip(&self.volumes).zip(step.mesh.region_of()) {
            volumes[region as usize] += f.determinant() * volume;
        }
        self.loads.row(step.step, step.t, &surfaces, &points, &volumes)
    }

    /// Writes the fields and the networks of a state: that of a full step, or of a substep after it.
    fn write_fields<M: TissueMaterial>(
        &mut self,
        (step, whole): (usize, bool),
        mesh: &Mesh,
        state: &BodyState,
        field: &M,
    ) -> Result<(), ResultsError> {
        let stress = |element: usize, f: &_, pk1: &_| self.stress.of(mesh.region_of()[element], f, pk1);
        let cells = CellFields::new(state, stress, &field.summaries(), |element| field.sites().life(element));
        let region: Vec<i64> = mesh.region_of().iter().map(|&region| region.into()).collect();
        let rank: Vec<i64> = (0..region.len()).map(|element| field.rank_of(element) as i64).collect();
        let fields = FieldSet {
            points: mesh.nodes(),
            elements: mesh.elements(),
            point_vectors: vec![("displacement", &state.displacements)],
            cell_scalars: vec![
                ("von_mises_stress", &cells.von_mises),
                ("energy_density", &state.responses.energy),
                ("fiber_alignment", &cells.alignment),
                ("stretch_min", &cells.stretch_min),
                ("stretch_max", &cells.stretch_max),
            ],
            cell_integers: vec![
                ("rve_iterations", &cells.iterations),
                ("rve_status", &cells.status),
                ("network", &cells.network),
                ("region", &region),
                ("rank", &rank),
            ],
            cell_vectors: vec![("fiber_direction", &cells.direction)],
            cell_tensors: vec![
                ("cauchy_stress", &cells.cauchy),
                ("deformation_gradient", &cells.gradient),
                ("fiber_orientation", &cells.orientation),
            ],
        };
        let of_step = if field.parts().is_some() { index_file(step) } else { field_file(step) };
        let file = if whole { of_step } else { partial(&of_step) };
        let path = self.dir.join(&file);
        match field.parts() {
            None => write_vtu(&path, &fields)?,
            Some((part_of, parts)) => write_parts(&path, &fields, part_of, parts)?,
        }
        self.fields.add(state.t, &file)?;
        self.written.push(FieldFile::new(&self.dir, state.t, &file)?);
        self.networks.write((step, whole), state.t, field)
    }

    /// Writes the times of all ranks, one entry per trial state.
    fn write_seconds(&mut self, step: usize, iterations: &[Vec<RankSeconds>]) -> Result<(), ResultsError> {
        for (iteration, ranks) in (1..).zip(iterations) {
            self.log.write(&Event::Ranks(Ranks { step, iteration, ranks: ranks.clone() }))?;
        }
        Ok(())
    }

    /// Writes the dump of a failed RVE; returns the file, relative to the directory.
    fn write_lost(&self, step: usize, halvings: u32, mut lost: FailedRve) -> Result<PathBuf, ResultsError> {
        let file = lost_file(step, halvings, lost.element);
        lost.dump.origin = format!("element {} in load step {step}", lost.element);
        lost.dump.write(&self.dir.join(&file))?;
        Ok(file)
    }

    /// Returns the dump of the RVE that made the last attempt fail, if one did.
    pub fn lost(&self) -> Option<&Path> {
        self.lost.as_deref()
    }

    /// Writes the fields of the last converged state if they are not written yet, for a run that fails between two
    /// outputs or within a step that was halved. `step` is the last full step.
    pub fn write_last<M: TissueMaterial>(
        &mut self,
        step: usize,
        t_of_step: f64,
        mesh: &Mesh,
        state: &BodyState,
        field: &M,
    ) -> Result<(), ResultsError> {
        let written = self.fields.entries().last().map_or(0.0, |entry| entry.time);
        if state.t <= written {
            return Ok(());
        }
        self.write_fields((step, state.t <= t_of_step), mesh, state, field)
    }
}

/// The callbacks of [`StepObserver`](crate::fem::stepping::StepObserver).
impl Recorder<'_> {
    pub fn converged<M: TissueMaterial>(&mut self, step: &ConvergedStep<'_, M>) -> Result<(), ResultsError> {
        self.write_loads(step)?;
        if step.step.is_multiple_of(self.every) || step.step == step.count {
            self.write_fields((step.step, true), step.mesh, step.state, step.field)?;
        }
        self.write_seconds(step.step, &step.field.take_seconds())?;
        let stats = step.field.take_stats();
        let line = Step {
            step: step.step,
            t: step.t,
            cuts: step.report.cuts as u32,
            rounds: step.report.evolutions,
            newton: newton_of_step(step.report, std::mem::replace(&mut self.started, std::time::Instant::now())),
            rve: (step.field.sites().rves() > 0).then(|| rve_log(&stats, step.field)),
            balance: balance(&step.forces),
        };
        self.lost = None;
        self.progress.converged(&line);
        self.log.write(&Event::Step(line))
    }

    pub fn failed<M: TissueMaterial, F: std::error::Error>(
        &mut self,
        attempt: &FailedAttempt<'_, M, F>,
    ) -> Result<(), ResultsError> {
        self.write_seconds(attempt.step, &attempt.field.take_seconds())?;
        let lost = attempt.field.take_lost();
        let lost_rve = lost.map(|lost| self.write_lost(attempt.step, attempt.halvings, lost)).transpose()?;
        self.lost = lost_rve.as_ref().map(|file| self.dir.join(file));
        let cut = Cut {
            step: attempt.step,
            t: attempt.t,
            reason: attempt.reason.to_string(),
            lost_rve,
            newton: newton_log(attempt.newton),
        };
        self.progress.failed(&cut);
        self.log.write(&Event::Cut(cut))
    }
}

/// Writes one file per part of the body, and the index file that lists them.
fn write_parts(path: &Path, fields: &FieldSet<'_>, part_of: &[u32], parts: usize) -> Result<(), ResultsError> {
    let pieces = Pieces::new(fields.elements, part_of, parts);
    (0..parts).try_for_each(|part| pieces.write_part(part, path, fields))?;
    pieces.write_index(path, fields)
}

/// The sum of all surface and point forces, and its norm divided by the largest of their norms.
fn balance(forces: &BoundaryForces) -> Balance {
    let norm = |force: &[f64; 3]| force.iter().map(|f| f * f).sum::<f64>().sqrt();
    let all = forces.surfaces.iter().map(|s| &s.force).chain(forces.points.iter().map(|p| &p.force));
    let largest = all.map(norm).fold(0.0, f64::max);
    let force = forces.sum();
    Balance { force, relative: if largest > 0.0 { norm(&force) / largest } else { 0.0 } }
}

fn newton_log(report: &NewtonReport) -> NewtonLog {
    let seconds = report.seconds;
    NewtonLog {
        iterations: report.iterations,
        residual: report.residuals.last().copied().unwrap_or(f64::NAN),
        residuals: report.residuals.clone(),
        relative: report.relative.clone(),
        line_search_cuts: report.backtracks,
        factorizations: Factorizations {
            cholesky: report.cholesky,
            ldlt: report.ldlt,
            lu: report.lu,
            approximate: report.approximate,
        },
        linear_iterations: report.linear_iterations,
        seconds: NewtonSeconds {
            point_field: seconds.residual,
            assembly: seconds.jacobian,
            factor: seconds.factor,
            solve: seconds.solve,
            total: seconds.residual + seconds.jacobian + seconds.factor + seconds.solve,
        },
    }
}

/// Sums the counts of all substeps of a step and concatenates their residual histories.
fn newton_of_step(report: &StepReport, started: std::time::Instant) -> NewtonLog {
    let mut sum = NewtonLog::default();
    for part in &report.solves {
        let part = newton_log(part);
        sum.iterations += part.iterations;
        sum.residual = part.residual;
        sum.residuals.extend(part.residuals);
        sum.relative.extend(part.relative);
        sum.line_search_cuts += part.line_search_cuts;
        sum.factorizations.cholesky += part.factorizations.cholesky;
        sum.factorizations.ldlt += part.factorizations.ldlt;
        sum.factorizations.lu += part.factorizations.lu;
        sum.factorizations.approximate += part.factorizations.approximate;
        sum.linear_iterations += part.linear_iterations;
    }
    let seconds = report.seconds();
    sum.seconds = NewtonSeconds {
        point_field: seconds.residual,
        assembly: seconds.jacobian,
        factor: seconds.factor,
        solve: seconds.solve,
        total: started.elapsed().as_secs_f64(),
    };
    sum
}

fn rve_log(stats: &RveStats, field: &impl TissueMaterial) -> RveLog {
    let sites = field.sites();
    let lives: Vec<Life> = (0..sites.len()).filter_map(|element| sites.life(element)).collect();
    let count = |life: Life| lives.iter().filter(|&&other| other == life).count() as u64;
    RveLog {
        solves: stats.solves as u64,
        iterations_total: stats.iterations as u64,
        iterations_max: stats.most_iterations as u64,
        iterations_mean: stats.iterations as f64 / stats.solves.max(1) as f64,
        cuts: stats.cuts as u64,
        indefinite: stats.indefinite as u64,
        line_search_cuts: stats.line_search_cuts as u64,
        predicted: stats.predicted as u64,
        by_cuts: stats.by_cuts as u64,
        by_regularized: stats.by_regularized as u64,
        by_relaxation: stats.by_relaxation as u64,
        relaxation_steps: stats.relaxation_steps as u64,
        verified: stats.verified as u64,
        replaced: stats.replaced as u64,
        reused: stats.reused as u64,
        seconds_cpu: stats.seconds,
        asleep: count(Life::Asleep),
        waiting: count(Life::Waiting),
        deleted: count(Life::Deleted),
    }
}

/// The element fields, collected for the writer.
#[derive(Default)]
struct CellFields {
    cauchy: Vec<[f64; 9]>,
    gradient: Vec<[f64; 9]>,
    von_mises: Vec<f64>,
    orientation: Vec<[f64; 9]>,
    direction: Vec<[f64; 3]>,
    alignment: Vec<f64>,
    stretch_min: Vec<f64>,
    stretch_max: Vec<f64>,
    iterations: Vec<i64>,
    status: Vec<i64>,
    network: Vec<i64>,
}

impl CellFields {
    fn new(
        state: &BodyState,
        stress: impl Fn(usize, &Matrix3<f64>, &Matrix3<f64>) -> Matrix3<f64>,
        summaries: &[Option<PointSummary>],
        life: impl Fn(usize) -> Option<Life>,
    ) -> Self {
        let mut cells = Self::default();
        let states = state.gradients.iter().zip(&state.responses.pk1);
        for (element, ((f, pk1), summary)) in states.zip(summaries).enumerate() {
            let cauchy = stress(element, f, pk1);
            cells.von_mises.push(von_mises(&cauchy));
            cells.cauchy.push(row_major(&cauchy));
            cells.gradient.push(row_major(f));
            // Elements without fibers have 0 in the fiber fields, and -1 in `iterations` and `network`.
            let s = summary.as_ref();
            cells.orientation.push(s.map_or([0.0; 9], |s| row_major(&s.orientation)));
            cells.direction.push(s.map_or([0.0; 3], |s| s.direction.into()));
            cells.alignment.push(s.map_or(0.0, |s| s.alignment));
            cells.stretch_min.push(s.map_or(0.0, |s| s.stretch[0]));
            cells.stretch_max.push(s.map_or(0.0, |s| s.stretch[1]));
            cells.iterations.push(s.map_or(-1, |s| s.iterations as i64));
            cells.status.push(life(element).map_or(-1, |life| match life {
                Life::Awake => 0,
                Life::Asleep => 1,
                Life::Waiting => 2,
                Life::Deleted => 3,
            }));
            cells.network.push(s.map_or(-1, |s| s.network as i64));
        }
        cells
    }
}
