//! The micro scale of a tissue: a formula or a fiber network at every integration point; all threads solve the
//! networks.
//!
//! | module | holds |
//! |---|---|
//! | `library` | the data that all RVEs of a case share: its networks, each read once |
//! | `unit`, `worker` | one RVE; the scratch of one thread |
//! | `units` | the RVEs of one rank, solved on its threads |
//! | `sites` | the material of each point: a formula, an RVE, or the substitute of an RVE that is not awake |
//! | `saved`, `summary` | the saved state of an RVE, and its values for the result files |
//! | this one | the body in one process ([`TissueField`]), and the interface to a run ([`TissueMaterial`]) |

mod error;
mod formula;
mod library;
mod saved;
mod sites;
mod summary;
mod unit;
mod units;
mod worker;

use std::collections::{HashMap, HashSet};

use nalgebra::Matrix3;

use crate::app::case::Case;
use crate::app::results::log::RankSeconds;
use crate::fem::material::Response;
use crate::fem::mesh::Mesh;
use crate::fem::point_field::{PointField, PointResponses};
use crate::las::{Backend, Scalar};

pub use error::{PointFailure, PointFailureKind, TissueFieldError};
pub use formula::Formula;
pub use library::{ElementMaterial, Library, LibraryError, regions_of_mesh};
pub use saved::{FieldRestoreError, UnitState};
pub use sites::{Life, Sites};
pub use summary::{DeformedNetwork, PointSummary};
pub use unit::RveStats;
pub use units::{FailedRve, Units};

/// The material of a body, on whichever ranks its RVEs are solved: what a run needs beyond stresses and tangents.
/// States are those of the last commit.
pub trait TissueMaterial: PointField<Error = TissueFieldError> {
    /// The backend of the RVEs.
    type Micro: Backend<Scalar = f64>;

    /// Returns the data that all RVEs share.
    fn library(&self) -> &Library<Self::Micro>;

    /// Returns the material of each point and the life states of the RVEs.
    fn sites(&self) -> &Sites;

    /// Bytes that all RVEs own in a run: states, last responses, and the start values of the next solves.
    fn rve_bytes(&self) -> usize;

    /// Returns the counters of the RVEs since the last call.
    fn take_stats(&self) -> RveStats;

    /// Returns the times of every rank since the last call, per trial state; empty in one process.
    fn take_seconds(&self) -> Vec<Vec<RankSeconds>> {
        Vec::new()
    }

    /// Returns the RVE that made the last update fail; a second call returns `None`.
    fn take_lost(&self) -> Option<FailedRve>;

    /// Returns the summary of the fibers of every element, `None` for one without fibers.
    fn summaries(&self) -> Vec<Option<PointSummary>>;

    /// Returns the deformed network of an element, `None` for one without.
    fn deformed_network(&self, element: usize) -> Option<DeformedNetwork>;

    /// Numbers of ranks of the macro scale and of the micro scale; 1 and 0 in one process.
    fn ranks(&self) -> [usize; 2] {
        [1, 0]
    }

    /// Returns the part of the body that each element belongs to, and the number of parts; `None` if the body is not
    /// divided among ranks.
    fn parts(&self) -> Option<(&[u32], usize)> {
        None
    }

    /// Returns the order in which the nodes of the body are numbered in its linear system.
    fn node_order(&self, mesh: &Mesh) -> Vec<u32> {
        (0..mesh.nodes().len() as u32).collect()
    }

    /// Returns the rank that solves the RVE of an element, or evaluates its formula.
    fn rank_of(&self, element: usize) -> usize;

    /// Returns the states of all RVEs that exist, in the order of their elements. Right after a commit, these and
    /// [`Sites::lives`] are all that the next load step depends on.
    fn unit_states(&self) -> impl ExactSizeIterator<Item = UnitState> + '_;

    /// Restores all RVEs from [`Sites::lives`] and [`TissueMaterial::unit_states`].
    ///
    /// # Errors
    /// Returns [`FieldRestoreError`] if the states do not match the body. RVEs are unchanged then, except if
    /// communication failed.
    fn restore_units(&mut self, lives: &[Life], states: Vec<UnitState>) -> Result<(), FieldRestoreError>;
}

/// The material of the whole body in one process.
pub struct TissueField<B: Backend> {
    sites: Sites,
    units: Units<B>,
    /// The index of the unit of each element with an RVE.
    unit_of: HashMap<usize, usize>,
}

impl<B: Backend<Scalar = f64>> TissueField<B>
where
    B::Reduced: Scalar,
{
    /// Reads the networks of a case and gives every element of the mesh its material; also returns the warnings of the
    /// network reader.
    ///
    /// # Errors
    /// Returns [`LibraryError`] if a network cannot be read or used, or a region of the mesh has no material.
    pub fn new(context: B::Context, case: &Case, mesh: &Mesh) -> Result<(Self, Vec<String>), LibraryError> {
        let (library, warnings) = Library::read(context, case)?;
        let sites = Sites::new(&library, case, mesh)?;
        let mut field = Self { sites, units: Units::new(library), unit_of: HashMap::new() };
        field.create_existing();
        Ok((field, warnings))
    }

    /// Replaces all RVEs by new ones at rest, for the elements whose RVE exists.
    fn create_existing(&mut self) {
        let existing: Vec<usize> = self.sites.existing().map(|(element, _)| element).collect();
        self.units.clear();
        self.unit_of.clear();
        self.update_rves(&[], &existing);
    }

    /// Deletes and creates the RVEs of these elements.
    fn update_rves(&mut self, gone: &[usize], new: &[usize]) {
        if gone.is_empty() && new.is_empty() {
            return;
        }
        let gone: HashSet<usize> = gone.iter().copied().collect();
        self.units.remove(&gone);
        for &element in new {
            if let Some((model, matrix)) = self.sites.material(element) {
                self.units.add(element, model, matrix);
            }
        }
        self.unit_of = self.units.by_element();
    }
}

