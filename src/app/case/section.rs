//! Reading `[mesh]` and the sections that control a run: steps, newton, micro, scales, output.

use std::path::Path;

use crate::coupling::balance::TriggerParams;
use crate::fem::element::ElementType;
use crate::fem::mesh::QuadraticHexahedron;
use crate::fem::mesh::shapes::TubeShape;
use crate::fem::stepping::{AdaptiveIncrements, StepStart};
use crate::fiber::equilibrium::{Stage, Stages};
use crate::tissue::materials::{ElementSelection, LaneUse, RveDevice, RveParams};
use crate::tissue::two_scale::{BalanceParams, PlannerName, WeightsName, When};
use toml::de::DeValue;

use super::data::{MeshSource, NewtonCase, OutputCase, QuadraticCase, ScalesCase, StepsCase};
use super::field_names::FieldSelection;
use super::problems::alternatives;
use super::range::Range;
use super::solver;
use super::table::{Either, Table};
use super::value::{Value, did_you_mean};

/// Maximum number of elements: meshes number nodes and elements with 32 bits.
const MOST_ELEMENTS: usize = u32::MAX as usize;
const TOLERANCE: Range = Range::between(0.0, 1.0);

/// The length of an increment in steps; 1e-9 is `StepParams::max_cuts = 30`.
const STEPS: Range = Range::from_to(1e-9, 1.0);

/// The section `[mesh]`.
pub(super) struct MeshSection {
    pub(super) source: MeshSource,
    /// Line of `file` or `generate`.
    pub(super) line: usize,
    /// Length of one mesh unit, m.
    pub(super) scale: f64,
    /// Line of `scale`.
    pub(super) scale_line: Option<usize>,
    pub(super) quadratic: Option<QuadraticCase>,
}

pub(super) fn mesh(root: &mut Table<'_>, base: &Path) -> Option<MeshSection> {
    let mut table = root.required_table("mesh", "a section [mesh] with `file` or `generate`")?;
    let scale = table.get("scale");
    let scale_line = scale.as_ref().map(|scale| scale.line);
    let scale = scale.and_then(|scale| scale.number(Range::above(0.0, "m for a mesh unit"))).unwrap_or(1.0);
    let (source, line) = match table.either("file", "generate") {
        Some(Either::First(file)) => {
            let expected =
                "a mesh file that exists (.msh, .vtu, .inp, .mesh or .feb); a path is relative to the case file";
            (file.existing_file(base, expected).map(MeshSource::File), file.line)
        }
        Some(Either::Second(generate)) => (generate.table().and_then(generated), generate.line),
        None => (None, table.line),
    };
    let quadratic = quadratic(&mut table, source.as_ref());
    table.report_unknown_keys();
    Some(MeshSection { source: source?, line, scale, scale_line, quadratic })
}

/// Reads the order of the elements and the type of quadratic hexahedra.
fn quadratic(table: &mut Table<'_>, source: Option<&MeshSource>) -> Option<QuadraticCase> {
    let order = table.get("order");
    let hexahedra = table.get("hexahedra");
    let number = order.as_ref().and_then(|order| order.integer(&(1..=2)));
    let nodes = hexahedra.as_ref().and_then(|value| match value.inner.as_integer()?.as_str() {
        "20" => Some(QuadraticHexahedron::Serendipity),
        "27" => Some(QuadraticHexahedron::Triquadratic),
        _ => None,
    });
    if let (Some(hexahedra), None) = (&hexahedra, nodes) {
        let expected = "20 or 27, the number of nodes of a hexahedron of order 2";
        hexahedra.report_invalid(expected, "write one of these, without quotes");
    }
    if let (Some(hexahedra), None | Some(1)) = (&hexahedra, number)
        && (order.is_none() || number.is_some())
    {
        let expected = "`hexahedra` beside `order = 2`: it is the number of nodes of the new hexahedra";
        hexahedra.report_error("is given without `order = 2`", expected, "add `order = 2`, or remove `hexahedra`");
    }
    let order = order.filter(|_| number == Some(2))?;
    let wedges = ElementType::Wedge6;
    if matches!(source, Some(MeshSource::Box { element, .. } | MeshSource::Tube { element, .. }) if *element == wedges)
    {
        let cure = "remove `order`, or write element = \"tet4\" or \"hex8\"";
        order.report_error("is 2, but there are no wedges of order 2", "tetrahedra or hexahedra", cure);
        return None;
    }
    Some(QuadraticCase { hexahedra: nodes.unwrap_or_default(), line: order.line })
}

