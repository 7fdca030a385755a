//! Reading boundaries, points and body forces.

use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

use super::data::{BodyForceCase, BoundaryCase, PointCase, PointPlace, RigidCase, SurfaceLoad};
use super::load_value::LoadValue;
use super::problems::{Problems, nearest};
use super::range::Range;
use super::table::{Either, Table};
use super::value::{Value, did_you_mean};
use crate::app::expression::{ExpressionFactor, VARIABLES};
use crate::fem::boundary::LoadCurve;
use crate::input::excerpt;

pub(super) const AXES: [&str; 3] = ["x", "y", "z"];
const NAMED_SURFACE: &str = "the name of a physical surface";

/// Reads all boundaries and reports components of a surface that are prescribed twice.
pub(super) fn boundaries(root: &mut Table<'_>) -> Vec<BoundaryCase> {
    let mut boundaries: Vec<BoundaryCase> = Vec::new();
    let mut prescribed = PrescribedComponents::default();
    for mut table in root.tables("boundary") {
        let surface = table.required_text("surface", NAMED_SURFACE);
        let load = boundary_load(&mut table);
        let curve = curve_beside(&mut table, load.iter().flat_map(SurfaceLoad::values));
        if let (Some(surface), Some(load)) = (surface, load) {
            let new = BoundaryCase { surface: surface.to_string(), line: table.line, load, curve };
            let place = || format!("surface \"{}\"", excerpt(surface));
            let holders = prescribed.entry(surface).or_default();
            prescribe(table.problems, holders, place, new.line, prescribed_components(&new.load));
            boundaries.push(new);
        }
        table.report_unknown_keys();
    }
    boundaries
}

fn boundary_load(table: &mut Table<'_>) -> Option<SurfaceLoad> {
    let keys = ["displacement", "traction", "pressure", "foundation", "symmetry", "rigid"];
    let (key, value) = table.one_of(&keys)?;
    match key {
        "displacement" => displacement_of(&value).map(SurfaceLoad::Displacement),
        "traction" => LoadValue::read_vector(&value, "Pa").map(SurfaceLoad::Traction),
        "pressure" => LoadValue::read(&value, "Pa").map(SurfaceLoad::Pressure),
        "rigid" => rigid(&value).map(SurfaceLoad::Rigid),
        "symmetry" => {
            if let Some(curve) = table.get("curve") {
                curve.report_error("is given for a plane of symmetry", "a plane that does not move", "remove `curve`");
            }
            let is_plane = value.boolean()?;
            if !is_plane {
                value.report_error("is false", "true", "remove this [[boundary]]: surfaces are free by default");
            }
            is_plane.then_some(SurfaceLoad::Symmetry)
        }
        _ => {
            if let Some(curve) = table.get("curve") {
                curve.report_error("is given for a foundation", "a constant stiffness", "remove `curve`");
            }
            foundation(&value).map(SurfaceLoad::Foundation)
        }
    }
}

/// Reads the reference point and the prescribed motion of a rigid surface.
fn rigid(value: &Value<'_>) -> Option<RigidCase> {
    let mut table = value.table()?;
    let reference = table.get("reference").map(|value| value.vector(Range::any("mesh units")));
    let displacement = table.get("displacement").map_or(Some([const { None }; 3]), |value| displacement_of(&value));
    let rotation =
        table.get("rotation").map_or(Some([const { None }; 3]), |value| components_of(&value, "rad", "{ z = 0.5 }"));
    table.report_unknown_keys();
    let reference = match reference {
        Some(read) => Some(read?),
        None => None,
    };
    Some(RigidCase { reference, displacement: displacement?, rotation: rotation? })
}

/// Reads a stiffness in all directions, or one along the normal and one along the surface.
fn foundation(value: &Value<'_>) -> Option<[f64; 2]> {
    const STIFFNESS: Range = Range::at_least(0.0, "Pa/m");
    let both = if value.inner.as_table().is_some() {
        let mut table = value.table()?;
        let parts = ["normal", "tangential"].map(|key| {
            let is_given = table.has(key);
            table.number(key, STIFFNESS).or((!is_given).then_some(0.0))
        });
        table.report_unknown_keys();
        [parts[0]?, parts[1]?]
    } else {
        [value.number(STIFFNESS)?; 2]
    };
    if both == [0.0; 2] {
        value.report_error("has no stiffness", "a stiffness above 0, in Pa/m", "write such as { normal = 1.0e6 }");
        return None;
    }
    Some(both)
}