impl<B: Backend<Scalar = f64>> PointField for TissueField<B>
where
    B::Reduced: Scalar,
{
    type Error = TissueFieldError;

    fn update(&mut self, gradients: &[Matrix3<f64>], out: &mut PointResponses) -> Result<(), Self::Error> {
        out.resize(gradients.len());
        let Self { sites, units, .. } = self;
        // Points that need no RVE come first: an inverted element there fails before any RVE is solved.
        for (element, f) in gradients.iter().enumerate() {
            if let Some(answer) = sites.respond(element, f)? {
                write(out, element, &answer);
            }
        }
        units.solve(|_, element| sites.is_awake(element).then(|| gradients[element]))?;
        for (element, answer) in units.answers() {
            if let Some(answer) = answer.filter(|_| sites.is_awake(element)) {
                write(out, element, answer);
                sites.answered(element, answer);
            }
        }
        Ok(())
    }

    fn verify(&mut self, gradients: &[Matrix3<f64>], out: &mut PointResponses) -> Result<bool, Self::Error> {
        let Self { sites, units, .. } = self;
        let replaced = units.verify(|_, element| sites.is_awake(element).then(|| gradients[element]))?;
        for &number in &replaced {
            let element = units.elements()[number];
            if let Some((_, answer)) = units.answer(number) {
                write(out, element, &answer);
                sites.answered(element, &answer);
            }
        }
        Ok(!replaced.is_empty())
    }

    fn evolve(&mut self) -> Result<bool, Self::Error> {
        let turnover = self.sites.evolve();
        // Deleted RVEs are kept until the commit, because the step may still fail.
        self.update_rves(&[], &turnover.created);
        Ok(!turnover.is_empty())
    }

    fn commit(&mut self) -> Result<(), Self::Error> {
        self.units.commit();
        let gone = self.sites.commit();
        self.update_rves(&gone, &[]);
        Ok(())
    }

    fn revert(&mut self) -> Result<(), Self::Error> {
        self.units.revert();
        let created = self.sites.revert();
        self.update_rves(&created, &[]);
        Ok(())
    }
}

impl<B: Backend<Scalar = f64>> TissueMaterial for TissueField<B>
where
    B::Reduced: Scalar,
{
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

    fn take_lost(&self) -> Option<FailedRve> {
        self.units.take_lost()
    }

    fn summaries(&self) -> Vec<Option<PointSummary>> {
        let mut summaries: Vec<Option<PointSummary>> = (0..self.sites.len()).map(|_| None).collect();
        for (&element, summary) in self.units.elements().iter().zip(self.units.summaries()) {
            summaries[element] = summary;
        }
        summaries
    }

    fn deformed_network(&self, element: usize) -> Option<DeformedNetwork> {
        self.units.deformed_network(*self.unit_of.get(&element)?)
    }

    fn rank_of(&self, _: usize) -> usize {
        0
    }

    fn unit_states(&self) -> impl ExactSizeIterator<Item = UnitState> + '_ {
        let existing = self.sites.existing();
        let all: Vec<_> = existing.filter_map(|(e, _)| Some((*self.unit_of.get(&e)?, self.sites.anchor(e)))).collect();
        all.into_iter().map(|(number, anchor)| {
            let state = self.units.state(number);
            UnitState { answer: anchor.or(state.answer), ..state }
        })
    }

    fn restore_units(&mut self, lives: &[Life], states: Vec<UnitState>) -> Result<(), FieldRestoreError> {
        check_states(&self.sites, self.library(), lives, &states)?;
        self.sites.restore(lives, |_| None);
        self.create_existing();
        self.units.restore(states)?;
        let Self { sites, units, unit_of } = self;
        sites.restore(lives, |element| units.answer(*unit_of.get(&element)?));
        Ok(())
    }
}

/// Checks that saved RVEs match those of a body.
pub(super) fn check_states<B: Backend<Scalar = f64>>(
    sites: &Sites,
    library: &Library<B>,
    lives: &[Life],
    states: &[UnitState],
) -> Result<(), FieldRestoreError> {
    let exists = |element: usize| matches!(lives.get(element), Some(Life::Awake | Life::Asleep));
    let elements: Vec<usize> =
        (0..sites.len()).filter(|&element| sites.life(element).is_some() && exists(element)).collect();
    let (found, expected) = (states.len(), elements.len());
    if found != expected || lives.len() != sites.len() {
        return Err(FieldRestoreError::Units { found, expected });
    }
    for (&element, state) in elements.iter().zip(states) {
        let model = sites.material(element).and_then(|(model, _)| model);
        match (model, &state.rve) {
            (Some(model), Some(rve)) => rve
                .check(library.models()[model].network())
                .map_err(|reason| FieldRestoreError::Rve { element, reason })?,
            (None, None) => {}
            (_, saved) => return Err(FieldRestoreError::Fibers { element, saved: saved.is_some() }),
        }
    }
    Ok(())
}

pub(super) fn write(out: &mut PointResponses, element: usize, answer: &Response) {
    out.energy[element] = answer.energy;
    out.pk1[element] = answer.pk1;
    out.tangent[element] = answer.tangent;
}
