//! Runs with constrained volumes: a driven cavity and a region of constant volume.

use biotissue::app::results::read_fields;
use biotissue::fem::element::ElementType;
use biotissue::fem::mesh::gmsh;

use crate::hollow_box::hollow_box;
use crate::variants::{CONSTANTS, loads, logged_steps, run_every_way};
use crate::{frozen, line};

/// A box with a cavity, whose side x1 is pulled.
fn case(material: &str, method: &str, newton: &str) -> String {
    format!(
        r#"[mesh]
file = "hollow.msh"
[[region]]
name = "*"
material = {material}
[[boundary]]
surface = "x0"
displacement = {{ x = 0.0, y = 0.0, z = 0.0 }}
[[boundary]]
surface = "x1"
displacement = {{ x = 1.5, y = 0.8 }}
[[constraint]]
cavity = ["floor", "walls"]
name = "lumen"
volume = [[0.0, 1.0], [0.4, 1.2], [1.0, 0.9]]
{method}
[[constraint]]
region = "body"
volume = "constant"
[steps]
count = 3
[newton]
{newton}
"#
    )
}

pub fn formula(method: &str, newton: &str) -> String {
    case(&format!("{{ {CONSTANTS} }}"), method, newton)
}

pub fn with_mesh() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    gmsh::write(&folder.path().join("hollow.msh"), &hollow_box(ElementType::Hex8)).unwrap();
    folder
}

#[test]
fn constrained_volumes_do_not_depend_on_ranks_rves_or_interruptions() {
    let folder = with_mesh();
    let folder = folder.path();
    let mut tables = Vec::new();
    for (method, newton) in [("", ""), ("method = \"penalty\"", ""), ("method = \"penalty\"", "max_iterations = 2")] {
        run_every_way(folder, 3, |material| case(material, method, newton));
        line(folder, "report formula").done();
        let page = std::fs::read_to_string(folder.join("formula/report.html")).unwrap();
        assert!(page.contains(">pressure in "), "{method} {newton}");

        let logged = logged_steps(folder, "formula");
        assert!(logged.iter().all(|step| step.balance.relative < 1e-6), "{logged:?}");
        // The target has a break point inside the second step.
        assert!(logged[1].increments >= 2, "{:?}", logged[1]);
        assert_eq!(logged.iter().any(|step| step.augmentations > 0), !method.is_empty());
        let cuts: u32 = logged.iter().map(|step| step.cuts).sum();
        assert_eq!(cuts > 0, !newton.is_empty(), "{cuts} cuts");
        let summary = line(folder, "run formula.toml --out formula");
        assert_eq!(
            summary.done().contains(" in a failed increment") || summary.done().contains(" failed increments, "),
            cuts > 0
        );
        tables.push(loads(folder, "formula"));
    }
    let [multiplier, penalty, cut] = &tables[..] else { panic!("three runs") };
    assert_eq!(multiplier.names.regions, ["body", "lumen"]);
    assert_eq!(multiplier.names.constraints, ["lumen", "body"]);
    for (k, row) in multiplier.rows.iter().enumerate() {
        let factor = if row.t < 0.4 { 1.0 + 0.5 * row.t } else { 1.2 - 0.5 * (row.t - 0.4) };
        assert!((row.volumes[0] - 26.0).abs() < 1e-6 && (row.volumes[1] - factor).abs() < 1e-6, "{row:?}");
        for other in [penalty, cut] {
            let row_of_other = &other.rows[k];
            for (p, q) in row.pressures.iter().zip(&row_of_other.pressures) {
                assert!((p - q).abs() < 1e-4 * p.abs(), "{row:?} {row_of_other:?}");
            }
        }
    }
}

/// The pressures of penalty constraints are augmented before RVEs are created and deleted, and again afterwards: the
/// decisions and the pressures are those of the multipliers, on any number of ranks and after a resumed run.
#[test]
fn rves_are_created_and_deleted_at_constrained_volumes() {
    let folder = with_mesh();
    let folder = folder.path();
    let material = format!(
        "{{ model = \"fiber-rve\", networks = [{:?}], fiber_volume_fraction = 0.003, law = {{ name = \"exponential\", \
         youngs_modulus = 1.0e6, radius = 5.0e-8, nonlinearity = 1.2 }}, matrix = {{ {CONSTANTS} }}, \
         life = {{ created_at = 0.05, deleted_at = 0.5 }} }}",
        frozen()
    );
    let mut found = Vec::new();
    for method in ["", "method = \"penalty\""] {
        std::fs::write(folder.join("case.toml"), case(&material, method, "")).unwrap();
        line(folder, "run case.toml --out whole").done();
        line(folder, "run case.toml --out ranks --ranks 3").done();
        std::fs::remove_file(folder.join("ranks/checkpoint/step-00003.bin")).unwrap();
        line(folder, "run case.toml --out ranks --resume").done();
        let read = |run: &str| std::fs::read_to_string(folder.join(run).join("loads.csv")).unwrap();
        assert_eq!(read("ranks"), read("whole"), "{method}");
        let steps = logged_steps(folder, "whole");
        let deleted: Vec<u64> = steps.iter().map(|step| step.rve.unwrap().deleted).collect();
        assert!(steps.iter().any(|step| step.rounds > 0) && deleted[2] > 0, "{deleted:?}");
        assert_eq!(steps.iter().any(|step| step.augmentations > 0), !method.is_empty());
        found.push((deleted, loads(folder, "whole")));
    }
    let [(by_multiplier, multiplier), (by_penalty, penalty)] = &found[..] else { panic!("two runs") };
    assert_eq!(by_multiplier, by_penalty);
    for (row, other) in multiplier.rows.iter().zip(&penalty.rows) {
        for (p, q) in row.pressures.iter().zip(&other.pressures) {
            assert!((p - q).abs() < 1e-4 * p.abs(), "{row:?} {other:?}");
        }
    }
}

