//! Scales on ranks that are close to each other in hardware.
//!
//! A message between two cores of one package stays in its caches or its memory; a message between machines crosses the
//! network. If each rank of one scale exchanges data with a group of ranks of another scale, [`place_nearby`] places
//! this group next to it. With the feature `hwloc`, `current_location` returns the hardware location of a rank.

use super::plan::{Plan, PlanError, Share};
use crate::las::{Comm, CommError, Message};

/// The hardware location of a rank.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct HardwareLocation {
    /// Name of the machine.
    pub machine: String,
    /// Number of the package, a part of the machine that shares memory and caches, from 0.
    pub package: u32,
    /// Number of the core, from 0.
    pub core: u32,
}

/// Chooses the ranks of two scales, `first_ranks` of them for the first, so that those of the second are close to one
/// of the first.
///
/// `locations` are those of all ranks. The function sorts the ranks by machine, package and core, and by rank if these
/// are equal, and cuts this sequence into `first_ranks` groups whose sizes differ by at most one. The first rank of
/// each group belongs to the first scale, all others to the second. A group thus lies on one machine and one package if
/// groups fill these evenly; cuts are not moved to package boundaries. Both lists are in the order of the groups. With
/// an even distribution and groups of equal size, all units therefore stay within their group.
///
/// # Errors
/// Returns [`PlanError::EmptyHalf`] if one of the two scales would get no rank.
pub fn place_nearby(locations: &[HardwareLocation], first_ranks: usize) -> Result<[Vec<usize>; 2], PlanError> {
    let groups = groups(locations, first_ranks)?;
    let first = groups.iter().filter_map(|group| group.first()).copied().collect();
    let second = groups.iter().flat_map(|group| group.iter().skip(1)).copied().collect();
    Ok([first, second])
}

/// Creates a plan of two scales with the ranks chosen by [`place_nearby`], `first_ranks` of them for the first.
///
/// # Errors
/// Returns the error of [`place_nearby`].
pub fn plan(names: [&str; 2], locations: &[HardwareLocation], first_ranks: usize) -> Result<Plan, PlanError> {
    let [first, second] = place_nearby(locations, first_ranks)?;
    Ok(Plan::default().with(names[0], Share::Ranks(first)).with(names[1], Share::Ranks(second)))
}

/// Gathers the locations of all ranks, ordered by rank. Collective over `world`.
///
/// # Errors
/// Returns [`CommError`] if the communication fails.
pub fn gather<C: Comm>(world: &C, own: &HardwareLocation) -> Result<Vec<HardwareLocation>, CommError> {
    let messages = world.gather_all(Message::text(&write(own)))?;
    let location = |(rank, message): (usize, &Message)| {
        let text = message.to_text();
        read(&text)
            .ok_or_else(|| CommError::Library(format!("rank {rank} says it runs at `{text}`, which is not a location")))
    };
    messages.iter().enumerate().map(location).collect()
}

/// Returns the groups of ranks that are close to each other, in order.
fn groups(locations: &[HardwareLocation], first_ranks: usize) -> Result<Vec<Vec<usize>>, PlanError> {
    let started = locations.len();
    if first_ranks == 0 || first_ranks >= started {
        return Err(PlanError::EmptyHalf { first_ranks, started });
    }
    let mut order: Vec<usize> = (0..started).collect();
    // The sort is stable: ranks at the same location keep their order.
    order.sort_by_key(|&rank| &locations[rank]);
    let begin = |group: usize| group * started / first_ranks;
    Ok((0..first_ranks).map(|group| order[begin(group)..begin(group + 1)].to_vec()).collect())
}

/// Encodes a location as text. The name of the machine is last because it may contain blanks.
fn write(location: &HardwareLocation) -> String {
    format!("{} {} {}", location.package, location.core, location.machine)
}

fn read(text: &str) -> Option<HardwareLocation> {
    let mut words = text.splitn(3, ' ');
    let (package, core) = (words.next()?.parse().ok()?, words.next()?.parse().ok()?);
    Some(HardwareLocation { machine: words.next()?.to_owned(), package, core })
}

#[cfg(feature = "hwloc")]
mod hwloc {
    //! The hardware location of this process, determined by hwloc.

    use hwlocality::cpu::binding::CpuBindingFlags;
    use hwlocality::cpu::cpuset::CpuSet;
    use hwlocality::object::TopologyObject;
    use hwlocality::object::types::ObjectType;
    use hwlocality::topology::Topology;

    use super::HardwareLocation;

