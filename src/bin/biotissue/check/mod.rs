//! `biotissue check`: reads and checks a case and all its files, and prints the plan without solving anything.

mod measured;
mod mesh_plan;
mod networks;

use std::collections::BTreeMap;
use std::path::PathBuf;

use biotissue::app::Examination;
use biotissue::app::case::Case;
use biotissue::app::material_fields::FieldRange;
use biotissue::app::run::{Forecast, MemoryForecast, NetworkSize, ProblemSize};
use biotissue::fem::constraint::{ConstrainedVolume, ConstraintMethod, VolumeConstraint};

use clap::Args;
use serde::Serialize;

use self::measured::Measured;
use self::mesh_plan::MeshPlan;
use self::networks::network_lines;

use crate::conditions::{ConditionPlan, conditions};
use crate::dispatch::{Job, ProgramBackend, dispatch};
use crate::error_hints::{CaseHints, not_set_up};
use crate::failure::Failure;
use crate::number::count;
use crate::output;
use crate::ranks::{check_near, check_requested, split};
use crate::run::{Common, read, setup};

/// Read and check a case and all its files, and print the plan; without --measure, solve nothing
#[derive(Args)]
pub struct CheckCommand {
    /// The case file
    case: PathBuf,
    #[command(flatten)]
    common: Common,
    /// Ranks of the planned run, started by `run --ranks` or by mpirun; no rank is started here [default: those of [scales],
    /// else 1]
    #[arg(long, value_name = "N", value_parser = count, allow_hyphen_values = true)]
    ranks: Option<usize>,
    /// Also solve a few RVEs of each network and the first load step with linear networks, to forecast times and
    /// propose numbers of ranks
    #[arg(long)]
    measure: bool,
    /// Print the plan as one JSON object
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn check(command: &CheckCommand) -> Result<(), Failure> {
    check_requested(command.ranks)?;
    let case = read(&command.case)?;
    check_near(case.scales)?;
    let ranks = split(&case, command.ranks)?;
    command.common.start_threads()?;
    let plan = dispatch(command.common.backend(), CheckJob { case, ranks, measure: command.measure })?;
    if command.json { output::print_json(&plan) } else { output::print(&plan.text()) }
}

struct CheckJob {
    case: Case,
    /// Numbers of macro and micro ranks of the planned run; 1 and 0 without ranks.
    ranks: [usize; 2],
    measure: bool,
}

/// The output of `biotissue check`.
#[derive(Serialize)]
struct Plan {
    title: String,
    backend: &'static str,
    elements: usize,
    element_types: BTreeMap<&'static str, usize>,
    integration_points: usize,
    nodes: usize,
    #[serde(flatten)]
    mesh: MeshPlan,
    unknowns: usize,
    rves: usize,
    /// In one process, bytes.
    memory: MemoryForecast,
    networks: Vec<NetworkSize>,
    /// The networks of regions without a matrix, or with a soft one, that have motions which no fiber resists.
    floppy_networks: Vec<String>,
    fields: Vec<FieldRange>,
    surfaces: Vec<String>,
    regions: Vec<String>,
    conditions: Vec<ConditionPlan>,
    /// The surfaces without a condition.
    free_surfaces: Vec<String>,
    /// The supports against free rigid-body modes.
    supports: Vec<SupportPlan>,
    constraints: Vec<String>,
    solver: String,
    steps: usize,
    threads: usize,
    ranks: usize,
    directory: PathBuf,
    #[serde(skip_serializing_if = "Option::is_none")]
    measured: Option<Measured>,
}

/// A displacement component that is held because of `free = "rigid"`.
#[derive(Serialize)]
struct SupportPlan {
    node: u32,
    /// Its position, m.
    position: [f64; 3],
    component: &'static str,
}

impl Job for CheckJob {
    type Output = Plan;

