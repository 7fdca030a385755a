//! Scales on ranks that lie near each other.
//!
//! A message between two cores of one package stays in its caches or its memory; one between machines goes over the
//! network. Where each rank of one scale has some ranks of another that work for it, [`near`] puts these beside it. With
//! the feature `hwloc`, `here` says where a rank runs.

use super::plan::{Plan, PlanError, Share};
use crate::las::{Comm, CommError, Message};

/// Where a rank runs.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct HardwareLocation {
    /// The machine, by name.
    pub machine: String,
    /// The part of the machine that shares memory and caches (package, NUMA node), from 0.
    pub package: u32,
    /// The core, from 0.
    pub core: u32,
}

/// The ranks of two scales, `above` of them for the first, so that those of the second lie near one of the first.
///
/// `places` are those of all ranks, by rank. The ranks are put in order by machine, package and core, and by number where
/// these are the same. This order is cut into `above` groups whose sizes differ by one at most; the first rank of each
/// group is of the first scale, and all others of it are of the second. So a group is on one machine and one package where
/// groups fill these evenly; no cut is moved to the end of a package. Both lists are in the order of
/// the groups, and so are the ranks of the scales: spread evenly, units stay in their group where groups are of one size.
///
/// # Errors
/// [`PlanError::Two`]: one of the two would get no rank.
pub fn near(places: &[HardwareLocation], above: usize) -> Result<[Vec<usize>; 2], PlanError> {
    let groups = groups(places, above)?;
    let first = groups.iter().filter_map(|group| group.first()).copied().collect();
    let second = groups.iter().flat_map(|group| group.iter().skip(1)).copied().collect();
    Ok([first, second])
}

/// A plan of two scales with ranks as [`near`] finds them, `above` for the first.
///
/// # Errors
/// As for [`near`].
pub fn plan(names: [&str; 2], places: &[HardwareLocation], above: usize) -> Result<Plan, PlanError> {
    let [first, second] = near(places, above)?;
    Ok(Plan::default().with(names[0], Share::Ranks(first)).with(names[1], Share::Ranks(second)))
}

/// The places of all ranks, by rank. Called by all ranks together, each with its own.
///
/// # Errors
/// [`CommError`].
pub fn gather<C: Comm>(world: &C, own: &HardwareLocation) -> Result<Vec<HardwareLocation>, CommError> {
    let messages = world.gather_all(Message::text(&write(own)))?;
    let place = |(rank, message): (usize, &Message)| {
        let text = message.to_text();
        read(&text)
            .ok_or_else(|| CommError::Library(format!("rank {rank} says it runs at `{text}`, which is no place")))
    };
    messages.iter().enumerate().map(place).collect()
}

/// The groups of ranks that lie near each other, in order.
fn groups(places: &[HardwareLocation], above: usize) -> Result<Vec<Vec<usize>>, PlanError> {
    let started = places.len();
    if above == 0 || above >= started {
        return Err(PlanError::Two { above, started });
    }
    let mut order: Vec<usize> = (0..started).collect();
    // Stable: ranks at one place keep their order.
    order.sort_by_key(|&rank| &places[rank]);
    let begin = |group: usize| group * started / above;
    Ok((0..above).map(|group| order[begin(group)..begin(group + 1)].to_vec()).collect())
}

/// The name of the machine comes last, since it may be any text.
fn write(place: &HardwareLocation) -> String {
    format!("{} {} {}", place.package, place.core, place.machine)
}

fn read(text: &str) -> Option<HardwareLocation> {
    let mut words = text.splitn(3, ' ');
    let (package, core) = (words.next()?.parse().ok()?, words.next()?.parse().ok()?);
    Some(HardwareLocation { machine: words.next()?.to_owned(), package, core })
}

#[cfg(feature = "hwloc")]
mod hwloc {
    //! What hwloc knows of this process.

    use hwlocality::cpu::binding::CpuBindingFlags;
    use hwlocality::cpu::cpuset::CpuSet;
    use hwlocality::object::TopologyObject;
    use hwlocality::object::types::ObjectType;
    use hwlocality::topology::Topology;

    use super::HardwareLocation;

    /// Where the calling thread runs: the package and the core to which it is bound, or, where it is bound to no single
    /// one, those on which it ran last. Needs the feature `hwloc`.
    ///
    /// # Errors
    /// In words: hwloc fails, or does not know the machine or the core.
    pub fn here() -> Result<HardwareLocation, String> {
        let topology =
            Topology::new().map_err(|error| format!("hwloc does not find the parts of this machine: {error}"))?;
        let bound = topology.cpu_binding(CpuBindingFlags::THREAD);
        let last = topology.last_cpu_location(CpuBindingFlags::THREAD);
        let known: Vec<CpuSet> = bound.into_iter().chain(last).filter(|set| !set.is_empty()).collect();
        let core = number(&topology, ObjectType::Core, &known).or_else(|| number(&topology, ObjectType::PU, &known));
        let core = core.ok_or("hwloc does not know on which core this process runs")?;
        // A machine that shows no packages counts as one.
        let package = number(&topology, ObjectType::Package, &known).unwrap_or(0);
        Ok(HardwareLocation { machine: machine(&topology)?, package, core })
    }

