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
    let names = (fields.point_vectors.iter().map(|(name, _)| name))
        .chain(fields.cell_scalars.iter().map(|(name, _)| name))
        .chain(fields.cell_integers.iter().map(|(name, _)| name))
        .chain(fields.cell_vectors.iter().map(|(name, _)| name))
        .chain(fields.cell_tensors.iter().map(|(name, _)| name));
    (names.cloned().collect(), fields)
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