/// The stress in the fields contains the pressure of a constrained region: that of a body without forces is zero.
#[test]
fn a_freely_swelling_body_has_no_stress() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let planes = ["x0", "y0", "z0"].map(|plane| format!("[[boundary]]\nsurface = \"{plane}\"\nsymmetry = true\n"));
    let text = format!(
        "[mesh]\ngenerate = {{ shape = \"box\", cells = [2, 2, 2], size = [1, 1, 1], element = \"hex8\" }}\n[[region]]\n\
         name = \"*\"\nmaterial = {{ {CONSTANTS} }}\n{}[[constraint]]\nregion = \"*\"\nvolume = [[0, 1], [1, 1.3]]\n\
         [steps]\ncount = 2\n",
        planes.concat()
    );
    std::fs::write(folder.join("case.toml"), text).unwrap();
    line(folder, "run case.toml --out out").done();
    let found = loads(folder, "out");
    assert_eq!(found.names.constraints, ["all"]);
    assert!(found.rows.last().unwrap().pressures[0] > 400.0, "{:?}", found.rows);
    let fields = read_fields(&folder.join("out/fields-00002.vtu")).unwrap();
    for stress in fields.cell_tensor("cauchy_stress").unwrap() {
        assert!(stress.iter().all(|component| component.abs() < 1e-6), "{stress:?}");
    }
}

#[test]
fn constraints_are_checked_against_the_mesh_and_planned() {
    let folder = with_mesh();
    let folder = folder.path();
    let write = |text: String| std::fs::write(folder.join("case.toml"), text).unwrap();
    write(formula("method = \"penalty\"\npenalty = 30", ""));
    let plan = line(folder, "check case.toml");
    for text in [
        "constraint lumen: cavity of floor (1.0000e0 m^2), walls (5.0000e0 m^2); volume driven; by penalty of 30\n",
        "constraint body: region body; volume constant; by multiplier\n",
    ] {
        assert!(plan.done().contains(text), "{}", plan.stdout);
    }
    let refused = |text: String, message: &str| {
        write(text);
        let refused = line(folder, "check case.toml");
        assert!(refused.failed(2).contains(message), "{}", refused.stderr);
    };
    let whole = formula("", "");
    refused(
        whole.replace("[\"floor\", \"walls\"]", "\"walls\""),
        "case.toml:12: constraint `lumen`: the surfaces of the cavity are not closed: the edge from node ",
    );
    refused(
        whole.replace("[\"floor\", \"walls\"]", "[\"x0\", \"x1\", \"y0\", \"y1\", \"z0\", \"z1\"]"),
        "case.toml:12: constraint `lumen`: its surfaces enclose no cavity",
    );
    refused(whole.replace("\"floor\"", "\"flor\""), "has no surface \"flor\"");
    refused(whole.replace("region = \"body\"", "region = \"bdy\""), "has no region \"bdy\"");
    refused(
        whole.replace("name = \"lumen\"", "name = \"body\""),
        "case.toml:17: `constraint` has the name \"body\" of the constraint at line 12",
    );
    let one = &whole[..whole.find("[[constraint]]\nregion").unwrap()];
    refused(one.replace("\"lumen\"", "\"body\""), "case.toml:12: the constraint has the name of region \"body\"");
    let all = ["y0", "y1", "z0", "z1", "floor", "walls"].map(|surface| {
        format!("[[boundary]]\nsurface = \"{surface}\"\ndisplacement = {{ x = 0.0, y = 0.0, z = 0.0 }}\n")
    });
    let held = whole.replace("{ x = 1.5, y = 0.8 }", "{ x = 0.0, y = 0.0, z = 0.0 }");
    let held = held.replacen("[[constraint]]", &(all.concat() + "[[constraint]]"), 1);
    refused(held, "constraint `lumen`: no free displacement changes the volume");
}

#[test]
fn constraints_that_contradict_each_other_end_the_run_with_a_hint() {
    let folder = with_mesh();
    let folder = folder.path();
    let twice =
        formula("", "") + "[[constraint]]\nregion = \"*\"\nname = \"again\"\nvolume = [[0.0, 1.0], [1.0, 1.1]]\n";
    std::fs::write(folder.join("case.toml"), twice).unwrap();
    let failed = line(folder, "run case.toml");
    let text = failed.failed(3);
    assert!(
        text.contains("is singular")
            && text.contains("; that constraint is `body`")
            && text.contains("remove one of two [[constraint]]s"),
        "{text}"
    );
}
