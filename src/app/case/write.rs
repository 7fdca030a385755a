//! Writing a case as TOML, with all defaults filled in.

use std::fmt::{self, Write};
use std::path::Path;

use crate::fem::boundary::{LoadCurve, SurfaceLoad};
use crate::fem::stepping::StepStart;
use crate::fiber::equilibrium::Stage;
use crate::fiber::law::{FiberMaterial, Law};
use crate::fiber::rve::StressScale;
use crate::tissue::materials::{
    BeforeCreation, ElementSelection, FiberRve, Formula, NetworkAssignment, RegionMaterial, RveLifecycle,
};

use super::data::{Case, MeshSource, PointPlace};
use super::solver;

impl Case {
    /// Returns the case as run: defaults filled in, elastic constants converted, networks listed, paths absolute, so
    /// that it can be read from any folder. Reading it gives an equal case except for the file and the line numbers (a
    /// path that is not Unicode, which no case file can contain, is written with replacement characters).
    #[must_use]
    pub fn to_toml(&self) -> String {
        let mut text = String::new();
        // Writing to a string cannot fail.
        let _ = self.write(&mut text);
        text
    }

    fn write(&self, out: &mut String) -> fmt::Result {
        writeln!(out, "# The case as run by biotissue {}, defaults filled in.", env!("CARGO_PKG_VERSION"))?;
        writeln!(out, "title = {}", quoted(&self.title))?;
        self.write_mesh(out)?;
        for region in &self.regions {
            writeln!(out, "\n[[region]]\nname = {}\n[region.material]", quoted(&region.name))?;
            match &region.material {
                RegionMaterial::Formula(formula) => {
                    for entry in formula_entries(formula) {
                        writeln!(out, "{entry}")?;
                    }
                }
                RegionMaterial::FiberRve(rve) => write_fiber_rve(out, rve)?,
            }
        }
        self.write_loads(out)?;
        self.write_sections(out)
    }

    fn write_mesh(&self, out: &mut String) -> fmt::Result {
        writeln!(out, "\n[mesh]")?;
        match &self.mesh {
            MeshSource::File(file) => writeln!(out, "file = {}", path(file))?,
            MeshSource::Box { cells, size } => {
                writeln!(out, "generate = {{ shape = \"box\", cells = {cells:?}, size = {size:?} }}")?;
            }
            MeshSource::Dogbone { element_size } => {
                writeln!(out, "generate = {{ shape = \"dogbone\", element_size = {element_size:?} }}")?;
            }
        }
        writeln!(out, "scale = {:?}", self.mesh_scale)
    }

    fn write_loads(&self, out: &mut String) -> fmt::Result {
        for boundary in &self.boundaries {
            writeln!(out, "\n[[boundary]]\nsurface = {}", quoted(&boundary.surface))?;
            match &boundary.load {
                SurfaceLoad::Displacement(components) => writeln!(out, "displacement = {}", displacement(components))?,
                SurfaceLoad::Traction(traction) => writeln!(out, "traction = {traction:?}")?,
            }
            writeln!(out, "curve = {}", curve(&boundary.curve))?;
        }
        for point in &self.points {
            match &point.place {
                PointPlace::At(at) => writeln!(out, "\n[[point]]\nat = {at:?}")?,
                PointPlace::Node(node) => writeln!(out, "\n[[point]]\nnode = {node}")?,
            }
            writeln!(out, "displacement = {}\ncurve = {}", displacement(&point.displacement), curve(&point.curve))?;
        }
        for force in &self.body_forces {
            writeln!(out, "\n[[body_force]]\nregion = {}\nvalue = {:?}", quoted(&force.region), force.value)?;
            writeln!(out, "curve = {}", curve(&force.curve))?;
        }
        Ok(())
    }

    fn write_sections(&self, out: &mut String) -> fmt::Result {
        let Self { steps, newton, micro, scales, output, .. } = self;
        writeln!(out, "\n[steps]\ncount = {}\nmax_cuts = {}", steps.count, steps.max_cuts)?;
        let start = match newton.start {
            StepStart::Held => "held",
            StepStart::Tangent => "tangent",
        };
        writeln!(out, "\n[newton]\ntolerance = {:?}\nmax_iterations = {}", newton.tolerance, newton.max_iterations)?;
        writeln!(out, "line_search = {}\nstart = \"{start}\"", newton.line_search)?;
        writeln!(out, "{}", solver::line(&newton.solver))?;
        writeln!(out, "\n[micro]\ntolerance = {:?}\nmax_iterations = {}", micro.tolerance, micro.max_iterations)?;
        let stages: Vec<&str> = micro.stages.iter().map(Stage::name).collect();
        writeln!(out, "max_cuts = {}\nstages = {stages:?}\npredictor = {}", micro.max_cuts, micro.predictor)?;
        writeln!(out, "{}", solver::line(&micro.solver))?;
        writeln!(out, "\n[scales]\nmacro = {}\nmicro = {}", scales.macro_ranks, scales.micro_ranks)?;
        writeln!(out, "near = {}", scales.near)?;
        let rve = match &output.rve {
            ElementSelection::None => "\"none\"".into(),
            ElementSelection::All => "\"all\"".into(),
            ElementSelection::Elements(ids) => format!("{ids:?}"),
        };
        writeln!(out, "\n[output]\ndirectory = {}\nevery = {}\nrve = {rve}", path(&output.directory), output.every)
    }
}

