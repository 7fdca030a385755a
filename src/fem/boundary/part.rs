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

#[cfg(test)]
mod tests {
    use nalgebra::{Rotation3, Vector3};

    use super::super::*;
    use crate::fem::mesh::{Division, Excerpt, ExcerptElements, shapes};

    /// Conditions of all kinds on the box from the origin to (4, 3, 2).
    fn conditions() -> Vec<Conditions> {
        let held = |surface: &str, displacement| SurfaceCondition {
            surface: surface.into(),
            displacement,
            curve: LoadCurve::Ramp,
        };
        let point = |place, displacement| PointCondition { place, displacement, curve: LoadCurve::Ramp };
        let corner = PointLocation::Nearest([4.0, 3.0, 2.1]);
        let pressure = |surface: &str| -> Arc<dyn LoadCondition> {
            Arc::new(Pressure { surface: surface.into(), value: 7.0, curve: LoadCurve::Ramp })
        };
        let weight = BodyForce { region: "*".into(), value: [0.0, 1.0, -10.0], curve: LoadCurve::Ramp };
        let rigid = RigidCondition {
            surface: "x1".into(),
            reference: None,
            displacement: [Some(0.1.into()), Some(0.0.into()), Some(0.0.into())],
            rotation: [0.0; 3].map(|angle: f64| Some(angle.into())),
        };
        vec![
            Conditions {
                surfaces: vec![held("x0", [Some(0.0); 3]), held("y0", [None, Some(0.0), None])],
                points: vec![point(corner, [None; 3]), point(PointLocation::Node(73), [Some(0.2), None, None])],
                loads: vec![
                    Arc::new(Traction { surface: "x1".into(), value: [4.0, -2.0, 0.5], curve: LoadCurve::Ramp }),
                    pressure("y1"),
                    Arc::new(Foundation { surface: "z0".into(), normal: 5.0, tangential: 0.5 }),
                    Arc::new(weight),
                    Arc::new(PointLoad { point: 0, place: corner, value: [1.0, 2.0, 3.0], curve: LoadCurve::Ramp }),
                ],
                ..Conditions::default()
            },
            Conditions {
                symmetry_planes: vec!["y0".into(), "z0".into()],
                rigid: vec![rigid],
                surfaces: vec![held("x0", [Some(0.0), None, None])],
                ..Conditions::default()
            },
            Conditions { loads: vec![pressure("z0"), pressure("z1")], hold_free_modes: true, ..Conditions::default() },
        ]
    }

    /// Conditions that a rank resolves on its excerpt are those of the whole body on its part, bit for bit.
    #[test]
    fn conditions_on_an_excerpt_are_those_on_the_whole_mesh() {
        let frame = Rotation3::from_euler_angles(0.3, -0.2, 0.5);
        for inclined in [false, true] {
            let mut mesh = shapes::cuboid([6, 4, 4], [4.0, 3.0, 2.0]).unwrap();
            if inclined {
                let turned = mesh.nodes().iter().map(|&x| (frame * Vector3::from(x)).into()).collect();
                let (regions, surfaces) = (mesh.regions().to_vec(), mesh.surfaces().to_vec());
                let region_of = mesh.region_of().to_vec();
                mesh = Mesh::new(turned, mesh.elements().clone(), region_of, regions, surfaces).unwrap();
            }
            for mut conditions in conditions() {
                if inclined {
                    // These would leave the inclined planes.
                    conditions.rigid.clear();
                    conditions.surfaces.clear();
                }
                let whole = Boundary::new(&mesh, &conditions).unwrap();
                let supports: Vec<_> = whole.free_mode_supports().collect();
                assert_eq!(supports.is_empty(), !conditions.hold_free_modes);
                let elements = mesh.elements().len();
                for ranks in [2, 5] {
                    let rank_of = (0..elements).map(|element| (element * ranks / elements) as u32).collect();
                    let division = Division::new(&mesh, rank_of, ranks, whole.node_groups());
                    let points = whole.point_nodes().iter().copied().flatten();
                    let of_excerpts = ExcerptElements::new(&mesh, &division, points);
                    for rank in 0..ranks {
                        let excerpt = Excerpt::new(&mesh, &division, rank, &of_excerpts);
                        let resolved = Boundary::on_excerpt(excerpt.mesh(), &conditions, &supports).unwrap();
                        let found = resolved.on_part(&excerpt.part().1).unwrap();
                        let part = mesh.divided(&division, rank);
                        let expected = whole.on_part(part.part().unwrap()).unwrap();
                        assert_eq!(format!("{found:?}"), format!("{expected:?}"), "rank {rank} of {ranks}");
                    }
                }
            }
        }
    }
}