#[derive(Clone, Copy)]
enum Shape {
    Box,
    Tube,
    Dogbone,
}

fn generated(mut table: Table<'_>) -> Option<MeshSource> {
    let shapes = [("box", Shape::Box), ("tube", Shape::Tube), ("dogbone", Shape::Dogbone)];
    let source = match table.require("shape", "\"box\", \"tube\" or \"dogbone\"")?.choice(&shapes)? {
        Shape::Box => {
            let cells = cells_of(&mut table, "along x, y, z");
            let size = table
                .require("size", "three numbers above 0, in mesh units: x, y, z")
                .and_then(|value| value.vector(Range::above(0.0, "mesh units")));
            let element = element(&mut table);
            cells.zip(size).zip(element).map(|((cells, size), element)| MeshSource::Box { cells, size, element })
        }
        Shape::Tube => tube(&mut table),
        Shape::Dogbone => table
            .required_number("element_size", Range::above(0.0, "mesh units"))
            .map(|element_size| MeshSource::Dogbone { element_size }),
    };
    table.report_unknown_keys();
    source
}

/// Reads the type of the elements of order 1 of a box or a tube.
fn element(table: &mut Table<'_>) -> Option<ElementType> {
    let types = [ElementType::Tet4, ElementType::Hex8, ElementType::Wedge6].map(|each| (each.name(), each));
    table.get("element").map_or(Some(ElementType::Tet4), |value| value.choice(&types))
}

fn tube(table: &mut Table<'_>) -> Option<MeshSource> {
    let cells = cells_of(table, "through the wall, around the axis, along it");
    if let Some([_, around @ ..3, _]) = cells {
        table.report(
            &format!("has `cells` with {around} around the axis"),
            "3 or more around the axis",
            "raise the second of the three numbers, for example to 16",
        );
    }
    let mut length = |key| table.required_number(key, Range::above(0.0, "mesh units"));
    let (inner, outer, length) = (length("inner_radius"), length("outer_radius"), length("length"));
    if let (Some(inner), Some(outer)) = (inner, outer)
        && inner >= outer
    {
        table.report(
            &format!("has an `inner_radius` of {inner} that is not below its `outer_radius` of {outer}"),
            "inner_radius < outer_radius, both in mesh units",
            "change one of the two",
        );
    }
    let element = element(table)?;
    let shape = TubeShape { inner_radius: inner?, outer_radius: outer?, length: length? };
    Some(MeshSource::Tube { cells: cells?, shape, element })
}

/// Reads the numbers of cells of a box or a tube and reports an error if six elements per cell are too many.
fn cells_of(table: &mut Table<'_>, directions: &str) -> Option<[usize; 3]> {
    let value = table.require("cells", &format!("three whole numbers above 0: {directions}"))?;
    let cells = value.integer_vector(&(1..=1_000_000), directions)?;
    let elements = cells.iter().try_fold(6_usize, |product, &count| product.checked_mul(count));
    if elements.is_none_or(|elements| elements > MOST_ELEMENTS) {
        let complaint = format!("requests 6 * {} * {} * {} elements", cells[0], cells[1], cells[2]);
        value.report_error(&complaint, format!("at most {MOST_ELEMENTS} elements"), "choose fewer cells");
        return None;
    }
    Some(cells)
}