/// Reads a displacement `{ x, y, z }` with at least one component.
fn displacement_of(value: &Value<'_>) -> Option<[Option<LoadValue>; 3]> {
    components_of(value, "m", "{ x = 0.0 }")
}

/// Reads `{ x, y, z }` with at least one component.
fn components_of(value: &Value<'_>, unit: &'static str, example: &str) -> Option<[Option<LoadValue>; 3]> {
    let mut table = value.table()?;
    let present = AXES.map(|axis| table.has(axis));
    let components = AXES.map(|axis| table.get(axis).and_then(|value| LoadValue::read(&value, unit)));
    if !present.contains(&true) {
        let expected = format!("at least one of `x`, `y` and `z`, in {unit}");
        table.report("contains no component", expected, format!("add one, such as {example}"));
    }
    table.report_unknown_keys();
    let complete =
        present.contains(&true) && components.iter().zip(present).all(|(read, there)| read.is_some() == there);
    complete.then_some(components)
}

/// Returns which components a load prescribes: given displacements, and tractions other than 0.
fn prescribed_components(load: &SurfaceLoad) -> [bool; 3] {
    match load {
        SurfaceLoad::Displacement(components) => components.each_ref().map(Option::is_some),
        SurfaceLoad::Traction(components) => components.each_ref().map(|component| !component.is_zero()),
        SurfaceLoad::Pressure(_) | SurfaceLoad::Foundation(_) | SurfaceLoad::Symmetry => [false; 3],
        // The other components are free, so that a traction may act along them.
        SurfaceLoad::Rigid(rigid) => rigid.displacement.each_ref().map(Option::is_some),
    }
}

/// For every place read so far, the line that first prescribed each component. Later duplicates are compared only with
/// that first line, so that 1000 duplicates give about 1000 errors, not half a million.
type PrescribedComponents<K> = HashMap<K, [Option<usize>; 3]>;

/// Adds the components that the entry at `line` prescribes at a place to the `holders` there, and reports components
/// that an earlier line already prescribes.
fn prescribe(
    problems: &Problems<'_>,
    holders: &mut [Option<usize>; 3],
    place: impl Fn() -> String,
    line: usize,
    held: [bool; 3],
) {
    let mut shared: BTreeMap<usize, Vec<&str>> = BTreeMap::new();
    for (k, holder) in holders.iter_mut().enumerate().filter(|(k, _)| held[*k]) {
        match holder {
            Some(first) => shared.entry(*first).or_default().push(AXES[k]),
            None => *holder = Some(line),
        }
    }
    for (first, axes) in shared {
        problems.report(
            line,
            format!("{} has {} prescribed here and at line {first}", place(), axes.join(", ")),
            "each component of a node or surface prescribed once, by displacement or by a traction other than 0",
            "remove it from one of the two",
        );
    }
}

/// Converts the specification of a node to a hash key: positions that compare equal have equal bits once -0 becomes 0.
fn key_of(place: &PointPlace) -> Result<[u64; 3], usize> {
    match place {
        PointPlace::At(at) => Ok(at.map(|x| (x + 0.0).to_bits())),
        PointPlace::Node(node) => Err(*node),
    }
}

/// Reads all points and reports components of a node that are prescribed twice.
pub(super) fn points(root: &mut Table<'_>) -> Vec<PointCase> {
    let mut points: Vec<PointCase> = Vec::new();
    let mut prescribed = PrescribedComponents::default();
    for mut table in root.tables("point") {
        let place = match table.either("at", "node") {
            Some(Either::First(at)) => at.vector(Range::any("mesh units")).map(PointPlace::At),
            Some(Either::Second(node)) => node.integer(&(0..=u32::MAX as usize)).map(PointPlace::Node),
            None => None,
        };
        if !table.has("displacement") && !table.has("force") {
            let expected = "a displacement, a force, or both";
            table.report("has neither `displacement` nor `force`", expected, "add such as force = [0.0, 0.0, 1.0e-3]");
        }
        let none = || Some([const { None }; 3]);
        let displacement = table.get("displacement").map_or_else(none, |value| displacement_of(&value));
        let force = table.get("force").map(|value| LoadValue::read_vector(&value, "N"));
        let forces = force.iter().flatten().flatten();
        let curve = curve_beside(&mut table, displacement.iter().flatten().flatten().chain(forces));
        let is_invalid = matches!(force, Some(None));
        let force = force.flatten();
        if let (Some(place), Some(displacement), false) = (place, displacement, is_invalid) {
            let pulled = force.as_ref().map_or([false; 3], |force| force.each_ref().map(|value| !value.is_zero()));
            for (k, axis) in AXES.iter().enumerate().filter(|&(k, _)| pulled[k] && displacement[k].is_some()) {
                let complaint = format!("has both a displacement and a force along {axis}");
                let expected = "each component prescribed by a displacement or by a force";
                table.report(&complaint, expected, format!("remove `{}` from `displacement`", AXES[k]));
            }
            let held = std::array::from_fn(|k| displacement[k].is_some() || pulled[k]);
            let holders = prescribed.entry(key_of(&place)).or_default();
            prescribe(table.problems, holders, || "this node".into(), table.line, held);
            points.push(PointCase { place, line: table.line, displacement, force, curve });
        }
        table.report_unknown_keys();
    }
    points
}

