//! Planes of symmetry: the mean plane of a surface whose nodes lie in a plane up to the rounding of their coordinates.

use nalgebra::Vector3;

use super::BoundaryError;
use super::rigid::centroid;
use crate::fem::mesh::Mesh;

/// The greatest distance of a node of a plane from the mean plane, as a part of the extent plus the largest coordinate.
///
/// Coordinates with 6 digits, as some programs write them, are wrong by up to `5e-6` of the coordinate, and a distance
/// from a plane by up to `sqrt(3)` times that, `9e-6` of the largest coordinate. Those in single precision are wrong by
/// `6e-8`. The extent counts as well, because the error of the mean plane itself grows with it.
const ROUNDING: f64 = 1e-5;
/// The greatest distance as a part of the extent, however far the surface is from the origin.
const FLAT: f64 = 1e-3;

/// The mean plane of a surface.
#[derive(Clone, Debug)]
pub(super) struct Plane {
    /// Index into [`Mesh::surfaces`].
    pub surface: usize,
    pub nodes: Vec<u32>,
    /// The unit normal: the mean normal of the faces, weighted by their areas. It depends on the edge of the surface alone,
    /// so that rounded positions of inner nodes do not change it.
    pub normal: Vector3<f64>,
    /// The centroid of the surface, m.
    centroid: Vector3<f64>,
    /// The diagonal of the box around the nodes, m.
    extent: f64,
    /// The greatest distance of a node from the plane that rounding may cause, m.
    rounding: f64,
}

impl Plane {
    /// Returns the mean plane of a plane surface.
    ///
    /// # Errors
    /// Returns [`BoundaryError::OppositeSides`] if the surface is closed, has faces that point against the mean normal, or
    /// has no face; [`BoundaryError::NotPlanar`] if its nodes do not lie in the mean plane.
    pub fn new(mesh: &Mesh, surface: usize) -> Result<Self, BoundaryError> {
        let of = &mesh.surfaces()[surface];
        let mut normals = Vec::new();
        for (face_type, nodes) in of.faces.typed() {
            face_type.integrate(&mesh.positions_of(nodes), |_, area| normals.push(Vector3::from(area)));
        }
        let sum: Vector3<f64> = normals.iter().sum();
        let total: f64 = normals.iter().map(Vector3::norm).sum();
        let opposite = || BoundaryError::OppositeSides { surface: of.name.clone() };
        // The mean of normals that point to all sides is rounding.
        let normal = sum.try_normalize(0.5 * total).ok_or_else(opposite)?;
        let (nodes, centroid) = (of.nodes(), Vector3::from(centroid(mesh, of)));
        let (extent, largest) = size(mesh, &nodes);
        let rounding = (ROUNDING * (extent + largest)).min(FLAT * extent);
        let plane = Self { surface, nodes, normal, centroid, extent, rounding };
        let distance = plane.farthest(mesh, &plane.nodes);
        if distance > rounding {
            return Err(BoundaryError::NotPlanar { surface: of.name.clone(), distance, extent });
        }
        if normals.iter().any(|face| face.dot(&normal) < 0.0) {
            return Err(opposite());
        }
        Ok(plane)
    }

    /// Returns the normal of the largest of the `planes` in which this one lies up to rounding, or its own. Surfaces that
    /// together form one plane so have one normal; with normals that differ by rounding, they would resist motions within
    /// the plane.
    pub fn common_normal(&self, mesh: &Mesh, planes: &[Self]) -> Vector3<f64> {
        let contains = |other: &&Self| other.farthest(mesh, &self.nodes) <= other.rounding + self.rounding;
        let larger = planes.iter().filter(|other| other.extent >= self.extent).filter(contains);
        // The first of those of one extent.
        let largest = larger.reduce(|best, other| if other.extent > best.extent { other } else { best });
        largest.unwrap_or(self).normal
    }

