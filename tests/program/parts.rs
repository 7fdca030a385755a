//! Bodies of which each rank of PETSc holds a part: the same results as in one process, at every point and in every file.

use std::collections::BTreeSet;
use std::path::Path;
use std::process::Command;

use biotissue::app::results::{Fields, PointValues, read_fields, read_points};

use crate::balance::{BY_ITERATIONS, migrations, restless, uneven};
use crate::ranks::processes::{assert_same_to_rounding, launched, mpirun_done, one_at_a_time};
use crate::ranks::{read, with_life_cycles, with_scales};
use crate::run::{PRESSED, events, fibers, run, write_case};
use crate::variants::CONSTANTS;
use crate::{frozen, line};

/// A body of two regions with every kind of load, of elements of one type, without networks.
pub fn loaded(element: &str, order: usize) -> String {
    let order = if order == 2 { "order = 2\n" } else { "" };
    format!(
        "[mesh]\ngenerate = {{ shape = \"box\", cells = [4, 3, 2], size = [2.0, 1.5, 1.0], element = \"{element}\" }}\n{order}\
         [[region]]\nname = \"*\"\n\
         material = {{ model = \"guccione\", c = \"1000 + 200*x\", bf = 3, bt = 2, bfs = 2, bulk_modulus = 2e4, \
         axis = [\"1 + y\", \"x\", 0] }}\n\
         [[boundary]]\nsurface = \"x0\"\ndisplacement = {{ x = 0.0, y = 0.0, z = 0.0 }}\n\
         [[boundary]]\nsurface = \"x1\"\ntraction = [100.0, 30.0, \"20*y\"]\n\
         [[boundary]]\nsurface = \"z1\"\npressure = 80.0\n\
         [[boundary]]\nsurface = \"z0\"\nfoundation = {{ normal = 500.0, tangential = 100.0 }}\n\
         [[point]]\nat = [2.0, 1.5, 0.0]\nforce = [0.0, 5.0, 0.0]\n\
         [[point]]\nat = [1.0, 0.0, 1.0]\ndisplacement = {{ z = 0.01 }}\n\
         [[body_force]]\nregion = \"*\"\nvalue = [0.0, 20.0, 0.0]\n\
         [newton]\ntolerance = 1e-12\n[steps]\ncount = 2\n[output]\npoints = true\n"
    )
}

/// The points of a file by element and number.
fn sorted(values: &PointValues) -> Vec<usize> {
    let (elements, points) = (values.integers("element").unwrap(), values.integers("point").unwrap());
    let mut order: Vec<usize> = (0..elements.len()).collect();
    order.sort_by_key(|&k| (elements[k], points[k]));
    order
}

/// Checks that two files hold the same points, whose values agree to `1e-9` of the largest of their array.
pub fn assert_same_points(found: &Path, expected: &Path) {
    let [found, expected] = [found, expected].map(|path| read_points(path).unwrap());
    let orders = [sorted(&found), sorted(&expected)];
    assert_eq!(orders[0].len(), orders[1].len());
    let pairs = || orders[0].iter().copied().zip(orders[1].iter().copied());
    for (name, values) in found.integers.iter().filter(|(name, _)| name != "rank" && name != "rve_iterations") {
        let of_expected = expected.integers(name).unwrap();
        assert!(pairs().all(|(a, b)| values[a] == of_expected[b]), "{name}");
    }
    for (name, size, values) in &found.numbers {
        let of_expected = expected.numbers(name).unwrap();
        let largest = of_expected.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
        let differs = |a: usize, b: usize| {
            (0..*size).any(|k| (values[size * a + k] - of_expected[size * b + k]).abs() > 1e-9 * largest)
        };
        assert!(!pairs().any(|(a, b)| differs(a, b)), "{name}");
    }
}