/// Reads the load steps.
pub(super) fn steps(root: &mut Table<'_>) -> StepsCase {
    root.section("steps", StepsCase::default(), |table, default| StepsCase {
        count: table.integer("count", 1..=1_000_000).unwrap_or(default.count),
        adaptive: adaptive(table),
        max_cuts: max_cuts(table).unwrap_or(default.max_cuts),
    })
}

fn max_cuts(table: &mut Table<'_>) -> Option<u32> {
    table.integer("max_cuts", 0..=30)
}

/// Reads `adaptive = true` or its table.
fn adaptive(table: &mut Table<'_>) -> Option<AdaptiveIncrements> {
    let value = table.get("adaptive")?;
    if value.inner.as_bool().is_some() {
        return value.boolean()?.then(AdaptiveIncrements::default);
    }
    if value.inner.as_table().is_none() {
        value.report_invalid("true, false, or a table", "write `adaptive = true` for the defaults");
        return None;
    }
    let (mut table, default) = (value.table()?, AdaptiveIncrements::default());
    let adaptive = AdaptiveIncrements {
        target_iterations: table.integer("target_iterations", 1..=1000).unwrap_or(default.target_iterations),
        largest: table.number("largest", STEPS).unwrap_or(default.largest),
        smallest: table.number("smallest", STEPS).unwrap_or(default.smallest),
    };
    if adaptive.smallest > adaptive.largest {
        let (smallest, largest) = (adaptive.smallest, adaptive.largest);
        table.report(
            &format!("has a `smallest` of {smallest} above its `largest` of {largest}"),
            "smallest <= largest, both in steps",
            "change one of the two",
        );
    }
    table.report_unknown_keys();
    Some(adaptive)
}

/// Reads the settings of Newton's method at the macro scale.
pub(super) fn newton(root: &mut Table<'_>) -> NewtonCase {
    let starts = [("held", StepStart::Prescribed), ("tangent", StepStart::Tangent)];
    root.section("newton", NewtonCase::default(), |table, default| NewtonCase {
        tolerance: table.number("tolerance", TOLERANCE).unwrap_or(default.tolerance),
        max_iterations: table.integer("max_iterations", 1..=10_000).unwrap_or(default.max_iterations),
        line_search: table.boolean("line_search").unwrap_or(default.line_search),
        displacement_tolerance: optional_tolerance(table, "displacement_tolerance"),
        energy_tolerance: optional_tolerance(table, "energy_tolerance"),
        start: table.choice("start", &starts).unwrap_or(default.start),
        solver: solver::of_newton(table),
    })
}

/// Reads a tolerance that need not be given; `"none"` stands for its absence.
fn optional_tolerance(table: &mut Table<'_>, key: &'static str) -> Option<f64> {
    let value = table.get(key)?;
    if value.inner.as_str().is_some() {
        value.choice(&[("none", ())]);
        return None;
    }
    value.number(TOLERANCE)
}

/// Reads the solver settings of the RVEs.
pub(super) fn micro(root: &mut Table<'_>) -> RveParams {
    let lanes = LaneUse::ALL.map(|lanes| (lanes.name(), lanes));
    root.section("micro", RveParams::default(), |table, default| RveParams {
        tolerance: table.number("tolerance", TOLERANCE).unwrap_or(default.tolerance),
        max_iterations: table.integer("max_iterations", 1..=10_000).unwrap_or(default.max_iterations),
        max_cuts: table.integer("max_cuts", 0..=30).unwrap_or(default.max_cuts),
        stages: table.get("stages").and_then(|value| stages(&value)).unwrap_or(default.stages),
        predictor: table.boolean("predictor").unwrap_or(default.predictor),
        solver: solver::of_micro(table),
        device: table.get("device").and_then(|value| device(&value)).unwrap_or(default.device),
        lanes: table.choice("lanes", &lanes).unwrap_or(default.lanes),
    })
}

