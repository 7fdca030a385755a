//! Writing a case as TOML, with all defaults filled in.
//!
//! `serde` and `toml` are not used: they write numbers without exponent (5e-8 as 0.00000005, 1e300 with 301 digits) and
//! every table that is a value as a section of its own, while checkpoints compare the case line by line.

use std::fmt::Debug;
use std::path::{Path, PathBuf};

use crate::fem::boundary::LoadCurve;
use crate::fem::constraint::{ConstrainedVolume, ConstraintMethod, VolumeConstraint};
use crate::fem::element::ElementType;
use crate::fem::mesh::QuadraticHexahedron;
use crate::fem::mesh::shapes::TubeShape;
use crate::fem::stepping::StepStart;
use crate::fiber::equilibrium::Stage;
use crate::fiber::law::{FiberLaw, FiberMaterial, Law};
use crate::fiber::rve::StressScale;
use crate::tissue::materials::{
    BeforeCreation, ElementSelection, FiberRve, LaneUse, NetworkAssignment, RegionMaterial, RveLifecycle, RveScale,
};
use crate::tissue::two_scale::BalanceParams;

use super::choice::NetworkChoice;
use super::data::{Case, ConstraintCase, MeshSource, PointPlace, RigidCase, ScalesCase, SurfaceLoad};
use super::field_names::FieldSelection;
use super::formula::FormulaCase;
use super::load::AXES;
use super::load_value::LoadValue;
use super::parameter::FieldCase;
use super::solver;

/// A key and its value as TOML.
pub(super) type Entry<'a> = (&'a str, String);

