//! The summary of a mesh.

use std::collections::BTreeMap;
use std::path::Path;

use biotissue::fem::element::CellType;
use biotissue::fem::mesh::{Faces, Mesh, Surface};

use crate::failure::Failure;
use crate::output;

/// Prints the summary of the mesh in a file, as a table or as JSON.
pub fn print(file: &Path, mesh: &Mesh, as_json: bool) -> Result<(), Failure> {
    if as_json { output::print_json(&json(file, mesh)) } else { output::print(&table(file, mesh)) }
}

fn table(file: &Path, mesh: &Mesh) -> String {
    let [low, high] = mesh.bounding_box();
    let [sharp, blunt] = mesh.dihedral_range();
    let mut lines = vec![
        format!("{}", file.display()),
        format!("  nodes     {:>10}", mesh.nodes().len()),
        format!("  elements  {:>10}   volume {:.6e} m^3", mesh.elements().len(), mesh.volume()),
        format!("  types     {}; {} integration points", types(mesh), mesh.points().len()),
        format!("  box       {low:?} to {high:?} m"),
        format!("  angles    {sharp:.1} to {blunt:.1} degrees between faces"),
    ];
    for (name, elements, volume) in regions(mesh) {
        lines.push(format!("  region    {name:<8} {elements:>10} elements    volume {volume:.6e} m^3"));
    }
    for surface in mesh.surfaces() {
        let Surface { name, faces } = surface;
        let area = mesh.surface_area(surface);
        lines.push(format!("  surface   {name:<8} {:>10} {:<11} area   {area:.6e} m^2", faces.len(), noun(faces)));
    }
    lines.join("\n")
}

/// Lists the elements by type.
fn types(mesh: &Mesh) -> String {
    let counts = mesh.elements().count_by_type();
    counts.iter().map(|(of, count)| format!("{count} {}", of.name())).collect::<Vec<_>>().join(", ")
}

fn json(file: &Path, mesh: &Mesh) -> serde_json::Value {
    let regions: Vec<_> = regions(mesh)
        .map(|(name, elements, volume)| serde_json::json!({ "name": name, "elements": elements, "volume": volume }))
        .collect();
    let surface = |surface: &Surface| {
        serde_json::json!({
            "name": surface.name,
            "triangles": surface.faces.typed().filter(|(face_type, _)| face_type.corners() == 3).count(),
            "quadrilaterals": surface.faces.typed().filter(|(face_type, _)| face_type.corners() == 4).count(),
            "area": mesh.surface_area(surface),
        })
    };
    serde_json::json!({
        "file": file.to_string_lossy(),
        "nodes": mesh.nodes().len(),
        "elements": mesh.elements().len(),
        "element_types": mesh.elements().count_by_type().iter().map(|(of, n)| (of.name(), *n)).collect::<BTreeMap<_, _>>(),
        "integration_points": mesh.points().len(),
        "volume": mesh.volume(),
        "bounding_box": mesh.bounding_box(),
        "dihedral_angles": mesh.dihedral_range(),
        "regions": regions,
        "surfaces": mesh.surfaces().iter().map(surface).collect::<Vec<_>>(),
    })
}

/// Returns `triangles`, `quadrilaterals`, or `faces` for both.
fn noun(faces: &Faces) -> &'static str {
    let mut nouns = faces.blocks().iter().map(|block| block.cell_type().nouns()[1]);
    nouns.next().filter(|first| nouns.all(|other| other == *first)).unwrap_or("faces")
}

/// Returns name, number of elements and volume of every region.
fn regions(mesh: &Mesh) -> impl Iterator<Item = (&str, usize, f64)> {
    (0..)
        .zip(mesh.regions().iter().zip(mesh.region_volumes()))
        .map(|(region, (name, volume))| (name.as_str(), mesh.elements_in(region).count(), volume))
}