/// Reads the device of the RVEs, which this build must be able to use.
fn device(value: &Value<'_>) -> Option<Option<RveDevice>> {
    let device = value.choice(&[("none", None), (RveDevice::Cuda.name(), Some(RveDevice::Cuda))])?;
    if device.is_some() && !cfg!(feature = "cuda") {
        value.report_invalid(
            "\"none\" in this build, which cannot use graphics processors",
            "build with `cargo build --release --features cuda`, or set `device = \"none\"`",
        );
        return None;
    }
    Some(device)
}

/// Reads the list of solution stages, which must not be empty.
fn stages(value: &Value<'_>) -> Option<Stages> {
    let names = Stage::ALL.map(Stage::name);
    let expected = format!("a list of stages: {}", alternatives(names, '"'));
    let form = "such as [\"newton\", \"cuts\"]";
    let elements = value.list(&expected, form)?;
    if elements.is_empty() {
        value.report_invalid(&*expected, "name at least one, or leave `stages` out for all of them");
        return None;
    }
    let stages: Vec<Option<Stage>> = elements.iter().map(|element| element.named(&names, Stage::named)).collect();
    Some(Stages::of(&stages.into_iter().collect::<Option<Vec<Stage>>>()?))
}

/// Reads the numbers of ranks.
pub(super) fn scales(root: &mut Table<'_>) -> ScalesCase {
    root.section("scales", ScalesCase::default(), |table, default| ScalesCase {
        macro_ranks: table.integer("macro", 1..=1_000_000).unwrap_or(default.macro_ranks),
        micro_ranks: table.integer("micro", 0..=1_000_000).unwrap_or(default.micro_ranks),
        near: table.boolean("near").unwrap_or(default.near),
        balance: table.section("balance", default.balance, balance),
    })
}

/// Reads how the micro scale balances its load.
fn balance(table: &mut Table<'_>, _: &Option<BalanceParams>) -> Option<BalanceParams> {
    let default = BalanceParams::default();
    let planner = planner(table);
    let weights = table.get("weights").and_then(|value| {
        let names: Vec<&str> = WeightsName::ALL.iter().map(|weights| weights.name()).collect();
        value.named(&names, |text| WeightsName::ALL.iter().copied().find(|weights| weights.name() == text))
    });
    let trigger = table.get("trigger").map(|value| trigger(&value));
    let when = table.get("when").and_then(|value| {
        let names: Vec<&str> = When::ALL.iter().map(|when| when.name()).collect();
        value.named(&names, |text| When::ALL.iter().copied().find(|when| when.name() == text))
    });
    let others = [("weights", weights.is_some()), ("trigger", trigger.is_some()), ("when", when.is_some())];
    if planner == Some(None)
        && let Some((key, _)) = others.into_iter().find(|&(_, is_given)| is_given)
    {
        let text = format!("`scales.balance.{key}` has no effect: with `planner = \"none\"`, RVEs stay where they are");
        table.problems.warn(table.line, &text);
    }
    planner.unwrap_or(Some(default.planner)).map(|planner| BalanceParams {
        planner,
        weights: weights.unwrap_or(default.weights),
        trigger: trigger.unwrap_or(default.trigger),
        when: when.unwrap_or(default.when),
    })
}

/// Reads the planner; an inner `None` stands for none.
fn planner(table: &mut Table<'_>) -> Option<Option<PlannerName>> {
    let value = table.get("planner")?;
    let names: Vec<&str> = PlannerName::ALL.iter().map(|planner| planner.name()).chain(["none"]).collect();
    value.named(&names, |text| match text {
        "none" => Some(None),
        _ => PlannerName::ALL.iter().copied().find(|planner| planner.name() == text).map(Some),
    })
}