/// Forces, fields and messages are the same, whichever rank holds an element or a condition.
#[test]
fn bodies_in_parts_give_the_same_loads_and_fields() {
    let _turn = one_at_a_time();
    let by_multigrid = "solver = { method = \"cg\", preconditioner = \"multigrid\" }\n";
    for (element, order, solver) in [("tet4", 1, ""), ("hex8", 2, ""), ("tet4", 2, by_multigrid)] {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        let text = loaded(element, order);
        run(folder, &text, "--out alone --backend sparse").done();
        for (above, below) in [(2, 1), (5, 1)] {
            let text = text.replace("[newton]\n", &format!("[newton]\n{solver}"));
            write_case(folder, "case.toml", &with_scales(&text, (above, below)));
            mpirun_done(folder, above + below, "run case.toml --backend petsc --out parts");
            assert_same_to_rounding(&read(folder, "parts/loads.csv"), &read(folder, "alone/loads.csv"));
            assert_same_points(&folder.join("parts/points-00002.pvtu"), &folder.join("alone/points-00002.vtu"));
            let index = read(folder, "parts/fields-00002.pvtu");
            let pieces = (0..above).filter(|rank| index.contains(&format!("part-{rank:04}.vtu")));
            assert_eq!(pieces.count(), above, "{index}");
            line(folder, "report parts").done();
            let starts = ["alone", "parts"].map(|out| events(&folder.join(out))[0].clone());
            for size in ["elements", "nodes", "unknowns", "rves"] {
                assert_eq!(starts[0][size], starts[1][size], "{size}");
            }
        }
    }
}

/// The largest residual of a failed attempt is found on whichever rank it is.
#[test]
fn the_largest_residual_is_that_of_all_parts() {
    let _turn = one_at_a_time();
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let text = loaded("tet4", 1).replace("[newton]\n", "[newton]\nmax_iterations = 1\n");
    let text = text.replace("count = 2\n", "count = 1\nmax_cuts = 0\n");
    let alone = run(folder, &text, "--out alone --backend sparse");
    let expected = alone.failed(3);
    let residual = |out: &str| {
        let events = events(&folder.join(out));
        let cut = events.iter().find(|event| event["event"] == "cut").unwrap();
        cut["largest_residual"].clone()
    };
    let of_alone = residual("alone");
    assert!(expected.contains(&format!("is at node {} (", of_alone["node"])), "{expected}");
    for above in [2, 5] {
        write_case(folder, "case.toml", &with_scales(&text, (above, 1)));
        let failed = launched(folder, above + 1, "run case.toml --backend petsc --out parts").output().unwrap();
        let message = String::from_utf8_lossy(&failed.stderr);
        assert!(!failed.status.success() && message.contains("the largest residual force"), "{message}");
        let of_parts = residual("parts");
        for key in ["node", "elements", "position"] {
            assert_eq!(of_parts[key], of_alone[key], "{key}");
        }
        let [a, b] = [&of_parts, &of_alone].map(|of| of["force"].as_f64().unwrap());
        assert!((a - b).abs() < 1e-9 * b, "{a} {b}");
    }
}

fn with_conditions(conditions: &str) -> String {
    format!(
        "[mesh]\ngenerate = {{ shape = \"box\", cells = [5, 2, 2], size = [2.5, 1.0, 1.0] }}\n{conditions}\
         [newton]\ntolerance = 1e-12\n[steps]\ncount = 2\n[output]\npoints = true\n"
    )
}

/// Supports of a free body, rigid surfaces, planes of symmetry, regions and cavities of constrained volume, and patches of
/// elements extend over the parts of several ranks.
#[test]
fn conditions_of_the_whole_body_hold_in_parts() {
    let _turn = one_at_a_time();
    let region = format!("[[region]]\nname = \"*\"\nmaterial = {{ {CONSTANTS} }}\n");
    let boundary = |surface: &str, load: &str| format!("[[boundary]]\nsurface = \"{surface}\"\n{load}\n");
    let free = "[body]\nfree = \"rigid\"\n".to_owned()
        + &region
        + &boundary("x0", "traction = [-100.0, 0.0, 0.0]")
        + &boundary("x1", "traction = [100.0, 0.0, 0.0]");
    let rigid = region.clone()
        + "f_bar = true\n"
        + &boundary("x0", "displacement = { x = 0.0, y = 0.0, z = 0.0 }")
        + &boundary("x1", "rigid = { displacement = { x = 0.2 }, rotation = { x = 0.3 } }")
        + "[[constraint]]\nregion = \"*\"\nvolume = [[0, 1], [1, 1.1]]\n";
    let planes = region.clone()
        + &boundary("x0", "symmetry = true")
        + &boundary("y0", "symmetry = true")
        + &boundary("z0", "symmetry = true")
        + &boundary("x1", "displacement = { x = \"0.2*t*(1 + y)\" }");
    let cavity = crate::constraints::formula("", "tolerance = 1e-12") + "[output]\npoints = true\n";
    let cases = [with_conditions(&free), with_conditions(&rigid), with_conditions(&planes), cavity];
    for text in &cases {
        let folder = crate::constraints::with_mesh();
        let folder = folder.path();
        run(folder, text, "--out alone --backend sparse").done();
        write_case(folder, "case.toml", &with_scales(text, (4, 1)));
        mpirun_done(folder, 5, "run case.toml --backend petsc --out parts");
        assert_same_to_rounding(&read(folder, "parts/loads.csv"), &read(folder, "alone/loads.csv"));
        assert_same_points(&folder.join("parts/points-00002.pvtu"), &folder.join("alone/points-00002.vtu"));
    }
}

