//! Runs with every kind of load: pressure, elastic foundation, forces on nodes; adaptive increments.

use std::path::Path;

use biotissue::fem::mesh::{Mesh, gmsh, shapes};

use crate::line;
use crate::variants::{CONSTANTS, loads, logged_steps, run_every_way};

/// A box on springs, loaded by a pressure that rises and falls and by a force on a corner.
fn case(material: &str, steps: &str) -> String {
    format!(
        r#"
        [mesh]
        generate = {{ shape = "box", cells = [2, 1, 1], size = [1.0, 0.5, 0.5] }}
        [[region]]
        name = "*"
        material = {material}
        [[boundary]]
        surface = "x0"
        foundation = {{ normal = 2.0e4, tangential = 5.0e3 }}
        [[boundary]]
        surface = "y1"
        pressure = 80.0
        curve = [[0.0, 0.0], [0.3, 1.0], [1.0, 0.5]]
        [[boundary]]
        surface = "x1"
        traction = [30.0, 0.0, 0.0]
        [[point]]
        at = [1.0, 0.5, 0.5]
        force = [0.0, 0.0, 4.0]
        [steps]
        count = 4
        {steps}
        "#
    )
}

#[test]
fn loads_that_follow_the_body_do_not_depend_on_ranks_rves_or_interruptions() {
    for steps in ["", "adaptive = { target_iterations = 3, largest = 0.5 }"] {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        run_every_way(folder, 4, |material| case(material, steps));
        let found = loads(folder, "formula");
        let last = found.rows.last().unwrap();
        let column = |name: &str| found.names.surfaces.iter().position(|surface| surface == name).unwrap();
        let force = |name: &str| last.surfaces[column(name)].force;
        // The dead loads: 30 Pa on 0.25 m^2, and 4 N.
        assert!((force("x1")[0] - 7.5).abs() < 1e-12 && last.points[0] == [0.0, 0.0, 4.0]);
        // At the end, 40 Pa press on 0.5 m^2, whose normal has hardly turned.
        assert!((force("y1")[1] + 20.0).abs() < 1.0, "{:?}", force("y1"));
        // The springs carry all loads.
        let held: [f64; 3] = std::array::from_fn(|i| force("x1")[i] + force("y1")[i] + last.points[0][i]);
        for (spring, load) in force("x0").iter().zip(held) {
            assert!((spring + load).abs() < 1e-6, "{spring} {load}");
        }
        let steps = logged_steps(folder, "formula");
        assert!(steps.iter().all(|step| step.balance.relative < 1e-7));
        // The pressure peaks inside the second step.
        assert!(steps[1].increments >= 2, "{:?}", steps[1]);
    }
}

#[test]
fn a_body_that_nothing_supports_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let text = case(&format!("{{ {CONSTANTS} }}"), "").replace("tangential = 5.0e3", "tangential = 0.0");
    std::fs::write(folder.path().join("case.toml"), text).unwrap();
    let refused = line(folder.path(), "check case.toml");
    assert!(refused.failed(2).contains("free to move along y and z and to rotate about x"), "{}", refused.stderr);
}

/// A bar twisted by a rigid grip, which a traction pulls along its free direction.
pub fn twisted(material: &str, mesh: &str) -> String {
    format!(
        r#"
        [mesh]
        {mesh}
        [[region]]
        name = "*"
        material = {material}
        [[boundary]]
        surface = "x0"
        symmetry = true
        [[boundary]]
        surface = "x0"
        displacement = {{ y = 0.0, z = 0.0 }}
        [[boundary]]
        surface = "x1"
        rigid = {{ reference = [1.0, 0.25, 0.25], displacement = {{ y = 0.0, z = 0.0 }}, rotation = {{ x = 0.6, y = 0.0, z = 0.0 }} }}
        curve = [[0.0, 0.0], [0.5, 1.0], [1.0, 1.5]]
        [[boundary]]
        surface = "x1"
        traction = [50.0, 0.0, 0.0]
        [steps]
        count = 4
        "#
    )
}

/// Writes `inclined.msh`: a box that is turned about z.
pub fn write_inclined_box(folder: &Path, cells: [usize; 3]) {
    let mesh = shapes::cuboid(cells, [1.0, 0.7, 0.5]).unwrap();
    let (sin, cos) = 0.5_f64.sin_cos();
    let nodes = mesh.nodes().iter().map(|&[x, y, z]| [cos * x - sin * y, sin * x + cos * y, z]).collect();
    let (elements, regions) = (mesh.elements().clone(), mesh.regions().to_vec());
    let mesh = Mesh::new(nodes, elements, mesh.region_of().to_vec(), regions, mesh.surfaces().to_vec()).unwrap();
    gmsh::write(&folder.join("inclined.msh"), &mesh).unwrap();
}