    /// Returns the hardware location of the calling thread: the package and the core to which it is bound, or on which
    /// it ran last if it is not bound to a single one. Needs the feature `hwloc`.
    ///
    /// # Errors
    /// Returns a message if hwloc fails, or cannot determine the machine or the core.
    pub fn current_location() -> Result<HardwareLocation, String> {
        let topology =
            Topology::new().map_err(|error| format!("hwloc does not find the parts of this machine: {error}"))?;
        let bound = topology.cpu_binding(CpuBindingFlags::THREAD);
        let last = topology.last_cpu_location(CpuBindingFlags::THREAD);
        let known: Vec<CpuSet> = bound.into_iter().chain(last).filter(|set| !set.is_empty()).collect();
        let core = number(&topology, ObjectType::Core, &known).or_else(|| number(&topology, ObjectType::PU, &known));
        let core = core.ok_or("hwloc does not know on which core this process runs")?;
        // A machine that reports no packages is treated as a single package.
        let package = number(&topology, ObjectType::Package, &known).unwrap_or(0);
        Ok(HardwareLocation { machine: machine(&topology)?, package, core })
    }

    /// Returns the logical index of the first object of a kind that contains all processors of a set; uses the first
    /// set for which such an object exists.
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
            let place = current_location().unwrap();
            assert!(!place.machine.is_empty(), "{place:?}");
        }
    }
}

#[cfg(feature = "hwloc")]
pub use hwloc::current_location;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backends::comm::thread::run;

    /// Two machines with two packages of four cores; consecutive ranks are far apart.
    fn locations() -> Vec<HardwareLocation> {
        let place = |rank: u32| {
            let slot = rank * 7 % 16;
            HardwareLocation { machine: format!("node{}", slot / 8), package: slot / 4 % 2, core: slot % 8 }
        };
        (0..16).map(place).collect()
    }

    /// Checks that every rank is in exactly one group, and that the sizes differ by at most one.
    fn check(groups: &[Vec<usize>], started: usize) {
        let mut ranks = groups.concat();
        ranks.sort_unstable();
        assert_eq!(ranks, (0..started).collect::<Vec<_>>());
        let sizes = || groups.iter().map(Vec::len);
        assert!(sizes().max() <= sizes().min().map(|least| least + 1), "{groups:?}");
    }

    #[test]
    fn each_group_is_on_one_package() {
        let locations = locations();
        let groups = groups(&locations, 4).unwrap();
        check(&groups, 16);
        for group in &groups {
            let package = |&rank: &usize| (&locations[rank].machine, locations[rank].package);
            assert!(group.iter().all(|rank| package(rank) == package(&group[0])), "{group:?}");
        }
        let [first, second] = place_nearby(&locations, 4).unwrap();
        // Slots 0, 4, 8 and 12; the slot of a rank is 7 rank modulo 16, so that the rank is 7 slot modulo 16.
        assert_eq!(first, [0, 12, 8, 4]);
        assert_eq!(second, [7, 14, 5, 3, 10, 1, 15, 6, 13, 11, 2, 9]);
    }

    #[test]
    fn a_single_first_rank_has_all_others_in_its_group() {
        let [first, second] = place_nearby(&locations(), 1).unwrap();
        assert_eq!((first, second.len()), (vec![0], 15));
    }

    #[test]
    fn groups_may_differ_in_size_by_one() {
        for first_ranks in 1..16 {
            let groups = groups(&locations(), first_ranks).unwrap();
            assert_eq!(groups.len(), first_ranks);
            check(&groups, 16);
        }
        let [first, second] = place_nearby(&locations()[..5], 2).unwrap();
        assert_eq!((first.len(), second.len()), (2, 3));
    }

    #[test]
    fn ranks_at_one_place_keep_their_order() {
        let place = HardwareLocation { machine: "node0".to_owned(), package: 0, core: 0 };
        assert_eq!(place_nearby(&vec![place; 6], 2), Ok([vec![0, 3], vec![1, 2, 4, 5]]));
    }

    #[test]
    fn both_scales_need_a_rank() {
        for first_ranks in [0, 16, 17] {
            assert_eq!(place_nearby(&locations(), first_ranks), Err(PlanError::EmptyHalf { first_ranks, started: 16 }));
        }
        let error = plan(["macro", "micro"], &locations()[..2], 2).map_err(|error| error.to_string());
        assert_eq!(error, Err("2 of 2 ranks are for one of two scales; each needs at least one".to_owned()));
    }

    #[test]
    fn a_plan_lists_the_ranks_of_each_scale() {
        let plan = plan(["macro", "micro"], &locations(), 4).unwrap();
        assert_eq!(plan.scales[0], ("macro".to_owned(), Share::Ranks(vec![0, 12, 8, 4])));
        assert_eq!(plan.assign(16).map(|ranks| ranks[1].len()), Ok(12));
    }

    #[test]
    fn all_ranks_gather_all_locations() {
        let locations = locations();
        let found = run(16, |world| gather(&world, &locations[world.rank()])).unwrap();
        assert!(found.iter().all(|found| *found == locations), "{found:?}");
        let odd = HardwareLocation { machine: "a machine ".to_owned(), package: u32::MAX, core: 0 };
        assert_eq!(read(&write(&odd)), Some(odd));
        assert_eq!(read("0 one node0"), None);
    }
}
