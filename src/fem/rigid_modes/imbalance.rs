//! Forces that do work in free rigid-body modes.

use std::fmt;

use nalgebra::Vector3;

use super::free_modes::{direction, vector};
use super::{FreeModes, Modes, Restraint, by_part, free_modes_of, parts};
use crate::fem::kinematics::RigidSurface;
use crate::fem::mesh::Mesh;

/// Forces balance if their sum is less than this fraction of the sum of their absolute values.
const BALANCED: f64 = 1e-6;

/// Forces on nodes that push or turn a part of the body in a direction in which nothing holds it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Imbalance {
    /// The sum of the forces along a free translation.
    Force {
        /// The direction, a unit vector.
        direction: [f64; 3],
        /// The sum, N.
        force: f64,
    },
    /// The work of the forces per radian of a free rotation.
    Moment {
        /// The axis of the rotation, a unit vector.
        axis: [f64; 3],
        /// A point on the axis, m.
        point: [f64; 3],
        /// The moment, N m.
        moment: f64,
    },
}

impl fmt::Display for Imbalance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Force { direction: along, force } => {
                write!(f, "a force of {force:.3e} N along {}", direction(along))
            }
            Self::Moment { axis, point, moment } => {
                let (point, axis) = (vector(point), direction(axis));
                write!(f, "a moment of {moment:.3e} N m about the axis through {point} along {axis}")
            }
        }
    }
}

/// Returns the first free rigid-body mode in which forces on the nodes of the undeformed body, N, do work: no
/// equilibrium exists near the undeformed state.
///
/// # Panics
/// Panics if a restraint names a node that does not exist, or if `forces` has fewer entries than the mesh has nodes.
pub fn imbalance(
    mesh: &Mesh,
    restraints: &[Restraint],
    rigid: &[RigidSurface],
    forces: &[[f64; 3]],
) -> Option<Imbalance> {
    let parts = parts(mesh, rigid);
    let equations = by_part(mesh, &parts, restraints);
    parts.iter().zip(&equations).find_map(|(part, restraints)| {
        let Modes { center, size, modes } = free_modes_of(mesh, part, restraints);
        let FreeModes { translations, rotations, .. } = FreeModes::new(center, size, &modes);
        let at = |node: u32| (Vector3::from(mesh.nodes()[node as usize]), Vector3::from(forces[node as usize]));
        // The work of the forces, if it is not zero up to rounding.
        let work_in = |motion: &dyn Fn(Vector3<f64>) -> Vector3<f64>| {
            let works = part.nodes.iter().map(|&node| {
                let (position, force) = at(node);
                let motion = motion(position);
                (force.dot(&motion), force.norm() * motion.norm())
            });
            let (work, most) = works.fold((0.0, 0.0), |(work, most), (w, m)| (work + w, most + m));
            (f64::abs(work) > BALANCED * most).then_some(work)
        };
        let of_translations = translations.iter().find_map(|&direction| {
            let force = work_in(&|_| Vector3::from(direction))?;
            Some(Imbalance::Force { direction, force })
        });
        of_translations.or_else(|| {
            rotations.iter().find_map(|screw| {
                let (axis, point) = (Vector3::from(screw.axis), Vector3::from(screw.point));
                let moment = work_in(&|position| screw.pitch * axis + axis.cross(&(position - point)))?;
                Some(Imbalance::Moment { axis: screw.axis, point: screw.point, moment })
            })
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fem::mesh::shapes::cuboid;

    #[test]
    fn only_forces_that_work_in_free_modes_are_out_of_balance() {
        let mesh = cuboid([2, 1, 1], [2.0, 1.0, 1.0]).unwrap();
        let held = |node: [f64; 3], components: [bool; 3]| {
            let node = mesh.nearest_node(node).0;
            let held: Vec<[bool; 3]> =
                (0..mesh.nodes().len()).map(|k| if k == node { components } else { [false; 3] }).collect();
            Restraint::of_components(&mesh, &held)
        };
        let pair = |first: ([f64; 3], [f64; 3]), second: ([f64; 3], [f64; 3])| {
            let mut forces = vec![[0.0; 3]; mesh.nodes().len()];
            for (at, force) in [first, second] {
                forces[mesh.nearest_node(at).0] = force;
            }
            forces
        };
        let pull = pair(([0.0; 3], [-2.0, 0.0, 0.0]), ([2.0, 0.0, 0.0], [2.0, 0.0, 0.0]));
        let couple = pair(([0.0; 3], [0.0, -2.0, 0.0]), ([2.0, 0.0, 0.0], [0.0, 2.0, 0.0]));
        let push = pair(([0.0; 3], [0.0, 0.0, 0.5]), ([2.0, 0.0, 0.0], [0.0, 0.0, 1.0]));
        let text = |restraints: &[Restraint], forces: &[[f64; 3]]| {
            imbalance(&mesh, restraints, &[], forces).map(|found| found.to_string())
        };
        assert_eq!(text(&[], &pull), None);
        assert_eq!(text(&[], &push).as_deref(), Some("a force of 1.500e0 N along z"));
        let moment = text(&[], &couple).unwrap();
        assert!(moment.starts_with("a moment of 4.000e0 N m about the axis through ("), "{moment}");
        assert!(moment.ends_with("along z"), "{moment}");
        // A hinge about z at the origin: the couple turns the body, and the force along z meets a support.
        let hinge = [held([0.0; 3], [true; 3]), held([0.0, 0.0, 1.0], [true, true, false])].concat();
        let expected = "a moment of 4.000e0 N m about the axis through (0, 0, 0.5) along z";
        assert_eq!(text(&hinge, &couple).as_deref(), Some(expected));
        assert_eq!(text(&hinge, &pull), None);
        assert_eq!(text(&hinge, &push), None);
    }
}
