//! Runs on meshes of every element type: an RVE at every integration point, resumed runs, ranks, and output.

use std::path::Path;

use biotissue::app::results::read_fields;
use biotissue::fem::element::ElementType;
use biotissue::fem::mesh::{gmsh, shapes};

use crate::line;

const CONSTANTS: &str = "model = \"neo-hookean\", shear_modulus = 1000.0, poisson_ratio = 0.3";

/// A bent box of elements of one type, whose material is `material`, in two steps.
fn case(material: &str, rve: &str) -> String {
    format!(
        "[mesh]\nfile = \"box.msh\"\n[[region]]\nname = \"*\"\nmaterial = {material}\n\
         [[boundary]]\nsurface = \"x0\"\ndisplacement = {{ x = 0.0, y = 0.0, z = 0.0 }}\n\
         [[boundary]]\nsurface = \"x1\"\ndisplacement = {{ x = 0.1, y = 0.05, z = 0.0 }}\n\
         [steps]\ncount = 2\n[output]\n{rve}\n"
    )
}

fn mesh(folder: &Path, element_type: ElementType) {
    let cells = if element_type == ElementType::Tet10 { [1, 1, 1] } else { [2, 1, 1] };
    gmsh::write(&folder.join("box.msh"), &shapes::cuboid_of(element_type, cells, [1.0, 0.5, 0.5]).unwrap()).unwrap();
}

fn read(folder: &Path, name: &str) -> String {
    std::fs::read_to_string(folder.join(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
}

/// A mesh of order 2 that a case generates equals that of a file; meshes without such a form are reported.
#[test]
fn a_case_chooses_elements_and_their_order() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let formula = case(&format!("{{ {CONSTANTS} }}"), "");
    let boxed = |element: &str| {
        format!("generate = {{ shape = \"box\", cells = [2, 1, 1], size = [1.0, 0.5, 0.5], element = \"{element}\" }}")
    };
    for (element_type, linear, order) in [
        (ElementType::Hex20, "hex8", "order = 2"),
        (ElementType::Hex27, "hex8", "order = 2\nhexahedra = 27"),
        (ElementType::Wedge6, "wedge6", "order = 1"),
    ] {
        mesh(folder, element_type);
        std::fs::write(folder.join("file.toml"), &formula).unwrap();
        let generated = formula.replace("file = \"box.msh\"", &format!("{}\n{order}", boxed(linear)));
        std::fs::write(folder.join("generated.toml"), generated).unwrap();
        line(folder, "run file.toml --out file").done();
        line(folder, "run generated.toml --out generated").done();
        assert_eq!(read(folder, "generated/loads.csv"), read(folder, "file/loads.csv"), "{element_type:?}");
        line(folder, "run generated/case.toml --out again").done();
        let plan = line(folder, "check generated.toml");
        let count = if element_type == ElementType::Wedge6 { 4 } else { 2 };
        let points = count * element_type.points();
        let types = format!("elements   {count} {}; {points} integration points", element_type.name());
        assert!(plan.done().contains(&types), "{}", plan.stdout);
    }
    std::fs::write(folder.join("file.toml"), formula.replace("box.msh\"", "box.msh\"\norder = 2")).unwrap();
    let refused = line(folder, "check file.toml");
    assert!(
        refused.failed(2).contains("file.toml:3: `order = 2`, but element 0 of the mesh is a wedge"),
        "{}",
        refused.stderr
    );
    mesh(folder, ElementType::Tet10);
    let refused = line(folder, "check file.toml");
    assert!(
        refused.failed(2).contains("file.toml:3: `order = 2`, but element 0 of the mesh (tet10) is of order 2"),
        "{}",
        refused.stderr
    );
}

/// RVEs of matrix alone give the history of the formula bit for bit, on any number of ranks.
#[test]
fn an_rve_at_every_point_reproduces_the_formula() {
    for element_type in ElementType::ALL {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        mesh(folder, element_type);
        let rve = format!("{{ model = \"fiber-rve\", networks = [], matrix = {{ {CONSTANTS} }} }}");
        std::fs::write(folder.join("formula.toml"), case(&format!("{{ {CONSTANTS} }}"), "")).unwrap();
        std::fs::write(folder.join("rve.toml"), case(&rve, "")).unwrap();
        line(folder, "run formula.toml --out formula").done();
        line(folder, "run rve.toml --out rve").done();
        line(folder, "run rve.toml --out ranks --ranks 3").done();
        let formula = read(folder, "formula/loads.csv");
        assert_eq!(read(folder, "rve/loads.csv"), formula, "{element_type:?}");
        assert_eq!(read(folder, "ranks/loads.csv"), formula, "{element_type:?}");
        let [one, several] = ["formula/fields-00002.vtu", "ranks/fields-00002.vtu"]
            .map(|name| read_fields(&folder.join(name)).unwrap_or_else(|error| panic!("{error}")));
        assert!(one.elements.typed().all(|(found, _)| found == element_type));
        assert_eq!((one.points, one.elements), (several.points, several.elements));
        assert_eq!(one.point_vectors, several.point_vectors);
        assert_eq!(one.cell_tensors, several.cell_tensors);
    }
}

/// The networks of all points of an element are written, and a resumed run continues bit for bit.
#[test]
fn points_have_networks_of_their_own_and_runs_are_resumed() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    mesh(folder, ElementType::Tet10);
    line(folder, "network generate --kind delaunay --points 30 --seed 1 -o net-1.txt").done();
    line(folder, "network generate --kind delaunay --points 30 --seed 2 -o net-2.txt").done();
    let fibers = format!(
        "{{ model = \"fiber-rve\", networks = [\"net-*.txt\"], fiber_volume_fraction = 0.003, law = {{ name = \"linear\", \
         youngs_modulus = 1.0e6, radius = 5.0e-8 }}, matrix = {{ {CONSTANTS} }} }}"
    );
    std::fs::write(folder.join("case.toml"), case(&fibers, "rve = [2]")).unwrap();
    line(folder, "run case.toml --out whole").done();
    let whole = read(folder, "whole/loads.csv");
    line(folder, "run case.toml --out parts").done();
    std::fs::remove_file(folder.join("parts/checkpoint/step-00002.bin")).unwrap();
    line(folder, "run case.toml --out parts --resume").done();
    assert_eq!(read(folder, "parts/loads.csv"), whole);
    for point in 0..4 {
        assert!(folder.join(format!("whole/rve/element-00002-point-{point:02}-step-00002.vtp")).exists());
        assert!(folder.join(format!("whole/rve/element-00002-point-{point:02}.pvd")).exists());
    }
    line(folder, "run case.toml --out ranks --ranks 3").done();
    assert_eq!(read(folder, "ranks/loads.csv"), whole);
    let report = line(folder, "report whole --picture body.svg");
    report.done();
    assert!(read(folder, "body.svg").contains("<svg"));
}

