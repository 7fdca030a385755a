//! The rigid-body motions of a body that its boundary conditions leave free, and supports against them.

use nalgebra::Vector3;

use super::{Boundary, PrescribedComponent, Source};
use crate::fem::mesh::Mesh;
use crate::fem::rigid_modes::{self, Imbalance, Restraint};

impl Boundary {
    /// Adds the fewest zero displacements that leave no free rigid-body mode.
    pub(super) fn hold_free_modes(&mut self, mesh: &Mesh) {
        let mask = self.prescribed_mask(mesh.nodes().len());
        let is_free =
            |node: u32, component: usize| self.kinematics.are_plain(&[node]) && !mask[node as usize][component];
        let restraints = self.restraints(mesh);
        let supports = rigid_modes::minimal_supports(mesh, &restraints, self.kinematics.rigid_surfaces(), is_free);
        self.hold(mesh, supports.into_iter().map(|(node, component)| (node, component as u8)));
    }

    /// Adds zero displacements of these nodes and components, which are free.
    pub(super) fn hold(&mut self, mesh: &Mesh, supports: impl Iterator<Item = (u32, u8)>) {
        let supports = supports.map(|(node, component)| PrescribedComponent::support(mesh, node, component));
        self.prescribed_components.extend(supports);
        self.prescribed_components.sort_by_key(|component| (component.node, component.component));
    }

    /// Returns the node and component of each support that [`Conditions::hold_free_modes`](super::Conditions::hold_free_modes)
    /// adds.
    pub fn free_mode_supports(&self) -> impl Iterator<Item = (u32, u8)> {
        let supports = self.prescribed_components.iter().filter(|component| component.source == Source::FreeMode);
        supports.map(|component| (component.node, component.component))
    }

    /// Returns the conditions on rigid-body motions that follow from prescribed displacements, rigid surfaces, and
    /// loads that support the body.
    ///
    /// # Panics
    /// Panics if the mesh is not that of the conditions.
    pub fn restraints(&self, mesh: &Mesh) -> Vec<Restraint> {
        self.restraints_by(mesh, |_| true)
    }

    /// Returns the first free rigid-body mode in which the loads at pseudo-time `t` do work on the undeformed body, if
    /// [`Conditions::hold_free_modes`](super::Conditions::hold_free_modes) was set; the supports that it adds would have to balance them.
    ///
    /// # Panics
    /// Panics if the mesh is not that of the conditions.
    pub fn imbalance(&self, mesh: &Mesh, t: f64) -> Option<Imbalance> {
        self.free_mode_supports().next()?;
        let zeros = vec![[0.0; 3]; mesh.nodes().len()];
        let mut forces = zeros.clone();
        self.loads.iter().for_each(|load| load.add_forces(t, &zeros, &mut forces));
        let restraints = self.restraints_by(mesh, |component| component.source != Source::FreeMode);
        rigid_modes::imbalance(mesh, &restraints, self.kinematics.rigid_surfaces(), &forces)
    }

    /// Returns the restraints, of prescribed components only those that are chosen.
    fn restraints_by(&self, mesh: &Mesh, is_chosen: impl Fn(&PrescribedComponent) -> bool) -> Vec<Restraint> {
        let at = |node: u32| mesh.nodes()[node as usize];
        let along = |node: u32, direction: [f64; 3]| Restraint::Displacement { node, point: at(node), direction };
        let components = self.prescribed_components.iter().filter(|component| is_chosen(component));
        let mut all: Vec<Restraint> = components
            .map(|prescribed| {
                Restraint::component(prescribed.node, at(prescribed.node), usize::from(prescribed.component))
            })
            .collect();
        for skew in &self.skew_nodes {
            all.extend(skew.directions().map(|direction| along(skew.node, direction.into())));
        }
        for rigid in &self.rigid {
            let Some(&node) = rigid.surface.nodes.first() else { continue };
            for k in (0..6).filter(|&k| rigid.prescribed()[k]) {
                let axis = Vector3::ith(k % 3, 1.0).into();
                let point = rigid.surface.reference;
                all.push(if k < 3 {
                    Restraint::Displacement { node, point, direction: axis }
                } else {
                    Restraint::Rotation { node, axis }
                });
            }
        }
        all.extend(self.supports().map(|support| along(support.node, support.direction)));
        all
    }
}