/// The box of [`write_inclined_box`] on two inclined planes of symmetry, pulled and sheared.
pub fn inclined(material: &str) -> String {
    format!(
        r#"
        [mesh]
        file = "inclined.msh"
        [[region]]
        name = "*"
        material = {material}
        [[boundary]]
        surface = "x0"
        symmetry = true
        [[boundary]]
        surface = "y0"
        symmetry = true
        [[boundary]]
        surface = "z0"
        displacement = {{ z = 0.0 }}
        [[boundary]]
        surface = "x1"
        traction = [200.0, 90.0, 30.0]
        [steps]
        count = 2
        "#
    )
}

#[test]
fn a_twisted_bar_does_not_depend_on_ranks_rves_or_interruptions() {
    for element in ["tet4", "hex8"] {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        let mesh = format!(
            "generate = {{ shape = \"box\", cells = [3, 1, 1], size = [1.0, 0.5, 0.5], element = \"{element}\" }}"
        );
        run_every_way(folder, 4, |material| twisted(material, &mesh));
        line(folder, "report parts").done();
        let page = std::fs::read_to_string(folder.join("parts/report.html")).unwrap();
        assert!(page.contains("moment in N m") && page.contains("size of the force in N"), "{element}");
        let found = loads(folder, "formula");
        assert_eq!(found.names.rigid, ["x1"]);
        let last = &found.rows[3];
        let grip = last.rigid[0];
        assert!((grip.rotation[0] - 0.9).abs() < 1e-15 && grip.rotation[1..] == [0.0; 2], "{:?}", grip.rotation);
        assert!(grip.moment[0] > 1.0 && grip.displacement[0].abs() > 1e-4, "{grip:?}");
        let force = last.surfaces[found.names.surfaces.iter().position(|surface| surface == "x1").unwrap()].force;
        assert!((force[0] - 12.5).abs() < 1e-6, "the traction alone acts along the free direction: {force:?}");
    }
}

#[test]
fn a_body_without_supports_is_held_against_rigid_motions_if_its_loads_balance() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let text = format!(
        r#"
        [mesh]
        generate = {{ shape = "box", cells = [2, 1, 1], size = [1.0, 0.5, 0.5] }}
        [body]
        free = "rigid"
        [[region]]
        name = "*"
        material = {{ {CONSTANTS} }}
        [[boundary]]
        surface = "x0"
        traction = [-100.0, 0.0, 0.0]
        [[boundary]]
        surface = "x1"
        traction = [100.0, 0.0, 0.0]
        [steps]
        count = 2
        "#
    );
    std::fs::write(folder.join("case.toml"), &text).unwrap();
    let checked = line(folder, "check case.toml");
    let checked = checked.done();
    assert_eq!(checked.matches("\nsupport    ").count(), 6, "{}", checked);
    assert!(
        checked.contains("\ncondition  surface \"x1\" (2 faces, 2.5000e-1 m^2): traction x, up to 100 Pa ("),
        "{checked}"
    );
    assert!(checked.contains("\nfree       surfaces y0 ("), "{checked}");
    line(folder, "run case.toml --out out").done();
    let row = &loads(folder, "out").rows[1];
    assert!((row.surfaces[1].force[0] - 25.0).abs() < 1e-12, "{row:?}");
    // More on one side than on the other.
    std::fs::write(folder.join("case.toml"), text.replace("[100.0,", "[100.01,")).unwrap();
    let failed = line(folder, "run case.toml --out other");
    assert!(failed.failed(3).contains("do not balance on the deformed body"), "{}", failed.stderr);
    let warned = line(folder, "check case.toml");
    warned.done();
    let expected = "case.toml: `free = \"rigid\"` in [body]: the loads at t = 0.5 do not balance, they exert a force of 1.250e-3 N \
                    along x on the undeformed body, and nothing holds it there: correct the loads, or hold it by a [[boundary]] or \
                    [[point]]\n";
    assert!(warned.stderr.contains(expected), "{}", warned.stderr);
}

/// Dead tractions of the stress `P` balance at rest if `P` is symmetric, but on the deformed body only if `P F^T` is: a
/// pull along x beside a shear needs a rotation, which the supports prevent.
#[test]
fn loads_that_balance_only_at_rest_end_the_run() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let loads = [("x0", "-300, -100"), ("x1", "300, 100"), ("y0", "-100, 0"), ("y1", "100, 0")];
    let boundaries =
        loads.map(|(surface, force)| format!("[[boundary]]\nsurface = \"{surface}\"\ntraction = [{force}, 0]\n"));
    let text = format!(
        "[mesh]\ngenerate = {{ shape = \"box\", cells = [2, 2, 2], size = [1, 1, 1] }}\n[body]\nfree = \"rigid\"\n\
         [[region]]\nname = \"*\"\nmaterial = {{ {CONSTANTS} }}\n{}",
        boundaries.concat()
    );
    std::fs::write(folder.join("case.toml"), text).unwrap();
    let checked = line(folder, "check case.toml");
    checked.done();
    assert_eq!(checked.stderr, "");
    let failed = line(folder, "run case.toml");
    assert!(failed.failed(3).contains("do not balance on the deformed body"), "{}", failed.stderr);
}

