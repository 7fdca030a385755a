//! Networks without a matrix that have motions which no fiber resists.

use std::sync::Arc;

use super::in_region;
use crate::app::case::Case;
use crate::fiber::network::Network;
use crate::fiber::network::check::{RigidityError, zero_modes};
use crate::las::RealBackend;
use crate::parallel;
use crate::tissue::micro_scale::Library;

/// How many networks are factored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Examination {
    /// For some seconds at most, before a run.
    Quick,
    /// As far as that is possible within a minute or so; a warning says if networks are left out.
    Thorough,
}

impl Examination {
    /// The most free unknowns of a network that is factored, and of all: the networks are factored in their order as long as
    /// the sum of their free unknowns is at most that. A network of 30 000 takes about a second on one thread.
    const fn most_unknowns(self) -> [usize; 2] {
        match self {
            Self::Quick => [10_000, 100_000],
            Self::Thorough => [30_000, 400_000],
        }
    }
}

/// The number of networks that a warning names.
const MOST_NAMES: usize = 5;

/// What is known about the rigidity of a network.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Finding {
    Rigid,
    Floppy,
    /// The network is too large, or its stiffness cannot be factored.
    NotExamined,
}

/// The networks without a matrix that have motions which no fiber resists at rest.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FloppyNetworks {
    /// Their names, each once.
    pub names: Vec<String>,
    /// The warnings, one line for each region, and one if a thorough examination left out networks.
    pub warnings: Vec<String>,
}

/// Finds the networks of regions without a matrix that have motions which no fiber resists.
pub fn floppy_networks<B: RealBackend>(case: &Case, library: &Library<B>, examination: Examination) -> FloppyNetworks {
    let without_matrix: Vec<(usize, Vec<&Arc<Network>>)> = (0..library.regions().len())
        .filter(|&region| library.formulas_of_region(region).is_empty())
        .map(|region| {
            let models = library.models_of_region(region).iter();
            (region, distinct(models.map(|&model| library.models()[model].network())))
        })
        .collect();
    let all = distinct(without_matrix.iter().flat_map(|(_, networks)| networks.iter().copied()));
    let findings = examine::<B>(library.context(), &all, examination.most_unknowns());
    let is_floppy = |network: &Arc<Network>| {
        let at = all.iter().position(|other| Arc::ptr_eq(other, network));
        at.is_some_and(|at| findings[at] == Finding::Floppy)
    };
    let mut found = FloppyNetworks::default();
    for (region, networks) in &without_matrix {
        let names: Vec<&str> =
            networks.iter().filter(|network| is_floppy(network)).map(|network| network.name()).collect();
        if !names.is_empty() {
            found.warnings.push(in_region(case, *region, &message(&names, networks.len())));
        }
    }
    let floppy = all.iter().zip(&findings).filter(|(_, finding)| **finding == Finding::Floppy);
    found.names = floppy.map(|(network, _)| network.name().to_owned()).collect();
    let not_examined = findings.iter().filter(|finding| **finding == Finding::NotExamined).count();
    if not_examined > 0 && examination == Examination::Thorough {
        found.warnings.push(format!(
            "{}: {not_examined} of {} networks without a matrix are too large to count their motions that no fiber resists: \
             `biotissue network check` does",
            case.file.display(),
            all.len()
        ));
    }
    found
}

/// Returns each network once, in the order of their first occurrence.
fn distinct<'a>(networks: impl Iterator<Item = &'a Arc<Network>>) -> Vec<&'a Arc<Network>> {
    let mut seen = std::collections::HashSet::new();
    networks.filter(|network| seen.insert(Arc::as_ptr(network))).collect()
}

/// Examines networks on all threads, given the most free unknowns of a network and of all that are factored.
fn examine<B: RealBackend>(
    context: &B::Context,
    networks: &[&Arc<Network>],
    [most, most_of_all]: [usize; 2],
) -> Vec<Finding> {
    let mut sum = 0;
    let with_cost: Vec<(&Network, bool)> = networks
        .iter()
        .map(|&network| {
            let unknowns = 3 * network.interior().len();
            let is_in_bounds = unknowns <= most && sum + unknowns <= most_of_all;
            sum += if is_in_bounds && !has_too_few_fibers(network) { unknowns } else { 0 };
            (&**network, is_in_bounds)
        })
        .collect();
    parallel::map(with_cost, |(network, is_in_bounds)| {
        if has_too_few_fibers(network) {
            return Finding::Floppy;
        }
        if !is_in_bounds {
            return Finding::NotExamined;
        }
        // A thread that waits inside a backend must not start another network.
        match parallel::alone(|| zero_modes::<B>(context, network)) {
            Ok(0) => Finding::Rigid,
            Ok(_) => Finding::Floppy,
            Err(RigidityError::Pattern(_) | RigidityError::Solve(_) | RigidityError::Undecided) => Finding::NotExamined,
        }
    })
}

