//! The deformed networks of the elements that a case requests: `rve/` in the result directory.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use rayon::prelude::*;

use super::case::{Case, ElementSelection};
use super::results::collection::partial;
use super::results::networks::{network_collection, network_file};
use super::results::{
    Collection, NETWORKS_FOLDER, NetworkSeries, NetworkSet, ResultsError, RunProgress, network_series, write_vtp,
};
use crate::input::{InputError, InputErrors};
use crate::tissue::micro_scale::{DeformedNetwork, TissueMaterial};

/// Returns the elements whose networks a case requests, ascending.
///
/// # Errors
/// Returns [`InputErrors`] that list all requested elements that do not exist or have no fibers.
pub(super) fn elements(case: &Case, count: usize, field: &impl TissueMaterial) -> Result<Vec<usize>, InputErrors> {
    let ids = match &case.output.rve {
        ElementSelection::None => return Ok(Vec::new()),
        ElementSelection::All => return Ok((0..count).filter(|&element| field.sites().has_fibers(element)).collect()),
        ElementSelection::Elements(ids) => ids,
    };
    let error = |&element: &usize| {
        let (what, cure) = match element {
            _ if element >= count => (
                format!("`output.rve` names element {element}; the mesh has {count} elements"),
                "name other elements, or write rve = \"all\"",
            ),
            _ if !field.sites().has_fibers(element) => (
                format!("`output.rve` names element {element}, which has no fibers"),
                "name elements of a region with the model \"fiber-rve\", or write rve = \"all\"",
            ),
            _ => return None,
        };
        let expected = format!("elements with a fiber network, between 0 and {}", count.saturating_sub(1));
        Some(InputError::in_file(&case.file, what, expected, cure))
    };
    let errors: Vec<InputError> = ids.iter().filter_map(error).collect();
    if errors.is_empty() { Ok(ids.clone()) } else { Err(InputErrors(errors)) }
}

/// The network files of a run in progress.
pub(super) struct NetworkFiles {
    folder: PathBuf,
    series: Vec<(usize, Collection)>,
}

impl NetworkFiles {
    /// Opens the files of a run. For a resumed run, the collections of all elements in the folder, also those that are
    /// not requested, are restored to the completed steps.
    pub fn open(dir: &Path, elements: &[usize], resumed: Option<RunProgress>) -> Result<Self, ResultsError> {
        let folder = dir.join(NETWORKS_FOLDER);
        if !elements.is_empty() {
            std::fs::create_dir_all(&folder).map_err(ResultsError::write(&folder))?;
        }
        let collection = |element: usize| Collection::new(folder.join(network_collection(element)));
        let mut series: BTreeMap<usize, Collection> =
            elements.iter().map(|&element| (element, collection(element))).collect();
        if let Some(progress) = resumed {
            for NetworkSeries { element, files } in network_series(&folder, progress)? {
                let resumed = Collection::resume(folder.join(network_collection(element)), progress.t(), &files)?;
                series.entry(element).and_modify(|collection| *collection = resumed);
            }
        }
        Ok(Self { series: series.into_iter().collect(), folder })
    }

    /// Returns the folder of the files; `None` if no networks are written.
    pub fn folder(&self) -> Option<&Path> {
        (!self.series.is_empty()).then_some(self.folder.as_path())
    }

    /// Writes all networks after a converged step or substep.
    pub fn write<M: TissueMaterial>(
        &mut self,
        (step, whole): (usize, bool),
        t: f64,
        field: &M,
    ) -> Result<(), ResultsError> {
        let Self { folder, series } = self;
        let networks: Vec<_> = field.library().models().iter().map(|model| model.network()).collect();
        let deformed: Vec<_> = series.iter().map(|(element, _)| field.deformed_network(*element)).collect();
        series.par_iter_mut().zip(deformed).try_for_each(|((element, collection), deformed)| {
            let Some(deformed) = deformed else { return Ok(()) };
            let DeformedNetwork { model, positions, stretches, forces } = &deformed;
            let network = &networks[*model];
            let kind: Vec<i64> = network.material_of().iter().map(|&reaction| reaction.into()).collect();
            let set = NetworkSet {
                points: positions,
                fibers: network.fibers(),
                stretch: stretches,
                force: forces,
                kind: &kind,
            };
            let name = network_file(*element, step);
            let name = if whole { name } else { partial(&name) };
            write_vtp(&folder.join(&name), &set)?;
            collection.add(t, &name)
        })
    }
}
