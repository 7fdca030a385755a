//! Bodies of every element type and of several types, on ranks of both scales, resumed, with all kinds of loads.

use std::path::Path;

use biotissue::app::results::{read_fields, read_points};
use biotissue::fem::element::ElementType;
use biotissue::fem::mesh::{Elements, Faces, Mesh, Surface, gmsh, shapes};

use crate::{frozen, line};

/// The name of a body, its mesh, and whether some of its elements can use F-bar.
type Body = (&'static str, Mesh, bool);

fn bodies() -> Vec<Body> {
    let of_one_type = ElementType::ALL.map(|element_type| {
        let cells = if element_type == ElementType::Tet10 { [1, 1, 1] } else { [2, 1, 1] };
        let mesh = shapes::cuboid_of(element_type, cells, [1.0, 0.5, 0.5]).unwrap();
        (element_type.name(), mesh, [ElementType::Tet4, ElementType::Hex8].contains(&element_type))
    });
    of_one_type.into_iter().chain([("mixed", mixed(), true)]).collect()
}

/// A box of hexahedra in `x < 1/2` and of wedges in the rest.
fn mixed() -> Mesh {
    let [hexahedra, wedges] = [ElementType::Hex8, ElementType::Wedge6]
        .map(|element_type| shapes::cuboid_of(element_type, [4, 1, 1], [1.0, 0.5, 0.5]).unwrap());
    let parts = [(&hexahedra, false), (&wedges, true)];
    let mut elements = Elements::default();
    for (mesh, is_upper) in parts {
        let own = mesh.elements().typed().enumerate().filter(|(e, _)| (mesh.center(*e)[0] > 0.5) == is_upper);
        own.for_each(|(_, (element_type, nodes))| elements.push(element_type, nodes));
    }
    let surface = |name: &str| {
        let mut faces = Faces::default();
        for (mesh, is_upper) in parts {
            for (face_type, nodes) in mesh.surface(name).unwrap().faces.typed() {
                let center = mesh.positions_of(nodes).iter().map(|x| x[0]).sum::<f64>() / nodes.len() as f64;
                if (center > 0.5) == is_upper {
                    faces.push(face_type, nodes);
                }
            }
        }
        Surface { name: name.into(), faces }
    };
    let (surfaces, region_of) = (["x0", "x1", "z0", "z1"].map(surface), vec![0; elements.len()]);
    Mesh::new(hexahedra.nodes().to_vec(), elements, region_of, vec!["body".into()], surfaces.into()).unwrap()
}

/// A body with a network and a matrix at every point, pressed on one side, on springs at the opposite one. RVEs are
/// created in both steps, and some are deleted in the second.
fn text(has_f_bar: bool, (above, below): (usize, usize)) -> String {
    format!(
        "[mesh]\nfile = \"body.msh\"\n[[region]]\nname = \"*\"\nf_bar = {has_f_bar}\n[region.material]\n\
         model = \"fiber-rve\"\nnetworks = [\"{}\"]\nfiber_volume_fraction = 0.003\n\
         law = {{ name = \"exponential\", youngs_modulus = 1.0e6, radius = 5.0e-8, nonlinearity = 1.2 }}\n\
         matrix = {{ model = \"neo-hookean\", shear_modulus = 1000.0, poisson_ratio = 0.4 }}\n\
         life = {{ created_at = 0.07, asleep_below = 1e-3, deleted_at = 0.13 }}\n\
         [[boundary]]\nsurface = \"x0\"\ndisplacement = {{ x = 0.0, y = 0.0, z = 0.0 }}\n\
         [[boundary]]\nsurface = \"x1\"\ndisplacement = {{ x = 0.1, y = 0.05 }}\n\
         [[boundary]]\nsurface = \"z1\"\npressure = 80.0\n\
         [[boundary]]\nsurface = \"z0\"\nfoundation = {{ normal = 500.0, tangential = 100.0 }}\n\
         [[body_force]]\nregion = \"*\"\nvalue = [0.0, 20.0, 0.0]\n\
         [steps]\ncount = 2\n[output]\npoints = true\n[scales]\nmacro = {above}\nmicro = {below}\n",
        frozen()
    )
}

fn write(folder: &Path, has_f_bar: bool, ranks: (usize, usize)) {
    std::fs::write(folder.join("case.toml"), text(has_f_bar, ranks)).unwrap();
}

/// Runs every body in one process, then with `run_on` on several ranks, and continues the latter after its first step on
/// other numbers of ranks. `run_on` gets the folder, the number of all ranks, and the arguments of the program.
pub fn assert_results_do_not_depend_on_ranks(run_on: impl Fn(&Path, usize, &str)) {
    for (name, mesh, has_f_bar) in bodies() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        let read = |file: &str| std::fs::read_to_string(folder.join(file)).unwrap();
        gmsh::write(&folder.join("body.msh"), &mesh).unwrap();
        write(folder, has_f_bar, (1, 0));
        line(folder, "run case.toml --backend sparse --out alone").done();
        let alone = read("alone/loads.csv");
        for ((above, below), options) in [((2, 2), ""), ((1, 2), "--resume")] {
            write(folder, has_f_bar, (above, below));
            run_on(folder, above + below, &format!("run case.toml --backend sparse --out shared {options}"));
            assert_eq!(read("shared/loads.csv"), alone, "{name}: {above} + {below} ranks");
            std::fs::remove_file(folder.join("shared/checkpoint/step-00002.bin")).unwrap();
        }
        let fields = ["alone/fields-00002.vtu", "shared/fields-00002.vtu"]
            .map(|file| read_fields(&folder.join(file)).unwrap_or_else(|error| panic!("{name}: {error}")));
        assert_eq!(&fields[0].elements, mesh.elements(), "{name}");
        assert_eq!(fields[0].point_vectors, fields[1].point_vectors, "{name}");
        assert_eq!(fields[0].cell_tensors, fields[1].cell_tensors, "{name}");
        let points = ["alone/points-00002.vtu", "shared/points-00002.vtu"]
            .map(|file| read_points(&folder.join(file)).unwrap_or_else(|error| panic!("{name}: {error}")));
        assert_eq!(points[0].positions.len(), mesh.points().len(), "{name}");
        assert_eq!(points[0].numbers, points[1].numbers, "{name}");
        let [status, of_ranks] = [0, 1].map(|k| points[k].integers("rve_status").unwrap());
        assert_eq!(status, of_ranks, "{name}");
        let before = read_points(&folder.join("alone/points-00001.vtu")).unwrap();
        let has = |statuses: &[i64], status: i64| statuses.contains(&status);
        assert!(has(before.integers("rve_status").unwrap(), 2), "{name}: some RVEs do not exist after step 1");
        assert!(has(status, 3) && has(status, 0), "{name}: some RVEs are deleted in step 2: {status:?}");
        line(folder, "report alone --picture body.svg").done();
        assert!(read("body.svg").contains("<svg"), "{name}");
    }
}