/// Returns true if a network has fewer fibers with a free end than free unknowns, and hence zero modes (Maxwell's rule).
fn has_too_few_fibers(network: &Network) -> bool {
    let is_free = |&node: &u32| network.interior_number()[node as usize] >= 0;
    let fibers = network.fibers().iter().filter(|ends| ends.iter().any(is_free)).count();
    fibers < 3 * network.interior().len()
}

fn message(names: &[&str], networks: usize) -> String {
    let more = match names.len().saturating_sub(MOST_NAMES) {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    let listed = names[..names.len().min(MOST_NAMES)].join(", ");
    let has = if names.len() == 1 { "has" } else { "have" };
    format!(
        "{} of {networks} networks {has} motions that no fiber resists, and no matrix resists them either: {listed}{more}; such \
         equilibria take long to find, or are not found: give the region a `matrix`, use networks with more fibers per node, or \
         remove loose fibers by `biotissue network check --clean`",
        names.len()
    )
}

#[cfg(all(test, feature = "sparse"))]
mod tests {
    use super::*;
    use crate::backends::sparse::Sparse;

    /// A network of the corners of the cube, and interior nodes, each connected to all corners or to the first ones only.
    fn star(name: &str, interior: usize, fibers: u32) -> Arc<Network> {
        let corner = |c: u32| [0, 1, 2].map(|k| f64::from(c >> k & 1) - 0.5);
        let mut nodes: Vec<[f64; 3]> = (0..8).map(corner).collect();
        nodes.extend((0..interior).map(|k| [0.0, 0.01 * k as f64, 0.1]));
        let ends = (0..interior as u32).flat_map(|k| (0..fibers).map(move |c| [c, 8 + k]));
        Arc::new(Network::new(name, nodes, ends.collect()).unwrap())
    }

    #[test]
    fn floppy_networks_are_found_and_large_ones_left_out() {
        let (rigid, loose, large) = (star("rigid", 1, 8), star("loose", 1, 2), star("large", 4, 8));
        // Four fibers in one plane do not resist motions out of it.
        let mut nodes: Vec<[f64; 3]> = rigid.nodes().to_vec();
        nodes.extend([[0.5, 0.0, 0.1], [-0.5, 0.0, 0.1], [0.0, 0.5, 0.1], [0.0, -0.5, 0.1]]);
        let plane = Arc::new(Network::new("plane", nodes, (9..13).map(|node| [8, node]).collect()).unwrap());
        assert!(!has_too_few_fibers(&rigid) && has_too_few_fibers(&loose) && !has_too_few_fibers(&plane));
        let networks = [&rigid, &loose, &large, &plane];
        let found = examine::<Sparse>(&(), &networks, [11, 1000]);
        assert_eq!(found, [Finding::Rigid, Finding::Floppy, Finding::NotExamined, Finding::Floppy]);
        // The networks that need no factorization do not count.
        let found = examine::<Sparse>(&(), &networks, [12, 15]);
        assert_eq!(found, [Finding::Rigid, Finding::Floppy, Finding::Rigid, Finding::NotExamined]);
        assert_eq!(distinct(networks.into_iter().chain([&rigid])).len(), 4);
    }

    #[test]
    fn at_most_five_networks_are_named() {
        let names: Vec<String> = (0..7).map(|k| format!("{k}.txt")).collect();
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        let text = message(&names, 9);
        assert!(text.starts_with("7 of 9 networks have motions that no fiber resists"), "{text}");
        assert!(text.contains("either: 0.txt, 1.txt, 2.txt, 3.txt, 4.txt and 2 more; such"), "{text}");
        assert!(message(&names[..5], 9).contains("4.txt; such"));
    }
}
