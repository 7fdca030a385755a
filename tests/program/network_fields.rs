//! Networks that are chosen by fields, and fiber volume fractions that vary over the body.

use std::path::Path;

use crate::fields::CELLS;
use crate::line;
use crate::published::published_file;

/// A bar of two cells along x, which are twelve tetrahedra, pulled along x. `NETWORKS` and `SCALE` describe the material.
const BAR: &str = r#"
[mesh]
generate = { shape = "box", cells = [2, 1, 1], size = [2.0, 1.0, 1.0] }
[[region]]
name = "*"
[region.material]
model = "fiber-rve"
NETWORKS
SCALE
law = { name = "linear", youngs_modulus = 1.0e8, radius = 5.0e-8 }
matrix = { model = "neo-hookean", shear_modulus = 1000.0, poisson_ratio = 0.3 }
[[boundary]]
surface = "x0"
displacement = { x = 0.0, y = 0.0, z = 0.0 }
[[boundary]]
surface = "x1"
displacement = { x = 0.1, y = 0.0, z = 0.0 }
[steps]
count = 2
"#;

const FRACTION: &str = "fiber_volume_fraction = 0.003";

fn bar(networks: &str, scale: &str) -> String {
    BAR.replace("NETWORKS", networks).replace("SCALE", scale)
}

/// Writes three networks with the names that fields choose from.
fn write_networks(folder: &Path) {
    line(folder, "network generate --points 25 --count 3 --directory networks").done();
    for (number, name) in [(1, "a-0-b-00"), (2, "a-0-b-01"), (3, "a-2-b-00")] {
        let from = folder.join(format!("networks/network-000{number}.txt"));
        std::fs::rename(from, folder.join(format!("networks/{name}.txt"))).unwrap();
    }
}

fn write(folder: &Path, name: &str, text: &str) {
    std::fs::write(folder.join(name), text).unwrap();
}

/// Writes a CSV file with these columns of the elements.
fn write_rows(folder: &Path, name: &str, header: &str, row: impl Fn(usize) -> String) {
    let rows: String = (0..12).map(|element| row(element) + "\n").collect();
    write(folder, name, &format!("{header}\n{rows}"));
}

/// Runs a case and returns the loads.
fn loads(folder: &Path, case: &str, options: &str) -> String {
    write(folder, "case.toml", case);
    line(folder, &format!("run case.toml --out out {options}")).done();
    std::fs::read_to_string(folder.join("out/loads.csv")).unwrap()
}

const LISTED: &str = "networks = [\"networks/a-2-b-00.txt\", \"networks/a-0-b-01.txt\"]\n";
const PATTERN: &str = "networks = \"networks/a-{a}-b-{b:02}.txt\"\n";