impl Case {
    /// Returns the case as run: defaults filled in, elastic constants converted, networks listed, paths absolute, so
    /// that it can be read from any folder. Reading it gives an equal case except for the file and the line numbers (a
    /// path that is not Unicode, which no case file can contain, is written with replacement characters). The keys
    /// `element`, `order` and `points`, which earlier versions do not know, are written only if they are not the default.
    pub fn to_toml(&self) -> String {
        let Self { steps, newton, micro, scales, output, .. } = self;
        let mut out = format!("# The case as run by biotissue {}, defaults filled in.\n", env!("CARGO_PKG_VERSION"));
        write(&mut out, [text("title", &self.title)]);
        // A checkpoint compares the lines of the case.
        let quadratic = self.quadratic.map(|quadratic| quadratic_entries(quadratic.hexahedra));
        let entries = [mesh(&self.mesh)].into_iter().chain(quadratic.into_iter().flatten());
        section(&mut out, "[mesh]", entries.chain([entry("scale", self.mesh_scale)]));
        for region in &self.regions {
            section(&mut out, "[[region]]", [text("name", &region.name), entry("f_bar", region.f_bar)]);
            out.push_str("[region.material]\n");
            match &region.material {
                RegionMaterial::Formula(material) => write(&mut out, material.entries()),
                RegionMaterial::FiberRve(rve) => write(&mut out, fiber_rve(rve)),
            }
        }
        // Earlier versions do not know this section.
        if self.hold_free_modes {
            section(&mut out, "[body]", [entry("free", "rigid")]);
        }
        for boundary in &self.boundaries {
            let load = match &boundary.load {
                SurfaceLoad::Displacement(displacement) => components("displacement", displacement),
                SurfaceLoad::Traction(traction) => vector("traction", traction),
                SurfaceLoad::Pressure(pressure) => ("pressure", load_value(pressure)),
                SurfaceLoad::Foundation([normal, tangential]) => {
                    table("foundation", [entry("normal", normal), entry("tangential", tangential)])
                }
                SurfaceLoad::Symmetry => entry("symmetry", true),
                SurfaceLoad::Rigid(rigid) => table("rigid", rigid_entries(rigid)),
            };
            let is_constant = matches!(boundary.load, SurfaceLoad::Foundation(_) | SurfaceLoad::Symmetry);
            let curve = curve(&boundary.curve, &boundary.load.values()).filter(|_| !is_constant);
            let entries = [text("surface", &boundary.surface), load].into_iter().chain(curve);
            section(&mut out, "[[boundary]]", entries);
        }
        for point in &self.points {
            let place = match &point.place {
                PointPlace::At(at) => entry("at", at),
                PointPlace::Node(node) => entry("node", node),
            };
            let moved = point.displacement.iter().any(Option::is_some);
            let moved = moved.then(|| components("displacement", &point.displacement));
            let force = point.force.as_ref().map(|force| vector("force", force));
            let entries = [place].into_iter().chain(moved).chain(force).chain(curve(&point.curve, &point.values()));
            section(&mut out, "[[point]]", entries);
        }
        for force in &self.body_forces {
            let entries = [text("region", &force.region), vector("value", &force.value)];
            let curve = curve(&force.curve, &force.value.iter().collect::<Vec<_>>());
            section(&mut out, "[[body_force]]", entries.into_iter().chain(curve));
        }
        for ConstraintCase { constraint, .. } in &self.constraints {
            section(&mut out, "[[constraint]]", constraint_entries(constraint));
        }
        let adaptive = steps.adaptive.map_or(entry("adaptive", false), |adaptive| {
            let entries = vec![
                entry("target_iterations", adaptive.target_iterations),
                entry("largest", adaptive.largest),
                entry("smallest", adaptive.smallest),
            ];
            table("adaptive", entries)
        });
        section(&mut out, "[steps]", [entry("count", steps.count), entry("max_cuts", steps.max_cuts), adaptive]);
        let start = match newton.start {
            StepStart::Prescribed => "held",
            StepStart::Tangent => "tangent",
        };
        // Settings may change on resume, so all of them have a line (`checkpoint/identity.rs`).
        let optional = |key, tolerance: Option<f64>| tolerance.map_or(entry(key, "none"), |value| entry(key, value));
        let entries = [
            entry("tolerance", newton.tolerance),
            entry("max_iterations", newton.max_iterations),
            entry("line_search", newton.line_search),
            optional("displacement_tolerance", newton.displacement_tolerance),
            optional("energy_tolerance", newton.energy_tolerance),
            entry("start", start),
            solver::newton_entry(newton.solver.as_ref()),
        ];
        section(&mut out, "[newton]", entries);
        let entries = [
            entry("tolerance", micro.tolerance),
            entry("max_iterations", micro.max_iterations),
            entry("max_cuts", micro.max_cuts),
            entry("stages", micro.stages.iter().map(Stage::name).collect::<Vec<_>>()),
            entry("predictor", micro.predictor),
            solver::micro_entry(&micro.solver),
        ];
        // Earlier versions do not know these keys.
        let device = micro.device.map(|device| entry("device", device.name()));
        let lanes = (micro.lanes != LaneUse::default()).then(|| entry("lanes", micro.lanes.name()));
        section(&mut out, "[micro]", entries.into_iter().chain(device).chain(lanes));
        let entries =
            [entry("macro", scales.macro_ranks), entry("micro", scales.micro_ranks), entry("near", scales.near)];
        // Earlier versions do not know this key.
        let balance = (scales.balance != ScalesCase::default().balance).then(|| balance(scales.balance.as_ref()));
        section(&mut out, "[scales]", entries.into_iter().chain(balance));
        let rve = match &output.rve {
            ElementSelection::None => entry("rve", "none"),
            ElementSelection::All => entry("rve", "all"),
            ElementSelection::Elements(ids) => entry("rve", ids),
        };
        let entries = [
            path("directory", &output.directory),
            entry("every", output.every),
            entry("checkpoint", output.checkpoint),
        ];
        let points = output.points.then(|| entry("points", true));
        let costs = output.costs.then(|| entry("costs", true));
        let fields = match &output.fields {
            FieldSelection::Default => None,
            FieldSelection::Names(names) => Some(entry("fields", names)),
        };
        section(&mut out, "[output]", entries.into_iter().chain(points).chain(costs).chain(fields).chain([rve]));
        out
    }
}

fn balance(balance: Option<&BalanceParams>) -> Entry<'static> {
    let Some(BalanceParams { planner, weights, trigger, when }) = balance else {
        return table("balance", [entry("planner", "none")]);
    };
    let trigger = table(
        "trigger",
        [
            entry("threshold", trigger.threshold),
            entry("sweeps", trigger.sweeps),
            entry("cool_down", trigger.cool_down),
            entry("horizon", trigger.horizon),
            entry("always", trigger.always),
        ],
    );
    let (planner, weights) = (entry("planner", planner.name()), entry("weights", weights.name()));
    table("balance", [planner, weights, trigger, entry("when", when.name())])
}

