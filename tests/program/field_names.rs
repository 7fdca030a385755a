//! Which fields the result files have.

use std::path::Path;

use biotissue::app::results::{Fields, read_fields, read_points};

use crate::run::{PRESSED, fibers, run};
use crate::{frozen, line};

/// Returns the names of the fields of the last step, and the fields.
fn fields(folder: &Path) -> (Vec<String>, Fields) {
    let files = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let last = files.filter(|path| path.to_string_lossy().contains("fields-0")).max().unwrap();
    let fields = read_fields(&last).unwrap();
    let names = (fields.point_scalars.iter().map(|(name, _)| name))
        .chain(fields.point_vectors.iter().map(|(name, _)| name))
        .chain(fields.point_tensors.iter().map(|(name, _)| name))
        .chain(fields.cell_scalars.iter().map(|(name, _)| name))
        .chain(fields.cell_integers.iter().map(|(name, _)| name))
        .chain(fields.cell_vectors.iter().map(|(name, _)| name))
        .chain(fields.cell_tensors.iter().map(|(name, _)| name));
    (names.cloned().collect(), fields)
}

/// The means at the nodes are those of the elements around them, bit for bit the same on any number of ranks.
#[test]
fn means_at_the_nodes_do_not_depend_on_ranks() {
    let folder = tempfile::tempdir().unwrap();
    let output = "[output]\nfields = [\"energy_density\", \"cauchy_stress\", \"nodal_energy_density\", \"nodal_cauchy_stress\", \
                  \"nodal_principal_stretches\"]\n";
    let text = fibers(&frozen()).replace("cells = [1, 1, 1]", "cells = [3, 2, 1]");
    run(folder.path(), &format!("{text}{output}"), "--out alone").done();
    let (names, alone) = fields(&folder.path().join("alone"));
    let at_nodes = ["nodal_energy_density", "nodal_cauchy_stress", "nodal_principal_stretches"];
    assert!(names.len() == 6 && at_nodes.iter().all(|name| names.contains(&(*name).into())), "{names:?}");
    let (energy, stress) = (alone.cell_scalar("energy_density").unwrap(), alone.cell_tensor("cauchy_stress").unwrap());
    let (of_nodes, stress_of_nodes) =
        (alone.point_scalar("nodal_energy_density").unwrap(), alone.point_tensor("nodal_cauchy_stress").unwrap());
    for node in 0..alone.points.len() {
        let around: Vec<usize> =
            (0..energy.len()).filter(|&element| alone.elements[element].contains(&(node as u32))).collect();
        let mean = |value: &dyn Fn(usize) -> f64| {
            around.iter().map(|&element| value(element)).sum::<f64>() / around.len() as f64
        };
        assert_eq!(of_nodes[node], mean(&|element| energy[element]));
        assert_eq!(stress_of_nodes[node], std::array::from_fn(|k| mean(&|element| stress[element][k])));
    }
    let scales = "[scales]\nmacro = 2\nmicro = 2\n";
    run(folder.path(), &format!("{text}{output}{scales}"), "--out shared --ranks 4").done();
    let index = std::fs::read_to_string(folder.path().join("shared/fields-00002.pvtu")).unwrap();
    let point_data = index.split("<PPointData").nth(1).unwrap().split("</PPointData>").next().unwrap();
    assert!(at_nodes.iter().all(|name| point_data.contains(&format!("Name=\"{name}\""))), "{index}");
    let (_, shared) = fields(&folder.path().join("shared"));
    assert_eq!(shared.points.len(), alone.points.len());
    for (node, point) in shared.points.iter().enumerate() {
        let in_alone = alone.points.iter().position(|other| other == point).unwrap();
        assert_eq!(shared.point_scalar(at_nodes[0]).unwrap()[node], of_nodes[in_alone]);
        assert_eq!(shared.point_tensor(at_nodes[1]).unwrap()[node], stress_of_nodes[in_alone]);
        let stretches = |fields: &Fields, node: usize| fields.point_vector(at_nodes[2]).unwrap()[node];
        assert_eq!(stretches(&shared, node), stretches(&alone, in_alone));
    }
    line(folder.path(), "report shared").done();
}