/// A body whose networks, fractions and matrices vary; writes the networks and the fields.
pub fn varying(folder: &Path) -> String {
    line(folder, "network generate --points 25 --count 2 --directory networks").done();
    let row = |element: u32| format!("{},{}\n", element % 2, 0.002 + 1e-4 * f64::from(element));
    std::fs::write(folder.join("fields.csv"), "index,fraction\n".to_owned() + &(0..18).map(row).collect::<String>())
        .unwrap();
    "[mesh]\ngenerate = { shape = \"box\", cells = [3, 1, 1], size = [3.0, 1.0, 1.0] }\n\
        [[region]]\nname = \"*\"\n[region.material]\nmodel = \"fiber-rve\"\nnetworks = \"networks/*.txt\"\n\
        choose = { index = { file = \"fields.csv\", column = \"index\" } }\n\
        fiber_volume_fraction = { file = \"fields.csv\", column = \"fraction\" }\n\
        law = { name = \"linear\", youngs_modulus = 1.0e8, radius = 5.0e-8 }\n\
        matrix = { model = \"neo-hookean\", shear_modulus = \"1000 + 200*x\", poisson_ratio = 0.3 }\n\
        [[boundary]]\nsurface = \"x0\"\ndisplacement = { x = 0.0, y = 0.0, z = 0.0 }\n\
        [[boundary]]\nsurface = \"x1\"\ndisplacement = { x = 0.2, y = 0.9, z = 0.0 }\n\
        [newton]\ntolerance = 1e-12\n[steps]\ncount = 3\n[output]\npoints = true\n"
        .into()
}

/// Each rank has the materials of its part, and RVEs bring theirs along when they are created, late here, and when they
/// migrate.
#[test]
fn materials_that_depend_on_the_mesh_are_those_of_the_whole_body() {
    let _turn = one_at_a_time();
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let text = &varying(folder);
    let life = "life = { created_at = 0.05, deleted_at = 0.25 }\nlaw = {";
    for (text, name) in [(text, "always"), (&text.replace("law = {", life), "late")] {
        run(folder, text, "--out alone --backend sparse").done();
        let events = events(&folder.join("alone"));
        let sum = |of: &str| events.iter().filter_map(|event| event["rve"][of].as_u64()).sum::<u64>();
        assert_eq!((sum("waiting") > 0, sum("deleted") > 0), (name == "late", name == "late"));
        let agrees = |scales: (usize, usize), options: &str| {
            write_case(folder, "case.toml", &restless(text, scales, BY_ITERATIONS));
            mpirun_done(folder, scales.0 + scales.1, &format!("run case.toml --backend petsc --out parts {options}"));
            assert_same_to_rounding(&read(folder, "parts/loads.csv"), &read(folder, "alone/loads.csv"));
            let points = if scales.0 > 1 { "pvtu" } else { "vtu" };
            let found = folder.join(format!("parts/points-00003.{points}"));
            assert_same_points(&found, &folder.join("alone/points-00003.vtu"));
        };
        agrees((1, 2), "");
        agrees((3, 2), "");
        line(folder, "divide case.toml --ranks 3 --out divided").done();
        agrees((3, 2), "--divided divided");
        assert!(!migrations(&folder.join("parts")).is_empty());
        std::fs::remove_file(folder.join("parts/checkpoint/step-00003.bin")).unwrap();
        agrees((2, 3), "--resume");
    }
    // The rank that reads the mesh fails: all end with its message.
    std::fs::write(folder.join("fields.csv"), "index,fraction\n7,0.1\n").unwrap();
    for (backend, shares) in [("petsc", (3, 2)), ("sparse", (2, 2))] {
        write_case(folder, "case.toml", &with_scales(text, shares));
        let options = format!("run case.toml --backend {backend} --out other");
        let failed = launched(folder, shares.0 + shares.1, &options).output().unwrap();
        let message = String::from_utf8_lossy(&failed.stderr);
        assert_eq!(failed.status.code(), Some(2), "{message}");
        assert!(message.contains("fields.csv"), "{message}");
    }
}