/// Conditions that contradict the mesh or each other, with the exact errors.
#[test]
fn contradictory_planes_and_rigid_surfaces_are_reported_with_line_and_cure() {
    let folder = tempfile::tempdir().unwrap();
    write_bent_box(&folder.path().join("bent.msh"));
    let head = format!("[[region]]\nname = \"*\"\nmaterial = {{ {CONSTANTS} }}\n");
    let tube =
        "[mesh]\ngenerate = { shape = \"tube\", cells = [1, 8, 1], inner_radius = 1, outer_radius = 2, length = 1 }\n";
    let block = "[mesh]\ngenerate = { shape = \"box\", cells = [1, 1, 1], size = [1, 1, 1] }\n";
    let held = &format!("{block}[body]\nfree = \"rigid\"\n");
    let boundary = |surface: &str, load: &str| format!("[[boundary]]\nsurface = \"{surface}\"\n{load}\n");
    let cases = [
        (
            tube,
            boundary("inner", "symmetry = true"),
            "case.toml:6: surface `inner` is not one plane: its faces point to opposite sides\n  \
             expected: a plane surface, of any orientation\n  \
             cure: name each plane of the surface as a physical group of its own\n",
        ),
        (
            "[mesh]\nfile = \"bent.msh\"\n",
            boundary("z1", "symmetry = true"),
            "case.toml:6: surface `z1` is not one plane: a node is 7.500e-3 m away from the mean plane, and the surface extends over \
             1.414e0 m\n  \
             expected: a plane surface, of any orientation, up to the rounding of coordinates to 6 digits\n  \
             cure: name each plane of the surface as a physical group of its own; if it is one plane, place its nodes more exactly\n",
        ),
        (
            block,
            boundary("x0", "symmetry = true") + &boundary("x0", "displacement = { x = 0.1 }"),
            "case.toml:9: node 0 is given two x-displacements: 1e-1 m by surface `x0` and 0e0 m by surface `x0` (times their curves)\n  \
             expected: each displacement component of a node prescribed once, or alike\n  \
             cure: the two surfaces or points share a node: leave the component out of one of the two\n",
        ),
        (
            block,
            boundary("x1", "rigid = { displacement = { x = 0.1 } }") + &boundary("y0", "displacement = { y = 0.0 }"),
            "case.toml:6: node 1 belongs to the rigid surface `x1`, but also to surface `y0`, which prescribes its y-displacement\n  \
             expected: nodes whose other conditions hold only components that the rigid surface holds: displacement 0 along \
             them, and rotation 0 about the other two axes\n  \
             cure: prescribe these components of `rigid` (beside a plane of symmetry along x: its displacement x and rotations y and z, \
             all 0), or leave the nodes out of one of the two surfaces\n",
        ),
        (
            block,
            boundary("x1", "rigid = { rotation = { x = 7.0 } }"),
            "case.toml:6: surface `x1` is turned by 7.0000 rad while a component of its rotation vector is free; at 2 pi, \
             rotations about all axes coincide\n  \
             expected: a rotation below 2 pi rad, or all three components prescribed\n  \
             cure: prescribe all components of `rotation`, such as 0.0 for the others\n",
        ),
        (
            held,
            boundary("x0", "rigid = { displacement = { x = 0.0, y = 0.0 }, rotation = { x = 0.0, y = 0.0, z = 0.0 } }")
                + &boundary("x1", "rigid = {}"),
            "case.toml: the body is free to move along z\n  \
             expected: prescribed displacements that prevent rigid-body motions of every connected part of the body\n  \
             cure: `free = \"rigid\"` adds no supports to nodes of rigid surfaces and of inclined planes of symmetry: hold the \
             motion that is named by a component of `rigid`, a [[boundary]] or a [[point]]\n",
        ),
    ];
    for (mesh, boundaries, expected) in cases {
        std::fs::write(folder.path().join("case.toml"), format!("{mesh}{head}{boundaries}")).unwrap();
        let checked = line(folder.path(), "check case.toml");
        let message = checked.failed(2);
        assert!(message.contains(expected), "{message}\nexpected:\n{expected}");
    }
}

/// Writes a box whose upper side bulges.
fn write_bent_box(path: &Path) {
    let mesh = shapes::cuboid([2, 2, 2], [1.0; 3]).unwrap();
    let bent = |&[x, y, z]: &[f64; 3]| [x, y, if [x, y, z] == [0.5, 0.5, 1.0] { 1.01 } else { z }];
    let nodes = mesh.nodes().iter().map(bent).collect();
    let (elements, regions) = (mesh.elements().clone(), mesh.regions().to_vec());
    let mesh = Mesh::new(nodes, elements, mesh.region_of().to_vec(), regions, mesh.surfaces().to_vec()).unwrap();
    gmsh::write(path, &mesh).unwrap();
}