/// A body of formulas without fibers has no fields of fibers and of RVEs.
#[test]
fn fields_are_those_of_the_materials() {
    let folder = tempfile::tempdir().unwrap();
    let pressed = PRESSED.replace("x = -1.5", "x = -0.5");
    run(folder.path(), &pressed, "--out formula").done();
    let (names, _) = fields(&folder.path().join("formula"));
    let expected = [
        "displacement",
        "von_mises_stress",
        "energy_density",
        "region",
        "rank",
        "cauchy_stress",
        "deformation_gradient",
    ];
    assert_eq!(names, expected);
    // Compressed, all of them take less than 200 bytes for a tetrahedron.
    let large = pressed.replace("cells = [1, 1, 1]", "cells = [8, 8, 8]").replace("count = 5", "count = 1");
    run(folder.path(), &large, "--out large").done();
    let bytes = std::fs::metadata(folder.path().join("large/fields-00001.vtu")).unwrap().len();
    assert!(bytes / (6 * 8 * 8 * 8) < 200, "{bytes}");
    run(folder.path(), &fibers(&frozen()), "--out networks").done();
    let (names, _) = fields(&folder.path().join("networks"));
    assert!(
        ["fiber_alignment", "fiber_direction", "rve_iterations"].iter().all(|name| names.contains(&(*name).into()))
    );
}

#[test]
fn named_fields_are_written_and_agree_with_each_other() {
    let folder = tempfile::tempdir().unwrap();
    let output = "[output]\npoints = true\nfields = [\"principal_stresses\", \"green_lagrange_strain\", \"cauchy_stress\", \"principal_stretches\"]\n";
    let text = format!("{}{output}", fibers(&frozen()));
    run(folder.path(), &text, "--out out").done();
    let out = folder.path().join("out");
    let (names, found) = fields(&out);
    let expected =
        ["displacement", "principal_stretches", "principal_stresses", "cauchy_stress", "green_lagrange_strain"];
    assert_eq!(names, expected);
    let trace = |tensor: &[f64; 9]| tensor[0] + tensor[4] + tensor[8];
    let [stresses, stretches] =
        ["principal_stresses", "principal_stretches"].map(|name| found.cell_vector(name).unwrap());
    let [cauchy, strains] = ["cauchy_stress", "green_lagrange_strain"].map(|name| found.cell_tensor(name).unwrap());
    for element in 0..cauchy.len() {
        let (sum, of_cauchy) = (stresses[element].iter().sum::<f64>(), trace(&cauchy[element]));
        assert!((sum - of_cauchy).abs() < 1e-9 * of_cauchy.abs() && of_cauchy > 0.0, "{sum} {of_cauchy}");
        assert!(stresses[element].is_sorted_by(|a, b| a >= b));
        let of_stretches: f64 = stretches[element].iter().map(|stretch| (stretch * stretch - 1.0) / 2.0).sum();
        assert!((of_stretches - trace(&strains[element])).abs() < 1e-14);
    }
    let points = read_points(&out.join("points-00002.vtu")).unwrap();
    let numbers: Vec<&str> = points.numbers.iter().map(|(name, ..)| name.as_str()).collect();
    assert!(numbers.contains(&"green_lagrange_strain") && numbers.contains(&"jacobian"), "{numbers:?}");
    assert!(!numbers.contains(&"von_mises_stress"));
    assert!(std::fs::read_to_string(out.join("case.toml")).unwrap().contains("fields = [\"principal_stresses\", "));
    line(folder.path(), "report out").done();
    let again = run(folder.path(), &text.replace("\"cauchy_stress\"", "\"cauchy\""), "--out out");
    let message = again.failed(2);
    assert!(message.contains("output.fields[2]") && message.contains("did you mean \"cauchy_stress\"?"), "{message}");
}
