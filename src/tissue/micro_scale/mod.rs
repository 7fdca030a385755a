//! The micro scale of a tissue: a formula or a fiber network at every integration point; all threads solve the
//! networks.
//!
//! | module | holds |
//! |---|---|
//! | `library` | the data that all RVEs share: the materials and their networks, each read once |
//! | `unit`, `worker` | one RVE; the scratch memory of one thread |
//! | `units`, `sweep`, `order` | the RVEs of one rank; their solution on its threads, and in which order |
//! | `batches` | the RVEs that another processor solves, all of one model at once |
//! | `sites` | the material of each point: a formula, an RVE, or the substitute of an RVE that is not awake |
//! | `activity` | what the threads are doing, for a report of progress |
//! | `iterations` | numbers of solves by their iterations |
//! | `costs` | what each RVE cost in each sweep |
//! | `lifecycle` | when an RVE is created, sleeps, wakes and is deleted |
//! | `moving`, `rve_material` | an RVE on the way to another rank; its material |
//! | `sampled` | a body in which only a few RVEs are solved, to measure what they cost |
//! | `saved`, `raw`, `summary` | the saved state of an RVE in memory and in files, and its values for the result files |
//! | `pieces` | the files of a checkpoint with the states of the RVEs of one rank |
//! | this one | the body in one process ([`TissueField`]), and the interface to a run ([`TissueMaterial`]) |

mod activity;
mod batches;
mod costs;
mod error;
mod iterations;
mod library;
mod lifecycle;
mod moving;
mod order;
pub(super) mod pieces;
mod raw;
mod rve_material;
mod sampled;
mod saved;
mod sites;
mod summary;
mod sweep;
mod unit;
mod units;
mod worker;

use std::collections::{HashMap, HashSet};
use std::path::Path;
use std::sync::Arc;

use nalgebra::Matrix3;

use crate::fem::mesh::Mesh;
use crate::fem::point_field::{PointField, PointResponses};
use crate::fiber::batch::BatchSolver;
use crate::fiber::rve::RveModel;
use crate::las::{Backend, RealBackend};
use crate::tissue::materials::Materials;
use crate::tissue::two_scale::{BalanceReport, RankTimes};

pub(super) use activity::Activity;
pub use activity::{ProgressSource, RveProgress, SlowestRve};
pub use costs::RveCost;
pub use error::{PointFailure, PointFailureKind, TissueFieldError};
pub use iterations::IterationCounts;
pub use library::{Library, LibraryError, PointMaterial, PointNetwork};
pub use lifecycle::RveStatus;
pub(super) use moving::MovingError;
pub use pieces::{Piece, PieceError, piece_file, piece_stem};
pub(crate) use pieces::{verify_sealed, write_sealed};
pub(super) use rve_material::{RveMaterial, SentMatrix};
pub use sampled::SampledField;
pub(super) use saved::SerializeIter;
pub use saved::{FieldRestoreError, SavedSites, SleepingRve, UnitState};
pub use sites::{RveCounts, Sites};
pub use summary::{DeformedNetwork, PointSummary};
pub use unit::RveStats;
pub use units::FailedRve;
pub(super) use units::Units;

/// The material of a body, on whichever ranks its RVEs are solved: what a run needs beyond stresses and tangents.
/// States are those of the last commit.
pub trait TissueMaterial: PointField<Error = TissueFieldError> {
    /// The backend of the RVEs.
    type Micro: RealBackend;

    /// Returns the data that all RVEs share.
    fn library(&self) -> &Library<Self::Micro>;

    /// Returns the material of each point and the statuses of the RVEs; in a divided body, of the points of this rank.
    fn sites(&self) -> &Sites;

    /// Releases what the library has of points of other ranks, in a divided body.
    fn forget_other_points(&mut self) {}

    /// Counts the RVEs of the whole body.
    fn rve_counts(&self) -> RveCounts {
        self.sites().counts(self.library().models().len(), |_| true)
    }

    /// Bytes that all RVEs own in a run: states, last responses, and the start values of the next solves.
    fn rve_bytes(&self) -> usize;

    /// Returns the counters of the RVEs since the last call.
    fn take_stats(&self) -> RveStats;

    /// Returns the times of every rank since the last call, per trial state; empty in one process.
    fn take_times(&self) -> Vec<Vec<RankTimes>> {
        Vec::new()
    }

    /// Returns the load balancing since the last call; empty in one process.
    fn take_balance(&self) -> BalanceReport {
        BalanceReport::default()
    }

    /// Returns what each RVE cost since the last call, per trial state; empty unless it is kept.
    fn take_costs(&self) -> Vec<Vec<RveCost>>;

    /// Returns a function that returns what the RVEs of all ranks do, for another thread; `None` if this rank does not get
    /// to know it.
    fn progress_source(&self) -> Option<ProgressSource>;

    /// In a divided body, replaces the values at the nodes that belong to other ranks by theirs: `width` numbers for each
    /// node of the part. Collective over the ranks of the body.
    ///
    /// # Errors
    /// Returns [`TissueFieldError`] if communication fails.
    fn share_at_nodes(&self, mesh: &Mesh, width: usize, values: &mut [f64]) -> Result<(), TissueFieldError> {
        let _ = (mesh, width, values);
        Ok(())
    }

