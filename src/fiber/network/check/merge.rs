//! Merging of fibers that join the same two nodes.

use std::collections::{HashMap, HashSet};

use crate::fiber::law::FiberMaterial;
use crate::fiber::network::{Network, NetworkError};

/// Fibers of a network after merging, with their materials.
pub(super) struct Merged {
    /// The remaining fibers, by their numbers in the network.
    pub(super) fibers: Vec<u32>,
    /// The materials of the network, then those of merged fibers.
    pub(super) materials: Vec<FiberMaterial>,
    /// Index into `materials` of every remaining fiber.
    pub(super) material_of: Vec<u16>,
    /// Number of fibers merged into an earlier one.
    pub(super) count: usize,
    /// Number of remaining fibers that join the same two nodes as an earlier one.
    pub(super) doubled: usize,
}

/// Merges those of the given fibers that join the same two nodes and have the same law. The force of a fiber is its
/// cross-sectional area times a function of its stretch, so that one fiber with the sum of the areas has the force, the
/// stiffness and the energy of all of them. Fibers without a law are not merged: whatever law they get later has the
/// same area for all of them.
///
/// # Errors
/// Returns [`NetworkError::TooMany`] if there would be more materials than 16-bit numbers can count.
pub(super) fn merge_doubled(network: &Network, fibers: &[u32]) -> Result<Merged, NetworkError> {
    let groups = groups(network, fibers);
    let mut materials = network.materials().to_vec();
    let mut material_of = Vec::with_capacity(groups.len());
    let mut pairs = HashSet::with_capacity(groups.len());
    let mut doubled = 0;
    for group in &groups {
        let material = match group[..] {
            [single] => network.material_of()[single as usize],
            _ => number_of(&mut materials, sum_of(network, group))?,
        };
        material_of.push(material);
        doubled += usize::from(!pairs.insert(pair(network, group[0])));
    }
    let kept: Vec<u32> = groups.iter().map(|group| group[0]).collect();
    Ok(Merged { count: fibers.len() - kept.len(), fibers: kept, materials, material_of, doubled })
}

/// The two nodes of a fiber, the lower number first.
fn pair(network: &Network, fiber: u32) -> [u32; 2] {
    let [a, b] = network.fibers()[fiber as usize];
    [a.min(b), a.max(b)]
}

/// Divides the fibers into groups with the same nodes and the same law, in the order of the first fiber of each.
fn groups(network: &Network, fibers: &[u32]) -> Vec<Vec<u32>> {
    let mut groups: Vec<Vec<u32>> = Vec::with_capacity(fibers.len());
    let mut groups_of: HashMap<[u32; 2], Vec<usize>> = HashMap::with_capacity(fibers.len());
    let law = |fiber: u32| {
        let number = network.material_of()[fiber as usize];
        network.materials().get(usize::from(number)).map(|material| (number, &material.law))
    };
    for &fiber in fibers {
        let same = groups_of.entry(pair(network, fiber)).or_default();
        let is_of = |&group: &usize| match (law(groups[group][0]), law(fiber)) {
            (Some((first, law)), Some((number, other))) => first == number || law == other,
            _ => false,
        };
        match same.iter().copied().find(|group| is_of(group)) {
            Some(group) => groups[group].push(fiber),
            None => {
                same.push(groups.len());
                groups.push(vec![fiber]);
            }
        }
    }
    groups
}

/// The material of one fiber in place of several with the same law. Its density gives it the mass of all of them; it
/// has none unless all have one.
fn sum_of(network: &Network, group: &[u32]) -> FiberMaterial {
    let materials =
        || group.iter().map(|&fiber| &network.materials()[usize::from(network.material_of()[fiber as usize])]);
    // The factor pi of the areas cancels.
    let areas: f64 = materials().map(|material| material.radius * material.radius).sum();
    let first = &network.materials()[usize::from(network.material_of()[group[0] as usize])];
    let density = if materials().all(|material| material.density == first.density) {
        first.density
    } else {
        let masses = materials().map(|material| material.density.map(|d| d * material.radius * material.radius));
        masses.sum::<Option<f64>>().map(|mass| mass / areas)
    };
    FiberMaterial { law: first.law.clone(), radius: areas.sqrt(), density }
}

/// The number of a material in the list, to which it is added if it is new.
fn number_of(materials: &mut Vec<FiberMaterial>, material: FiberMaterial) -> Result<u16, NetworkError> {
    let most = usize::from(u16::MAX);
    let number = materials.iter().position(|known| *known == material).unwrap_or(materials.len());
    let short = u16::try_from(number).ok().filter(|_| number < most);
    let short = short.ok_or(NetworkError::TooMany { what: "materials", count: number + 1, most })?;
    if number == materials.len() {
        materials.push(material);
    }
    Ok(short)
}