/// With `f_bar`, an RVE at every point gives the history of the formula on any number of ranks, a resumed run continues
/// bit for bit, and a body without linear tetrahedra or hexahedra is reported.
#[test]
fn regions_with_f_bar_run_on_ranks_and_are_resumed() {
    let constants = "model = \"neo-hookean\", shear_modulus = 1000.0, poisson_ratio = 0.499";
    let f_bar = |material: &str| case(material, "").replace("name = \"*\"", "name = \"*\"\nf_bar = true");
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    std::fs::write(folder.join("formula.toml"), f_bar(&format!("{{ {constants} }}"))).unwrap();
    std::fs::write(folder.join("plain.toml"), case(&format!("{{ {constants} }}"), "")).unwrap();
    let rve = f_bar(&format!("{{ model = \"fiber-rve\", networks = [], matrix = {{ {constants} }} }}"));
    std::fs::write(folder.join("rve.toml"), rve).unwrap();
    for element_type in [ElementType::Tet4, ElementType::Hex8] {
        mesh(folder, element_type);
        let plan = line(folder, "check plain.toml");
        plan.done();
        assert!(plan.stderr.contains("lock at a Poisson ratio of 0.499"), "{}", plan.stderr);
        let name = element_type.name();
        line(folder, &format!("run formula.toml --out formula-{name}")).done();
        line(folder, &format!("run rve.toml --out rve-{name}")).done();
        line(folder, &format!("run rve.toml --out ranks-{name} --ranks 3")).done();
        line(folder, &format!("run plain.toml --out plain-{name}")).done();
        let formula = read(folder, &format!("formula-{name}/loads.csv"));
        assert_eq!(read(folder, &format!("rve-{name}/loads.csv")), formula, "{name}");
        assert_eq!(read(folder, &format!("ranks-{name}/loads.csv")), formula, "{name}");
        assert_ne!(read(folder, &format!("plain-{name}/loads.csv")), formula, "{name}");
        std::fs::remove_file(folder.join(format!("rve-{name}/checkpoint/step-00002.bin"))).unwrap();
        line(folder, &format!("run rve.toml --out rve-{name} --resume")).done();
        assert_eq!(read(folder, &format!("rve-{name}/loads.csv")), formula, "{name}");
    }
    mesh(folder, ElementType::Wedge6);
    let refused = line(folder, "check formula.toml");
    let expected = "formula.toml:3: the region \"*\" has `f_bar`, but none of its elements can use it";
    assert!(refused.failed(2).contains(expected), "{}", refused.stderr);
}

/// Every formula of finite strain gives the same history as a material and as the matrix of RVEs without networks.
#[test]
fn every_formula_is_a_material_and_a_matrix() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    mesh(folder, ElementType::Tet10);
    let formulas = [
        "model = \"holmes-mow\", youngs_modulus = 1000.0, poisson_ratio = 0.3, beta = 0.5",
        "model = \"transversely-isotropic\", youngs_modulus = 1000.0, poisson_ratio = 0.2, axial_youngs_modulus = 4000.0, \
         axial_shear_modulus = 600.0, axis = [1.0, 1.0, 0.0]",
        "model = \"holzapfel-gasser-ogden\", shear_modulus = 300.0, k1 = 200.0, k2 = 0.8, dispersion = 0.1, \
         bulk_modulus = 2000.0, axes = [[0.8, 0.6, 0.0], [0.8, -0.6, 0.0]]",
        "model = \"guccione\", c = 200.0, bf = 8.0, bt = 2.0, bfs = 4.0, bulk_modulus = 2000.0, axis = [1.0, 0.0, 0.0]",
    ];
    let mut histories: Vec<String> = Vec::new();
    for (number, formula) in formulas.into_iter().enumerate() {
        let rve = format!("{{ model = \"fiber-rve\", networks = [], matrix = {{ {formula} }} }}");
        std::fs::write(folder.join("formula.toml"), case(&format!("{{ {formula} }}"), "")).unwrap();
        std::fs::write(folder.join("rve.toml"), case(&rve, "")).unwrap();
        line(folder, &format!("run formula.toml --out formula-{number}")).done();
        line(folder, &format!("run rve.toml --out rve-{number} --ranks 2")).done();
        let history = read(folder, &format!("formula-{number}/loads.csv"));
        assert_eq!(read(folder, &format!("rve-{number}/loads.csv")), history, "{formula}");
        assert!(!histories.contains(&history), "{formula}");
        histories.push(history);
    }
}
