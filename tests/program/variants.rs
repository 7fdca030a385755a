//! Runs of one case in every way that must not change its results.

use std::path::Path;

use biotissue::app::results::Loads;
use biotissue::app::results::log::{self, Event};

use crate::line;

/// The parameters of the material of the bodies.
pub const CONSTANTS: &str = "model = \"neo-hookean\", shear_modulus = 1000.0, poisson_ratio = 0.3";

/// Runs a case of `steps` load steps, whose text `case` returns for a material: with the formula of [`CONSTANTS`], from the
/// case file that this run writes, with an RVE of the same material at every point on three ranks, and interrupted before
/// the last step. All must write the same loads. The results of the formula are in the folder `formula`, those of the
/// interrupted run in `parts`.
pub fn run_every_way(folder: &Path, steps: usize, case: impl Fn(&str) -> String) {
    let rve = format!("{{ model = \"fiber-rve\", networks = [], matrix = {{ {CONSTANTS} }} }}");
    std::fs::write(folder.join("formula.toml"), case(&format!("{{ {CONSTANTS} }}"))).unwrap();
    std::fs::write(folder.join("rve.toml"), case(&rve)).unwrap();
    line(folder, "run formula.toml --out formula").done();
    line(folder, "run formula/case.toml --out written").done();
    line(folder, "run rve.toml --out rve --ranks 3").done();
    line(folder, "run rve.toml --out parts").done();
    std::fs::remove_file(folder.join(format!("parts/checkpoint/step-{steps:05}.bin"))).unwrap();
    line(folder, "run rve.toml --out parts --resume").done();
    let read = |run: &str| std::fs::read_to_string(folder.join(run).join("loads.csv")).unwrap();
    for other in ["written", "rve", "parts"] {
        assert_eq!(read(other), read("formula"), "{other}: {}", case("material"));
    }
}

/// Returns the loads of a run.
pub fn loads(folder: &Path, run: &str) -> Loads {
    Loads::read(&folder.join(run).join("loads.csv")).unwrap_or_else(|error| panic!("{error}"))
}

/// Returns the logged steps of a run.
pub fn logged_steps(folder: &Path, run: &str) -> Vec<log::Step> {
    let events = log::read(&folder.join(run).join("log.jsonl")).unwrap().into_iter();
    events.filter_map(|event| if let Event::Step(step) = event { Some(step) } else { None }).collect()
}
