//! Opens the result directory of a run.

use std::sync::Arc;

use super::Recorder;
use crate::app::case::{Case, SurfaceLoad};
use crate::app::checkpoint;
use crate::app::field_files::FieldFiles;
use crate::app::progress::Progress;
use crate::app::rank_shares::RankShares;
use crate::app::results::collection::Entry;
use crate::app::results::log::LogWriter;
use crate::app::results::{
    self, CASE_FILE, COSTS_FILE, Collection, CostsWriter, FIELDS_FILE, FieldFile, LOADS_FILE, LOG_FILE, LoadNames,
    LoadsWriter, POINTS_FILE, ResultsError, ResultsRecord, RunProgress,
};
use crate::app::rve_files::NetworkFiles;
use crate::fem::mesh::Mesh;

/// The state from which a resumed run continues.
pub(in crate::app) struct ResumePoint {
    /// The completed steps.
    pub progress: RunProgress,
    /// The results that the run had written until then.
    pub written: ResultsRecord,
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