/// Reads the trigger: the threshold alone, or a table.
fn trigger(value: &Value<'_>) -> TriggerParams {
    const THRESHOLD: Range = Range::at_least(1.0, "");
    let default = TriggerParams::default();
    if !matches!(value.inner, DeValue::Table(_)) {
        let threshold = value.number(THRESHOLD).unwrap_or(default.threshold);
        return TriggerParams { threshold, ..default };
    }
    let Some(mut table) = value.table() else { return default };
    let params = TriggerParams {
        threshold: table.number("threshold", THRESHOLD).unwrap_or(default.threshold),
        sweeps: table.integer("sweeps", 1..=1_000_000).unwrap_or(default.sweeps),
        cool_down: table.integer("cool_down", 0..=1_000_000).unwrap_or(default.cool_down),
        horizon: table.number("horizon", Range::above(0.0, "sweeps")).unwrap_or(default.horizon),
        always: table.boolean("always").unwrap_or(default.always),
        ..default
    };
    table.report_unknown_keys();
    params
}

/// Reads the output settings. Warns if networks are requested but no region has any.
pub(super) fn output(root: &mut Table<'_>, base: &Path, any_network: bool) -> OutputCase {
    let mut output = OutputCase { directory: base.join("results"), ..OutputCase::default() };
    root.section("output", (), |table, ()| {
        let directory = table.get("directory").and_then(|value| value.text("a folder, relative to the case file"));
        output.directory = directory.map_or_else(|| output.directory.clone(), |directory| base.join(directory));
        output.every = table.integer("every", 0..=1_000_000).unwrap_or(1);
        output.checkpoint = table.integer("checkpoint", 1..=1_000_000).unwrap_or(1);
        output.points = table.boolean("points").unwrap_or(false);
        output.costs = table.boolean("costs").unwrap_or(false);
        output.fields = table.get("fields").and_then(|value| fields(&value)).unwrap_or_default();
        output.rve = table.get("rve").and_then(|value| rve_output(&value)).unwrap_or(ElementSelection::None);
        if output.rve != ElementSelection::None && !any_network {
            table.problems.warn(table.line, "`output.rve` has no effect: no region has the model \"fiber-rve\"");
        }
    });
    output
}

/// Reads which fields are written.
fn fields(value: &Value<'_>) -> Option<FieldSelection> {
    if value.inner.as_str() == Some("default") {
        return Some(FieldSelection::Default);
    }
    let known: Vec<&str> = FieldSelection::all().collect();
    let items = value.list("\"default\", or a list of fields", "\"default\" or such as [\"cauchy_stress\"]")?;
    let read: Vec<Option<&'static str>> = (items.iter())
        .map(|item| item.named(&known, |text| FieldSelection::all().find(|&name| name == text)))
        .collect();
    let mut names: Vec<&'static str> = Vec::new();
    for name in read.into_iter().collect::<Option<Vec<_>>>()? {
        if !names.contains(&name) {
            names.push(name);
        }
    }
    Some(FieldSelection::Names(names))
}

fn rve_output(value: &Value<'_>) -> Option<ElementSelection> {
    const EXPECTED: &str = "\"none\", \"all\", or a list of element ids, such as [0, 17]";
    match value.inner.as_str() {
        Some("none") => return Some(ElementSelection::None),
        Some("all") => return Some(ElementSelection::All),
        Some(word) => {
            value.report_invalid(EXPECTED, did_you_mean(word, &["none", "all"]));
            return None;
        }
        None => {}
    }
    let elements = value.list(EXPECTED, "\"none\", \"all\" or such as [0, 17]")?;
    if elements.is_empty() {
        value.report_invalid(EXPECTED, "write \"none\" or name elements");
        return None;
    }
    let read: Vec<Option<usize>> = elements.iter().map(|element| element.integer(&(0..=MOST_ELEMENTS))).collect();
    let mut ids = read.into_iter().collect::<Option<Vec<usize>>>()?;
    ids.sort_unstable();
    ids.dedup();
    Some(ElementSelection::Elements(ids))
}
