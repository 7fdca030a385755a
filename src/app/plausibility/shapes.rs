//! Elements of poor shape.

use super::at;
use crate::app::case::Case;
use crate::fem::mesh::{ElementQuality, Mesh};

/// Elements of a quality ([`Mesh::element_qualities`]) below this are reported. A regular tetrahedron or a cube that is
/// flattened to 1/58 of its height has this quality, and so has a sliver, four nodes near the corners of a square, of
/// 1/80 of their diagonal in height.
const LEAST_QUALITY: f64 = 0.1;

/// Finds flat and very long elements, which spoil the condition of the stiffness and the accuracy around them.
pub(super) fn check_shapes(case: &Case, mesh: &Mesh) -> Option<String> {
    let qualities = mesh.element_qualities();
    let ElementQuality { minimum, worst, .. } =
        ElementQuality::of(&qualities).filter(|of| of.minimum < LEAST_QUALITY)?;
    let poor = qualities.iter().filter(|quality| **quality < LEAST_QUALITY).count();
    let (is, all) = (if poor == 1 { "is" } else { "are" }, qualities.len());
    let [x, y, z] = mesh.center(worst);
    let message = format!(
        "{poor} of {all} elements {is} nearly flat, or very long, with a quality below {LEAST_QUALITY} (mean ratio; 1 is \
         ideal): the worst is element {worst} at ({x:.4e}, {y:.4e}, {z:.4e}) m, with {minimum:.1e}; optimize the mesh \
         in the mesh generator"
    );
    Some(at(case, case.mesh_line, &message))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::app::plausibility::tests::CASE;
    use crate::fem::mesh::shapes::cuboid;

    #[test]
    fn slivers_are_counted_and_the_worst_one_is_named() {
        let case = Case::parse(CASE, Path::new("case.toml")).unwrap().case;
        let mesh = cuboid([3, 1, 1], [3.0, 1.0, 1.0]).unwrap();
        assert_eq!(check_shapes(&case, &mesh), None);
        // A node on a face of the first tetrahedron of a chain, up to 1/1000 of an edge, and one less near to another.
        let nodes =
            vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.3, 0.3, 1.0], [0.3, 0.3, -1e-3], [1.0, 1.0, 2e-2]];
        let elements = vec![[0, 1, 2, 3], [0, 2, 1, 4], [1, 5, 2, 3]];
        let mesh = Mesh::new(nodes, elements, vec![0; 3], vec!["body".into()], Vec::new()).unwrap();
        let expected = "case.toml:2: 1 of 3 elements is nearly flat, or very long, with a quality below 0.1 (mean ratio; \
                        1 is ideal): the worst is element 1 at (3.2500e-1, 3.2500e-1, -2.5000e-4) m, with 1.4e-2; \
                        optimize the mesh in the mesh generator";
        assert_eq!(check_shapes(&case, &mesh).as_deref(), Some(expected));
    }
}
