//! The micro scale of a tissue: a formula or a fiber network at every integration point; all threads solve the
//! networks.
//!
//! | module | holds |
//! |---|---|
//! | `library` | the data that all RVEs share: the materials and their networks, each read once |
//! | `unit`, `worker` | one RVE; the scratch memory of one thread |
//! | `units` | the RVEs of one rank, solved on its threads |
//! | `sites` | the material of each point: a formula, an RVE, or the substitute of an RVE that is not awake |
//! | `lifecycle` | when an RVE is created, sleeps, wakes and is deleted |
//! | `saved`, `raw`, `summary` | the saved state of an RVE in memory and in files, and its values for the result files |
//! | this one | the body in one process ([`TissueField`]), and the interface to a run ([`TissueMaterial`]) |

mod error;
mod library;
mod lifecycle;
mod raw;
mod saved;
mod sites;
mod summary;
mod unit;
mod units;
mod worker;

use std::collections::{HashMap, HashSet};

use nalgebra::Matrix3;

use crate::fem::mesh::Mesh;
use crate::fem::point_field::{PointField, PointResponses};
use crate::las::{Backend, RealBackend};
use crate::tissue::materials::Materials;
use crate::tissue::two_scale::RankTimes;

pub use error::{PointFailure, PointFailureKind, TissueFieldError};
pub use library::{Library, LibraryError, PointMaterial};
pub use lifecycle::RveStatus;
pub use saved::{FieldRestoreError, SerializeIter, UnitState};
pub use sites::Sites;
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

    /// Returns the material of each point and the statuses of the RVEs.
    fn sites(&self) -> &Sites;

    /// Bytes that all RVEs own in a run: states, last responses, and the start values of the next solves.
    fn rve_bytes(&self) -> usize;

    /// Returns the counters of the RVEs since the last call.
    fn take_stats(&self) -> RveStats;

    /// Returns the times of every rank since the last call, per trial state; empty in one process.
    fn take_times(&self) -> Vec<Vec<RankTimes>> {
        Vec::new()
    }

    /// Returns the RVE that made the last update fail; a second call returns `None`.
    fn take_failed_rve(&self) -> Option<FailedRve>;

    /// Returns the summary of the fibers of every point, `None` for one without fibers.
    fn summaries(&self) -> Vec<Option<PointSummary>>;

    /// Returns the deformed network of a point, `None` for one without.
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

    /// Returns the states of all RVEs that exist, in the order of their points. Right after a commit, these and
    /// [`Sites::statuses`] are all that the next load step depends on.
    fn unit_states(&self) -> impl ExactSizeIterator<Item = UnitState> + '_;

    /// Restores all RVEs from [`Sites::statuses`] and [`TissueMaterial::unit_states`].
    ///
    /// # Errors
    /// Returns [`FieldRestoreError`] if the states do not match the body. RVEs are unchanged then, except if
    /// communication failed.
    fn restore_units(&mut self, statuses: &[RveStatus], states: Vec<UnitState>) -> Result<(), FieldRestoreError>;
}

/// The material of the whole body in one process.
pub struct TissueField<B: Backend> {
    sites: Sites,
    units: Units<B>,
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
        let (library, warnings) = Library::read(context, materials)?;
        let sites = Sites::new(&library, mesh)?;
        let mut field = Self { sites, units: Units::new(library), unit_of: HashMap::new() };
        field.create_existing();
        Ok((field, warnings))
    }

    /// Replaces all RVEs by new ones at rest, for the points whose RVE exists.
    fn create_existing(&mut self) {
        let existing: Vec<usize> = self.sites.existing().map(|(point, _)| point).collect();
        self.units.clear();
        self.unit_of.clear();
        self.update_rves(&[], &existing);
    }

    /// Deletes and creates the RVEs of these points.
    fn update_rves(&mut self, deleted: &[usize], created: &[usize]) {
        if deleted.is_empty() && created.is_empty() {
            return;
        }
        let deleted: HashSet<usize> = deleted.iter().copied().collect();
        self.units.remove(&deleted);
        for &point in created {
            if let Some((model, matrix)) = self.sites.material(point) {
                self.units.add((point, self.sites.locate(point)), model, matrix);
            }
        }
        self.unit_of = self.units.by_point();
    }
}

impl<B: RealBackend> PointField for TissueField<B> {
    type Error = TissueFieldError;

    fn update(&mut self, gradients: &[Matrix3<f64>], out: &mut PointResponses) -> Result<(), Self::Error> {
        let Self { sites, units, .. } = self;
        // Points that need no RVE come first: an inverted point there fails before any RVE is solved.
        sites.evaluate(gradients, out)?;
        units.solve(|_, point| sites.is_awake(point).then(|| gradients[point]))?;
        for (point, response) in units.responses() {
            if let Some(response) = response.filter(|_| sites.is_awake(point)) {
                sites.set_response(point, response, out);
            }
        }
        Ok(())
    }

    fn verify(&mut self, gradients: &[Matrix3<f64>], out: &mut PointResponses) -> Result<bool, Self::Error> {
        let Self { sites, units, .. } = self;
        let replaced = units.verify(|_, point| sites.is_awake(point).then(|| gradients[point]))?;
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

    fn commit(&mut self) -> Result<(), Self::Error> {
        self.units.commit();
        let deleted = self.sites.commit();
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
        self.units.bytes()
    }

    fn take_stats(&self) -> RveStats {
        self.units.take_stats()
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

    fn unit_states(&self) -> impl ExactSizeIterator<Item = UnitState> + '_ {
        let existing = self.sites.existing();
        let all: Vec<_> = existing
            .filter_map(|(point, _)| Some((*self.unit_of.get(&point)?, self.sites.extrapolation_point(point))))
            .collect();
        all.into_iter().map(|(number, extrapolation_point)| {
            let state = self.units.state(number);
            UnitState { response: extrapolation_point.or(state.response), ..state }
        })
    }

    fn restore_units(&mut self, statuses: &[RveStatus], states: Vec<UnitState>) -> Result<(), FieldRestoreError> {
        check_states(&self.sites, self.library(), statuses, &states)?;
        self.sites.restore(statuses, |_| None);
        self.create_existing();
        self.units.restore(states)?;
        let Self { sites, units, unit_of } = self;
        sites.restore(statuses, |point| units.response(*unit_of.get(&point)?));
        Ok(())
    }
}

/// Checks that saved RVEs match those of a body.
pub(super) fn check_states<B: RealBackend>(
    sites: &Sites,
    library: &Library<B>,
    statuses: &[RveStatus],
    states: &[UnitState],
) -> Result<(), FieldRestoreError> {
    let exists = |point: usize| statuses.get(point).is_some_and(|status| status.exists());
    let points: Vec<usize> = (0..sites.len()).filter(|&point| sites.status(point).is_some() && exists(point)).collect();
    let (found, expected) = (states.len(), points.len());
    if found != expected || statuses.len() != sites.len() {
        return Err(FieldRestoreError::Units { found, expected });
    }
    for (&point, state) in points.iter().zip(states) {
        let model = sites.material(point).and_then(|(model, _)| model);
        state.check(sites.locate(point), model.map(|model| &**library.models()[model].network()))?;
    }
    Ok(())
}
