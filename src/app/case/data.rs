//! The data of a case after it is read and checked.

use std::path::PathBuf;

use super::choice::NetworkChoice;
use super::field_names::FieldSelection;
use super::formula::FormulaCase;
use super::load_value::LoadValue;
use super::parameter::FieldCase;
use super::read::folder_of;
use crate::fem::boundary::LoadCurve;
use crate::fem::constraint::VolumeConstraint;
use crate::fem::element::ElementType;
use crate::fem::mesh::QuadraticHexahedron;
use crate::fem::mesh::shapes::TubeShape;
use crate::fem::stepping::{AdaptiveIncrements, StepStart};
use crate::las::Method;
use crate::tissue::materials::{ElementSelection, Formulas, Materials, Region, RegionMaterial, RveParams};
use crate::tissue::two_scale::BalanceParams;

/// A checked case. Paths are absolute, resolved against the folder of the case file.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    /// The case file.
    pub file: PathBuf,
    /// The title of the run.
    pub title: String,
    /// The source of the mesh.
    pub mesh: MeshSource,
    /// Line of the case file that names the mesh source, for errors found when the mesh is made.
    pub mesh_line: usize,
    /// Length of one mesh unit, m.
    pub mesh_scale: f64,
    /// Line of the case file that states it; `None` if it is the default of 1.
    pub mesh_scale_line: Option<usize>,
    /// Elements of order 2 in place of those of the source; `None` leaves the elements as they are.
    pub quadratic: Option<QuadraticCase>,
    /// Regions with their materials.
    pub regions: Vec<RegionCase>,
    /// Boundary conditions on surfaces.
    pub boundaries: Vec<BoundaryCase>,
    /// Prescribed displacements at single nodes.
    pub points: Vec<PointCase>,
    /// Body forces.
    pub body_forces: Vec<BodyForceCase>,
    /// Whether supports are added against the free rigid-body modes of the body.
    pub hold_free_modes: bool,
    /// Volume constraints.
    pub constraints: Vec<ConstraintCase>,
    /// The load steps.
    pub steps: StepsCase,
    /// Newton's method at the macro scale.
    pub newton: NewtonCase,
    /// The solver of the RVEs.
    pub micro: RveParams,
    /// Numbers of ranks.
    pub scales: ScalesCase,
    /// The result directory and the output written to it.
    pub output: OutputCase,
}

impl Case {
    /// Returns the folder of the case file, absolute.
    pub(in crate::app) fn folder(&self) -> PathBuf {
        // A case that was read has one.
        folder_of(&self.file).unwrap_or_default()
    }

    /// Returns the materials of the regions and the solver of the RVEs; `None` if a parameter varies over the body, so
    /// that the materials depend on the mesh ([`material_fields`](crate::app::material_fields)).
    pub fn materials(&self) -> Option<Materials> {
        let region = |region: &RegionCase| {
            let constant = |formula: &FormulaCase| formula.constant().map(|formula| Formulas::from(formula.clone()));
            let material = match &region.material {
                RegionMaterial::Formula(formula) => RegionMaterial::Formula(constant(formula)?),
                RegionMaterial::FiberRve(rve) => {
                    let matrix = rve.matrix.as_ref().map(|matrix| constant(matrix).ok_or(())).transpose().ok()?;
                    RegionMaterial::FiberRve(rve.without_fields(matrix)?)
                }
            };
            Some(Region { name: region.name.clone(), material })
        };
        let regions = self.regions.iter().map(region).collect::<Option<_>>()?;
        Some(Materials { regions, rve: self.micro })
    }
}

/// The source of a mesh.
#[derive(Clone, Debug, PartialEq)]
pub enum MeshSource {
    /// A file; the ending of its name tells the format ([`mesh_files`](crate::app::mesh_files)).
    File(PathBuf),
    /// The built-in box.
    Box {
        /// Cells along x, y, z.
        cells: [usize; 3],
        /// Edge lengths, in mesh units.
        size: [f64; 3],
        /// The type of the elements, of order 1.
        element: ElementType,
    },
    /// The built-in tube.
    Tube {
        /// Cells through the wall, around the axis and along it.
        cells: [usize; 3],
        /// The dimensions, in mesh units.
        shape: TubeShape,
        /// The type of the elements, of order 1.
        element: ElementType,
    },
    /// The built-in dogbone.
    Dogbone {
        /// Target edge length of the elements, in mesh units.
        element_size: f64,
    },
}

