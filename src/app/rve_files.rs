//! The deformed networks of the RVEs that a case requests: `rve/` in the result directory.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use rayon::prelude::*;

use super::case::{Case, ElementSelection};
use super::results::collection::partial;
use super::results::networks::{NetworkPoint, network_collection, network_file};
use super::results::{
    Collection, NETWORKS_FOLDER, NetworkSeries, NetworkSet, ResultsError, RunProgress, network_series, write_vtp,
};
use crate::fem::mesh::PointNumbering;
use crate::input::{InputError, InputErrors};
use crate::tissue::micro_scale::{DeformedNetwork, Sites, TissueMaterial};

/// Returns the integration points whose networks a case requests, ascending: all points of the requested elements.
///
/// # Errors
/// Returns [`InputErrors`] that list all requested elements that do not exist or have no fibers.
pub(super) fn points(case: &Case, sites: &Sites) -> Result<Vec<usize>, InputErrors> {
    let points = sites.points();
    let count = points.elements();
    let has_fibers = |element: usize| points.of_element(element).any(|point| sites.has_fibers(point));
    let ids = match &case.output.rve {
        ElementSelection::None => return Ok(Vec::new()),
        ElementSelection::All => return Ok((0..points.len()).filter(|&point| sites.has_fibers(point)).collect()),
        ElementSelection::Elements(ids) => ids,
    };
    let with_fibers = || ranges((0..count).filter(|&element| has_fibers(element)));
    let error = |&element: &usize| {
        let (what, cure) = match element {
            _ if element >= count => (
                format!("`output.rve` names element {element}; the mesh has {count} elements"),
                "name other elements, or write rve = \"all\"",
            ),
            _ if !has_fibers(element) => (
                format!("`output.rve` names element {element}, which has no fibers"),
                "name elements of a region with the model \"fiber-rve\", or write rve = \"all\"",
            ),
            _ => return None,
        };
        let expected = format!("elements with a fiber network: {}", with_fibers());
        Some(InputError::in_file(&case.file, what, expected, cure))
    };
    let errors: Vec<InputError> = ids.iter().filter_map(error).collect();
    if !errors.is_empty() {
        return Err(InputErrors(errors));
    }
    Ok(ids.iter().flat_map(|&element| points.of_element(element)).filter(|&point| sites.has_fibers(point)).collect())
}

/// Lists ascending numbers by their ranges, such as `0 to 9, 12 to 20`; at most the first few.
fn ranges(numbers: impl Iterator<Item = usize>) -> String {
    /// The number of ranges that are listed.
    const MOST: usize = 4;
    let mut ranges: Vec<[usize; 2]> = Vec::new();
    for number in numbers {
        match ranges.last_mut() {
            Some([_, last]) if *last + 1 == number => *last = number,
            _ => ranges.push([number; 2]),
        }
    }
    let text =
        |[first, last]: &[usize; 2]| if first == last { first.to_string() } else { format!("{first} to {last}") };
    let mut texts: Vec<String> = ranges.iter().take(MOST).map(text).collect();
    match ranges.len() {
        0 => "there is none".into(),
        count if count > MOST => {
            texts.push(format!("... up to {}", ranges[count - 1][1]));
            texts.join(", ")
        }
        _ => texts.join(", "),
    }
}

/// The network files of a run in progress.
pub(super) struct NetworkFiles {
    folder: PathBuf,
    /// The RVEs whose networks are written, with the numbers of their integration points.
    series: Vec<(NetworkPoint, usize, Collection)>,
}

impl NetworkFiles {
    /// Opens the files of a run, for these integration points. For a resumed run, the collections of all RVEs in the
    /// folder, also those that are not requested, are restored to the completed steps.
    pub fn open(
        dir: &Path,
        points: &[usize],
        numbering: &PointNumbering,
        resumed: Option<RunProgress>,
    ) -> Result<Self, ResultsError> {
        let folder = dir.join(NETWORKS_FOLDER);
        if !points.is_empty() {
            std::fs::create_dir_all(&folder).map_err(ResultsError::write(&folder))?;
        }
        let new = |&number: &usize| {
            let point = NetworkPoint::from(numbering.locate(number));
            (point, (number, Collection::new(folder.join(network_collection(point)))))
        };
        let mut series: BTreeMap<NetworkPoint, (usize, Collection)> = points.iter().map(new).collect();
        if let Some(progress) = resumed {
            for NetworkSeries { point, files } in network_series(&folder, progress)? {
                let resumed = Collection::resume(folder.join(network_collection(point)), progress.t(), &files)?;
                series.entry(point).and_modify(|(_, collection)| *collection = resumed);
            }
        }
        let series = series.into_iter().map(|(point, (number, collection))| (point, number, collection));
        Ok(Self { series: series.collect(), folder })
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
        let deformed: Vec<_> = series.iter().map(|(_, number, _)| field.deformed_network(*number)).collect();
        series.par_iter_mut().zip(deformed).try_for_each(|((point, _, collection), deformed)| {
            let Some(deformed) = deformed else { return Ok(()) };
            let DeformedNetwork { model, positions, stretches, forces } = &deformed;
            let network = &networks[*model];
            let kind: Vec<i64> = network.material_of().iter().map(|&reaction| reaction.into()).collect();
            let displacements: Vec<[f64; 3]> = (positions.iter().zip(network.nodes()))
                .map(|(current, reference)| std::array::from_fn(|k| current[k] - reference[k]))
                .collect();
            let set = NetworkSet {
                points: positions,
                displacements: &displacements,
                fibers: network.fibers(),
                stretch: stretches,
                force: forces,
                kind: &kind,
            };
            let name = network_file(*point, step);
            let name = if whole { name } else { partial(&name) };
            write_vtp(&folder.join(&name), &set)?;
            collection.add(t, &name)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::ranges;

    #[test]
    fn numbers_are_listed_by_ranges() {
        assert_eq!(ranges([0, 1, 2, 7, 9, 10].into_iter()), "0 to 2, 7, 9 to 10");
        assert_eq!(ranges((0..20).map(|k| 2 * k)), "0, 2, 4, 6, ... up to 38");
        assert_eq!(ranges(std::iter::empty()), "there is none");
    }
}
