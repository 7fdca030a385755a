//! Cases with expressions, and with material parameters and axes that vary over the body.

use std::path::Path;

use biotissue::app::results::Loads;

use crate::{frozen, line};

/// A bar of 1 m x 0.5 m x 0.5 m that slides on three sides and is pulled at its end.
pub const BAR: &str = r#"
[mesh]
generate = { shape = "box", cells = [CELLS, 1, 1], size = [1.0, 0.5, 0.5], element = "hex8" }
[[region]]
name = "*"
material = { MATERIAL }
[[boundary]]
surface = "x0"
displacement = { x = 0.0 }
[[boundary]]
surface = "y0"
displacement = { y = 0.0 }
[[boundary]]
surface = "z0"
displacement = { z = 0.0 }
[[boundary]]
surface = "x1"
traction = [2.0, 0.0, 0.0]
[steps]
count = 2
"#;

fn write(folder: &Path, name: &str, text: &str) {
    std::fs::write(folder.join(name), text).unwrap();
}

/// Returns the text of a file of a run.
fn text(folder: &Path, file: &str) -> String {
    std::fs::read_to_string(folder.join(file)).unwrap()
}

/// Returns the mean displacement of a surface after the last step, m.
fn displacement(folder: &Path, run: &str, surface: &str) -> [f64; 3] {
    let loads = Loads::read(&folder.join(run).join("loads.csv")).unwrap_or_else(|error| panic!("{error}"));
    let column = loads.names.surfaces.iter().position(|name| name == surface).unwrap();
    loads.rows.last().unwrap().surfaces[column].displacement
}

#[test]
fn a_bar_with_a_varying_modulus_is_as_long_as_the_closed_form_says() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let stretched = |cells: usize, modulus: &str| {
        let material = format!("model = \"linear-elastic\", youngs_modulus = {modulus}, poisson_ratio = 0");
        let text = BAR.replace("CELLS", &cells.to_string()).replace("MATERIAL", &material);
        write(folder, "bar.toml", &text);
        line(folder, "run bar.toml --out bar").done();
        displacement(folder, "bar", "x1")[0]
    };
    // Two halves: u = T (L/2 / E1 + L/2 / E2).
    let halves = stretched(4, "\"1000 + 1000*step(x - 0.5)\"");
    assert!((halves / 1.5e-3 - 1.0).abs() < 1e-9, "{halves}");
    write(folder, "E.csv", "element,E\n3,2000\n2,2000\n1,1000\n0,1000\n");
    let by_element = stretched(4, "{ file = \"E.csv\", column = \"E\" }");
    assert!((by_element / halves - 1.0).abs() < 1e-12, "{by_element} {halves}");
    // E = E0 (1 + x): u = T / E0 ln 2, with an error of second order.
    let exact = 2.0e-3 * 2.0_f64.ln();
    let error = |cells| (stretched(cells, "\"1000*(1 + x)\"") / exact - 1.0).abs();
    let (coarse, fine) = (error(4), error(8));
    assert!(coarse < 1e-2 && (3.5..4.5).contains(&(coarse / fine)), "{coarse:e} {fine:e}");
    let check = line(folder, "check bar.toml");
    let range = check.done().lines().find(|line| line.starts_with("field")).unwrap().to_owned();
    // Points lie at (1 +- 1/sqrt(3))/2 of an element.
    assert!(range.starts_with("field      youngs_modulus from 1026.") && range.contains(" to 1973."), "{range}");
}

#[test]
fn constants_given_as_expressions_are_the_numbers() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let numbers = BAR
        .replace("CELLS", "2")
        .replace("MATERIAL", "model = \"neo-hookean\", youngs_modulus = 1000.0, poisson_ratio = 0.3");
    let expressions = numbers.replace("1000.0", "\"2*500\"").replace("0.3", "\"3/10\"").replace("[2.0,", "[\"1 + 1\",");
    write(folder, "numbers.toml", &numbers);
    write(folder, "expressions.toml", &expressions);
    // A field whose values are the numbers: formulas by point.
    write(folder, "field.toml", &numbers.replace("1000.0", "\"1000 + 0*x\""));
    for run in ["numbers", "expressions", "field"] {
        line(folder, &format!("run {run}.toml --out {run}")).done();
        assert_eq!(text(folder, &format!("{run}/loads.csv")), text(folder, "numbers/loads.csv"), "{run}");
    }
}

/// The nodes of [`CELLS`] in meters if a mesh unit is half a meter.
const IN_METERS: &str =
    "0 0 0 0.5 0 0 1 0 0  0 0.5 0 0.5 0.5 0 1 0.5 0  0 0 0.5 0.5 0 0.5 1 0 0.5  0 0.5 0.5 0.5 0.5 0.5 1 0.5 0.5";