fn section<'a>(out: &mut String, header: &str, entries: impl IntoIterator<Item = Entry<'a>>) {
    *out += &format!("\n{header}\n");
    write(out, entries);
}

fn write<'a>(out: &mut String, entries: impl IntoIterator<Item = Entry<'a>>) {
    for (key, value) in entries {
        *out += &format!("{key} = {value}\n");
    }
}

/// Formats a number, a truth value, a keyword, or a list of these: TOML and Rust write them in the same way.
pub(super) fn entry(key: &str, value: impl Debug) -> Entry<'_> {
    (key, format!("{value:?}"))
}

pub(super) fn quoted(text: &str) -> String {
    toml::Value::String(text.into()).to_string()
}

fn text<'a>(key: &'a str, text: &str) -> Entry<'a> {
    (key, quoted(text))
}

fn path<'a>(key: &'a str, path: &Path) -> Entry<'a> {
    text(key, &path.to_string_lossy())
}

/// Formats a table on one line.
pub(super) fn table<'a, 'b>(key: &'a str, entries: impl IntoIterator<Item = Entry<'b>>) -> Entry<'a> {
    let entries: Vec<String> = entries.into_iter().map(|(key, value)| format!("{key} = {value}")).collect();
    (key, format!("{{ {} }}", entries.join(", ")))
}

fn mesh(source: &MeshSource) -> Entry<'static> {
    match source {
        MeshSource::File(file) => path("file", file),
        MeshSource::Box { cells, size, element } => {
            let entries = [entry("shape", "box"), entry("cells", cells), entry("size", size)];
            table("generate", entries.into_iter().chain(element_entry(*element)))
        }
        MeshSource::Tube { cells, shape, element } => {
            let TubeShape { inner_radius, outer_radius, length } = shape;
            let entries = [
                entry("shape", "tube"),
                entry("cells", cells),
                entry("inner_radius", inner_radius),
                entry("outer_radius", outer_radius),
                entry("length", length),
            ];
            table("generate", entries.into_iter().chain(element_entry(*element)))
        }
        MeshSource::Dogbone { element_size } => {
            table("generate", [entry("shape", "dogbone"), entry("element_size", element_size)])
        }
    }
}

fn element_entry(element: ElementType) -> Option<Entry<'static>> {
    (element != ElementType::Tet4).then(|| entry("element", element.name()))
}

fn quadratic_entries(hexahedra: QuadraticHexahedron) -> [Entry<'static>; 2] {
    let nodes = match hexahedra {
        QuadraticHexahedron::Serendipity => 20,
        QuadraticHexahedron::Triquadratic => 27,
    };
    [entry("order", 2), entry("hexahedra", nodes)]
}

fn fiber_rve(rve: &FiberRve<FormulaCase, NetworkChoice, FieldCase>) -> Vec<Entry<'static>> {
    let line = |file: &PathBuf| format!("    {},\n", quoted(&file.to_string_lossy()));
    let listed = || format!("[\n{}]", rve.networks.iter().map(line).collect::<String>());
    let (networks, choose) = match &rve.assignment {
        NetworkAssignment::Random => (listed(), quoted("random")),
        NetworkAssignment::Cycle => (listed(), quoted("cycle")),
        NetworkAssignment::Field(choice) => {
            (choice.pattern.as_ref().map_or_else(listed, |pattern| quoted(&pattern.text())), choice.toml())
        }
    };
    let mut entries = vec![
        entry("model", "fiber-rve"),
        ("networks", networks),
        ("choose", choose),
        entry("seed", rve.seed),
        match &rve.scale {
            RveScale::Uniform(StressScale::Raw) => entry("scale", "raw"),
            RveScale::Uniform(StressScale::FiberVolumeFraction(fraction)) => entry("fiber_volume_fraction", fraction),
            RveScale::Fractions(field) => ("fiber_volume_fraction", field.source.toml()),
        },
    ];
    entries.extend(rve.law.as_ref().map(|material| table("law", law(material))));
    entries.extend(rve.matrix.as_ref().map(|matrix| table("matrix", matrix.entries())));
    entries.extend((rve.lifecycle != RveLifecycle::default()).then(|| table("life", lifecycle(&rve.lifecycle))));
    entries
}

