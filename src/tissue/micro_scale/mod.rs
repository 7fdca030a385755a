//! The micro scale of a tissue: a formula or a fiber network at every integration point, networks on all cores.
//!
//! | module | holds |
//! |---|---|
//! | `library` | what all RVEs of a case share: its networks, read once |
//! | `unit`, `worker` | one RVE; the scratch of one thread |
//! | `units` | the RVEs of one rank, solved on its threads |
//! | `sites` | what answers at each point: a formula, an RVE, or what stands in for one |
//! | `saved`, `summary` | what RVEs remember, and what pictures show of them |
//! | this one | the whole body in one process ([`TissueField`]), and what a run wants of it ([`TissueMaterial`]) |

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

use crate::fem::material::Response;
use crate::fem::mesh::Mesh;
use crate::fem::point_field::{PointField, PointResponses};
use crate::las::{Backend, Scalar};
use crate::tissue::case::Case;
use crate::tissue::results::log::RankSeconds;

pub use error::{PointFailure, PointFailureKind, TissueFieldError};
pub use formula::Formula;
pub use library::{ElementMaterial, Library, LibraryError, regions_of_mesh};
pub use saved::{FieldRestoreError, UnitState};
pub use sites::{Life, Sites};
pub use summary::{DeformedNetwork, PointSummary};
pub use unit::SweepStats;
pub use units::{LostRve, Units};

/// The material of a body, wherever its RVEs are solved: what a run wants of it beyond stresses and tangents. States are
/// those of the last commit.
pub trait TissueMaterial: PointField<Error = TissueFieldError> {
    /// The backend of the RVEs.
    type Micro: Backend<Scalar = f64>;

    /// What all RVEs share.
    fn library(&self) -> &Library<Self::Micro>;

    /// What answers at each point, and where the RVEs are in their lives.
    fn sites(&self) -> &Sites;

    /// Bytes that all RVEs own in a run: states, last answers, and what the next solves start from.
    fn rve_bytes(&self) -> usize;

    /// What the RVEs have taken since this was last asked.
    fn take_stats(&self) -> SweepStats;

    /// Where the time of every rank went since this was last asked, trial state by trial state; nothing in one process.
    fn take_seconds(&self) -> Vec<Vec<RankSeconds>> {
        Vec::new()
    }

    /// The RVE that made the last update fail, once.
    fn take_lost(&self) -> Option<LostRve>;

    /// The fibers of every element, `None` where there are none.
    fn summaries(&self) -> Vec<Option<PointSummary>>;

    /// The network of an element, `None` where there is none.
    fn deformed_network(&self, element: usize) -> Option<DeformedNetwork>;

    /// Ranks of the macro scale and of the RVEs; 1 and 0 in one process.
    fn ranks(&self) -> [usize; 2] {
        [1, 0]
    }

    /// The part of the body that each element lies in, and how many there are, where it is divided among ranks.
    fn parts(&self) -> Option<(&[u32], usize)> {
        None
    }

    /// The order in which the nodes of the body are numbered in its linear system.
    fn node_order(&self, mesh: &Mesh) -> Vec<u32> {
        (0..mesh.nodes().len() as u32).collect()
    }

    /// The rank that solves the RVE of an element, or answers for it.
    fn rank_of(&self, element: usize) -> usize;

    /// The memory of all RVEs that exist, in the order of their elements; right after a commit it is, with
    /// [`Sites::lives`], all that the next load step depends on.
    fn unit_states(&self) -> impl ExactSizeIterator<Item = UnitState> + '_;

    /// Takes all RVEs back to what [`Sites::lives`] and [`TissueMaterial::unit_states`] gave.
    ///
    /// # Errors
    /// [`FieldRestoreError`]; nothing has changed then.
    fn restore_units(&mut self, lives: &[Life], states: Vec<UnitState>) -> Result<(), FieldRestoreError>;
}

/// The material of the whole body in one process.
pub struct TissueField<B: Backend> {
    sites: Sites,
    units: Units<B>,
    /// The number of the unit of an element.
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
    /// [`LibraryError`].
    pub fn new(context: B::Context, case: &Case, mesh: &Mesh) -> Result<(Self, Vec<String>), LibraryError> {
        let (library, warnings) = Library::read(context, case)?;
        let sites = Sites::new(&library, case, mesh)?;
        let mut field = Self { sites, units: Units::new(library), unit_of: HashMap::new() };
        field.create_existing();
        Ok((field, warnings))
    }

    /// Gives every element whose RVE exists one at rest.
    fn create_existing(&mut self) {
        let existing: Vec<usize> = self.sites.existing().map(|(element, _)| element).collect();
        self.units.clear();
        self.unit_of.clear();
        self.turn_over(&[], &existing);
    }

    /// Deletes and creates RVEs, by element.
    fn turn_over(&mut self, gone: &[usize], new: &[usize]) {
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
        // What needs no RVE first: an element that is inside out is found before its RVE is asked.
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
        // What is deleted stays until the commit: the step may still fail.
        self.turn_over(&[], &turnover.created);
        Ok(!turnover.is_empty())
    }

    fn commit(&mut self) -> Result<(), Self::Error> {
        self.units.commit();
        let gone = self.sites.commit();
        self.turn_over(&gone, &[]);
        Ok(())
    }

    fn revert(&mut self) -> Result<(), Self::Error> {
        self.units.revert();
        let created = self.sites.revert();
        self.turn_over(&created, &[]);
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

    fn take_stats(&self) -> SweepStats {
        self.units.take_stats()
    }

    fn take_lost(&self) -> Option<LostRve> {
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

/// Whether saved RVEs are those of a body.
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
