//! Resolution of conditions that share nodes: planes of symmetry, rigid surfaces, and the groups of nodes that loads couple.

use std::collections::BTreeMap;

use super::plane::Plane;
use super::prescribed::PrescribedCollector;
use super::rigid::ResolvedRigid;
use super::skew::GivenDirection;
use super::{BoundaryError, CoupledNodes, LoadCurve, RigidCondition, Source, find_surface};
use crate::fem::mesh::Mesh;

/// Returns the normals of the inclined planes of each node; the displacements normal to the other planes are
/// components, which are prescribed.
pub(super) fn symmetry_planes(
    mesh: &Mesh,
    names: &[String],
    prescribed: &mut PrescribedCollector<'_>,
) -> Result<BTreeMap<u32, Vec<GivenDirection>>, BoundaryError> {
    let mut of_nodes: BTreeMap<u32, Vec<GivenDirection>> = BTreeMap::new();
    let planes = names.iter().map(|name| Plane::new(mesh, find_surface(mesh, name)?.0));
    let planes = planes.collect::<Result<Vec<_>, _>>()?;
    for plane in &planes {
        let (normal, source) = (plane.common_normal(mesh, &planes), Source::Surface(plane.surface));
        // A greater angle than `sqrt(2 EPSILON)`, the rounding error of a normal, makes the plane an inclined one.
        if let Some(component) = (0..3).find(|&k| normal[k].abs() > 1.0 - f64::EPSILON) {
            let held = std::array::from_fn(|k| (k == component).then_some(0.0));
            prescribed.add(&plane.nodes, &held, &LoadCurve::Ramp, source)?;
            continue;
        }
        for &node in &plane.nodes {
            of_nodes.entry(node).or_default().push(GivenDirection { source, along: normal, component: None });
        }
    }
    Ok(of_nodes)
}

/// Resolves rigid surfaces and removes the conditions on their nodes that they satisfy.
///
/// # Errors
/// Returns [`BoundaryError::RigidConflict`] or [`BoundaryError::LeavesPlane`] for a node with another condition.
pub(super) fn rigid_surfaces(
    mesh: &Mesh,
    conditions: &[RigidCondition],
    prescribed: &mut PrescribedCollector<'_>,
    planes: &mut BTreeMap<u32, Vec<GivenDirection>>,
) -> Result<Vec<ResolvedRigid>, BoundaryError> {
    let mut owner: BTreeMap<u32, usize> = BTreeMap::new();
    let mut all = Vec::with_capacity(conditions.len());
    for condition in conditions {
        let rigid = condition.resolve(mesh)?;
        let (number, motions) = (rigid.surface.surface, rigid.compared_motions());
        for &node in &rigid.surface.nodes {
            let conflict_in = |what: &str, other: Source| BoundaryError::RigidConflict {
                node: node as usize,
                rigid: Source::Surface(number).describe(mesh),
                other: other.describe(mesh) + what,
            };
            if let Some(other) = owner.insert(node, number) {
                return Err(conflict_in("", Source::Surface(other)));
            }
            let of_node = planes.remove(&node).unwrap_or_default();
            if let Some(plane) = of_node.iter().find(|plane| !rigid.stays_in_plane(&plane.along, &motions)) {
                return Err(BoundaryError::LeavesPlane {
                    node: node as usize,
                    rigid: Source::Surface(number).describe(mesh),
                    plane: plane.source.describe(mesh),
                });
            }
            if let Some(other) = prescribed.take(node).iter().find(|component| !rigid.agrees_with(component)) {
                let component = ["x", "y", "z"][usize::from(other.component)];
                return Err(conflict_in(&format!(", which prescribes its {component}-displacement"), other.source));
            }
        }
        all.push(rigid);
    }
    Ok(all)
}

/// Checks that the nodes of each group belong to one element, so that the sparsity pattern couples them.
pub(super) fn check_coupled_nodes(mesh: &Mesh, coupled: CoupledNodes<'_>) -> Result<(), BoundaryError> {
    if coupled.is_none() {
        return Ok(());
    }
    let mut elements_of = vec![Vec::new(); mesh.nodes().len()];
    for nodes in mesh.elements() {
        nodes.iter().for_each(|&node| elements_of[node as usize].push(nodes));
    }
    for group in coupled.groups() {
        let elements = group.first().and_then(|&node| elements_of.get(node as usize));
        let contain = |nodes: &&[u32]| group.iter().all(|node| nodes.contains(node));
        if !elements.is_some_and(|elements| elements.iter().any(contain)) {
            return Err(BoundaryError::NotInOneElement(group.to_vec()));
        }
    }
    Ok(())
}