/// Two hexahedra side by side along x with a modulus and an axis each; the faces at both ends are `surface_2` and
/// `surface_3`.
pub const CELLS: &str = r#"<?xml version="1.0"?>
<VTKFile type="UnstructuredGrid" version="0.1" byte_order="LittleEndian">
<UnstructuredGrid><Piece NumberOfPoints="12" NumberOfCells="4">
<Points><DataArray type="Float64" NumberOfComponents="3" format="ascii">
0 0 0 1 0 0 2 0 0  0 1 0 1 1 0 2 1 0  0 0 1 1 0 1 2 0 1  0 1 1 1 1 1 2 1 1
</DataArray></Points>
<Cells>
<DataArray type="Int64" Name="connectivity" format="ascii">
0 6 9 3  0 1 4 3 6 7 10 9  2 5 11 8  1 2 5 4 7 8 11 10
</DataArray>
<DataArray type="Int64" Name="offsets" format="ascii">4 12 16 24</DataArray>
<DataArray type="UInt8" Name="types" format="ascii">9 12 9 12</DataArray>
</Cells>
<CellData>
<DataArray type="Int64" Name="region" format="ascii">2 1 3 1</DataArray>
<DataArray type="Float64" Name="E" format="ascii">nan 1000 nan 2000</DataArray>
<DataArray type="Float64" Name="fiber" NumberOfComponents="3" format="ascii">
nan nan nan  2 0 0  nan nan nan  0 0.5 0.5
</DataArray>
</CellData>
</Piece></UnstructuredGrid></VTKFile>
"#;

const PULLED_CELLS: &str = r#"
[mesh]
file = "cells.vtu"
[[region]]
name = "region_1"
material = { model = "transversely-isotropic", youngs_modulus = MODULUS, poisson_ratio = 0.2, axial_youngs_modulus = 4000.0, axial_shear_modulus = 900.0, axis = AXIS }
[[boundary]]
surface = "surface_2"
displacement = { x = 0.0, y = 0.0, z = 0.0 }
[[boundary]]
surface = "surface_3"
displacement = { x = 0.3 }
[steps]
count = 2
"#;

#[test]
fn expressions_cells_and_columns_give_the_same_field() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    write(folder, "cells.vtu", CELLS);
    write(folder, "other.vtu", CELLS);
    // As of a result file: in meters, while the mesh is in mesh units.
    let meters = CELLS.replace("0 0 0 1 0 0 2 0 0  0 1 0 1 1 0 2 1 0  0 0 1 1 0 1 2 0 1  0 1 1 1 1 1 2 1 1", IN_METERS);
    write(folder, "meters.vtu", &meters);
    write(folder, "fields.csv", "az, ax, ay, E\n0,2,0,1000\n0.5,0,0.5,2000\n");
    let sources = [
        ("\"1000*(1 + step(x - 1))\"", "[\"2*step(1 - x)\", \"step(x - 1)/2\", \"step(x - 1)/2\"]"),
        ("{ cells = \"E\" }", "{ cells = \"fiber\" }"),
        ("{ file = \"other.vtu\", cells = \"E\" }", "{ file = \"other.vtu\", cells = \"fiber\" }"),
        ("{ file = \"fields.csv\", column = \"E\" }", "{ file = \"fields.csv\", columns = [\"ax\", \"ay\", \"az\"] }"),
    ];
    let mut found = Vec::new();
    for (number, (modulus, axis)) in sources.into_iter().enumerate() {
        write(folder, "case.toml", &PULLED_CELLS.replace("MODULUS", modulus).replace("AXIS", axis));
        line(folder, &format!("run case.toml --out out-{number}")).done();
        line(folder, &format!("run out-{number}/case.toml --out again")).done();
        found.push(text(folder, &format!("out-{number}/loads.csv")));
        assert_eq!(text(folder, "again/loads.csv"), found[0]);
        assert_eq!(found[number], found[0], "{modulus}");
    }
    let scaled = PULLED_CELLS.replace("file = \"cells.vtu\"", "file = \"cells.vtu\"\nscale = 0.5");
    for source in
        ["{ cells = \"E\" }", "{ file = \"other.vtu\", cells = \"E\" }", "{ file = \"meters.vtu\", cells = \"E\" }"]
    {
        write(folder, "case.toml", &scaled.replace("MODULUS", source).replace("AXIS", "{ cells = \"fiber\" }"));
        line(folder, "check case.toml").done();
    }
    // The same cells in another order.
    let reversed = CELLS.replace(
        "0 6 9 3  0 1 4 3 6 7 10 9  2 5 11 8  1 2 5 4 7 8 11 10",
        "0 6 9 3  1 2 5 4 7 8 11 10  2 5 11 8  0 1 4 3 6 7 10 9",
    );
    write(folder, "meters.vtu", &reversed);
    let misplaced = "meters.vtu:4: the center of cell 1 lies at x = 7.500000e-1, y = 2.500000e-1, z = 2.500000e-1 m, that of element 0 of the mesh at x = 2.500000e-1,";
    let other = scaled.replace("MODULUS", "{ file = \"meters.vtu\", cells = \"E\" }").replace("AXIS", "[1, 0, 0]");
    assert_refused(folder, &other, misplaced);
    write(folder, "case.toml", &PULLED_CELLS.replace("MODULUS", "1000").replace("AXIS", "[1, 0, 0]"));
    line(folder, "run case.toml --out constant").done();
    assert_ne!(text(folder, "constant/loads.csv"), found[0]);
}

