//! Tests of the whole reader: valid files, invalid files, written files, damaged files.

mod broken;
mod damaged;
mod good;
mod names;
mod written;

use std::path::{Path, PathBuf};

use super::{Case, CaseFile};
use crate::input::InputErrors;

/// A folder with a mesh and a network library beside the case file.
pub(super) struct Folder(tempfile::TempDir);

impl Folder {
    pub(super) fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("networks")).unwrap();
        for file in ["sample.msh", "networks/b.txt", "networks/a.txt", "networks/a.txt.params", "networks/a.txt.toml"] {
            std::fs::write(folder.path().join(file), "").unwrap();
        }
        Self(folder)
    }

    pub(super) fn path(&self) -> &Path {
        self.0.path()
    }

    pub(super) fn case(&self) -> PathBuf {
        self.path().join("pull.toml")
    }

    pub(super) fn parse(&self, text: &str) -> Result<CaseFile, InputErrors> {
        Case::parse(text, &self.case())
    }

    /// Returns all errors as shown to the user, without the name of the folder.
    pub(super) fn errors(&self, text: &str) -> String {
        let errors = self.parse(text).expect_err("a broken case was accepted").to_string();
        errors.replace(&format!("{}/", self.path().display()), "").replace(&self.path().display().to_string(), "FOLDER")
    }
}

/// A case with every section and every kind of entry.
pub(super) const FULL: &str = r#"title = "Dogbone in tension"

[mesh]
file = "sample.msh"
scale = 0.001

[[region]]
name = "gauge"
[region.material]
model = "fiber-rve"
networks = ["networks/*.txt*"]
choose = "cycle"
seed = 7
fiber_volume_fraction = 0.003
law = { name = "exponential-stretch", youngs_modulus = 1.0e8, radius = 5.0e-8, nonlinearity = 1.2, transition = 1.4 }
matrix = { model = "neo-hookean", shear_modulus = 100, poisson_ratio = 0.3 }

[[region]]
name = "*"
material = { model = "linear-elastic", youngs_modulus = 1.0e6, poisson_ratio = 0.3 }

[[boundary]]
surface = "left"
displacement = { x = 0, y = 0.0, z = 0.0 }
[[boundary]]
surface = "right"
traction = [4.0e4, 0.0, 0.0]
curve = [[0.0, 0.0], [0.5, 1.0], [1, 0.25]]
[[boundary]]
surface = "right"
displacement = { y = 0.0 }

[[point]]
at = [0.0, 0.0, 0.5]
displacement = { z = -1e-3 }
[[point]]
node = 12
displacement = { x = 0.0, z = 0.0 }
curve = "ramp"

[[body_force]]
region = "gauge"
value = [0.0, 0.0, -9810.0]

[[constraint]]
region = "gauge"
volume = "constant"
[[constraint]]
cavity = ["left", "right"]
name = "lumen"
volume = [[0.0, 1], [1.0, 1.25]]
method = "penalty"
penalty = 50

[steps]
count = 20
max_cuts = 4
adaptive = { target_iterations = 6, largest = 0.5 }

[newton]
tolerance = 1e-9
max_iterations = 30
line_search = false
displacement_tolerance = 1e-5
energy_tolerance = "none"
start = "held"
solver = { method = "cg", preconditioner = "diagonal", tolerance = 1e-13 }

[micro]
lanes = "mixed"
tolerance = 1e-11
max_iterations = 60
max_cuts = 5
stages = ["newton", "cuts"]
predictor = false
solver = { method = "gmres", restart = 30, drop_tolerance = 0, fill = 7 }

[scales]
macro = 1
micro = 3
near = true

[output]
directory = "out/pull"
every = 5
checkpoint = 2
points = true
rve = [17, 0, 17]
"#;

/// The smallest case.
pub(super) const SMALL: &str = r#"[mesh]
generate = { shape = "dogbone", element_size = 0.002 }
[[region]]
name = "*"
material = { model = "neo-hookean", shear_modulus = 1.0e5, lame_lambda = 2.0e5 }
"#;
