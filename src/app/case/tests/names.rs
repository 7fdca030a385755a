//! Comparison of names with those of a mesh.

use super::super::*;
use super::{FULL, Folder, SMALL};

fn names(list: &[&str]) -> Vec<String> {
    list.iter().map(|name| (*name).to_string()).collect()
}

#[test]
fn known_names_pass_and_the_star_covers_the_rest() {
    let case = Folder::new().parse(FULL).unwrap().case;
    case.check_names(&names(&["grip", "gauge"]), &names(&["left", "right", "sides"])).unwrap();
    let clash = case.check_names(&names(&["grip", "gauge", "lumen"]), &names(&["left", "right"])).unwrap_err();
    let clash = clash.to_string();
    assert!(clash.contains("pull.toml:48: the constraint has the name of region \"lumen\" of the mesh"), "{clash}");
    assert!(matches!(case.material_of("gauge"), Some(RegionMaterial::FiberRve(_))));
    assert!(matches!(case.material_of("grip"), Some(RegionMaterial::Formula(_))));
}

#[test]
fn all_wrong_names_are_reported_with_the_nearest() {
    let mut case = Folder::new().parse(FULL).unwrap().case;
    case.file = "pull.toml".into();
    case.regions.truncate(1);
    let text = case.check_names(&names(&["guage", "grip"]), &names(&["lefft", "x1"])).unwrap_err().to_string();
    let MeshSource::File(mesh) = &case.mesh else { panic!("{:?}", case.mesh) };
    let mesh = mesh.display();
    let no_right = format!(
        "the mesh {mesh} has no surface \"right\"
  expected: a surface of the mesh: \"lefft\" or \"x1\"
  cure: choose one of these, or name it in the mesh as a physical group; Gmsh leaves out groups without elements"
    );
    let expected = format!(
        "pull.toml:7: the mesh {mesh} has no region \"gauge\"
  expected: a region of the mesh: \"guage\" or \"grip\"
  cure: did you mean \"guage\"?
pull.toml:22: the mesh {mesh} has no surface \"left\"
  expected: a surface of the mesh: \"lefft\" or \"x1\"
  cure: did you mean \"lefft\"?
pull.toml:25: {no_right}
pull.toml:29: {no_right}
pull.toml:41: the mesh {mesh} has no region \"gauge\"
  expected: a region of the mesh: \"guage\" or \"grip\"
  cure: did you mean \"guage\"?
pull.toml:45: the mesh {mesh} has no region \"gauge\"
  expected: a region of the mesh: \"guage\" or \"grip\"
  cure: did you mean \"guage\"?
pull.toml:48: the mesh {mesh} has no surface \"left\"
  expected: a surface of the mesh: \"lefft\" or \"x1\"
  cure: did you mean \"lefft\"?
pull.toml:48: {no_right}
pull.toml: region \"guage\" of the mesh {mesh} has no material
  expected: a [[region]] for every region of the mesh, or one of name \"*\" for the rest
  cure: add [[region]] with name = \"guage\" and its material
pull.toml: region \"grip\" of the mesh {mesh} has no material
  expected: a [[region]] for every region of the mesh, or one of name \"*\" for the rest
  cure: add [[region]] with name = \"grip\" and its material"
    );
    assert_eq!(text, expected);
    assert_eq!(case.material_of("grip"), None);
}

#[test]
fn name_of_the_other_kind_and_mesh_without_surfaces() {
    let text = format!("{SMALL}[[boundary]]\nsurface = \"body\"\ntraction = [0, 0, 1]\n");
    let mut case = Folder::new().parse(&text).unwrap().case;
    case.file = "pull.toml".into();
    let text = case.check_names(&names(&["body"]), &[]).unwrap_err().to_string();
    let expected = "pull.toml:6: the mesh has no surface \"body\"
  expected: a surface of the mesh, which has none
  cure: \"body\" is a region of the mesh: name a surface";
    assert_eq!(text, expected);
}
