//! Writes the result directory during a run.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::case::{Case, SurfaceLoad};
use super::checkpoint;
use super::field_files::{FieldFiles, FieldNames, FieldState, PieceIndex};
use super::rank_shares::RankShares;
use super::results::collection::Entry;
use super::results::log::{
    Balance, Cut, Event, Factorizations, LinearLog, LogWriter, Migration, NewtonLog, NewtonSeconds, Ranks, RveLog,
    ScalesLog, Step,
};
use super::results::{
    self, CASE_FILE, COSTS_FILE, Collection, CostRow, CostsWriter, FIELDS_FILE, FieldFile, LOADS_FILE, LOG_FILE,
    LoadNames, LoadRow, LoadsWriter, POINTS_FILE, ResultsError, ResultsRecord, RigidRow, RunProgress, SurfaceRow,
    failed_rve_file,
};
use super::rve_files::NetworkFiles;
use crate::fem::mesh::Mesh;
use crate::fem::reactions::{BoundaryForces, RigidForce, SurfaceForce};
use crate::fem::stepping::{ConvergedStep, FailedAttempt, Iterating};
use crate::las::{self, NewtonReport, SolveReport};
use crate::output;
use crate::tissue::micro_scale::{FailedRve, RveCost, RveCounts, RveStats, TissueMaterial};

/// An observer of the progress of a run.
pub trait Progress {
    /// Called after a load step has converged.
    fn converged(&mut self, step: &Step);

    /// Called after an attempt has failed; the increment is then halved, if there are halvings left.
    fn failed(&mut self, cut: &Cut);

    /// Called before every iteration of Newton's method of the body.
    fn iterating(&mut self, iteration: &Iterating<'_>) {
        let _ = iteration;
    }

    /// Called after a checkpoint of a load step has been written.
    fn saved(&mut self, step: usize) {
        let _ = step;
    }

    /// Returns true if the run is to end before its next load step, with a checkpoint.
    fn is_interrupted(&self) -> bool {
        false
    }
}

/// Ignores progress.
impl Progress for () {
    fn converged(&mut self, _: &Step) {}

    fn failed(&mut self, _: &Cut) {}
}

/// The state from which a resumed run continues.
pub(super) struct ResumePoint {
    /// The completed steps.
    pub progress: RunProgress,
    /// The results that the run had written until then.
    pub written: ResultsRecord,
}

/// The result directory of a run in progress.
pub(super) struct Recorder<'a> {
    dir: PathBuf,
    files: Arc<FieldFiles>,
    loads: LoadsWriter,
    log: LogWriter,
    /// The costs of RVEs, if they are written.
    costs: Option<CostsWriter>,
    fields: Collection,
    /// The collection of integration points, if they are written.
    points: Option<Collection>,
    networks: NetworkFiles,
    /// The field files in the collection.
    written: Vec<FieldFile>,
    progress: &'a mut dyn Progress,
    started: std::time::Instant,
    shares: RankShares,
    /// How the ranks shared the work of each step so far.
    scales: Vec<ScalesLog>,
    /// The dump of the RVE that made the last attempt fail, if one did.
    failed_rve: Option<PathBuf>,
}