/// Runs every body in one process, then with `run_on` on the body's ranks of another backend, which assembles and solves in
/// parts; `compare` gets the loads of the latter and of the former.
#[cfg(feature = "petsc")]
pub fn compare_loads_on_ranks(run_on: impl Fn(&Path, usize, &str), compare: impl Fn(&str, &str)) {
    for (_, mesh, has_f_bar) in bodies() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        let read = |file: &str| std::fs::read_to_string(folder.join(file)).unwrap();
        gmsh::write(&folder.join("body.msh"), &mesh).unwrap();
        let text = |ranks| text(has_f_bar, ranks) + "[newton]\ntolerance = 1e-12\n";
        std::fs::write(folder.join("case.toml"), text((1, 0))).unwrap();
        line(folder, "run case.toml --backend sparse --out alone").done();
        std::fs::write(folder.join("case.toml"), text((3, 1))).unwrap();
        run_on(folder, 4, "run case.toml --backend petsc --out shared");
        compare(&read("shared/loads.csv"), &read("alone/loads.csv"));
    }
}

#[test]
fn results_do_not_depend_on_ranks_for_any_element_type() {
    assert_results_do_not_depend_on_ranks(|folder, _, arguments| {
        line(folder, arguments).done();
    });
}

/// A tube of a case equals that of the command `mesh`; with elements of order 2 its lumen is round.
#[test]
fn a_tube_of_a_case_expands_under_pressure() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let text = |mesh: &str| {
        format!(
            "[mesh]\n{mesh}\nscale = 1e-6\n[[region]]\nname = \"wall\"\n\
             material = {{ model = \"neo-hookean\", shear_modulus = 1000.0, poisson_ratio = 0.3 }}\n\
             [[boundary]]\nsurface = \"inner\"\npressure = 100.0\n\
             [[boundary]]\nsurface = \"z0\"\ndisplacement = {{ x = 0.0, y = 0.0, z = 0.0 }}\n\
             [[boundary]]\nsurface = \"z1\"\ndisplacement = {{ z = 0.0 }}\n[steps]\ncount = 1\n"
        )
    };
    for (element, order, options) in [
        ("tet4", "", ""),
        ("wedge6", "", ""),
        ("hex8", "", ""),
        ("tet4", "order = 2", "--order 2"),
        ("hex8", "order = 2\nhexahedra = 27", "--order 2 --hexahedra 27"),
    ] {
        let generated = format!(
            "generate = {{ shape = \"tube\", cells = [1, 8, 2], inner_radius = 3.0, outer_radius = 4.0, length = 5.0, \
             element = \"{element}\" }}\n{order}"
        );
        std::fs::write(folder.join("generated.toml"), text(&generated)).unwrap();
        std::fs::write(folder.join("file.toml"), text("file = \"tube.msh\"")).unwrap();
        let size = "--cells 1,8,2 --inner-radius 3 --outer-radius 4 --length 5";
        line(folder, &format!("mesh tube {size} --element {element} {options} -o tube.msh")).done();
        line(folder, "run generated.toml --out generated").done();
        line(folder, "run file.toml --out file").done();
        let [generated, file] =
            ["generated", "file"].map(|out| std::fs::read_to_string(folder.join(out).join("loads.csv")).unwrap());
        assert_eq!(generated, file, "{element} {order}");
        let [generated, file] =
            ["generated", "file"].map(|out| read_fields(&folder.join(out).join("fields-00001.vtu")).unwrap());
        assert_eq!(generated, file, "{element} {order}");
        let displacements = generated.point_vector("displacement").unwrap();
        let outward = generated.points.iter().zip(displacements).map(|(x, u)| u[0] * x[0] + u[1] * x[1]);
        assert!(outward.sum::<f64>() > 0.0, "{element} {order}");
    }
    line(folder, "run generated/case.toml --out again").done();
}
