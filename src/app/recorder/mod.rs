//! Writes the result directory during a run.

mod log_entries;
mod open;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use log_entries::{balance, linear_log, newton_log, rve_log};
pub(super) use open::ResumePoint;

use super::field_files::{FieldFiles, FieldNames, FieldState, PieceIndex};
use super::progress::Progress;
use super::rank_shares::RankShares;
use super::results::log::{Cut, Event, LogWriter, Migration, Ranks, ScalesLog, Step};
use super::results::{
    Collection, CostRow, CostsWriter, FieldFile, LoadRow, LoadsWriter, ResultsError, ResultsRecord, RigidRow,
    SurfaceRow, failed_rve_file,
};
use super::rve_files::NetworkFiles;
use crate::fem::reactions::{RigidForce, SurfaceForce};
use crate::fem::stepping::{ConvergedStep, FailedAttempt, Iterating};
use crate::output;
use crate::tissue::micro_scale::{FailedRve, RveCost, TissueMaterial};

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
            largest_residual: attempt.largest_residual.cloned(),
        };
        self.progress.failed(&cut);
        self.log.write(&Event::Cut(cut))
    }
}
