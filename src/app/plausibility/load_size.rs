//! The size of a load relative to the stiffness of the material on which it acts.

use std::collections::HashSet;

use serde::Serialize;

use super::{Stiffness, short};
use crate::app::case::Case;
use crate::fem::element::CellType;
use crate::fem::mesh::Mesh;

/// A traction, pressure, point force or body force, compared with the softest material on which it acts.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LoadSize {
    /// The condition of the case.
    #[serde(skip)]
    pub of: LoadOf,
    /// The largest component at any time: Pa, of a point force N, of a body force N/m^3; expressions are sampled.
    pub largest: f64,
    /// Its unit.
    pub unit: &'static str,
    /// The region of the case with the softest material on which it acts.
    pub softest_region: String,
    /// Young's modulus of this material at rest, Pa; of an RVE, that of its matrix and of its network, as if that
    /// were isotropic and moved with the body.
    pub stiffness: f64,
    /// The ratio of the load to the stiffness; a body force is multiplied by the longest edge of the body, a point force divided
    /// by the volume of the body over that edge.
    pub ratio: f64,
}

/// A condition of a case: its index among those of its kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LoadOf {
    /// A boundary.
    Boundary(usize),
    /// A point.
    Point(usize),
    /// A body force.
    BodyForce(usize),
}

impl LoadSize {
    /// Describes the size, such as `up to 2.5e4 Pa (0.08 of the stiffness)`.
    pub fn text(&self) -> String {
        format!("up to {} {} ({} of the stiffness)", short(self.largest), self.unit, short(self.ratio))
    }
}

/// Returns the softest of these materials in some regions of the mesh.
pub(super) fn softest_in<'a>(
    stiffnesses: &'a [Stiffness],
    case: &Case,
    mesh: &Mesh,
    is_in: impl Fn(usize) -> bool,
) -> Option<&'a Stiffness> {
    let regions: Vec<usize> = (mesh.regions().iter().enumerate())
        .filter(|(number, _)| is_in(*number))
        .filter_map(|(_, name)| case.region_of(name))
        .collect();
    let on_these = stiffnesses.iter().filter(|stiffness| regions.contains(&stiffness.region));
    on_these.min_by(|a, b| a.total().total_cmp(&b.total()))
}

/// Returns, for each region of the mesh, whether an element of it has a face of this surface.
pub(super) fn regions_behind(mesh: &Mesh, surface: &str) -> Vec<bool> {
    let Some(surface) = mesh.surfaces().iter().find(|other| other.name == surface) else {
        return vec![false; mesh.regions().len()];
    };
    if mesh.regions().len() == 1 {
        return vec![true];
    }
    let mut is_on_surface = vec![false; mesh.nodes().len()];
    let mut faces = HashSet::new();
    for (face_type, nodes) in surface.faces.typed() {
        let corners = &nodes[..face_type.corners()];
        corners.iter().for_each(|&node| is_on_surface[node as usize] = true);
        faces.insert(sorted(corners.iter().copied()));
    }
    let mut behind = vec![false; mesh.regions().len()];
    for ((element_type, nodes), &region) in mesh.elements().typed().zip(mesh.region_of()) {
        let region = &mut behind[region as usize];
        if *region || nodes.iter().filter(|node| is_on_surface[**node as usize]).count() < 3 {
            continue;
        }
        let mut sides = element_type.face_corners().iter();
        *region = sides.any(|face| faces.contains(&sorted(face.iter().map(|&corner| nodes[corner]))));
    }
    behind
}

/// Returns the corners of a face in ascending order.
fn sorted(corners: impl Iterator<Item = u32>) -> Vec<u32> {
    let mut corners: Vec<u32> = corners.collect();
    corners.sort_unstable();
    corners
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::app::plausibility::tests::CASE;
    use crate::app::plausibility::{Plausibility, check_magnitudes};
    use crate::fem::mesh::shapes::cuboid;

    /// A box of two regions, of which the one at x = 0 is soft.
    fn two_regions() -> Mesh {
        let mesh = cuboid([2, 1, 1], [2.0, 1.0, 1.0]).unwrap();
        let region_of = (0..mesh.elements().len()).map(|element| u32::from(mesh.center(element)[0] > 1.0)).collect();
        let names = vec!["soft".into(), "hard".into()];
        Mesh::new(mesh.nodes().to_vec(), mesh.elements().clone(), region_of, names, mesh.surfaces().to_vec()).unwrap()
    }

    #[test]
    fn a_load_is_compared_with_the_material_on_which_it_acts() {
        let mesh = two_regions();
        assert_eq!(regions_behind(&mesh, "x0"), [true, false]);
        assert_eq!(regions_behind(&mesh, "x1"), [false, true]);
        assert_eq!(regions_behind(&mesh, "y0"), [true, true]);
        assert_eq!(regions_behind(&mesh, "none"), [false, false]);
        let text = format!(
            "{}[[point]]\nat = [0, 0, 0]\nforce = [0, -50, 0]\n[[body_force]]\nregion = \"*\"\nvalue = [0, 0, -100]\n[[boundary]]\nsurface = \"y0\"\npressure = -500\n",
            CASE.replace("name = \"*\"", "name = \"soft\"")
                .replace("displacement = { x = 0.1 }", "traction = [0, 4e3, 0]")
        );
        let text = text.replace(
            "[[boundary]]\nsurface = \"x0\"",
            "[[region]]\nname = \"hard\"\nmaterial = { model = \"neo-hookean\", shear_modulus = 1e6, poisson_ratio = 0.25 }\n\
             [[boundary]]\nsurface = \"x0\"",
        );
        let case = Case::parse(&text, Path::new("case.toml")).unwrap_or_else(|errors| panic!("{errors}")).case;
        let stiffness = |region, modulus| Stiffness { region, formula: Some([modulus; 2]), fibers: None };
        let Plausibility { loads, warnings } = check_magnitudes(&case, &mesh, &[stiffness(0, 1e3), stiffness(1, 1e6)]);
        assert!(warnings.is_empty(), "{warnings:?}");
        let found: Vec<_> = loads.iter().map(|load| (load.of, &*load.softest_region, load.ratio)).collect();
        // The body force acts over 2 m, the point force on 1 m^2.
        let expected = [
            (LoadOf::Boundary(1), "hard", 4e-3),
            (LoadOf::Boundary(2), "soft", 0.5),
            (LoadOf::Point(0), "soft", 0.05),
            (LoadOf::BodyForce(0), "soft", 0.2),
        ];
        assert_eq!(found, expected);
        assert_eq!(loads[0].text(), "up to 4000 Pa (4.0e-3 of the stiffness)");
        assert_eq!(loads[2].text(), "up to 50 N (0.05 of the stiffness)");
        assert_eq!(loads[3].text(), "up to 100 N/m^3 (0.2 of the stiffness)");
        let soft = check_magnitudes(&case, &mesh, &[stiffness(0, 1e3), stiffness(1, 1e3)]);
        assert_eq!(soft.warnings.len(), 1);
        assert!(soft.warnings[0].ends_with("the stiffness of the region \"hard\", about 1000 Pa: are both in Pa?"));
    }
}
