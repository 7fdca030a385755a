//! The networks of single elements: their nodes before loading, and nodes and stretches at each step.

use std::path::Path;

use serde::Serialize;

use super::pack::{Packed, integers, pack, pack_scalars};
use super::steps::evenly;
use crate::app::report::ReportError;
use crate::app::report::directory::Directory;
use crate::app::report::picture::color;
use crate::app::results::collection::Entry;
use crate::app::results::{Collection, NETWORKS_FOLDER, ResultsError, read_vtp};

/// Most networks of a page.
const MOST_NETWORKS: usize = 24;
/// Most steps of a network.
const MOST_STEPS: usize = 30;
/// Most bytes of the numbers of all networks.
const MOST_BYTES: usize = 8 << 20;

/// A network.
#[derive(Clone, Debug, Serialize)]
pub(super) struct NetworkSeries {
    pub name: String,
    /// The two nodes of each fiber.
    pub fibers: String,
    /// The nodes before loading; absent in files of earlier versions.
    pub reference: Option<Packed>,
    pub steps: Vec<NetworkStep>,
}

/// A network at a step.
#[derive(Clone, Debug, Serialize)]
pub(super) struct NetworkStep {
    pub time: f64,
    pub nodes: Packed,
    pub stretch: Packed,
}

/// The networks of a page.
#[derive(Clone, Debug, Default, Serialize)]
pub(super) struct NetworkPage {
    pub networks: Vec<NetworkSeries>,
    /// The stretches at the ends of the color map.
    pub range: [f64; 2],
    /// The smallest and the largest stretch of the fibers in all steps.
    pub extremes: [f64; 2],
    /// Number of networks in the result directory.
    pub of: usize,
}

/// Reads the networks of a result directory, up to the limits of a page.
pub(super) fn collect(directory: &Directory) -> Result<NetworkPage, ReportError> {
    let folder = directory.path.join(NETWORKS_FOLDER);
    let mut files: Vec<_> = match folder.read_dir() {
        Ok(entries) => entries.filter_map(|entry| entry.ok().map(|entry| entry.path())).collect(),
        Err(_) => Vec::new(),
    };
    files.retain(|file| file.extension().is_some_and(|extension| extension == "pvd"));
    files.sort();
    let of = files.len();
    let (mut networks, mut stretches, mut left) = (Vec::new(), Vec::new(), MOST_BYTES);
    for place in evenly(of, MOST_NETWORKS) {
        let entries = Collection::read(files[place].clone())?.entries().to_vec();
        let Some(series) = series(&folder, name(&files[place]), &entries, &mut stretches, &mut left)? else { continue };
        networks.push(series);
    }
    let (low, high) = color::range(&stretches);
    let finite = stretches.iter().copied().filter(|stretch| stretch.is_finite());
    let extremes = finite.fold([1.0_f64; 2], |[least, most], stretch| [least.min(stretch), most.max(stretch)]);
    Ok(NetworkPage { networks, range: [low.min(1.0), high.max(1.0)], extremes, of })
}

/// Returns `element 12, point 3` for `element-00012-point-03.pvd`.
fn name(file: &Path) -> String {
    let stem = file.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
    let number = |text: &str| text.parse::<usize>().ok();
    match stem.split('-').collect::<Vec<_>>().as_slice() {
        ["element", element] if let Some(element) = number(element) => format!("element {element}"),
        ["element", element, "point", point] if let (Some(element), Some(point)) = (number(element), number(point)) => {
            format!("element {element}, point {point}")
        }
        _ => stem,
    }
}

/// Reads the steps of a network while `left` bytes suffice.
fn series(
    folder: &Path,
    name: String,
    entries: &[Entry],
    stretches: &mut Vec<f64>,
    left: &mut usize,
) -> Result<Option<NetworkSeries>, ResultsError> {
    let mut series: Option<NetworkSeries> = None;
    // From the last step on, which is drawn first.
    for place in evenly(entries.len(), MOST_STEPS).into_iter().rev() {
        let network = read_vtp(&folder.join(&entries[place].file))?;
        let bytes = 6 * network.points.len() + 2 * network.fibers.len();
        if *left < bytes {
            break;
        }
        *left -= bytes;
        let series = series.get_or_insert_with(|| {
            let rest = |(x, u): (&[f64; 3], &[f64; 3])| std::array::from_fn(|k| x[k] - u[k]);
            let nodes: Vec<[f64; 3]> = network.points.iter().zip(&network.displacements).map(rest).collect();
            NetworkSeries {
                name: name.clone(),
                fibers: integers(network.fibers.iter().flatten().copied()),
                reference: (!nodes.is_empty()).then(|| pack(&nodes)),
                steps: Vec::new(),
            }
        });
        let nodes = pack(&network.points);
        let stretch = pack_scalars(&network.stretch);
        series.steps.push(NetworkStep { time: entries[place].time, nodes, stretch });
        stretches.extend(network.stretch);
    }
    if let Some(series) = &mut series {
        series.steps.reverse();
    }
    Ok(series)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn networks_are_named_after_their_elements() {
        let named = ["element-00012.pvd", "element-00012-point-03.pvd", "other.pvd"].map(|file| name(Path::new(file)));
        assert_eq!(named, ["element 12", "element 12, point 3", "other"]);
    }
}