/// The means at the nodes of a body in parts are those of the whole body, although a part lacks elements at its nodes.
#[test]
fn means_at_the_nodes_of_bodies_in_parts_are_complete() {
    let _turn = one_at_a_time();
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let text = loaded("tet4", 1) + "fields = [\"energy_density\", \"nodal_energy_density\"]\n";
    run(folder, &text, "--out alone --backend sparse").done();
    write_case(folder, "case.toml", &with_scales(&text, (4, 1)));
    mpirun_done(folder, 5, "run case.toml --backend petsc --out parts");
    let [alone, parts] =
        ["alone/fields-00002.vtu", "parts/fields-00002.pvtu"].map(|file| read_fields(&folder.join(file)).unwrap());
    let mean = |fields: &Fields, node: usize| fields.point_scalar("nodal_energy_density").unwrap()[node];
    let largest = (0..alone.points.len()).map(|node| mean(&alone, node)).fold(0.0, f64::max);
    assert!(largest > 0.0);
    for (node, point) in parts.points.iter().enumerate() {
        let in_alone = alone.points.iter().position(|other| other == point).unwrap();
        assert!((mean(&parts, node) - mean(&alone, in_alone)).abs() < 1e-9 * largest, "node {in_alone}");
    }
}

/// RVEs of a part are solved by the micro scale like those of a whole body, whichever of its ranks they move to; networks
/// come from all ranks.
#[test]
fn networks_of_bodies_in_parts_are_written() {
    let _turn = one_at_a_time();
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let text = uneven(&fibers(&frozen())).replace("cells = [1, 1, 1]", "cells = [3, 1, 1]");
    let text = format!("{text}[newton]\ntolerance = 1e-12\n[output]\npoints = true\nrve = [1, 4, 16]\n");
    run(folder, &text, "--out alone --backend sparse").done();
    write_case(folder, "case.toml", &restless(&text, (3, 2), BY_ITERATIONS));
    mpirun_done(folder, 5, "run case.toml --backend petsc --out parts");
    assert!(events(&folder.join("parts")).iter().any(|event| event["event"] == "migration"));
    assert_same_to_rounding(&read(folder, "parts/loads.csv"), &read(folder, "alone/loads.csv"));
    assert_same_points(&folder.join("parts/points-00002.pvtu"), &folder.join("alone/points-00002.vtu"));
    for file in ["rve/element-00001-step-00002.vtp", "rve/element-00016-step-00001.vtp", "rve/element-00004.pvd"] {
        // The numbers may differ in their last digits.
        let lengths = ["parts", "alone"].map(|out| read(folder, &format!("{out}/{file}")).len());
        assert!(lengths[0].abs_diff(lengths[1]) < lengths[1] / 50, "{file}: {lengths:?}");
    }
    let logged = ["alone", "parts"].map(|out| {
        let steps = events(&folder.join(out)).into_iter().filter(|event| event["event"] == "step");
        steps.map(|step| step["rve"]["solves"].as_u64().unwrap()).collect::<Vec<_>>()
    });
    assert_eq!(logged[0], logged[1]);
    write_case(folder, "case.toml", &with_scales(&text.replace("[1, 4, 16]", "[1, 99]"), (3, 2)));
    let failed = launched(folder, 5, "run case.toml --backend petsc --out other").output().unwrap();
    let message = String::from_utf8_lossy(&failed.stderr);
    assert!(message.contains("names element 99; the mesh has 18 elements"), "{message}");
}