    /// Returns the RVE that made the last update fail; a second call returns `None`.
    fn take_failed_rve(&self) -> Option<FailedRve>;

    /// Returns the summary of the fibers of every point, `None` for one without fibers.
    fn summaries(&self) -> Vec<Option<PointSummary>>;

    /// Returns the deformed network of a point, by its number in the whole mesh; `None` for one without.
    fn deformed_network(&self, point: usize) -> Option<DeformedNetwork>;

    /// Numbers of ranks of the macro scale and of the micro scale; 1 and 0 in one process.
    fn ranks(&self) -> [usize; 2] {
        [1, 0]
    }

    /// Returns the shard of the body that each element belongs to, and the number of shards; `None` if the body is
    /// not divided among ranks.
    fn shards(&self) -> Option<(&[u32], usize)> {
        None
    }

    /// Returns the order in which the nodes of the body are numbered in its linear system.
    fn node_order(&self, mesh: &Mesh) -> Vec<u32> {
        (0..mesh.nodes().len() as u32).collect()
    }

    /// Returns the rank that solves the RVE of a point, or evaluates its formula; 0 in one process.
    fn rank_of(&self, _element: usize) -> usize {
        0
    }

    /// Writes the states of all RVEs that exist to `folder`, each rank those that it solves to a file of its own, whose
    /// name begins with `stem` ([`piece_file`]). Right after a commit, these states and [`Sites::saved`] are all that
    /// the next load step depends on. Returns the pieces, which are complete and on the disk.
    ///
    /// # Errors
    /// Returns [`PieceError`], the same on all ranks of the body, if a piece cannot be written or communication failed.
    fn save_units(&self, folder: &Path, stem: &str) -> Result<Vec<Piece>, PieceError>;

    /// Verifies that the pieces are as [`TissueMaterial::save_units`] wrote them; the ranks share the work.
    ///
    /// # Errors
    /// Returns the [`PieceError`] of one that is not, the same on all ranks of the body.
    fn verify_pieces(&self, folder: &Path, pieces: &[Piece]) -> Result<(), PieceError>;

    /// Restores all RVEs from [`Sites::saved`] and pieces that were verified. Each rank keeps the states of the RVEs
    /// that it solves, whichever rank wrote them.
    ///
    /// # Errors
    /// Returns [`FieldRestoreError`] if the states do not match the body, which must then be set up anew.
    fn restore_units(&mut self, sites: &SavedSites, folder: &Path, pieces: &[Piece]) -> Result<(), FieldRestoreError>;
}

/// The material of the whole body in one process. The first evaluation creates the RVEs, so that a body whose RVEs are
/// not solved, or only a few of them ([`TissueField::sampled`]), does not need their memory.
pub struct TissueField<B: Backend> {
    sites: Sites,
    units: Units<B>,
    /// Whether the RVEs that exist have units.
    is_created: bool,
    /// The index of the unit of each point with an RVE.
    unit_of: HashMap<usize, usize>,
}

impl<B: RealBackend> TissueField<B> {
    /// Reads the networks of the materials and gives every point of the mesh its material; also returns the warnings
    /// of the network reader.
    ///
    /// # Errors
    /// Returns [`LibraryError`] if a network cannot be read or used, or a region of the mesh has no material.
    pub fn new(context: B::Context, materials: Materials, mesh: &Mesh) -> Result<(Self, Vec<String>), LibraryError> {
        let (mut library, warnings) = Library::read(context, materials)?;
        let sites = Sites::new(&library, mesh)?;
        library.use_lanes(&sites.counts(library.models().len(), |_| true).per_model);
        Ok((Self { sites, units: Units::new(library), is_created: false, unit_of: HashMap::new() }, warnings))
    }

    /// Solves the RVEs of models for which `make` returns a solver in batches; see [`Library::solve_in_batches`].
    ///
    /// # Errors
    /// Returns the error of `make`.
    pub fn solve_in_batches<E>(
        &mut self,
        make: impl FnMut(&RveModel<B>) -> Result<Option<Box<dyn BatchSolver>>, E>,
    ) -> Result<(), E> {
        self.units.library.solve_in_batches(make)
    }

    /// Keeps what each RVE costs, for [`TissueMaterial::take_costs`].
    pub fn keep_costs(&mut self) {
        self.units.keep_costs();
    }

    /// Replaces all RVEs by new ones at rest, for the points whose RVE exists.
    fn create_existing(&mut self) {
        let existing: Vec<usize> = self.sites.existing().map(|(point, _)| point).collect();
        self.units.clear();
        self.unit_of.clear();
        self.is_created = true;
        self.update_rves(&[], &existing);
    }

