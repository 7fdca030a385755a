//! Networks that have motions which no fiber resists, without a matrix or beside one that hardly resists them.

use std::sync::Arc;

use super::{Stiffness, in_region, short};
use crate::app::case::Case;
use crate::fiber::network::Network;
use crate::fiber::network::check::{RigidityError, clean, zero_modes};
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

/// Young's modulus of a matrix, relative to that of the network if it moved with the body, below which steps are likely to
/// fail. In a notched strip with Voronoi networks that was pulled by 15 %, 0.05 was too little and 0.5 enough.
const SOFT_MATRIX: f64 = 0.2;

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

/// The networks without a matrix, or beside a soft one, that have motions which no fiber resists at rest.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FloppyNetworks {
    /// Their names, each once.
    pub names: Vec<String>,
    /// The warnings, one line for each region, and one if a thorough examination left out networks.
    pub warnings: Vec<String>,
}

/// Finds the networks of regions without a matrix, or with a soft one, that have motions which no fiber resists.
pub fn floppy_networks<B: RealBackend>(case: &Case, library: &Library<B>, examination: Examination) -> FloppyNetworks {
    let unsupported: Vec<(Stiffness, Vec<&Arc<Network>>)> = (0..library.regions().len())
        .map(|region| Stiffness::of_region(library, region))
        .filter(has_soft_matrix)
        .map(|stiffness| {
            let models = library.models_of_region(stiffness.region).iter();
            (stiffness, distinct(models.map(|&model| library.models()[model].network())))
        })
        .collect();
    let all = distinct(unsupported.iter().flat_map(|(_, networks)| networks.iter().copied()));
    let findings = examine::<B>(library.context(), &all, examination.most_unknowns());
    let is_floppy = |network: &&Arc<Network>| {
        let at = all.iter().position(|other| Arc::ptr_eq(other, network));
        at.is_some_and(|at| findings[at] == Finding::Floppy)
    };
    let mut found = FloppyNetworks::default();
    for (stiffness, networks) in &unsupported {
        let floppy: Vec<&Arc<Network>> = networks.iter().copied().filter(is_floppy).collect();
        if !floppy.is_empty() {
            found.warnings.push(in_region(case, stiffness.region, &message(&floppy, networks.len(), stiffness)));
        }
    }
    let floppy = all.iter().zip(&findings).filter(|(_, finding)| **finding == Finding::Floppy);
    found.names = floppy.map(|(network, _)| network.name().to_owned()).collect();
    let not_examined = findings.iter().filter(|finding| **finding == Finding::NotExamined).count();
    if not_examined > 0 && examination == Examination::Thorough {
        found.warnings.push(format!(
            "{}: {not_examined} of {} networks without a matrix, or with a soft one, are too large to count their motions that no \
             fiber resists: `biotissue network check` does",
            case.file.display(),
            all.len()
        ));
    }
    found
}

/// Returns true if networks of a region stand alone, or beside a matrix that hardly resists what they do not.
fn has_soft_matrix(stiffness: &Stiffness) -> bool {
    match (stiffness.formula, stiffness.fibers) {
        (_, None) => false,
        (None, Some(_)) => true,
        (Some([softest, _]), Some([_, fibers])) => softest < SOFT_MATRIX * fibers,
    }
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

/// Describes the floppy networks among all networks of a region.
fn message(floppy: &[&Arc<Network>], networks: usize, stiffness: &Stiffness) -> String {
    let more = match floppy.len().saturating_sub(MOST_NAMES) {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    let listed = floppy.iter().take(MOST_NAMES).map(|network| network.name()).collect::<Vec<_>>().join(", ");
    let which = match (floppy.len(), networks) {
        (1, 1) => "the network has".to_owned(),
        (1, _) => format!("1 of {networks} networks has"),
        (all, _) if all == networks => format!("all {networks} networks have"),
        (some, _) => format!("{some} of {networks} networks have"),
    };
    let (resistance, matrix) = match (stiffness.formula, stiffness.fibers) {
        (Some([matrix, _]), Some([_, fibers])) => (
            format!(
                "and the matrix, about {} Pa, is too soft beside the fibers, about {} Pa, to resist them",
                short(matrix),
                short(fibers)
            ),
            "make the `matrix` stiffer",
        ),
        _ => ("and no matrix resists them either".into(), "give the region a `matrix`"),
    };
    let has_loose_fibers = |network: &&Arc<Network>| {
        clean(network, None).is_ok_and(|of| of.removed.dangling_fibers + of.removed.unsupported_fibers > 0)
    };
    let cures = if floppy.iter().any(has_loose_fibers) {
        format!(
            "{matrix}, use networks with more fibers per node, or remove loose fibers by `biotissue network check --clean`"
        )
    } else {
        format!("{matrix}, or use networks with more fibers per node")
    };
    format!(
        "{which} motions that no fiber resists, {resistance}: {listed}{more}; such equilibria take long to find, or are not found: \
         {cures}"
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
    fn a_soft_matrix_hardly_resists() {
        let of = |formula: Option<f64>, fibers: Option<f64>| Stiffness {
            region: 0,
            formula: formula.map(|modulus| [modulus, 10.0 * modulus]),
            fibers: fibers.map(|modulus| [0.1 * modulus, modulus]),
        };
        assert!(has_soft_matrix(&of(None, Some(1e4))) && has_soft_matrix(&of(Some(1e3), Some(1e4))));
        assert!(!has_soft_matrix(&of(Some(3e3), Some(1e4))) && !has_soft_matrix(&of(Some(1e3), None)));
        let rigid = star("rigid", 1, 8);
        let (mut nodes, mut fibers) = (rigid.nodes().to_vec(), rigid.fibers().to_vec());
        nodes.push([0.1, 0.1, 0.3]);
        fibers.push([8, 9]);
        let loose = Arc::new(Network::new("loose", nodes, fibers).unwrap());
        let text = message(&[&loose], 2, &of(Some(1e3), Some(1e4)));
        assert!(
            text.contains("resists, and the matrix, about 1000 Pa, is too soft beside the fibers, about 1.0e4 Pa, to"),
            "{text}"
        );
        assert!(text.contains(": make the `matrix` stiffer, ") && text.ends_with("network check --clean`"), "{text}");
        // Its fibers do not dangle.
        let text = message(&[&star("straight", 1, 2)], 2, &of(None, Some(1e4)));
        assert!(
            text.ends_with("found: give the region a `matrix`, or use networks with more fibers per node"),
            "{text}"
        );
    }

    #[test]
    fn at_most_five_networks_are_named() {
        let networks: Vec<Arc<Network>> = (0..7).map(|k| star(&format!("{k}.txt"), 1, 2)).collect();
        let networks: Vec<&Arc<Network>> = networks.iter().collect();
        let bare = Stiffness { region: 0, formula: None, fibers: Some([1e3, 1e4]) };
        let text = message(&networks, 9, &bare);
        assert!(text.starts_with("7 of 9 networks have motions that no fiber resists"), "{text}");
        assert!(text.contains("either: 0.txt, 1.txt, 2.txt, 3.txt, 4.txt and 2 more; such"), "{text}");
        assert!(message(&networks[..5], 9, &bare).contains("4.txt; such"));
    }
}