#[test]
fn fields_choose_the_networks_that_a_cycle_chooses() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    write_networks(folder);
    // Sorted, the second network of the list is the first.
    let cycle = loads(folder, &bar(&format!("{LISTED}choose = \"cycle\""), FRACTION), "");
    write_rows(folder, "index.csv", "index,a,b,x", |element| match element % 2 {
        0 => "1,0,1,0.1".into(),
        _ => "0,2,0,0.9".into(),
    });
    let column = |name: &str| format!("{{ file = \"index.csv\", column = \"{name}\" }}");
    let by_index = format!("{LISTED}choose = {{ index = {} }}", column("index"));
    assert_eq!(loads(folder, &bar(&by_index, FRACTION), ""), cycle);
    let by_name = format!("{PATTERN}choose = {{ a = {}, b = {} }}", column("a"), column("b"));
    assert_eq!(loads(folder, &bar(&by_name, FRACTION), ""), cycle);
    // Three bins of 0.1 to 0.9: numbers 0 and 2; and b = 1 - a/2.
    let bins = format!(
        "{PATTERN}choose = {{ a = {{ file = \"index.csv\", column = \"x\", bins = 3 }}, b = {} }}",
        column("b")
    );
    assert_eq!(loads(folder, &bar(&bins, FRACTION), ""), cycle);
    let range = bins.replace("bins = 3", "bins = 2, range = [0.9, 1.7], first = 2").replace("0.1", "0.9");
    write(folder, "case.toml", &bar(&range, FRACTION));
    let error = line(folder, "check case.toml");
    assert!(error.failed(2).contains("index.csv:2: `x` of element 0 is 0.1"), "{}", error.stderr);

    // The case as run names the same networks, on any number of ranks.
    for options in ["--ranks 3", "--resume"] {
        write(folder, "case.toml", &bar(&bins, FRACTION));
        line(folder, &format!("run case.toml --out out {options}")).done();
        assert_eq!(std::fs::read_to_string(folder.join("out/loads.csv")).unwrap(), cycle, "{options}");
    }
    line(folder, "run out/case.toml --out again").done();
    assert_eq!(std::fs::read_to_string(folder.join("again/loads.csv")).unwrap(), cycle);
    let shared = bar(&bins, FRACTION) + "[scales]\nmacro = 2\nmicro = 2\n";
    assert_eq!(loads(folder, &shared, "--ranks 4"), cycle);

    let check = line(folder, "check case.toml --json").object();
    let rves: Vec<(&str, u64)> = check["networks"]
        .as_array()
        .unwrap()
        .iter()
        .map(|network| (network["name"].as_str().unwrap(), network["rves"].as_u64().unwrap()))
        .collect();
    assert_eq!(rves.iter().map(|(_, rves)| *rves).collect::<Vec<_>>(), [6, 6]);
    assert!(rves[0].0.ends_with("a-0-b-01.txt") && rves[1].0.ends_with("a-2-b-00.txt"), "{rves:?}");
    let plan = line(folder, "check case.toml");
    assert!(plan.done().contains("field      choose.a from 0.0 to 2.0 in region \"*\""), "{}", plan.stdout);
}

/// An array of the cells of the mesh, a .vtu file, or of another file with the same cells.
/// A pattern that matches all networks in every bin gives each point that which it has by chance among all of them.
#[test]
fn stars_choose_among_realizations_by_the_seed() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    line(folder, "network generate --points 25 --count 3 --directory networks").done();
    let by_chance = |seed: u64| {
        let networks = format!("networks = \"networks/*.txt\"\nchoose = \"random\"\nseed = {seed}");
        loads(folder, &bar(&networks, FRACTION), "")
    };
    let by_field = |seed: u64| {
        let choose = "choose = { k = \"floor(x)\" }";
        bar(&format!("networks = \"one-{{k}}-*.txt\"\n{choose}\nseed = {seed}"), FRACTION)
    };
    for name in ["one-0-", "one-1-"] {
        for number in 1..4 {
            let from = folder.join(format!("networks/network-000{number}.txt"));
            std::fs::copy(from, folder.join(format!("{name}{number}.txt"))).unwrap();
        }
    }
    assert_ne!(by_chance(1), by_chance(2));
    for seed in [1, 2] {
        assert_eq!(loads(folder, &by_field(seed), ""), by_chance(seed));
    }
    write(folder, "case.toml", &by_field(1));
    for number in 1..4 {
        std::fs::remove_file(folder.join(format!("one-1-{number}.txt"))).unwrap();
    }
    let error = line(folder, "check case.toml");
    let text = error.failed(2);
    assert!(text.contains("one-1-*.txt, which does not exist (k = 1)"), "{text}");
}

