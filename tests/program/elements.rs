//! Runs on meshes of every element type: an RVE at every integration point, resumed runs, ranks, and output.

use std::path::Path;

use biotissue::app::results::{PointValues, read_fields, read_points};
use biotissue::fem::element::ElementType;
use biotissue::fem::mesh::{gmsh, shapes};

use crate::{beside, frozen, line};

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

/// Values at the integration points agree with those of the elements; resumed runs and several ranks write the same
/// files, and a later run without them removes them.
#[test]
fn values_at_integration_points_are_written_for_every_element_type() {
    for element_type in ElementType::ALL {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        mesh(folder, element_type);
        let rve = format!("{{ model = \"fiber-rve\", networks = [], matrix = {{ {CONSTANTS} }} }}");
        std::fs::write(folder.join("case.toml"), case(&rve, "points = true")).unwrap();
        line(folder, "run case.toml --out whole").done();
        let points = read_points(&folder.join("whole/points-00002.vtu")).unwrap();
        let fields = read_fields(&folder.join("whole/fields-00002.vtu")).unwrap();
        let numbering = gmsh::read(&folder.join("box.msh")).unwrap().mesh;
        assert_eq!(points.positions, numbering.at_points(numbering.nodes()), "{element_type:?}");
        let volumes = points.numbers("volume").unwrap();
        assert!((volumes.iter().sum::<f64>() - 0.25).abs() < 1e-14, "{element_type:?}");
        assert_eq!(points.numbers("displacement").unwrap().len(), 3 * volumes.len());
        for (name, of_elements) in
            ["cauchy_stress", "deformation_gradient"].map(|name| (name, fields.cell_tensor(name).unwrap()))
        {
            let values = points.numbers(name).unwrap().as_chunks::<9>().0;
            for (element, expected) in of_elements.iter().enumerate() {
                let own = numbering.points().of_element(element);
                let total: f64 = volumes[own.clone()].iter().sum();
                for (k, expected) in expected.iter().enumerate() {
                    let mean = own.clone().map(|point| volumes[point] * values[point][k]).sum::<f64>() / total;
                    assert!((mean - expected).abs() <= 1e-12 * (1.0 + expected.abs()), "{element_type:?} {name}");
                }
            }
        }
        let elements = points.integers("element").unwrap();
        assert!((0..volumes.len()).all(|k| elements[k] == i64::from(numbering.points().locate(k).element)));

        // A resumed run repeats the second step; its collection lists the points again even if it was lost.
        line(folder, "run case.toml --out parts").done();
        std::fs::remove_file(folder.join("parts/checkpoint/step-00002.bin")).unwrap();
        std::fs::remove_file(folder.join("parts/points-00002.vtu")).unwrap();
        if element_type == ElementType::Hex8 {
            std::fs::remove_file(folder.join("parts/points.pvd")).unwrap();
        }
        let resumed = line(folder, "run case.toml --out parts --resume");
        resumed.done();
        let is_lost = resumed.stderr.contains("points.pvd: does not list a file of points of the run");
        assert_eq!(is_lost, element_type == ElementType::Hex8, "{}", resumed.stderr);
        for name in ["loads.csv", "points.pvd", "fields.pvd"] {
            assert_eq!(
                read(folder, &format!("parts/{name}")),
                read(folder, &format!("whole/{name}")),
                "{element_type:?}"
            );
        }
        let bytes = |name: &str| std::fs::read(folder.join(name)).unwrap();
        for name in ["points-00001.vtu", "points-00002.vtu", "fields-00002.vtu"] {
            assert!(bytes(&format!("parts/{name}")) == bytes(&format!("whole/{name}")), "{element_type:?} {name}");
        }
        line(folder, "report whole").done();
        assert!(read(folder, "whole/report.html").contains("<svg"));

        line(folder, "run case.toml --out ranks --ranks 2").done();
        let ranks = read_points(&folder.join("ranks/points-00002.vtu")).unwrap();
        assert_eq!((&ranks.positions, &ranks.numbers), (&points.positions, &points.numbers), "{element_type:?}");
        assert_eq!(ranks.integers("rve_status"), points.integers("rve_status"));

        // A body of two ranks is written in two pieces, whose points follow one another.
        let divided = case(&rve, "points = true\n[scales]\nmacro = 2\nmicro = 1");
        std::fs::write(folder.join("divided.toml"), divided).unwrap();
        line(folder, "run divided.toml --out divided").done();
        assert!(read(folder, "divided/points.pvd").contains("points-00002.pvtu"));
        let divided = read_points(&folder.join("divided/points-00002.pvtu")).unwrap();
        assert_eq!(divided.positions.len(), points.positions.len());
        for (k, &element) in divided.integers("element").unwrap().iter().enumerate() {
            let point = divided.integers("point").unwrap()[k] as usize;
            let place = numbering.points().of_element(element as usize).start + point;
            assert_eq!(divided.positions[k], points.positions[place], "{element_type:?}");
            let energy = |values: &PointValues, k: usize| values.numbers("energy_density").unwrap()[k];
            let (one, other) = (energy(&points, place), energy(&divided, k));
            assert!((one - other).abs() <= 1e-9 * one, "{element_type:?}: {one} {other}");
        }

        std::fs::write(folder.join("case.toml"), case(&rve, "")).unwrap();
        for out in ["parts", "divided"] {
            line(folder, &format!("run case.toml --out {out}")).done();
            let left = std::fs::read_dir(folder.join(out)).unwrap().map(|entry| entry.unwrap().file_name());
            assert!(left.into_iter().all(|name| !name.to_string_lossy().starts_with("points")), "{element_type:?}");
        }
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

/// A mesh in a `.vtu` file runs as the same mesh in a Gmsh file; names of groups are numbers.
#[test]
fn a_vtu_file_is_a_mesh() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let data = beside("data");
    for name in ["tet10", "hex8", "hex20", "wedge6", "hex27"] {
        std::fs::copy(data.join(format!("gmsh/ring_{name}_4.1_text.msh")), folder.join("ring.msh")).unwrap();
        std::fs::copy(data.join(format!("vtu/ring_{name}_zlib.vtu")), folder.join("ring.vtu")).unwrap();
        let text = |file: &str, region: &str, surface: &str| {
            format!(
                "[mesh]\nfile = \"{file}\"\n[[region]]\nname = \"{region}\"\nmaterial = {{ {CONSTANTS} }}\n\
                 [[boundary]]\nsurface = \"{surface}\"\ndisplacement = {{ x = 0.0, y = 0.0, z = 0.0 }}\n\
                 [[body_force]]\nregion = \"*\"\nvalue = [10.0, 0.0, 20.0]\n[steps]\ncount = 1\n"
            )
        };
        std::fs::write(folder.join("gmsh.toml"), text("ring.msh", "ring", "base")).unwrap();
        std::fs::write(folder.join("vtu.toml"), text("ring.vtu", "region_2", "surface_1")).unwrap();
        line(folder, "check vtu.toml").done();
        line(folder, "run gmsh.toml --out gmsh").done();
        line(folder, "run vtu.toml --out vtu").done();
        let [gmsh, vtu] = ["gmsh", "vtu"].map(|out| read_fields(&folder.join(out).join("fields-00001.vtu")).unwrap());
        assert_eq!(gmsh, vtu, "{name}");
        line(folder, "run vtu.toml --out vtu --resume").done();
        std::fs::write(folder.join("vtu.toml"), text("ring.vtu", "region_2", "base")).unwrap();
        let refused = line(folder, "check vtu.toml");
        for part in ["vtu.toml:6: the mesh ", "has no surface \"base\"", "\"surface_1\"", "integer array `region`"] {
            assert!(refused.failed(2).contains(part), "{}", refused.stderr);
        }
    }
    // Another mesh in the file is found by a resumed run.
    std::fs::write(folder.join("ring.msh"), "").unwrap();
    let text = std::fs::read_to_string(data.join("vtu/ring_hex27_text.vtu")).unwrap();
    std::fs::write(folder.join("ring.vtu"), text).unwrap();
    let case = read(folder, "vtu.toml").replace("\"base\"", "\"surface_1\"");
    std::fs::write(folder.join("vtu.toml"), case).unwrap();
    let refused = line(folder, "run vtu.toml --out vtu --resume");
    assert!(refused.failed(2).contains("the mesh differs"), "{}", refused.stderr);
}

/// RVEs at the points of elements are created, sleep and are deleted alike on any number of ranks and after a resumed
/// run; the status of an element in the fields is the highest of its points.
#[test]
fn rves_at_the_points_of_an_element_have_lives_of_their_own() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let material = format!(
        "{{ model = \"fiber-rve\", networks = [\"{}\"], fiber_volume_fraction = 0.003, law = {{ name = \"exponential\", \
         youngs_modulus = 1.0e6, radius = 5.0e-8, nonlinearity = 1.2 }}, matrix = {{ {CONSTANTS} }}, \
         life = {{ created_at = 0.022, asleep_below = 2e-3, deleted_at = 0.24 }} }}",
        frozen()
    );
    let text = case(&material, "points = true")
        .replace(
            "x = 0.1, y = 0.05, z = 0.0 }",
            "x = 0.2, y = 0.1 }\n\
        curve = [[0.0, 0.0], [0.2, 0.1], [0.4, 0.45], [0.6, 0.452], [0.8, 0.454], [1.0, 1.0]]",
        )
        .replace("count = 2", "count = 5");
    for element_type in [ElementType::Tet10, ElementType::Hex8] {
        mesh(folder, element_type);
        std::fs::write(folder.join("case.toml"), &text).unwrap();
        line(folder, "run case.toml --out whole").done();
        let status = |out: &str, step: usize| {
            read_points(&folder.join(format!("{out}/points-{step:05}.vtu")))
                .unwrap()
                .integers("rve_status")
                .unwrap()
                .to_vec()
        };
        let all: Vec<Vec<i64>> = (1..=5).map(|step| status("whole", step)).collect();
        let points = all[0].len();
        let count = |step: usize, status: i64| all[step - 1].iter().filter(|&&other| other == status).count();
        assert!((1..points).contains(&count(1, 2)), "{element_type:?}: some RVEs exist in step 1: {all:?}");
        assert_eq!(count(2, 2), 0, "{element_type:?}: all RVEs exist in step 2: {all:?}");
        assert!(count(4, 1) > 0, "{element_type:?}: some RVEs sleep while the load is constant: {all:?}");
        assert!((1..points).contains(&count(5, 3)), "{element_type:?}: some RVEs are deleted at the end: {all:?}");
        let numbering = gmsh::read(&folder.join("box.msh")).unwrap().mesh;
        let fields = read_fields(&folder.join("whole/fields-00005.vtu")).unwrap();
        let of_elements = fields.cell_integer("rve_status").unwrap();
        for (element, &highest) in of_elements.iter().enumerate() {
            let own = &all[4][numbering.points().of_element(element)];
            assert_eq!(own.iter().max(), Some(&highest));
        }
        let differ = |element: usize, statuses: &[i64]| {
            let own = &statuses[numbering.points().of_element(element)];
            own.iter().any(|status| *status != own[0])
        };
        let differ_in = |statuses: &Vec<i64>| (0..of_elements.len()).any(|element| differ(element, statuses));
        assert!(all.iter().any(differ_in), "{element_type:?}: points of one element differ: {all:?}");

        let loads = read(folder, "whole/loads.csv");
        line(folder, "run case.toml --out ranks --ranks 2").done();
        assert_eq!(read(folder, "ranks/loads.csv"), loads, "{element_type:?}");
        // Continued from a state in which RVEs sleep; the last step deletes others.
        std::fs::remove_file(folder.join("ranks/checkpoint/step-00005.bin")).unwrap();
        line(folder, "run case.toml --out ranks --resume").done();
        assert_eq!(read(folder, "ranks/loads.csv"), loads, "{element_type:?}");
        assert_eq!(status("ranks", 5), all[4], "{element_type:?}");
        line(folder, "report whole --picture body.svg").done();
    }
}
