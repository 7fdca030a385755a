//! Values of loads and fields that are refused.

use super::{BAR, CELLS, assert_refused, write};
use crate::line;

#[test]
fn values_that_are_not_finite_or_out_of_range_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let material = "model = \"neo-hookean\", youngs_modulus = 1.0e3, poisson_ratio = 0.3";
    let loaded = |from: &str, to: &str| BAR.replace("CELLS", "2").replace("MATERIAL", material).replace(from, to);
    let pull = "traction = [2.0, 0.0, 0.0]";
    let at = "case.toml:16: surface `x1`: the value at t = ";
    assert_refused(folder, &loaded(pull, "traction = [\"1/t\", 0, 0]"), &format!("{at}0 and x = 1.000000e0, "));
    assert_refused(folder, &loaded(pull, "pressure = \"sqrt(-z)*t\""), "m is NaN, which is not finite");
    assert_refused(folder, &loaded(pull, "displacement = { x = \"1/(1 - t)\" }"), &format!("{at}1 and x = "));
    assert_refused(folder, &loaded(pull, "pressure = 2\ncurve = \"ln(y - 10)\""), "case.toml:16: ");
    let force = "[[body_force]]\nregion = \"*\"\nvalue = [\"ln(x - 2)\", 0, 0]\n[steps]";
    assert_refused(folder, &loaded("[steps]", force), "case.toml:19: the body force on region `*`: the value at t = 0");

    let pole = "pressure = \"1/(t - 0.5)\"";
    assert_refused(folder, &loaded(pull, pole), &format!("{at}0.5 and x = 1.000000e0, "));
    // The traction is infinite at x = 0 only, where it does not act; the pressure on the same surface is the mistake.
    let both = format!("traction = [\"t/x\", 0, 0]\n[[boundary]]\nsurface = \"x1\"\n{pole}");
    assert_refused(
        folder,
        &loaded(pull, &both),
        "case.toml:19: surface `x1`: the value at t = 0.5 and x = 1.000000e0, ",
    );
    let moved = "displacement = { x = \"0.1*t\" }\n[[point]]\nat = [1.0, 0.5, 0.5]\ndisplacement = { x = NUMBER }";
    write(folder, "case.toml", &loaded(pull, &moved.replace("NUMBER", "0.1")));
    line(folder, "check case.toml").done();
    let other = "is given two x-displacements: \"0.1*t\" m by surface `x1` and 2e-1 m by point condition 1 (the number times its curve)";
    assert_refused(folder, &loaded(pull, &moved.replace("NUMBER", "0.2")), other);

    let of = |material: &str| BAR.replace("CELLS", "2").replace("MATERIAL", material);
    let refused = |material: &str, expected: &str| assert_refused(folder, &of(material), expected);
    let constants = |modulus: &str| format!("model = \"neo-hookean\", youngs_modulus = {modulus}, poisson_ratio = 0.3");
    let negative = "case.toml:6: `region.material.youngs_modulus` is -";
    refused(&constants("\"0.5 - x\""), negative);
    refused(&constants("\"0.5 - x\""), "(element 1, point ");
    refused(&constants("\"1/(x - x)\""), "is inf at x = ");
    refused(&constants("{ cells = \"E\" }"), "names an array of the mesh, which is not a .vtu file");
    write(folder, "f.csv", "E,z\n5,0\n-5,0\n");
    refused(
        &constants("{ file = \"f.csv\", column = \"E\" }"),
        "f.csv:3: `E` of element 1 is -5\n  expected: a number above 0, in Pa",
    );
    write(folder, "f.csv", "E,z\n5,0\nnan,0\n");
    refused(&constants("{ file = \"f.csv\", column = \"E\" }"), "f.csv:3: `E` of element 1 is NaN");
    write(folder, "f.csv", "E,z\n5,0\n");
    refused(
        &constants("{ file = \"f.csv\", column = \"E\" }"),
        "f.csv: the file has 1 rows of values; the mesh has 2 elements",
    );
    write(folder, "f.vtu", CELLS);
    refused(&constants("{ file = \"f.vtu\", cells = \"F\" }"), "the cells have no array \"F\"");
    refused(&constants("{ file = \"f.vtu\", cells = \"fiber\" }"), "the array `fiber` has 3 components");
    let axis = |axis: &str| {
        format!("model = \"guccione\", c = 1e3, bf = 8, bt = 2, bfs = 4, bulk_modulus = 1e4, axis = {axis}")
    };
    refused(&axis("[\"0*x\", 0, 0]"), "case.toml:6: `region.material.axis` is [0.0, 0.0, 0.0] at x = ");
    refused(&axis("{ file = \"f.vtu\", cells = \"E\" }"), "the array `E` has 1 components");
    write(folder, "f.csv", "E,z\n5,0\n5,0\n");
    refused(
        &axis("{ file = \"f.csv\", columns = [\"z\", \"z\", \"z\"] }"),
        "f.csv:2: `z`, `z`, `z` of element 0 is [0.0, 0.0, 0.0]",
    );
    let unstable = "model = \"neo-hookean\", youngs_modulus = 4, shear_modulus = \"1 + 0*x\"";
    refused(unstable, "case.toml:6: `region.material` gives mu = 1 Pa and K = -");
    // The first error of each parameter.
    let all = axis("[\"1 - floor(x + 0.9)\", 0, 0]").replace("1e3", "\"x - 0.5\"").replace("1e4", "\"0.5 - x\"");
    let text = of(&all);
    write(folder, "case.toml", &text);
    let refused_all = line(folder, "check case.toml");
    let block = refused_all.failed(2);
    assert_eq!(block.matches("case.toml:6: ").count(), 3, "{block}");
    for expected in
        ["`region.material.c` is -0.", "`region.material.bulk_modulus` is -0.", "`region.material.axis` is [0.0, "]
    {
        assert!(block.contains(expected), "{block}");
    }
    refused(
        &constants("{ file = \"f.vtu\", column = \"E\" }"),
        "a CSV file with the columns\n  cure: name a CSV file, or write `cells`",
    );
    refused(
        &constants("{ file = \"f.vtu\", cells = \"E\" }"),
        "f.vtu:4: the center of cell 1 lies at x = 5.000000e-1, y = 5.000000e-1, ",
    );
    let more = BAR
        .replace("cells = [CELLS", "cells = [3")
        .replace("MATERIAL", &constants("{ file = \"f.vtu\", cells = \"E\" }"));
    assert_refused(folder, &more, "f.vtu:16: the array `E` has values of 2 elements; the mesh has 3");
}