#[test]
fn arrays_of_cells_choose_networks() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    write_networks(folder);
    // Two hexahedra with eight points each: the first has the value 1, the other one 0.
    let cells = CELLS.replace("2 1 3 1</DataArray>", "2 1 3 4</DataArray>").replace("nan 1000 nan 2000", "nan 1 nan 0");
    write(folder, "cells.vtu", &cells);
    let mesh = "generate = { shape = \"box\", cells = [2, 1, 1], size = [2.0, 1.0, 1.0] }";
    let on_cells = |text: String| {
        text.replace(mesh, "file = \"cells.vtu\"").replace("\"x0\"", "\"surface_2\"").replace("\"x1\"", "\"surface_3\"")
    };
    let by_cells = on_cells(bar(&format!("{LISTED}choose = {{ index = {{ cells = \"E\" }} }}"), FRACTION));
    let found = loads(folder, &by_cells, "");
    // In the order of the list, 0 is `a-2-b-00`, and 1 is `a-0-b-01`.
    let networks = |case: &str| -> Vec<(String, u64)> {
        write(folder, "case.toml", case);
        let check = line(folder, "check case.toml --json").object();
        let of = |network: &serde_json::Value| {
            let name = network["name"].as_str().unwrap().rsplit('/').next().unwrap().to_owned();
            (name, network["rves"].as_u64().unwrap())
        };
        check["networks"].as_array().unwrap().iter().map(of).collect()
    };
    assert_eq!(networks(&by_cells), [("a-2-b-00.txt".to_owned(), 8), ("a-0-b-01.txt".to_owned(), 8)]);
    let by_rows = |rows: &str| {
        write(folder, "rows.csv", &format!("index\n{rows}"));
        on_cells(bar(
            &format!("{LISTED}choose = {{ index = {{ file = \"rows.csv\", column = \"index\" }} }}"),
            FRACTION,
        ))
    };
    assert_eq!(loads(folder, &by_rows("1\n0\n"), ""), found);
    assert_ne!(loads(folder, &by_rows("0\n1\n"), ""), found);
    assert_eq!(loads(folder, &(by_cells.clone() + "[scales]\nmacro = 1\nmicro = 2\n"), "--ranks 3"), found);
    // By the names of the files, from another file with the same cells.
    write(folder, "other.vtu", &cells.replace("nan 1 nan 0", "nan 0 nan 2"));
    let of_other = "{ file = \"other.vtu\", cells = \"E\" }";
    let b = "{ file = \"rows.csv\", column = \"index\" }";
    write(folder, "rows.csv", "index\n1\n0\n");
    let by_name = on_cells(bar(&format!("{PATTERN}choose = {{ a = {of_other}, b = {b} }}"), FRACTION));
    assert_eq!(loads(folder, &by_name, ""), found);
}

#[test]
fn grids_and_expressions_choose_networks() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    write_networks(folder);
    let expression = format!("{PATTERN}choose = {{ a = \"2*floor(x)\", b = 0 }}");
    let expected = loads(folder, &bar(&expression, FRACTION), "");
    write(folder, "grid.txt", "# x0 y0 z0 dx dy dz nx ny nz\n0 0 0  1 5 5  2 1 1\n0.0\n7.0\n");
    let grid = format!("{PATTERN}choose = {{ a = {{ grid = \"grid.txt\", bins = 3 }}, b = 0 }}");
    assert_eq!(loads(folder, &bar(&grid, FRACTION), ""), expected);
    // Whole numbers without bins: the second one has no network.
    let whole = grid.replace(", bins = 3", "");
    write(folder, "case.toml", &bar(&whole, FRACTION));
    let error = line(folder, "check case.toml");
    let block = error.failed(2);
    assert!(block.contains("case.toml:9: element 6 needs the network") && block.contains("a-7-b-00.txt"), "{block}");
    assert!(block.contains("(a = 7, b = 0)"), "{block}");
    // Outside of the grid.
    write(folder, "grid.txt", "0 0 0  1 5 5  1 1 1\n0.0\n");
    let error = line(folder, "check case.toml");
    let block = error.failed(2);
    assert!(block.contains("grid.txt: element 6 at x = 1.") && block.contains("outside of the grid"), "{block}");
}

/// A field that is the same everywhere gives the bits of the constant; one that differs from region to region, the result of
/// two regions.
#[test]
fn fiber_volume_fractions_vary() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    write_networks(folder);
    let constant = loads(folder, &bar(LISTED, FRACTION), "");
    write_rows(folder, "phi.csv", "phi", |_| "0.003".into());
    let field = "fiber_volume_fraction = { file = \"phi.csv\", column = \"phi\" }";
    assert_eq!(loads(folder, &bar(LISTED, field), ""), constant);

    for life in ["", "life = { created_at = 0.03, asleep_below = 1e-9 }\n"] {
        fractions_of_cells(folder, life);
    }
}