    /// Deletes and creates the RVEs of these points.
    fn update_rves(&mut self, deleted: &[usize], created: &[usize]) {
        if deleted.is_empty() && created.is_empty() {
            return;
        }
        let deleted: HashSet<usize> = deleted.iter().copied().collect();
        self.units.remove(&deleted);
        created.iter().for_each(|&point| self.create(point));
        self.unit_of = self.units.by_point();
    }

    /// Creates the RVE of a point, at rest.
    fn create(&mut self, point: usize) {
        if let Some((model, matrix)) = self.sites.material(point) {
            self.units.add((point, self.sites.locate(point), self.sites.region(point)), model, matrix);
        }
    }
}

impl<B: RealBackend> PointField for TissueField<B> {
    type Error = TissueFieldError;

    fn update(&mut self, gradients: &[Matrix3<f64>], out: &mut PointResponses) -> Result<(), Self::Error> {
        if !self.is_created {
            self.create_existing();
        }
        let Self { sites, units, .. } = self;
        units.forget_failed_rve();
        // Points that need no RVE come first: an inverted point there fails before any RVE is solved.
        sites.evaluate(gradients, out)?;
        units.solve(&|_, point| sites.is_awake(point).then(|| gradients[point]))?;
        units.record_costs();
        for (point, response) in units.responses() {
            if let Some(response) = response.filter(|_| sites.is_awake(point)) {
                sites.set_response(point, response, out);
            }
        }
        Ok(())
    }

    fn verify(&mut self, gradients: &[Matrix3<f64>], out: &mut PointResponses) -> Result<bool, Self::Error> {
        let Self { sites, units, .. } = self;
        units.forget_failed_rve();
        let replaced = units.verify(&|_, point| sites.is_awake(point).then(|| gradients[point]))?;
        for &number in &replaced {
            let point = units.points()[number];
            if let Some((_, response)) = units.response(number) {
                sites.set_response(point, &response, out);
            }
        }
        Ok(!replaced.is_empty())
    }

    fn evolve(&mut self) -> Result<bool, Self::Error> {
        let changes = self.sites.evolve();
        // Deleted RVEs are kept until the commit, because the step may still fail.
        self.update_rves(&[], &changes.created);
        Ok(!changes.is_empty())
    }

    fn is_cheap(&self) -> bool {
        self.sites.rves() == 0
    }

    fn is_final(error: &Self::Error) -> bool {
        error.is_final()
    }

    fn commit(&mut self, ends_step: bool) -> Result<(), Self::Error> {
        self.units.commit(ends_step);
        let deleted = self.sites.commit(ends_step);
        self.update_rves(&deleted, &[]);
        Ok(())
    }

    fn revert(&mut self) -> Result<(), Self::Error> {
        self.units.revert();
        let created = self.sites.revert();
        self.update_rves(&created, &[]);
        Ok(())
    }
}

impl<B: RealBackend> TissueMaterial for TissueField<B> {
    type Micro = B;

    fn library(&self) -> &Library<B> {
        self.units.library()
    }

    fn sites(&self) -> &Sites {
        &self.sites
    }

    fn rve_bytes(&self) -> usize {
        if self.is_created { self.units.bytes() } else { self.units.bytes_of_new(self.sites.by_model()) }
    }

    fn take_stats(&self) -> RveStats {
        self.units.take_stats()
    }

    fn take_costs(&self) -> Vec<Vec<RveCost>> {
        self.units.take_costs()
    }

    fn progress_source(&self) -> Option<ProgressSource> {
        let activity = Arc::clone(self.units.activity());
        Some(Box::new(move || activity.progress()))
    }

    fn take_failed_rve(&self) -> Option<FailedRve> {
        self.units.take_failed_rve()
    }

    fn summaries(&self) -> Vec<Option<PointSummary>> {
        let mut summaries: Vec<Option<PointSummary>> = (0..self.sites.len()).map(|_| None).collect();
        for (&point, summary) in self.units.points().iter().zip(self.units.summaries()) {
            summaries[point] = summary;
        }
        summaries
    }

    fn deformed_network(&self, point: usize) -> Option<DeformedNetwork> {
        self.units.deformed_network(*self.unit_of.get(&point)?)
    }

    fn save_units(&self, folder: &Path, stem: &str) -> Result<Vec<Piece>, PieceError> {
        Ok(self.units.write_piece(folder, stem, 0)?.into_iter().collect())
    }

    fn verify_pieces(&self, folder: &Path, pieces: &[Piece]) -> Result<(), PieceError> {
        pieces::verify_all(folder, pieces)
    }

    fn restore_units(&mut self, sites: &SavedSites, folder: &Path, pieces: &[Piece]) -> Result<(), FieldRestoreError> {
        self.sites.restore(sites)?;
        check_count(self.sites.existing().count(), pieces)?;
        self.create_existing();
        self.units.restore(folder, pieces)
    }
}

/// Checks that pieces hold as many RVEs as exist.
pub(super) fn check_count(expected: usize, pieces: &[Piece]) -> Result<(), FieldRestoreError> {
    let found = pieces.iter().map(|piece| piece.rves).fold(0, usize::saturating_add);
    if found == expected { Ok(()) } else { Err(FieldRestoreError::Units { found, expected }) }
}