/// Reads how the free rigid-body modes of the body are treated.
pub(super) fn hold_free_modes(root: &mut Table<'_>) -> bool {
    root.section("body", false, |table, _| table.choice("free", &[("rigid", true)]).is_some())
}

/// Reads all body forces; those of one region add up.
pub(super) fn body_forces(root: &mut Table<'_>) -> Vec<BodyForceCase> {
    let expected = "the name of a physical volume, or \"*\" for all of the body";
    let mut forces = Vec::new();
    for mut table in root.tables("body_force") {
        let region = table.required_text("region", expected);
        let range = Range::any("N/m^3");
        let form = format!("three numbers{}: x, y, z", range.describe());
        let value = table.require("value", &form).and_then(|value| LoadValue::read_vector(&value, "N/m^3"));
        let curve = curve_beside(&mut table, value.iter().flatten());
        if let (Some(region), Some(value)) = (region, value) {
            forces.push(BodyForceCase { region: region.to_string(), line: table.line, value, curve });
        }
        table.report_unknown_keys();
    }
    forces
}

/// Reads the load curve of these values; a ramp is the default. An expression that contains `t` excludes a curve.
fn curve_beside<'a>(table: &mut Table<'_>, values: impl Iterator<Item = &'a LoadValue>) -> LoadCurve {
    let given = table.get("curve");
    let curve = given.as_ref().and_then(curve_of);
    if let (Some(given), Some(LoadValue::Expression(timed))) = (given, values.into_iter().find(|v| v.contains_time())) {
        given.report_error(
            &format!("is given beside the expression \"{}\", which contains t", excerpt(timed.text())),
            "an expression of t alone, or a curve and values without t, which it multiplies",
            "remove `curve`, or `t` from the expression",
        );
    }
    curve.unwrap_or(LoadCurve::Ramp)
}

fn curve_of(value: &Value<'_>) -> Option<LoadCurve> {
    const EXPECTED: &str =
        "\"ramp\", a list of [t, factor] with t ascending from 0 to 1, or an expression of t, x, y and z";
    const FORM: &str = "\"ramp\" or such as [[0.0, 0.0], [1.0, 1.0]]";
    const PAIR: &str = "[t, factor]: a t from 0 to 1 and a number";
    if let Some(name) = value.inner.as_str() {
        if name == "ramp" {
            return Some(LoadCurve::Ramp);
        }
        if nearest(name, ["ramp"]).is_some() {
            value.report_invalid(EXPECTED, did_you_mean(name, &["ramp"]));
            return None;
        }
        let factor = ExpressionFactor::new(value.expression(EXPECTED, &VARIABLES)?);
        return Some(LoadCurve::Function(Arc::new(factor)));
    }
    table_of(value, [EXPECTED, FORM, PAIR], Range::any(""))
}

/// Reads the points of a curve whose factors are in `factors`; the texts describe the whole value, a valid form, and a
/// point.
pub(super) fn table_of(value: &Value<'_>, [expected, form, pair]: [&str; 3], factors: Range) -> Option<LoadCurve> {
    let rows = value.list(expected, form)?;
    if rows.is_empty() {
        value.report_invalid(expected, format!("write {form}"));
        return None;
    }
    let mut points: Vec<[f64; 2]> = Vec::with_capacity(rows.len());
    let mut complete = true;
    for row in &rows {
        let Some(point) = row.pair([Range::from_to(0.0, 1.0), factors], pair) else {
            complete = false;
            continue;
        };
        if let Some(before) = points.last().filter(|before| point[0] <= before[0]) {
            let complaint = format!("has t = {} after t = {}", point[0], before[0]);
            row.report_error(&complaint, expected, "sort the points by t and give each t once");
            complete = false;
        }
        points.push(point);
    }
    // The checks above are those of `LoadCurve::table`.
    LoadCurve::table(&points).ok().filter(|_| complete)
}