/// Two cells of a file, each a region; without an RVE before it is created.
fn fractions_of_cells(folder: &Path, life: &str) {
    let listed = &format!("{LISTED}{life}");
    let cells =
        CELLS.replace("2 1 3 1</DataArray>", "2 1 3 4</DataArray>").replace("nan 1000 nan 2000", "nan 0.002 nan 0.006");
    write(folder, "cells.vtu", &cells);
    let mesh = "generate = { shape = \"box\", cells = [2, 1, 1], size = [2.0, 1.0, 1.0] }";
    let two = |text: String| {
        text.replace(mesh, "file = \"cells.vtu\"").replace("\"x0\"", "\"surface_2\"").replace("\"x1\"", "\"surface_3\"")
    };
    let of_cells = two(bar(listed, "fiber_volume_fraction = { cells = \"E\" }"));
    let by_field = loads(folder, &of_cells, "");
    let shared = loads(folder, &(of_cells.clone() + "[scales]\nmacro = 1\nmicro = 2\n"), "--ranks 3");
    assert_eq!(shared, by_field);
    let regions = two(bar(listed, "fiber_volume_fraction = 0.006"));
    let (before, after) = regions.split_once("[[region]]").unwrap();
    let (region, after) = after.split_once("[[boundary]]").unwrap();
    let first = region.replace("\"*\"", "\"region_1\"").replace("0.006", "0.002");
    let regions = format!("{before}[[region]]{first}[[region]]{region}[[boundary]]{after}");
    let by_region = loads(folder, &regions, "");
    let numbers = |text: &str| -> Vec<f64> {
        text.lines().last().unwrap().split(',').map(|number| number.parse().unwrap()).collect()
    };
    let names: Vec<&str> = by_region.lines().next().unwrap().split(',').collect();
    let of_field: std::collections::HashMap<&str, f64> =
        by_field.lines().next().unwrap().split(',').zip(numbers(&by_field)).collect();
    let force = of_field["surface_3.fx"];
    assert!(force > 0.0);
    for (name, expected) in names.iter().zip(numbers(&by_region)).filter(|(name, _)| name.contains(".f")) {
        assert!((of_field[name] - expected).abs() < 1e-9 * force, "{name}: {} {expected}", of_field[name]);
    }

    write(folder, "case.toml", &of_cells);
    let plan = line(folder, "check case.toml");
    let range = "field      fiber_volume_fraction from 0.002 to 0.006 in region \"*\"";
    assert!(plan.done().contains(range), "{}", plan.stdout);
    for (value, shown) in [("0", "0"), ("1.5", "1.5"), ("nan", "NaN")] {
        write(folder, "cells.vtu", &cells.replace("nan 0.006", &format!("nan {value}")));
        let error = line(folder, "check case.toml");
        let block = error.failed(2);
        assert!(block.contains(&format!(": `E` of element 1 is {shown}\n")), "{block}");
        assert!(block.contains("expected: a fiber volume fraction above 0 and at most 1"), "{block}");
    }
}

