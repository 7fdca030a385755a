//! The forecast of memory by `biotissue check`, against the peak of runs.

use std::path::Path;
use std::process::Command;

use crate::run::write_case;
use crate::skip::skip;
use crate::{line, program};

/// Runs a command and prints the largest memory that it had, in bytes.
const PEAK: &str = "import resource, subprocess, sys\n\
                    subprocess.run(sys.argv[1:], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)\n\
                    print(1024 * resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)";

/// Returns the peak of the program with these arguments, in bytes; `None` without Python.
fn peak(folder: &Path, arguments: &str) -> Option<f64> {
    let command = program(folder);
    let mut python = Command::new("python3");
    python.args(["-c", PEAK]).arg(command.get_program()).args(arguments.split(' ')).current_dir(folder);
    let output = python.output().ok()?;
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    Some(String::from_utf8(output.stdout).unwrap().trim().parse().unwrap())
}

fn body(cells: usize, order: usize, material: &str, end: &str) -> String {
    format!(
        "[mesh]\norder = {order}\ngenerate = {{ shape = \"box\", cells = [{cells}, {cells}, {cells}], size = [1.0, 1.0, 1.0] }}\n\
         [[region]]\nname = \"*\"\n[region.material]\n{material}\n\
         [[boundary]]\nsurface = \"x0\"\ndisplacement = {{ x = 0.0, y = 0.0, z = 0.0 }}\n\
         [[boundary]]\nsurface = \"x1\"\ndisplacement = {{ x = 0.02, y = 0.0, z = 0.0 }}\n\
         [steps]\ncount = 1\n[output]\n{end}"
    )
}

#[test]
fn the_forecast_of_memory_is_within_a_fifth() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    line(folder, "network generate --points 300 --count 4 --directory networks").done();
    let formula = "model = \"neo-hookean\"\nyoungs_modulus = 1.0e6\npoisson_ratio = 0.3";
    let fibers = "model = \"fiber-rve\"\nnetworks = [\"networks/*.txt\"]\nfiber_volume_fraction = 0.003\n\
                  law = { name = \"linear\", youngs_modulus = 1.0e8, radius = 5.0e-8 }";
    let direct = "every = 1\n[newton]\nsolver = { method = \"direct\" }\n";
    for (case, what) in [
        (body(20, 1, formula, "every = 1\n"), "multigrid with fields"),
        (body(10, 2, formula, direct), "direct solver, order 2, fields"),
        (body(4, 1, fibers, "every = 0\n"), "networks"),
    ] {
        write_case(folder, "case.toml", &case);
        // The program itself is larger with the libraries of all features.
        let arguments = ["--version", "run case.toml --threads 2 --out out"];
        let [Some(program), Some(run)] = arguments.map(|arguments| peak(folder, arguments)) else {
            return skip("needs python3");
        };
        let plan = line(folder, "check case.toml --json --threads 2").object();
        let parts =
            ["rves", "networks", "points", "system", "fields"].map(|part| plan["memory"][part].as_f64().unwrap());
        let (found, forecast) = (run - program, parts.iter().sum::<f64>());
        println!("{what}: {:.1} MB beyond the program, forecast {:.1} MB", 1e-6 * found, 1e-6 * forecast);
        assert!((forecast - found).abs() <= 0.2 * found, "{what}: {found:e} bytes, forecast {forecast:e}");
    }
}