impl<'a> Recorder<'a> {
    /// Creates the directory and its files. A run from the beginning removes the results of an earlier run; a resumed
    /// one keeps those up to the step that it continues from. `rves` are the integration points whose networks are written.
    pub fn open(
        files: Arc<FieldFiles>,
        case: &Case,
        mesh: &Mesh,
        rves: &[usize],
        resumed: Option<&ResumePoint>,
        progress: &'a mut dyn Progress,
    ) -> Result<Self, ResultsError> {
        let dir = files.dir();
        std::fs::create_dir_all(dir).map_err(ResultsError::write(dir))?;
        match resumed {
            // The run may have been killed before it removed the oldest checkpoints.
            Some(on) => checkpoint::keep_last(dir, on.progress.steps)?,
            None => {
                // Checkpoints first: no checkpoint may exist without its results.
                checkpoint::clear(dir)?;
                results::clear(dir)?;
            }
        }
        results::clear_unfinished(dir)?;
        results::replace(&dir.join(CASE_FILE), results::case_copy(case).as_bytes())?;
        let names = load_names(case, mesh);
        let (loads_file, log_file) = (dir.join(LOADS_FILE), dir.join(LOG_FILE));
        let (loads, log, fields) = match resumed {
            None => (
                LoadsWriter::create(&loads_file, names)?,
                LogWriter::create(&log_file)?,
                Collection::new(dir.join(FIELDS_FILE)),
            ),
            Some(ResumePoint { progress, written }) => {
                let known: Vec<Entry> = written.fields.iter().map(FieldFile::entry).collect();
                (
                    LoadsWriter::resume(&loads_file, names, progress.steps)?,
                    LogWriter::resume(&log_file, progress.steps)?,
                    Collection::resume(dir.join(FIELDS_FILE), progress.t(), &known)?,
                )
            }
        };
        let costs_file = dir.join(COSTS_FILE);
        let costs = match resumed {
            None => case.output.costs.then(|| CostsWriter::create(&costs_file)).transpose()?,
            // Without costs in the output, those of the steps that the run repeats still have to go.
            Some(on) if case.output.costs || costs_file.exists() => {
                let costs = CostsWriter::resume(&costs_file, on.progress.steps)?;
                case.output.costs.then_some(costs)
            }
            Some(_) => None,
        };
        let points_file = dir.join(POINTS_FILE);
        let points = match resumed {
            None => Collection::new(points_file),
            // The files of earlier steps stay listed if the resumed run writes none.
            Some(on) => {
                let known = results::unlisted_points(dir, on.progress)?;
                Collection::resume(points_file, on.progress.t(), &known)?
            }
        };
        let listed = fields.entries().iter().map(|entry| FieldFile::new(dir, entry.time, &entry.file));
        let written = listed.collect::<Result<_, ResultsError>>()?;
        let networks = NetworkFiles::open(dir, rves, mesh.whole_points(), resumed.map(|on| on.progress))?;
        if let Some(on) = resumed {
            // No collection lists them any more.
            results::clear_after(dir, on.progress.steps)?;
        }
        Ok(Self {
            dir: dir.to_owned(),
            files: Arc::clone(&files),
            loads,
            log,
            costs,
            fields,
            points: case.output.points.then_some(points),
            networks,
            progress,
            started: std::time::Instant::now(),
            shares: RankShares::default(),
            scales: Vec::new(),
            failed_rve: None,
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
        let forces = &step.forces;
        let of_surface = |s: &SurfaceForce| SurfaceRow { area: s.area, force: s.force, displacement: s.displacement };
        let of_rigid = |RigidForce { moment, motion, .. }: &RigidForce| RigidRow {
            moment: *moment,
            rotation: motion.rotation,
            displacement: motion.displacement,
        };
        let mut volumes = step.region_volumes.clone();
        let constrained = step.constraints.iter().zip(&step.state.volumes);
        let others = constrained.filter(|(constraint, _)| step.mesh.region(constraint.name()).is_none());
        volumes.extend(others.map(|(_, state)| state.volume));
        self.loads.row(&LoadRow {
            step: step.step,
            t: step.t,
            surfaces: forces.surfaces.iter().map(of_surface).collect(),
            points: forces.points.iter().map(|point| point.force).collect(),
            rigid: forces.rigid.iter().map(of_rigid).collect(),
            volumes,
            pressures: step.state.volumes.iter().map(|state| state.pressure).collect(),
        })
    }

    /// Writes the fields and the networks of a state. In a divided body, the ranks have written the pieces, and `index`
    /// names them.
    pub fn write_fields<M: TissueMaterial>(
        &mut self,
        of: &FieldState<'_, M>,
        index: Option<&PieceIndex>,
    ) -> Result<(), ResultsError> {
        let FieldNames { fields, points } = match index {
            None => self.files.write(of)?,
            Some(index) => self.files.write_index(of, index)?,
        };
        let t = of.state.t;
        if let (Some(collection), Some(points)) = (&mut self.points, &points) {
            collection.add(t, points)?;
        }
        self.fields.add(t, &fields)?;
        self.written.push(FieldFile::new(&self.dir, t, &fields)?);
        self.networks.write(of.step, t, of.field)
    }

    /// Writes the times of all ranks, one entry per trial state, and the migrations of RVEs.
    fn write_times(&mut self, step: usize, field: &impl TissueMaterial) -> Result<(), ResultsError> {
        let (sweeps, balance) = (field.take_times(), field.take_balance());
        for &report in &balance.migrations {
            self.log.write(&Event::Migration(Migration { step, report }))?;
        }
        for (iteration, ranks) in (1..).zip(&sweeps) {
            self.log.write(&Event::Ranks(Ranks { step, iteration, ranks: ranks.clone() }))?;
        }
        self.shares.add(field.ranks()[0], sweeps, &balance);
        self.write_costs(step, field)
    }

    fn write_costs(&mut self, step: usize, field: &impl TissueMaterial) -> Result<(), ResultsError> {
        let Some(costs) = &mut self.costs else { return Ok(()) };
        let network = |model: Option<u32>| {
            let model = model.and_then(|model| field.library().models().get(model as usize));
            model.map(|model| model.network().name().to_owned()).unwrap_or_default()
        };
        for sweep in field.take_costs() {
            let iteration = costs.next_iteration(step);
            costs.write(sweep.into_iter().map(|RveCost { point, model, iterations, seconds }| CostRow {
                step,
                iteration,
                rve: point,
                network: network(model),
                iterations,
                seconds,
            }))?;
        }
        Ok(())
    }

    /// Writes the dump of a failed RVE; returns the file, relative to the directory.
    fn write_failed_rve(&self, step: usize, halvings: u32, mut failed: FailedRve) -> Result<PathBuf, ResultsError> {
        let file = failed_rve_file(step, halvings, failed.point.element as usize);
        failed.dump.origin = format!("{} in load step {step}", failed.point);
        let path = self.dir.join(&file);
        failed.dump.write(&path).map_err(ResultsError::write(&path))?;
        Ok(file)
    }

    /// Reports that a checkpoint has been written.
    pub fn saved(&mut self, step: usize) {
        self.progress.saved(step);
    }

    /// Returns true if the run is to end before its next load step.
    pub fn is_interrupted(&self) -> bool {
        self.progress.is_interrupted()
    }

    /// Returns how the ranks shared the work of all steps; `None` for a run in one process.
    pub fn scales(&self) -> Option<ScalesLog> {
        (!self.scales.is_empty()).then(|| ScalesLog::total(&self.scales))
    }

    /// Returns the dump of the RVE that made the last attempt fail, if one did.
    pub fn failed_rve(&self) -> Option<&Path> {
        self.failed_rve.as_deref()
    }

    /// Returns true if the fields of the last converged state, at pseudo-time `t`, are to be written when a run fails between
    /// two outputs or within a step that was halved: if no fields of this state are written yet.
    pub fn lacks_fields(&self, t: f64) -> bool {
        let written = self.fields.entries().last().map_or(0.0, |entry| entry.time);
        self.files.are_written() && t > written
    }
}

/// The callbacks of [`StepObserver`](crate::fem::stepping::StepObserver).
impl Recorder<'_> {
    /// Records a step; in a divided body, `index` names the pieces of its fields if they are written.
    pub fn converged<M: TissueMaterial>(
        &mut self,
        step: &ConvergedStep<'_, M>,
        index: Option<&PieceIndex>,
    ) -> Result<(), ResultsError> {
        self.write_loads(step)?;
        if self.files.is_due(step.step, step.count) {
            self.write_fields(&FieldState::of(step), index)?;
        }
        self.write_times(step.step, step.field)?;
        let stats = step.field.take_stats();
        let total = std::mem::replace(&mut self.started, std::time::Instant::now()).elapsed().as_secs_f64();
        let mut newton = newton_log(&step.report.solves, step.report.seconds(), total);
        newton.linear_starts = step.report.linearized_solves.iter().map(linear_log).collect();
        newton.linear_iterations += newton.linear_starts.iter().map(|solve| solve.iterations).sum::<usize>();
        newton.fallbacks = step.report.fallbacks();
        let line = Step {
            step: step.step,
            t: step.t,
            increments: step.report.increments,
            cuts: step.report.cuts as u32,
            rounds: step.report.evolutions,
            augmentations: step.report.augmentations,
            newton,
            rve: Some(step.field.rve_counts()).filter(|counts| counts.rves > 0).map(|counts| rve_log(&stats, &counts)),
            balance: balance(&step.forces),
            scales: self.shares.take().map(Box::new),
        };
        self.scales.extend(line.scales.as_deref().cloned());
        self.failed_rve = None;
        self.progress.converged(&line);
        self.log.write(&Event::Step(line))
    }

    pub fn iterating(&mut self, iteration: &Iterating<'_>) {
        self.progress.iterating(iteration);
    }

    pub fn failed<M: TissueMaterial, F: std::error::Error>(
        &mut self,
        attempt: &FailedAttempt<'_, M, F>,
    ) -> Result<(), ResultsError> {
        self.write_times(attempt.step, attempt.field)?;
        let failed = attempt.field.take_failed_rve();
        let lost_rve = failed.map(|rve| self.write_failed_rve(attempt.step, attempt.halvings, rve)).transpose()?;
        self.failed_rve = lost_rve.as_ref().map(|file| self.dir.join(file));
        let seconds = attempt.newton.seconds;
        let total = seconds.residual + seconds.jacobian + seconds.factor + seconds.solve;
        let cut = Cut {
            step: attempt.step,
            t: attempt.t,
            reason: attempt.reason.to_string(),
            lost_rve,
            newton: newton_log(std::slice::from_ref(attempt.newton), seconds, total),
        };
        self.progress.failed(&cut);
        self.log.write(&Event::Cut(cut))
    }
}

/// The sum of all surface and point forces, and its norm divided by the largest of their norms.
fn balance(forces: &BoundaryForces) -> Balance {
    let norm = |force: &[f64; 3]| force.iter().map(|f| f * f).sum::<f64>().sqrt();
    let all = forces.surfaces.iter().map(|s| &s.force).chain(forces.points.iter().map(|p| &p.force));
    let largest = all.map(norm).fold(0.0, f64::max);
    let force = forces.sum();
    Balance { force, relative: if largest > 0.0 { norm(&force) / largest } else { 0.0 } }
}

/// Sums the counts of the solves of a step and concatenates their residual histories; `total` is the wall time, s.
fn newton_log(reports: &[NewtonReport], seconds: las::NewtonSeconds, total: f64) -> NewtonLog {
    let sum = |count: fn(&NewtonReport) -> usize| reports.iter().map(count).sum();
    NewtonLog {
        iterations: sum(|report| report.iterations),
        residual: reports.last().map_or(0.0, |last| last.residuals.last().copied().unwrap_or(f64::NAN)),
        residuals: reports.iter().flat_map(|report| &report.residuals).copied().collect(),
        relative: reports.iter().flat_map(|report| &report.relative).copied().collect(),
        line_search_cuts: sum(|report| report.backtracks),
        factorizations: Factorizations {
            cholesky: sum(|report| report.cholesky),
            ldlt: sum(|report| report.ldlt),
            lu: sum(|report| report.lu),
            approximate: sum(|report| report.approximate),
            kept: sum(|report| report.kept),
        },
        linear_iterations: sum(|report| report.linear_iterations),
        linear: reports.iter().flat_map(|report| &report.linear_solves).map(linear_log).collect(),
        linear_starts: Vec::new(),
        fallbacks: sum(|report| report.fallbacks),
        seconds: NewtonSeconds {
            point_field: seconds.residual,
            assembly: seconds.jacobian,
            factor: seconds.factor,
            solve: seconds.solve,
            total,
        },
    }
}

fn linear_log(solve: &SolveReport) -> LinearLog {
    LinearLog { iterations: solve.iterations, residual: solve.residual }
}

/// Returns what the columns of the table of loads describe.
fn load_names(case: &Case, mesh: &Mesh) -> LoadNames {
    let rigid = case.boundaries.iter().filter(|boundary| matches!(boundary.load, SurfaceLoad::Rigid(_)));
    let constraints: Vec<String> = case.constraints.iter().map(|each| each.constraint.name.clone()).collect();
    let others = constraints.iter().filter(|name| mesh.region(name).is_none());
    LoadNames {
        surfaces: mesh.surface_names().map(str::to_owned).collect(),
        points: (0..case.points.len()).map(|k| format!("point{k}")).collect(),
        rigid: rigid.map(|boundary| boundary.surface.clone()).collect(),
        regions: mesh.regions().iter().chain(others).cloned().collect(),
        constraints,
    }
}

fn rve_log(stats: &RveStats, counts: &RveCounts) -> RveLog {
    let quantile =
        |share| stats.by_iterations.quantile(share, stats.most_iterations).map(|iterations| iterations as u64);
    RveLog {
        solves: stats.solves as u64,
        in_batches: stats.in_batches as u64,
        iterations_total: stats.iterations as u64,
        iterations_max: stats.most_iterations as u64,
        iterations_median: quantile(0.5),
        iterations_p95: quantile(0.95),
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
        asleep: counts.asleep as u64,
        waiting: counts.waiting as u64,
        deleted: counts.deleted as u64,
    }
}
