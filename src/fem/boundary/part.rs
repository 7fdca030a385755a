//! Boundary conditions on a part of a mesh.

use std::sync::Arc;

use super::rigid::ResolvedRigid;
use super::skew::SkewNode;
use super::{Boundary, Indivisible, PrescribedComponent};
use crate::fem::kinematics::Kinematics;
use crate::fem::mesh::Part;

impl Boundary {
    /// Returns the conditions on a part of the mesh that they were resolved on. All nodes of a rigid surface belong to one
    /// rank ([`Boundary::node_groups`]); others hold those of their ghosts. Prescribed displacements are those of all
    /// nodes of the part, ghosts included; reactions and point conditions those of its own nodes.
    ///
    /// # Errors
    /// Returns [`Indivisible`] if there is a load that cannot be divided.
    pub fn on_part(&self, part: &Part) -> Result<Self, Indivisible> {
        let component = |component: &PrescribedComponent| {
            let mut of_part = component.clone();
            of_part.node = part.local_node(component.node)?;
            Some(of_part)
        };
        let skew = |skew: &SkewNode| {
            let mut of_part = skew.clone();
            of_part.node = part.local_node(skew.node)?;
            Some(of_part)
        };
        let skew_nodes: Vec<SkewNode> = self.skew_nodes.iter().filter_map(skew).collect();
        let rigid = self.rigid.iter().map(|rigid| rigid.on_part(part));
        let rigid: Vec<ResolvedRigid> = rigid.collect();
        let surfaces = rigid.iter().map(|rigid| rigid.surface.clone()).collect();
        let frames = skew_nodes.iter().map(|node| (node.node, node.frame)).collect();
        let loads = self.loads.iter().filter_map(|load| load.on_part(part).transpose());
        Ok(Self {
            prescribed_components: self.prescribed_components.iter().filter_map(component).collect(),
            skew_nodes,
            kinematics: Arc::new(Kinematics::new(part.nodes.len(), frames, surfaces)),
            rigid,
            loads: loads.collect::<Result<_, _>>()?,
            point_nodes: self.point_nodes.iter().map(|node| part.own_node((*node)?)).collect(),
        })
    }

    /// Returns the groups of nodes that must belong to one rank: those of each rigid surface, which share unknowns.
    pub fn node_groups(&self) -> impl Iterator<Item = &[u32]> {
        self.rigid.iter().map(|rigid| rigid.surface.nodes.as_slice())
    }
}