/// A step fails on all ranks if it fails on one, and the first failed element is that of a run in one process.
#[test]
fn a_failing_step_of_a_body_in_parts_gives_the_same_message() {
    let _turn = one_at_a_time();
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let text = PRESSED.replace("cells = [1, 1, 1]", "cells = [3, 2, 1]");
    let alone = run(folder, &text, "--backend sparse --out out");
    let message = alone.failed(3).to_owned();
    write_case(folder, "case.toml", &with_scales(&text, (3, 1)));
    let failed = launched(folder, 4, "run case.toml --backend petsc --out parts").output().unwrap();
    let of_parts = String::from_utf8_lossy(&failed.stderr);
    let first = message.lines().next().unwrap();
    assert!(of_parts.contains(first), "{of_parts}\n{first}");
    assert!(folder.join("parts/fields-00003-partial-part-0002.vtu").is_file(), "{of_parts}");
    line(folder, "report parts").done();
}

/// Some ranks have no element, and none of them a free node of their own.
#[test]
fn a_body_of_fewer_elements_than_ranks_runs() {
    let _turn = one_at_a_time();
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let text =
        PRESSED.replace("-1.5", "-0.4").replace("size = [1.0, 1.0, 1.0]", "size = [1.0, 1.0, 1.0], element = \"hex8\"");
    let text = text.replace("cells = [1, 1, 1]", "cells = [2, 1, 1]");
    run(folder, &text, "--out alone --backend sparse").done();
    write_case(folder, "case.toml", &with_scales(&text, (4, 1)));
    mpirun_done(folder, 5, "run case.toml --backend petsc --out parts");
    assert_same_to_rounding(&read(folder, "parts/loads.csv"), &read(folder, "alone/loads.csv"));
}

/// The checkpoint holds the whole body: a run goes on with other parts, and in one process.
#[test]
fn a_body_in_parts_is_resumed_with_other_parts() {
    let _turn = one_at_a_time();
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let text = loaded("tet4", 1);
    run(folder, &text, "--out alone --backend sparse").done();
    write_case(folder, "case.toml", &with_scales(&text, (3, 1)));
    mpirun_done(folder, 4, "run case.toml --backend petsc --out parts");
    let last = folder.join("parts/checkpoint/step-00002.bin");
    assert_eq!(body_pieces(folder, 2), 3);
    for (above, below) in [(2, 2), (1, 1), (4, 1)] {
        std::fs::remove_file(&last).unwrap();
        write_case(folder, "case.toml", &with_scales(&text, (above, below)));
        mpirun_done(folder, above + below, "run case.toml --backend petsc --out parts --resume");
        assert_same_to_rounding(&read(folder, "parts/loads.csv"), &read(folder, "alone/loads.csv"));
        assert_eq!(body_pieces(folder, 2), above);
    }
}

/// Returns the number of body pieces in the checkpoint of a step.
fn body_pieces(folder: &Path, step: usize) -> usize {
    let begin = format!("step-{step:05}-body-");
    let entries = std::fs::read_dir(folder.join("parts/checkpoint")).unwrap();
    entries.filter(|entry| entry.as_ref().unwrap().file_name().to_str().unwrap().starts_with(&begin)).count()
}