    /// Returns the greatest distance of a node from the plane, m.
    fn farthest(&self, mesh: &Mesh, nodes: &[u32]) -> f64 {
        let position = |node: u32| Vector3::from(mesh.nodes()[node as usize]);
        nodes.iter().map(|&node| self.normal.dot(&(position(node) - self.centroid)).abs()).fold(0.0, f64::max)
    }
}

/// Returns the diagonal of the box around the nodes, and the largest coordinate, m.
fn size(mesh: &Mesh, nodes: &[u32]) -> (f64, f64) {
    let (mut low, mut high) = (Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY));
    for &node in nodes {
        let position = Vector3::from(mesh.nodes()[node as usize]);
        (low, high) = (low.inf(&position), high.sup(&position));
    }
    ((high - low).norm(), low.amax().max(high.amax()))
}

#[cfg(test)]
mod tests {
    use nalgebra::Rotation3;

    use super::super::{Boundary, Conditions};
    use super::*;
    use crate::fem::element::ElementType;
    use crate::fem::mesh::{Surface, shapes};
    use crate::fem::rigid_modes;

    fn rebuilt(mesh: &Mesh, nodes: Vec<[f64; 3]>, surfaces: Vec<Surface>) -> Mesh {
        let (elements, regions) = (mesh.elements().clone(), mesh.regions().to_vec());
        Mesh::new(nodes, elements, mesh.region_of().to_vec(), regions, surfaces).unwrap()
    }

    fn moved(mesh: &Mesh, to: impl Fn(Vector3<f64>) -> [f64; 3]) -> Mesh {
        rebuilt(mesh, mesh.nodes().iter().map(|&x| to(x.into())).collect(), mesh.surfaces().to_vec())
    }

    fn with_surfaces(mesh: &Mesh, surfaces: Vec<Surface>) -> Mesh {
        rebuilt(mesh, mesh.nodes().to_vec(), surfaces)
    }

    fn number(mesh: &Mesh, name: &str) -> usize {
        mesh.surface_names().position(|known| known == name).unwrap()
    }

    fn faces(mesh: &Mesh, name: &str) -> Vec<[u32; 3]> {
        mesh.surfaces()[number(mesh, name)].faces.iter().map(|face| face.try_into().unwrap()).collect()
    }

    fn single(x: f64) -> f64 {
        f64::from(x as f32)
    }

    fn six_digits(x: f64) -> f64 {
        format!("{x:.5e}").parse().unwrap()
    }

    #[test]
    fn the_normal_of_an_inclined_plane_tolerates_rounded_coordinates() {
        let frame = Rotation3::from_axis_angle(&Vector3::z_axis(), 30.0_f64.to_radians());
        type Rounding = fn(f64) -> f64;
        // Cells, the offset in edges of the cube, and the error of the normal.
        let cases: [(usize, f64, Rounding, f64); 6] = [
            (40, 0.0, single, 1e-7),
            (10, 5.0, single, 1e-6),
            (10, 1e3, single, 1e-4),
            (10, 0.0, six_digits, 1e-5),
            (10, 5.0, six_digits, 1e-5),
            (10, 50.0, six_digits, 1e-4),
        ];
        for (cells, offset, rounded, accuracy) in cases {
            for element_type in [ElementType::Tet4, ElementType::Hex20] {
                let cells = if element_type == ElementType::Hex20 { cells.min(10) } else { cells };
                let size = [1.0, 1.0 / cells as f64, 1.0];
                let mesh = shapes::cuboid_of(element_type, [cells, 1, cells], size).unwrap();
                let mesh = moved(&mesh, |x| (frame * x).map(|x| rounded(x + offset)).into());
                for (name, axis) in [("y0", -Vector3::y()), ("y1", Vector3::y()), ("z1", Vector3::z())] {
                    let plane = Plane::new(&mesh, number(&mesh, name)).unwrap();
                    let error = (plane.normal - frame * axis).norm();
                    // A strip of one cell may tilt by more.
                    let accuracy = if name == "z1" { accuracy * cells as f64 } else { accuracy };
                    assert!(error < accuracy, "{name} {cells} {offset}: {error:e}");
                }
            }
        }
    }