/// Formats the entries of `life` that differ from the defaults; the defaults zero and infinity are not valid in a file.
fn lifecycle(lifecycle: &RveLifecycle) -> Vec<Entry<'static>> {
    let before = match lifecycle.before {
        BeforeCreation::Linear => "linear",
        BeforeCreation::Matrix => "matrix",
    };
    let numbers = [
        ("created_at", lifecycle.created_at),
        ("asleep_below", lifecycle.asleep_below),
        ("deleted_at", lifecycle.deleted_at),
    ];
    let given = numbers.into_iter().filter(|(_, value)| *value > 0.0 && value.is_finite());
    given.map(|(key, value)| entry(key, value)).chain([entry("before", before)]).collect()
}

/// Formats a law. A table is written as points, even if it came from a file; a custom law, which no case file can name,
/// with all its parameters.
fn law(FiberMaterial { law, radius, .. }: &FiberMaterial) -> Vec<Entry<'static>> {
    let in_tension = if let Law::Buckling { law, .. } = law { law } else { law };
    let mut entries = match in_tension {
        Law::Table(table) => vec![entry("points", table.points())],
        law => law.parameters().into_iter().map(|(name, value)| entry(name, value)).collect(),
    };
    entries.insert(entries.len().min(1), entry("radius", radius));
    entries.insert(0, text("name", law.name()));
    if let Law::Buckling { compression, buckling_strain, .. } = law {
        entries.extend([entry("compression", compression), entry("buckling_strain", buckling_strain)]);
    }
    entries
}

fn rigid_entries(rigid: &RigidCase) -> Vec<Entry<'static>> {
    let reference = rigid.reference.map(|reference| entry("reference", reference));
    let motion = [("displacement", &rigid.displacement), ("rotation", &rigid.rotation)];
    let given = motion.into_iter().filter(|(_, given)| given.iter().any(Option::is_some));
    reference.into_iter().chain(given.map(|(key, given)| components(key, given))).collect()
}

fn constraint_entries(constraint: &VolumeConstraint) -> Vec<Entry<'_>> {
    let mut entries = vec![
        match &constraint.of {
            ConstrainedVolume::Region(region) => text("region", region),
            ConstrainedVolume::Cavity(surfaces) => {
                let surfaces: Vec<String> = surfaces.iter().map(|surface| quoted(surface)).collect();
                ("cavity", format!("[{}]", surfaces.join(", ")))
            }
        },
        text("name", &constraint.name),
        match &constraint.curve {
            Some(LoadCurve::Table(table)) => entry("volume", table.points()),
            // A case file has no other curves.
            _ => entry("volume", "constant"),
        },
    ];
    match constraint.method {
        ConstraintMethod::Multiplier => entries.push(entry("method", "multiplier")),
        ConstraintMethod::Penalty { factor } => {
            entries.extend([entry("method", "penalty"), entry("penalty", factor)]);
        }
    }
    entries
}

fn components(key: &'static str, components: &[Option<LoadValue>; 3]) -> Entry<'static> {
    let named = AXES.into_iter().zip(components);
    let given = named.filter_map(|(axis, component)| component.as_ref().map(|value| (axis, load_value(value))));
    table(key, given)
}

fn load_value(value: &LoadValue) -> String {
    match value {
        LoadValue::Number(number) => entry("", number).1,
        LoadValue::Expression(expression) => quoted(expression.text()),
    }
}

fn vector<'a>(key: &'a str, values: &[LoadValue; 3]) -> Entry<'a> {
    (key, format!("[{}]", values.each_ref().map(load_value).join(", ")))
}

/// Formats the curve of these values; there is none beside an expression that contains `t`.
fn curve(curve: &LoadCurve, values: &[&LoadValue]) -> Option<Entry<'static>> {
    if values.iter().any(|value| value.contains_time()) {
        return None;
    }
    Some(match curve {
        LoadCurve::Ramp => entry("curve", "ramp"),
        LoadCurve::Table(table) => entry("curve", table.points()),
        // A case file names functions by their formulas; only these are made from one.
        LoadCurve::Function(function) => text("curve", function.formula().unwrap_or("ramp")),
    })
}