/// The elements of order 2 that replace those of order 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct QuadraticCase {
    /// The type of the hexahedra.
    pub hexahedra: QuadraticHexahedron,
    /// Line of the case file.
    pub line: usize,
}

/// A region and its material.
#[derive(Clone, Debug, PartialEq)]
pub struct RegionCase {
    /// The physical volume; `*` is every volume that no other region names.
    pub name: String,
    /// Line of the case file, for errors found once the mesh is read.
    pub line: usize,
    /// Whether the linear hexahedra and tetrahedra of the region are patches of the F-bar method; see
    /// [`assembly`](crate::fem::assembly#f-bar).
    pub f_bar: bool,
    /// The material.
    pub material: MaterialCase,
}

/// The material of a region before there is a mesh.
pub type MaterialCase = RegionMaterial<FormulaCase, NetworkChoice, FieldCase>;

/// A boundary condition on a surface.
#[derive(Clone, Debug, PartialEq)]
pub struct BoundaryCase {
    /// The physical surface.
    pub surface: String,
    /// Line of the case file.
    pub line: usize,
    /// The prescribed displacement or the load.
    pub load: SurfaceLoad,
    /// The load curve over pseudo-time.
    pub curve: LoadCurve,
}

/// A load on a surface.
#[derive(Clone, Debug, PartialEq)]
pub enum SurfaceLoad {
    /// Displacement by component, m; a component that is `None` is free.
    Displacement([Option<LoadValue>; 3]),
    /// Traction: force per reference area, Pa.
    Traction([LoadValue; 3]),
    /// Pressure on the deformed surface, Pa; positive if it presses on the body.
    Pressure(LoadValue),
    /// Elastic foundation: spring stiffness per reference area along the normal and along the surface, Pa/m.
    Foundation([f64; 2]),
    /// A plane of symmetry: no displacement along the normal.
    Symmetry,
    /// A surface that moves as a rigid body.
    Rigid(RigidCase),
}

/// A surface that moves as a rigid body about a reference point.
#[derive(Clone, Debug, PartialEq)]
pub struct RigidCase {
    /// The reference point, in mesh units; `None` is the centroid of the surface.
    pub reference: Option<[f64; 3]>,
    /// Displacement of the reference point by component, m; a component that is `None` is free.
    pub displacement: [Option<LoadValue>; 3],
    /// Rotation vector by component, rad; a component that is `None` is free.
    pub rotation: [Option<LoadValue>; 3],
}

impl SurfaceLoad {
    /// Returns the values that may be expressions.
    pub fn values(&self) -> Vec<&LoadValue> {
        match self {
            Self::Displacement(components) => components.iter().flatten().collect(),
            Self::Traction(components) => components.iter().collect(),
            Self::Pressure(value) => vec![value],
            Self::Rigid(rigid) => rigid.displacement.iter().chain(&rigid.rotation).flatten().collect(),
            Self::Foundation(_) | Self::Symmetry => Vec::new(),
        }
    }
}

/// A prescribed displacement of a node or a force on it.
#[derive(Clone, Debug, PartialEq)]
pub struct PointCase {
    /// The node.
    pub place: PointPlace,
    /// Line of the case file.
    pub line: usize,
    /// Displacement by component, m; a component that is `None` is free.
    pub displacement: [Option<LoadValue>; 3],
    /// The force on the node, N.
    pub force: Option<[LoadValue; 3]>,
    /// The load curve over pseudo-time, of displacement and force.
    pub curve: LoadCurve,
}

impl PointCase {
    /// Returns the values that may be expressions.
    pub fn values(&self) -> Vec<&LoadValue> {
        self.displacement.iter().flatten().chain(self.force.iter().flatten()).collect()
    }
}

/// The specification of a node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PointPlace {
    /// The node nearest to a position, in mesh units.
    At([f64; 3]),
    /// The node with this index, from 0.
    Node(usize),
}

/// A body force, per reference volume.
#[derive(Clone, Debug, PartialEq)]
pub struct BodyForceCase {
    /// The physical volume; `*` is the whole body.
    pub region: String,
    /// Line of the case file.
    pub line: usize,
    /// The force, N/m^3.
    pub value: [LoadValue; 3],
    /// The load curve over pseudo-time.
    pub curve: LoadCurve,
}

