//! Element types of the Gmsh format.

/// The treatment of an element type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ElementTreatment {
    /// Points and lines, with this number of nodes: skipped.
    Ignored(usize),
    Triangle,
    Tetrahedron,
}

/// Returns the treatment of an element type number.
///
/// # Errors
/// Returns the name and a cure if the type is not supported.
pub(super) fn treatment(number: i32) -> Result<ElementTreatment, (String, &'static str)> {
    match number {
        15 => Ok(ElementTreatment::Ignored(1)),
        1 => Ok(ElementTreatment::Ignored(2)),
        2 => Ok(ElementTreatment::Triangle),
        4 => Ok(ElementTreatment::Tetrahedron),
        _ => Err(unsupported(number)),
    }
}

/// Returns the name of an unsupported element type and a cure.
fn unsupported(number: i32) -> (String, &'static str) {
    const LINEAR: &str = "export the mesh with element order 1 (in Gmsh: Mesh.ElementOrder = 1)";
    const SIMPLICES: &str =
        "mesh the body with tetrahedra only (in Gmsh: no recombination, no transfinite or extruded hexahedra)";
    const UNKNOWN: &str = "the file is damaged or of a newer version: export it again from Gmsh";
    let (name, order, cure) = match number {
        3 => ("4-node quadrangles", 1, SIMPLICES),
        5 => ("8-node hexahedra", 1, SIMPLICES),
        6 => ("6-node prisms", 1, SIMPLICES),
        7 => ("5-node pyramids", 1, SIMPLICES),
        8 => ("3-node lines", 2, LINEAR),
        9 => ("6-node triangles", 2, LINEAR),
        10 => ("9-node quadrangles", 2, SIMPLICES),
        11 => ("10-node tetrahedra", 2, LINEAR),
        12 => ("27-node hexahedra", 2, SIMPLICES),
        13 => ("18-node prisms", 2, SIMPLICES),
        14 => ("14-node pyramids", 2, SIMPLICES),
        16 => ("8-node quadrangles", 2, SIMPLICES),
        17 => ("20-node hexahedra", 2, SIMPLICES),
        18 => ("15-node prisms", 2, SIMPLICES),
        19 => ("13-node pyramids", 2, SIMPLICES),
        20 => ("9-node triangles", 3, LINEAR),
        21 => ("10-node triangles", 3, LINEAR),
        22 => ("12-node triangles", 4, LINEAR),
        23 => ("15-node triangles", 4, LINEAR),
        24 => ("15-node triangles", 5, LINEAR),
        25 => ("21-node triangles", 5, LINEAR),
        26 => ("4-node lines", 3, LINEAR),
        27 => ("5-node lines", 4, LINEAR),
        28 => ("6-node lines", 5, LINEAR),
        29 => ("20-node tetrahedra", 3, LINEAR),
        30 => ("35-node tetrahedra", 4, LINEAR),
        31 => ("56-node tetrahedra", 5, LINEAR),
        92 => ("64-node hexahedra", 3, SIMPLICES),
        93 => ("125-node hexahedra", 4, SIMPLICES),
        _ => return (format!("elements of type {number}"), UNKNOWN),
    };
    (format!("{name} (order {order}, element type {number})"), cure)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_points_lines_triangles_and_tetrahedra_are_accepted() {
        let accepted: Vec<i32> = (-5..200).filter(|&number| treatment(number).is_ok()).collect();
        assert_eq!(accepted, [1, 2, 4, 15]);
        assert_eq!(treatment(11).unwrap_err().0, "10-node tetrahedra (order 2, element type 11)");
        assert_eq!(treatment(77).unwrap_err().0, "elements of type 77");
    }
}