/// A box of networks with a matrix that varies and RVEs that are created late, under loads that vary.
const VARYING: &str = r#"
[mesh]
generate = { shape = "box", cells = [2, 1, 1], size = [1.0, 0.5, 0.5] }
[[region]]
name = "*"
[region.material]
model = "fiber-rve"
networks = [NETWORK]
scale = "raw"
law = { name = "linear", youngs_modulus = 1.0e3, radius = 0.1 }
matrix = { model = "guccione", c = { file = "c.csv", column = "c" }, bf = 8, bt = 2, bfs = 4, bulk_modulus = "1e4*(1 + x)", axis = ["-y", "1 + x", 0] }
life = { created_at = 0.005, before = "matrix" }
[[boundary]]
surface = "x0"
displacement = { x = 0.0, y = 0.0, z = 0.0 }
[[boundary]]
surface = "x1"
displacement = { x = "0.05*t*(1 + y)", y = "0" }
[[boundary]]
surface = "z1"
pressure = "20*sin(pi*t)"
[[boundary]]
surface = "y1"
traction = ["3*x", 1.0, 0.0]
curve = "t^2"
[[point]]
at = [0.5, 0.0, 0.0]
force = [0.0, "-t*z", "-0.2*t"]
[[body_force]]
region = "*"
value = [0.0, 0.0, "-5*x"]
curve = [[0.0, 0.0], [0.5, 1.0], [1.0, 0.5]]
[steps]
count = 3
"#;

#[test]
fn fields_and_expressions_do_not_depend_on_ranks_or_interruptions() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let rows: Vec<String> = (0..12).map(|element| format!("{}\n", 100 + 10 * element)).collect();
    write(folder, "c.csv", &format!("c\n{}", rows.concat()));
    let case = VARYING.replace("NETWORK", &format!("{:?}", frozen()));
    write(folder, "case.toml", &case);
    line(folder, "run case.toml --out one").done();
    line(folder, "run one/case.toml --out written").done();
    line(folder, "run case.toml --out ranks --ranks 4").done();
    line(folder, "run case.toml --out parts").done();
    std::fs::remove_file(folder.join("parts/checkpoint/step-00003.bin")).unwrap();
    line(folder, "run case.toml --out parts --resume").done();
    for other in ["written", "ranks", "parts"] {
        assert_eq!(text(folder, &format!("{other}/loads.csv")), text(folder, "one/loads.csv"), "{other}");
    }

    write(folder, "c.csv", &format!("c\n{}", rows.concat().replace("150", "150.5")));
    let other = line(folder, "run case.toml --out parts --resume");
    assert!(other.failed(2).contains("the material fields differ"), "{}", other.stderr);
    write(folder, "case.toml", &case.replace("1e4*(1 + x)", "1e4*(1 + 2*x)"));
    let other = line(folder, "run case.toml --out parts --resume");
    assert!(other.failed(2).contains("bulk_modulus = \"1e4*(1 + x)\""), "{}", other.stderr);
}

#[test]
fn loads_given_by_expressions_act_as_their_integrals() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let material = "model = \"neo-hookean\", youngs_modulus = 1.0e5, poisson_ratio = 0.3";
    let case = BAR.replace("CELLS", "2").replace("MATERIAL", material);
    write(folder, "case.toml", &case.replace("[2.0, 0.0, 0.0]", "[\"1e3*t*z\", \"8*z\", 4.0]"));
    line(folder, "run case.toml --out out").done();
    let loads = Loads::read(&folder.join("out/loads.csv")).unwrap();
    let column = loads.names.surfaces.iter().position(|name| name == "x1").unwrap();
    for (row, t) in loads.rows.iter().filter(|row| row.step > 0).zip([0.5, 1.0]) {
        let [fx, fy, fz] = row.surfaces[column].force;
        // int z dA = 0.25 / 4; values without t follow the ramp.
        assert!((fx / (1.0e3 * t * 0.0625) - 1.0).abs() < 1e-12 && (fz / t - 1.0).abs() < 1e-12, "{fx} {fz}");
        assert!((fy / (0.5 * t) - 1.0).abs() < 1e-12, "{fy}");
    }
}

#[track_caller]
fn assert_refused(folder: &Path, case: &str, expected: &str) {
    write(folder, "case.toml", case);
    let refused = line(folder, "check case.toml");
    let block = refused.failed(2);
    assert!(block.contains(expected), "{block}\ninstead of\n{expected}");
}