#[test]
fn wrong_fields_are_reported_with_their_cure() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    write_networks(folder);
    let block = |networks: &str| {
        write(folder, "case.toml", &bar(networks, FRACTION));
        line(folder, "check case.toml").failed(2).to_owned()
    };
    let by = |field: &str| format!("{LISTED}choose = {{ index = {field} }}");
    write_rows(folder, "index.csv", "index", |element| if element == 7 { "2".into() } else { "0".into() });
    let column = "{ file = \"index.csv\", column = \"index\" }";
    for (rows, networks, expected) in [
        ("", by(column), &["index.csv:9: `index` of element 7 is 2", "one of 2 networks, from 0"][..]),
        ("", by("{ file = \"index.csv\", column = \"idx\" }"), &["no column \"idx\"", "which has \"index\""]),
        ("", by("\"x\""), &["case.toml:9: `region.material.choose.index` is ", "a whole number from 0, for `index`"]),
        ("", by("{ cells = \"k\" }"), &["names an array of the mesh, which is not a .vtu file"]),
        ("index\n1.5\n", by(column), &["the file has 1 row of values; the mesh has 12 elements"]),
        ("element,index\n0,1.5\n", by(column), &["11 elements have no row, the first of them element 1"]),
        ("", format!("{LISTED}choose = {{ a = 1 }}"), &["has no field `index`", "write `index = ...`"]),
        ("", format!("{PATTERN}choose = {{ a = 1 }}"), &["has no field `b`", "add `b = ...`"]),
        ("", PATTERN.to_owned(), &["has a path with places for `a`, `b`", "add `choose = { a = ..., b = ... }`"]),
        ("", PATTERN.replace("{a}", "{a"), &["is not a pattern", "{angle:02}"]),
        ("", by("{ file = \"index.csv\", column = \"index\", first = 1 }"), &["has `first` but no `bins`"]),
        ("", by("{ grid = \"index.csv\" }"), &["index.csv:1: `element` is not a number", "x0 y0 z0 dx dy dz nx ny nz"]),
    ] {
        if !rows.is_empty() {
            write(folder, "index.csv", rows);
        }
        let block = block(&networks);
        expected.iter().for_each(|text| assert!(block.contains(text), "{text}: {block}"));
    }
}

#[test]
fn a_run_does_not_continue_with_another_field() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    write_networks(folder);
    write_rows(folder, "f.csv", "index,phi", |element| format!("{},0.003", element % 2));
    let networks = format!("{LISTED}choose = {{ index = {{ file = \"f.csv\", column = \"index\" }} }}");
    let case = bar(&networks, "fiber_volume_fraction = { file = \"f.csv\", column = \"phi\" }");
    loads(folder, &case, "");
    for (index, phi) in [(0, 0.003), (1, 0.002)] {
        write_rows(folder, "f.csv", "index,phi", |element| match element {
            5 => format!("{index},{phi}"),
            _ => format!("{},0.003", element % 2),
        });
        let error = line(folder, "run case.toml --out out --resume");
        assert!(error.failed(2).contains("the material fields differ"), "{}", error.stderr);
    }
    write_rows(folder, "f.csv", "index,phi", |element| format!("{},0.003", element % 2));
    line(folder, "run case.toml --out out --resume").done();
}

/// The published scheme: the networks of the ligament chosen by the value of a grid.
#[test]
fn a_grid_chooses_the_networks_of_the_ligament() {
    let Some(grid) = published_file("ligament/field_grid.csv") else { return };
    let folder = tempfile::tempdir().unwrap();
    let data = grid.parent().unwrap().display();
    let case = format!(
        r#"
[mesh]
file = "{data}/ligament_6192.msh"
[[region]]
name = "*"
[region.material]
model = "fiber-rve"
networks = "{data}/theta_*.txt"
choose = {{ index = {{ grid = "{data}/field_grid.csv", bins = 20 }} }}
fiber_volume_fraction = 0.003
[[boundary]]
surface = "face82"
displacement = {{ x = 0.0, y = 0.0, z = 0.0 }}
[[boundary]]
surface = "face78"
displacement = {{ x = 2.5e-3, y = 0.0, z = 0.0 }}
"#
    );
    write(folder.path(), "case.toml", &case);
    let plan = line(folder.path(), "check case.toml --json").object();
    let networks = plan["networks"].as_array().unwrap();
    assert_eq!(networks.iter().map(|network| network["rves"].as_u64().unwrap()).sum::<u64>(), 6192);
    // The order is that of the numbers in the names, and the field is not uniform.
    let rves = |theta: usize| {
        let name = format!("theta_{theta}_align_{}_realization_1.txt", theta % 10);
        let network = networks.iter().find(|network| network["name"].as_str().unwrap().ends_with(&name));
        network.unwrap()["rves"].as_u64().unwrap()
    };
    assert_eq!(networks.len(), 20);
    assert!((1..19).all(|theta| rves(theta) > 0) && rves(0) < rves(9), "{plan}");
    assert_eq!(plan["fields"][0]["parameter"], "choose.index");
}