    /// The number, in the whole machine, of the object of a kind that has all processors of a set; for the first set for
    /// which there is one.
    fn number(topology: &Topology, kind: ObjectType, sets: &[CpuSet]) -> Option<u32> {
        let holder = |set: &CpuSet| {
            let has_all = |object: &&TopologyObject| object.cpuset().is_some_and(|own| own.includes(set));
            topology.objects_with_type(kind).find(has_all).map(TopologyObject::logical_index)
        };
        sets.iter().find_map(holder).and_then(|index| u32::try_from(index).ok())
    }

    fn machine(topology: &Topology) -> Result<String, String> {
        let found = topology.root_object().info("HostName").map(|name| name.to_string_lossy().into_owned());
        let named = found.or_else(|| std::fs::read_to_string("/etc/hostname").ok());
        let named = named.map(|name| name.trim().to_owned()).filter(|name| !name.is_empty());
        named.ok_or_else(|| "neither hwloc nor /etc/hostname knows the name of this machine".to_owned())
    }

    #[cfg(test)]
    mod tests {
        use super::*;

        #[test]
        fn this_process_runs_somewhere() {
            let place = here().unwrap();
            assert!(!place.machine.is_empty(), "{place:?}");
        }
    }
}

#[cfg(feature = "hwloc")]
pub use hwloc::here;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backends::comm::thread::run;

    /// Two machines of two packages of four cores; neighboring ranks are far from each other.
    fn places() -> Vec<HardwareLocation> {
        let place = |rank: u32| {
            let slot = rank * 7 % 16;
            HardwareLocation { machine: format!("node{}", slot / 8), package: slot / 4 % 2, core: slot % 8 }
        };
        (0..16).map(place).collect()
    }

    /// Every rank is in one group, and the sizes differ by one at most.
    fn check(groups: &[Vec<usize>], started: usize) {
        let mut ranks = groups.concat();
        ranks.sort_unstable();
        assert_eq!(ranks, (0..started).collect::<Vec<_>>());
        let sizes = || groups.iter().map(Vec::len);
        assert!(sizes().max() <= sizes().min().map(|least| least + 1), "{groups:?}");
    }

    #[test]
    fn each_group_is_on_one_package() {
        let places = places();
        let groups = groups(&places, 4).unwrap();
        check(&groups, 16);
        for group in &groups {
            let package = |&rank: &usize| (&places[rank].machine, places[rank].package);
            assert!(group.iter().all(|rank| package(rank) == package(&group[0])), "{group:?}");
        }
        let [first, second] = near(&places, 4).unwrap();
        // Slots 0, 4, 8 and 12: rank 7 slot, modulo 16.
        assert_eq!(first, [0, 12, 8, 4]);
        assert_eq!(second, [7, 14, 5, 3, 10, 1, 15, 6, 13, 11, 2, 9]);
    }

    #[test]
    fn one_rank_has_all_others_below() {
        let [first, second] = near(&places(), 1).unwrap();
        assert_eq!((first, second.len()), (vec![0], 15));
    }

    #[test]
    fn groups_need_not_be_of_one_size() {
        for above in 1..16 {
            let groups = groups(&places(), above).unwrap();
            assert_eq!(groups.len(), above);
            check(&groups, 16);
        }
        let [first, second] = near(&places()[..5], 2).unwrap();
        assert_eq!((first.len(), second.len()), (2, 3));
    }

    #[test]
    fn ranks_at_one_place_keep_their_order() {
        let place = HardwareLocation { machine: "node0".to_owned(), package: 0, core: 0 };
        assert_eq!(near(&vec![place; 6], 2), Ok([vec![0, 3], vec![1, 2, 4, 5]]));
    }

    #[test]
    fn both_scales_need_a_rank() {
        for above in [0, 16, 17] {
            assert_eq!(near(&places(), above), Err(PlanError::Two { above, started: 16 }));
        }
        let error = plan(["macro", "micro"], &places()[..2], 2).map_err(|error| error.to_string());
        assert_eq!(error, Err("2 of 2 ranks are for one of two scales; each needs at least one".to_owned()));
    }

    #[test]
    fn a_plan_has_the_ranks_by_number() {
        let plan = plan(["macro", "micro"], &places(), 4).unwrap();
        assert_eq!(plan.scales[0], ("macro".to_owned(), Share::Ranks(vec![0, 12, 8, 4])));
        assert_eq!(plan.assign(16).map(|ranks| ranks[1].len()), Ok(12));
    }

    #[test]
    fn all_ranks_find_all_places() {
        let places = places();
        let found = run(16, |world| gather(&world, &places[world.rank()])).unwrap();
        assert!(found.iter().all(|found| *found == places), "{found:?}");
        let odd = HardwareLocation { machine: "a machine ".to_owned(), package: u32::MAX, core: 0 };
        assert_eq!(read(&write(&odd)), Some(odd));
        assert_eq!(read("0 one node0"), None);
    }
}