fn write_fiber_rve(out: &mut String, rve: &FiberRve) -> fmt::Result {
    writeln!(out, "model = \"fiber-rve\"\nnetworks = [")?;
    for network in &rve.networks {
        writeln!(out, "    {},", path(network))?;
    }
    let assignment = match rve.assignment {
        NetworkAssignment::Random => "random",
        NetworkAssignment::Cycle => "cycle",
    };
    writeln!(out, "]\nchoose = \"{assignment}\"\nseed = {}", rve.seed)?;
    match rve.scale {
        StressScale::Raw => writeln!(out, "scale = \"raw\"")?,
        StressScale::FiberVolumeFraction(fraction) => writeln!(out, "fiber_volume_fraction = {fraction:?}")?,
    }
    if let Some(material) = &rve.law {
        writeln!(out, "law = {{ {} }}", law_entries(material))?;
    }
    if let Some(matrix) = &rve.matrix {
        writeln!(out, "matrix = {{ {} }}", formula_entries(matrix).join(", "))?;
    }
    if rve.lifecycle != RveLifecycle::default() {
        writeln!(out, "life = {{ {} }}", lifecycle_entries(&rve.lifecycle))?;
    }
    Ok(())
}

/// Formats the entries of `life` that differ from the defaults; the defaults zero and infinity are not valid in a file.
fn lifecycle_entries(lifecycle: &RveLifecycle) -> String {
    let before = match lifecycle.before {
        BeforeCreation::Linear => "linear",
        BeforeCreation::Matrix => "matrix",
    };
    let numbers = [
        ("created_at", lifecycle.created_at, lifecycle.created_at > 0.0),
        ("asleep_below", lifecycle.asleep_below, lifecycle.asleep_below > 0.0),
        ("deleted_at", lifecycle.deleted_at, lifecycle.deleted_at.is_finite()),
    ];
    let given = numbers.iter().filter(|(_, _, is_given)| *is_given).map(|(key, value, _)| format!("{key} = {value:?}"));
    given.chain([format!("before = \"{before}\"")]).collect::<Vec<_>>().join(", ")
}

fn formula_entries(formula: &Formula) -> [String; 3] {
    let model = match formula {
        Formula::NeoHookean(_) => "neo-hookean",
        Formula::LinearElastic(_) => "linear-elastic",
    };
    let [mu, lambda] = formula.lame_constants();
    [format!("model = \"{model}\""), format!("shear_modulus = {mu:?}"), format!("lame_lambda = {lambda:?}")]
}

fn law_entries(material: &FiberMaterial) -> String {
    let mut entries = parameters(&material.law);
    entries.insert(entries.len().min(1), format!("radius = {:?}", material.radius));
    format!("name = {}, {}", quoted(material.law.name()), entries.join(", "))
}

/// Formats the parameters of a law. A table is written as points, even if it came from a file; a custom law, which no
/// case file can name, with all its parameters.
fn parameters(law: &Law) -> Vec<String> {
    let of = |name: &str, value: f64| format!("{name} = {value:?}");
    match law {
        Law::Linear { youngs_modulus } => vec![of("youngs_modulus", *youngs_modulus)],
        Law::Exponential { youngs_modulus, nonlinearity } => {
            vec![of("youngs_modulus", *youngs_modulus), of("nonlinearity", *nonlinearity)]
        }
        Law::ExponentialStretch { youngs_modulus, nonlinearity, transition } => vec![
            of("youngs_modulus", *youngs_modulus),
            of("nonlinearity", *nonlinearity),
            of("transition", *transition),
        ],
        Law::Table(table) => vec![format!("points = {:?}", table.points())],
        Law::Buckling { law, compression, buckling_strain } => {
            let mut entries = parameters(law);
            entries.extend([of("compression", *compression), of("buckling_strain", *buckling_strain)]);
            entries
        }
        Law::Custom(law) => law.law().parameters().iter().map(|(name, value)| of(name, *value)).collect(),
    }
}

fn displacement(components: &[Option<f64>; 3]) -> String {
    let named = ["x", "y", "z"].into_iter().zip(components);
    let written: Vec<String> = named.filter_map(|(axis, value)| value.map(|u| format!("{axis} = {u:?}"))).collect();
    format!("{{ {} }}", written.join(", "))
}

fn curve(curve: &LoadCurve) -> String {
    match curve {
        LoadCurve::Ramp => "\"ramp\"".into(),
        LoadCurve::Table(table) => format!("{:?}", table.points()),
    }
}

fn quoted(text: &str) -> String {
    toml::Value::String(text.into()).to_string()
}

fn path(path: &Path) -> String {
    quoted(&path.to_string_lossy())
}