/// A body piece that is damaged or missing makes all ranks use the checkpoint before, also the ranks that do not need it.
#[test]
fn a_lost_body_piece_makes_all_ranks_use_the_checkpoint_before() {
    let _turn = one_at_a_time();
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let text = loaded("tet4", 1);
    run(folder, &text, "--out alone --backend sparse").done();
    let last = folder.join("parts/checkpoint/step-00002-body-0001.bin");
    let changes: [(&str, &dyn Fn()); 2] = [
        ("step-00002-body-0001.bin: is missing; trying the one before", &|| std::fs::remove_file(&last).unwrap()),
        ("step-00002-body-0001.bin: damaged: its ", &|| {
            let mut bytes = std::fs::read(&last).unwrap();
            bytes[100] ^= 4;
            std::fs::write(&last, bytes).unwrap();
        }),
    ];
    for (message, change) in changes {
        for scales in [(3, 1), (2, 1), (1, 1)] {
            write_case(folder, "case.toml", &with_scales(&text, (3, 1)));
            mpirun_done(folder, 4, "run case.toml --backend petsc --out parts");
            change();
            write_case(folder, "case.toml", &with_scales(&text, scales));
            let arguments = "run case.toml --backend petsc --out parts --resume";
            let resumed = launched(folder, scales.0 + scales.1, arguments).output().unwrap();
            let warned = String::from_utf8_lossy(&resumed.stderr);
            assert!(resumed.status.success() && warned.matches(message).count() == 1, "{scales:?}: {warned}");
            assert!(warned.contains("continuing after step 1 of 2"), "{scales:?}: {warned}");
            assert_same_to_rounding(&read(folder, "parts/loads.csv"), &read(folder, "alone/loads.csv"));
        }
    }
    // Without a checkpoint before, the run ends.
    std::fs::remove_file(folder.join("parts/checkpoint/step-00001.bin")).unwrap();
    let last = folder.join("parts/checkpoint/step-00002-body-0000.bin");
    std::fs::write(&last, "BIOTISSU").unwrap();
    let failed = launched(folder, 2, "run case.toml --backend petsc --out parts --resume").output().unwrap();
    let message = String::from_utf8_lossy(&failed.stderr);
    assert_eq!(failed.status.code(), Some(2), "{message}");
    assert!(message.contains("step-00002-body-0000.bin: damaged: ends after 8 bytes"), "{message}");
}

/// Only the second rank finds a piece damaged, in a folder of its own: the first one does not go on without it.
#[test]
fn a_body_piece_that_one_rank_cannot_read_is_reported_by_all() {
    let _turn = one_at_a_time();
    let folder = tempfile::tempdir().unwrap();
    let [first, second] = ["first", "second"].map(|name| folder.path().join(name));
    let arguments = "run case.toml --backend petsc --out parts";
    let damaged = "parts/checkpoint/step-00002-body-0000.bin";
    std::fs::create_dir(&first).unwrap();
    write_case(&first, "case.toml", &with_scales(&loaded("tet4", 1), (2, 1)));
    let resumed = |has_one_before: bool| {
        mpirun_done(&first, 3, arguments);
        if !has_one_before {
            std::fs::remove_file(first.join("parts/checkpoint/step-00001.bin")).unwrap();
        }
        let _ = std::fs::remove_dir_all(&second);
        assert!(Command::new("cp").arg("-r").args([&first, &second]).status().unwrap().success());
        std::fs::write(second.join(damaged), "BIOTISSU").unwrap();
        let mut command = launched(&first, 1, &format!("{arguments} --resume"));
        for folder in [&second, &first] {
            let rank = [":", "-n", "1", "--wdir", folder.to_str().unwrap(), env!("CARGO_BIN_EXE_biotissue")];
            command.args(rank).args(arguments.split(' ')).arg("--resume");
        }
        // Ranks that do not agree would wait for each other.
        let output = command.env("MPIEXEC_TIMEOUT", "60").output().unwrap();
        assert!(!output.status.success());
        String::from_utf8_lossy(&output.stderr).into_owned()
    };
    let (message, found) = (resumed(true), format!("rank 1 failed: {damaged}: damaged: ends after 8 bytes"));
    assert!(message.contains(&format!("warning: {found}")), "{message}");
    assert!(
        message.contains("; trying the one before") && message.contains("continuing after step 1 of 2"),
        "{message}"
    );
    let message = resumed(false);
    assert!(
        message.contains(&format!("error: {found}")) || message.contains(&format!("error: {damaged}")),
        "{message}"
    );
    assert!(!message.contains("continuing after"), "{message}");
}

/// The networks of an RVE are written as long as it exists, whichever rank holds its element.
#[test]
fn networks_of_deleted_rves_are_not_written() {
    let _turn = one_at_a_time();
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let text = with_life_cycles() + "[output]\nrve = \"all\"\n";
    run(folder, &text, "--out alone --backend sparse").done();
    write_case(folder, "case.toml", &with_scales(&text, (3, 1)));
    mpirun_done(folder, 4, "run case.toml --backend petsc --out parts");
    let written = |out: &str| -> BTreeSet<String> {
        let entries = std::fs::read_dir(folder.join(out).join("rve")).unwrap();
        entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect()
    };
    let alone = written("alone");
    assert!(alone.iter().any(|name| name.contains("step-00009")) && !alone.is_empty());
    assert_eq!(written("parts"), alone);
}