    fn run<B: ProgramBackend>(self, context: B::Context) -> Result<Plan, Failure> {
        let setup = setup::<B>(context, self.case)?;
        let (size, memory) = setup.problem_size().map_err(|error| not_set_up(&CaseHints::of(setup.case()), error))?;
        let floppy = setup.floppy_networks(Examination::Thorough);
        output::warn(&floppy.warnings);
        let ProblemSize { elements, nodes, unknowns, rves, networks, solver, steps, threads, .. } = size;
        let (conditions, free_surfaces) = conditions(setup.case(), setup.mesh(), setup.load_sizes());
        let mesh = MeshPlan::new(setup.mesh());
        let is_listed = |surface: &str| setup.case().boundaries.iter().any(|boundary| boundary.surface == surface);
        let wall = |surface: &String| if is_listed(surface) { surface.clone() } else { mesh.with_area(surface) };
        let constraints = &setup.case().constraints;
        let constraints = constraints.iter().map(|each| description(&each.constraint, wall)).collect();
        let mut plan = Plan {
            title: setup.case().title.clone(),
            backend: B::NAME,
            elements,
            element_types: setup.mesh().elements().count_by_type().iter().map(|(of, n)| (of.name(), *n)).collect(),
            integration_points: setup.mesh().points().len(),
            nodes,
            mesh,
            unknowns,
            rves,
            memory,
            solver,
            networks,
            floppy_networks: floppy.names,
            fields: setup.field_ranges().to_vec(),
            surfaces: setup.mesh().surface_names().map(str::to_owned).collect(),
            regions: setup.mesh().regions().to_vec(),
            conditions,
            free_surfaces,
            supports: setup
                .free_mode_supports()
                .map(|(node, component)| SupportPlan {
                    node,
                    position: setup.mesh().nodes()[node as usize],
                    component: ["x", "y", "z"][usize::from(component)],
                })
                .collect(),
            constraints,
            steps,
            threads,
            ranks: self.ranks.iter().sum(),
            directory: setup.case().output.directory.clone(),
            measured: None,
        };
        if self.measure {
            let hints = CaseHints::of(setup.case());
            let measurement = setup.measure().map_err(|error| not_set_up(&hints, error))?;
            let is_floppy = !plan.floppy_networks.is_empty();
            // Where an RVE finds no equilibrium even in the first step, the times say nothing.
            let is_known = !is_floppy || measurement.converged && measurement.failures == 0;
            let forecast = is_known.then(|| Forecast::new(&measurement, B::DISTRIBUTES, self.ranks));
            plan.measured = Some(Measured { measurement, forecast, is_floppy });
        }
        Ok(plan)
    }
}

/// Describes a volume constraint, such as `lumen: cavity of inner, lid; volume constant; by multiplier`; `wall` describes a
/// surface.
fn description(
    VolumeConstraint { name, of, curve, method }: &VolumeConstraint,
    wall: impl Fn(&String) -> String,
) -> String {
    let of = match of {
        ConstrainedVolume::Region(region) if region == "*" => "the whole body".into(),
        ConstrainedVolume::Region(region) => format!("region {region}"),
        ConstrainedVolume::Cavity(surfaces) => {
            format!("cavity of {}", surfaces.iter().map(wall).collect::<Vec<_>>().join(", "))
        }
    };
    let target = if curve.is_some() { "driven" } else { "constant" };
    let method = match method {
        ConstraintMethod::Multiplier => "multiplier".into(),
        ConstraintMethod::Penalty { factor } => format!("penalty of {factor}"),
    };
    format!("{name}: {of}; volume {target}; by {method}")
}

impl Plan {
    fn text(&self) -> String {
        let types: Vec<String> = self.element_types.iter().map(|(of, count)| format!("{count} {of}")).collect();
        let mut lines = vec![
            format!("title      {}", self.title),
            format!("mesh       {} elements, {} nodes", self.elements, self.nodes),
            format!("elements   {}; {} integration points", types.join(", "), self.integration_points),
        ];
        lines.extend(self.mesh.text());
        lines.extend([
            format!("regions    {}", self.regions.join(", ")),
            format!("unknowns   {} free, backend {}", self.unknowns, self.backend),
            format!("RVEs       {}", self.rves),
        ]);
        lines.extend(network_lines(&self.networks));
        lines.extend(self.conditions.iter().map(ConditionPlan::text));
        if !self.free_surfaces.is_empty() {
            let free: Vec<String> = self.free_surfaces.iter().map(|surface| self.mesh.with_area(surface)).collect();
            lines.push(format!("free       surfaces {}", free.join(", ")));
        }
        for SupportPlan { node, position: [x, y, z], component } in &self.supports {
            let place = format!("node {node} at ({x:.4e}, {y:.4e}, {z:.4e}) m");
            lines.push(format!("support    {component} of {place}, against a rigid-body mode"));
        }
        for FieldRange { region, parameter, min, max } in &self.fields {
            lines.push(format!("field      {parameter} from {min:?} to {max:?} in region \"{region}\""));
        }
        lines.extend(self.constraints.iter().map(|constraint| format!("constraint {constraint}")));
        lines.push(format!("solver     {}", self.solver));
        lines.push(format!("steps      {}", self.steps));
        let memory = &self.memory;
        let megabytes = |bytes: usize| format!("{:.0}", (bytes as f64 * 1e-6).ceil());
        lines.push(format!(
            "memory     {} MB in one process: {} MB of RVE states, {} MB of networks, {} MB of stresses and tangents, {} MB of \
             the linear system, {} MB to write fields",
            megabytes(memory.total),
            megabytes(memory.rves),
            megabytes(memory.networks),
            megabytes(memory.points),
            megabytes(memory.system),
            megabytes(memory.fields)
        ));
        if memory.fallback > 0 {
            lines.push(format!(
                "           {} MB more if a direct solver replaces the iterative one",
                megabytes(memory.fallback)
            ));
        }
        let plural = if self.threads == 1 { "" } else { "s" };
        lines.push(format!("ranks      {}, with {} thread{plural}", self.ranks, self.threads));
        lines.push(format!("results    {}", self.directory.display()));
        lines.extend(self.measured.iter().flat_map(|measured| measured.text(self.steps)));
        lines.join("\n") + "\n"
    }
}
