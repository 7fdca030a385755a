//! Runs with constrained volumes: a driven cavity and a region of constant volume.

use std::path::Path;

use biotissue::app::results::Loads;
use biotissue::app::results::log::{self, Event};
use biotissue::fem::element::ElementType;
use biotissue::fem::mesh::gmsh;

use crate::hollow_box::hollow_box;
use crate::line;

const CONSTANTS: &str = "model = \"neo-hookean\", shear_modulus = 1000.0, poisson_ratio = 0.3";

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

fn formula(method: &str, newton: &str) -> String {
    case(&format!("{{ {CONSTANTS} }}"), method, newton)
}

fn with_mesh() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    gmsh::write(&folder.path().join("hollow.msh"), &hollow_box(ElementType::Hex8)).unwrap();
    folder
}

fn steps(folder: &Path, run: &str) -> Vec<log::Step> {
    let events = log::read(&folder.join(run).join("log.jsonl")).unwrap().into_iter();
    events.filter_map(|event| if let Event::Step(step) = event { Some(step) } else { None }).collect()
}

#[test]
fn constrained_volumes_do_not_depend_on_ranks_rves_or_interruptions() {
    let folder = with_mesh();
    let folder = folder.path();
    let mut tables = Vec::new();
    for (method, newton) in [("", ""), ("method = \"penalty\"", ""), ("method = \"penalty\"", "max_iterations = 2")] {
        let rve = format!("{{ model = \"fiber-rve\", networks = [], matrix = {{ {CONSTANTS} }} }}");
        std::fs::write(folder.join("formula.toml"), formula(method, newton)).unwrap();
        std::fs::write(folder.join("rve.toml"), case(&rve, method, newton)).unwrap();
        line(folder, "run formula.toml --out formula").done();
        line(folder, "run formula/case.toml --out written").done();
        line(folder, "run rve.toml --out rve --ranks 3").done();
        line(folder, "run rve.toml --out parts").done();
        std::fs::remove_file(folder.join("parts/checkpoint/step-00003.bin")).unwrap();
        line(folder, "run rve.toml --out parts --resume").done();
        let read = |run: &str| std::fs::read_to_string(folder.join(run).join("loads.csv")).unwrap();
        for other in ["written", "rve", "parts"] {
            assert_eq!(read(other), read("formula"), "{other}, {method} {newton}");
        }
        line(folder, "report formula").done();

        let logged = steps(folder, "formula");
        assert!(logged.iter().all(|step| step.balance.relative < 1e-6), "{logged:?}");
        // The target has a break point inside the second step.
        assert!(logged[1].increments >= 2, "{:?}", logged[1]);
        assert_eq!(logged.iter().any(|step| step.augmentations > 0), !method.is_empty());
        let cuts: u32 = logged.iter().map(|step| step.cuts).sum();
        assert_eq!(cuts > 0, !newton.is_empty(), "{cuts} cuts");
        tables.push(Loads::read(&folder.join("formula/loads.csv")).unwrap());
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

#[test]
fn constraints_are_checked_against_the_mesh_and_planned() {
    let folder = with_mesh();
    let folder = folder.path();
    let write = |text: String| std::fs::write(folder.join("case.toml"), text).unwrap();
    write(formula("method = \"penalty\"\npenalty = 30", ""));
    let plan = line(folder, "check case.toml");
    for text in [
        "constraint lumen: cavity of floor, walls; volume driven; by penalty of 30\n",
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
    assert!(text.contains("is singular") && text.contains("remove one of two [[constraint]]s"), "{text}");
}
