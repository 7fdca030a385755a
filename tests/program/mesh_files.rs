//! Meshes of other programs.

use std::path::Path;

use biotissue::app::results::Loads;

use crate::{beside, line};

fn case(mesh: &str, region: &str, surface: &str) -> String {
    format!(
        "[mesh]\nfile = \"{mesh}\"\n[[region]]\nname = \"{region}\"\n\
         material = {{ model = \"neo-hookean\", youngs_modulus = 1e4, poisson_ratio = 0.3 }}\n\
         [[boundary]]\nsurface = \"{surface}\"\ndisplacement = {{ x = 0.0, y = 0.0, z = 0.0 }}\n\
         [[body_force]]\nregion = \"*\"\nvalue = [10.0, 0.0, 20.0]\n[steps]\ncount = 1\n"
    )
}

fn forces(folder: &Path, file: &str, region: &str, surface: &str) -> Vec<f64> {
    std::fs::write(folder.join("case.toml"), case(file, region, surface)).unwrap();
    line(folder, "run case.toml --out out").done();
    let loads = Loads::read(&folder.join("out/loads.csv")).unwrap_or_else(|error| panic!("{error}"));
    let row = loads.rows.last().unwrap();
    let column = loads.names.surfaces.iter().position(|name| name == surface).unwrap();
    let of_surface = &row.surfaces[column];
    of_surface.force.iter().chain(&[of_surface.area]).copied().collect()
}

/// A curved body of tetrahedra of order 2 has the same weight, and the same surface, in every format.
#[test]
fn meshes_of_all_formats_give_the_same_forces() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    std::fs::copy(beside("data/gmsh/ring_tet10_4.1_text.msh"), folder.join("ring.msh")).unwrap();
    for ending in ["inp", "mesh", "feb"] {
        let from = beside("data/mesh_files").join(format!("ring_tet10.{ending}"));
        std::fs::copy(from, folder.join(format!("ring.{ending}"))).unwrap();
    }
    let expected = forces(folder, "ring.msh", "ring", "base");
    // The weight of a quarter of a ring of the radii 1 and 2 and the height 0.5, up to the error of quadratic edges.
    let weight = 20.0 * 0.125 * std::f64::consts::PI * 3.0;
    assert!((expected[2].abs() / weight - 1.0).abs() < 1e-2, "{expected:?} {weight}");
    for (ending, region, surface) in
        [("inp", "ring", "base"), ("feb", "ring", "base"), ("mesh", "region_1", "surface_2")]
    {
        let found = forces(folder, &format!("ring.{ending}"), region, surface);
        for (found, expected) in found.iter().zip(&expected) {
            assert!((found - expected).abs() < 1e-9 * weight, "{ending}: {found} {expected}");
        }
    }
    for (ending, cure) in
        [("inp", "*SURFACE, *NSET"), ("feb", "<Surface>"), ("mesh", "`surface_1` for the reference 1")]
    {
        std::fs::write(folder.join("case.toml"), case(&format!("ring.{ending}"), "*", "top")).unwrap();
        let refused = line(folder, "check case.toml");
        assert!(
            refused.failed(2).contains("has no surface \"top\"") && refused.stderr.contains(cure),
            "{}",
            refused.stderr
        );
    }
}

#[test]
fn other_formats_are_named_with_their_cure() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for (name, text, cure) in [
        ("a.stl", "solid a\n", "mesh its inside"),
        ("a.vtk", "# vtk DataFile Version 3.0\n", "save it as .vtu"),
        ("a.step", "ISO-10303-21;\n", "mesh it with Gmsh"),
        ("a.k", "*KEYWORD\n", "meshio convert"),
    ] {
        std::fs::write(folder.join(name), text).unwrap();
        std::fs::write(folder.join("case.toml"), case(name, "*", "top")).unwrap();
        let refused = line(folder, "check case.toml");
        let block = refused.failed(2);
        assert!(block.contains(cure) && block.contains("VTK (.vtu), Abaqus (.inp), Medit (.mesh) or FEBio"), "{block}");
    }
}