    #[test]
    fn surfaces_that_are_not_plane_are_refused_with_the_distance_from_the_mean_plane() {
        let mesh = shapes::cuboid([4, 4, 4], [1.0; 3]).unwrap();
        let refused = |mesh: &Mesh| Plane::new(mesh, number(mesh, "z1")).map_err(|error| error.to_string());
        // A bulge with the height of the rounding of 6 digits, and a greater one.
        let bulge = |height: f64| {
            moved(&mesh, |x| {
                let top = (1.0 - (2.0 * x.x - 1.0).powi(2)) * x.z;
                [x.x, x.y, x.z + height * top]
            })
        };
        assert!(refused(&bulge(1e-5)).is_ok());
        let text = refused(&bulge(1e-3)).unwrap_err();
        let expected = "surface `z1` is not one plane: a node is 6.250e-4 m away from the mean plane, and the surface extends over \
                        1.414e0 m";
        assert_eq!(text, expected);
        // Far from the origin, where the rounding of 6 digits may be greater, a thousandth of the extent is the limit.
        assert!(refused(&moved(&bulge(1e-3), |x| (x.add_scalar(1e2)).into())).is_ok());
        assert!(refused(&moved(&bulge(1e-2), |x| (x.add_scalar(1e6)).into())).is_err());
    }

    #[test]
    fn two_planes_are_not_one() {
        let mesh = shapes::cuboid([2, 2, 2], [1.0; 3]).unwrap();
        let together = |names: [&str; 2]| {
            let faces = names.map(|name| faces(&mesh, name)).concat();
            let mesh = with_surfaces(&mesh, vec![Surface { name: "both".into(), faces: faces.into() }]);
            Plane::new(&mesh, 0).unwrap_err()
        };
        let corner = together(["x0", "y0"]);
        assert!(matches!(corner, BoundaryError::NotPlanar { distance, .. } if distance > 0.3), "{corner}");
        let opposite = together(["x0", "x1"]);
        assert_eq!(opposite, BoundaryError::OppositeSides { surface: "both".into() });
    }

    /// Two parts of an inclined plane leave the same unknowns and the same rigid motions free as the whole.
    #[test]
    fn parts_of_a_plane_with_rounded_coordinates_have_one_normal() {
        let frame = Rotation3::from_euler_angles(0.4, -0.7, 1.1);
        let mesh = shapes::cuboid([6, 6, 1], [1.0, 1.0, 0.2]).unwrap();
        let mesh = moved(&mesh, |x| (frame * x).map(|x| six_digits(x + 20.0)).into());
        let all = faces(&mesh, "z0");
        for count in [1, 30, 36, 50] {
            let (one, other) = all.split_at(count);
            let parts = [("one", one), ("other", other), ("all", &all)];
            let surfaces = parts.map(|(name, faces)| Surface { name: name.into(), faces: faces.to_vec().into() });
            let mesh = with_surfaces(&mesh, surfaces.to_vec());
            let resolved = |names: &[&str]| {
                let symmetry_planes = names.iter().map(|&name| name.to_owned()).collect();
                let conditions = Conditions { symmetry_planes, ..Conditions::default() };
                let boundary = Boundary::new(&mesh, &conditions).unwrap();
                let error = rigid_modes::check(&mesh, &boundary.restraints(&mesh), &[]).unwrap_err();
                let modes = &error.parts[0].free_modes;
                (boundary.free_unknowns(mesh.nodes().len()), modes.translations.len(), modes.rotations.len())
            };
            let (whole, divided) = (resolved(&["all"]), resolved(&["one", "other"]));
            assert!(whole == divided && (whole.1, whole.2) == (2, 1), "{count}: {divided:?} {whole:?}");
        }
    }
}