/// A volume constraint.
#[derive(Clone, Debug, PartialEq)]
pub struct ConstraintCase {
    /// Line of the case file.
    pub line: usize,
    /// The constraint.
    pub constraint: VolumeConstraint,
}

/// The load steps; by default 10 steps, each one increment unless it fails, and at most 6 cuts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepsCase {
    /// Number of load steps; step `k` ends at `t = k / count`.
    pub count: usize,
    /// Maximum number of times that a failed step is halved.
    pub max_cuts: u32,
    /// Increments that adapt to the number of Newton iterations; then `max_cuts` has no effect.
    pub adaptive: Option<AdaptiveIncrements>,
}

impl Default for StepsCase {
    fn default() -> Self {
        Self { count: 10, max_cuts: 6, adaptive: None }
    }
}

/// Newton's method at the macro scale; by default tolerance 1e-8, at most 25 iterations, line search, and the initial
/// guess [`StepStart::Tangent`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NewtonCase {
    /// Tolerance of the relative residual.
    pub tolerance: f64,
    /// Maximum number of iterations per step.
    pub max_iterations: usize,
    /// Whether the line search may shorten steps.
    pub line_search: bool,
    /// Tolerance of the last correction of the displacements, relative to their change since the last increment.
    pub displacement_tolerance: Option<f64>,
    /// Tolerance of the work of the last correction, relative to the product of the same change and the force norm.
    pub energy_tolerance: Option<f64>,
    /// The initial guess of every step but the first.
    pub start: StepStart,
    /// The linear solver; `None`: by the size of the system.
    pub solver: Option<SolverCase>,
}

/// The linear solver of Newton's method at the macro scale.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolverCase {
    /// The method.
    pub method: Method,
    /// Whether an iterative method solves every system to its tolerance, instead of as far as Newton's method needs.
    pub fixed_tolerance: bool,
}

impl Default for NewtonCase {
    fn default() -> Self {
        Self {
            tolerance: 1e-8,
            max_iterations: 25,
            line_search: true,
            displacement_tolerance: None,
            energy_tolerance: None,
            start: StepStart::default(),
            solver: None,
        }
    }
}

/// Number of ranks of each scale, and how RVEs move between ranks; by default one process computes both scales.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScalesCase {
    /// Number of ranks of the macro scale.
    pub macro_ranks: usize,
    /// Number of ranks of the micro scale; 0: all ranks that the macro scale leaves, or one process for both scales.
    pub micro_ranks: usize,
    /// Whether ranks are assigned so that each rank of the micro scale is near a rank of the macro scale, according to
    /// the machine topology that hwloc reports.
    pub near: bool,
    /// How the micro scale balances its load; `None` if RVEs stay on their ranks.
    pub balance: Option<BalanceParams>,
}

impl ScalesCase {
    /// Returns the smallest number of ranks with which this case can run.
    pub fn least(&self) -> usize {
        match (self.macro_ranks, self.micro_ranks) {
            (1, 0) => 1,
            (macro_ranks, micro_ranks) => macro_ranks + micro_ranks.max(1),
        }
    }
}

impl Default for ScalesCase {
    fn default() -> Self {
        Self { macro_ranks: 1, micro_ranks: 0, near: false, balance: Some(BalanceParams::default()) }
    }
}

/// The result directory and the output written to it.
#[derive(Clone, Debug, PartialEq)]
pub struct OutputCase {
    /// The result directory, resolved against the folder of the case file.
    pub directory: PathBuf,
    /// Number of steps between two outputs of the fields; the last step is always written. 0: no fields.
    pub every: usize,
    /// Number of steps between two checkpoints; the last step always has one.
    pub checkpoint: usize,
    /// Whether the values at the integration points are written with the fields.
    pub points: bool,
    /// Whether the costs of all RVEs are written.
    pub costs: bool,
    /// The fields that are written.
    pub fields: FieldSelection,
    /// The elements whose deformed networks are written too.
    pub rve: ElementSelection,
}

impl Default for OutputCase {
    fn default() -> Self {
        let (fields, rve) = (FieldSelection::Default, ElementSelection::None);
        Self { directory: PathBuf::new(), every: 1, checkpoint: 1, points: false, costs: false, fields, rve }
    }
}
