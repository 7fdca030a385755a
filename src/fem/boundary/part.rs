//! Boundary conditions on a part of a mesh.

use std::sync::Arc;

use super::skew::SkewNode;
use super::{Boundary, Indivisible, PrescribedComponent};
use crate::fem::kinematics::Kinematics;
use crate::fem::mesh::Part;

impl Boundary {
    /// Returns the conditions on a part of the mesh that they were resolved on. Prescribed displacements are those of all
    /// nodes of the part, ghosts included; reactions and point conditions those of its own nodes.
    ///
    /// # Errors
    /// Returns [`Indivisible`] if there are rigid surfaces, whose nodes may belong to several ranks, or a load that cannot
    /// be divided.
    pub fn on_part(&self, part: &Part) -> Result<Self, Indivisible> {
        if !self.rigid.is_empty() {
            return Err(Indivisible);
        }
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
        let frames = skew_nodes.iter().map(|node| (node.node, node.frame)).collect();
        let loads = self.loads.iter().filter_map(|load| load.on_part(part).transpose());
        Ok(Self {
            prescribed_components: self.prescribed_components.iter().filter_map(component).collect(),
            skew_nodes,
            rigid: Vec::new(),
            kinematics: Arc::new(Kinematics::new(part.nodes.len(), frames, Vec::new())),
            loads: loads.collect::<Result<_, _>>()?,
            point_nodes: self.point_nodes.iter().map(|node| part.own_node((*node)?)).collect(),
        })
    }
}
