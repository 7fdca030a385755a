//! The data of a case after it is read and checked.

use std::path::PathBuf;

use crate::fiber::equilibrium::Stages;
use crate::fiber::law::FiberMaterial;
use crate::las::Method;

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
    /// Regions with their materials.
    pub regions: Vec<RegionCase>,
    /// Boundary conditions on surfaces.
    pub boundaries: Vec<BoundaryCase>,
    /// Prescribed displacements at single nodes.
    pub points: Vec<PointCase>,
    /// Body forces.
    pub body_forces: Vec<BodyForceCase>,
    /// The load steps.
    pub steps: StepsCase,
    /// Newton's method at the macro scale.
    pub newton: NewtonCase,
    /// Newton's method at the micro scale.
    pub micro: MicroCase,
    /// Numbers of ranks.
    pub scales: ScalesCase,
    /// The result directory and the output written to it.
    pub output: OutputCase,
}

/// The source of a mesh.
#[derive(Clone, Debug, PartialEq)]
pub enum MeshSource {
    /// A Gmsh file.
    File(PathBuf),
    /// The built-in box.
    Box {
        /// Cells along x, y, z.
        cells: [usize; 3],
        /// Edge lengths, in mesh units.
        size: [f64; 3],
    },
    /// The built-in dogbone.
    Dogbone {
        /// Target edge length of the elements, in mesh units.
        element_size: f64,
    },
}

/// A region and its material.
#[derive(Clone, Debug, PartialEq)]
pub struct RegionCase {
    /// The physical volume; `*` is every volume that no other region names.
    pub name: String,
    /// Line of the case file, for errors found once the mesh is read.
    pub line: usize,
    /// The material.
    pub material: MaterialCase,
}

/// A material of the macro scale.
#[derive(Clone, Debug, PartialEq)]
pub enum MaterialCase {
    /// A formula.
    Formula(FormulaCase),
    /// A fiber network at every integration point.
    FiberRve(FiberRveCase),
}

/// A material given by a formula. Every pair of elastic constants is converted to `mu` and `lambda`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FormulaCase {
    /// The formula.
    pub model: FormulaModel,
    /// Shear modulus `mu`, Pa.
    pub shear_modulus: f64,
    /// Lame's first constant `lambda`, Pa.
    pub lame_lambda: f64,
}

/// The available formulas.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FormulaModel {
    /// `mu/2 (I1 - 3) - mu ln J + lambda/2 (ln J)^2`.
    NeoHookean,
    /// Linear elasticity at small strain.
    LinearElastic,
}

/// A fiber network at every integration point.
#[derive(Clone, Debug, PartialEq)]
pub struct FiberRveCase {
    /// The network files, sorted, with glob patterns expanded. If empty, the material is its matrix alone, which must
    /// exist.
    pub networks: Vec<PathBuf>,
    /// The rule that assigns a network to each element.
    pub choose: Choose,
    /// Seed of the random assignment.
    pub seed: u64,
    /// The scaling of the stress.
    pub scale: ScaleCase,
    /// The law of all fibers; if `None`, the parameter files beside each network define it.
    pub law: Option<FiberMaterial>,
    /// A matrix in parallel with the network.
    pub matrix: Option<FormulaCase>,
    /// The conditions under which RVEs are created, sleep, and are deleted.
    pub life: LifeCase,
}

/// The conditions under which the RVE of an element is created, sleeps, and is deleted. By default it exists and is
/// awake throughout the run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LifeCase {
    /// The RVE is created once the strain of its element, `|E|` with `E = (F^T F - I) / 2`, exceeds this value.
    pub created_at: f64,
    /// The response before creation.
    pub before: Before,
    /// The RVE falls asleep after a step in which every component of `F` changes by less than this value, and wakes
    /// once a component has changed by more since.
    pub asleep_below: f64,
    /// The RVE is deleted once the strain exceeds this value; from then on its matrix alone responds.
    pub deleted_at: f64,
}

impl Default for LifeCase {
    fn default() -> Self {
        Self { created_at: 0.0, before: Before::Linear, asleep_below: 0.0, deleted_at: f64::INFINITY }
    }
}

/// The response that replaces an RVE before it is created.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Before {
    /// The linear response of its network at rest, plus its matrix if it has one.
    Linear,
    /// Its matrix alone.
    Matrix,
}

/// The rule that assigns a network of the library to each element.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Choose {
    /// By a hash of seed and element number.
    Random,
    /// By the element number modulo the number of networks.
    Cycle,
}

/// The factor `kappa` that converts network forces to stresses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ScaleCase {
    /// `kappa = 1`.
    Raw,
    /// `kappa = phi / sum(A L)`, where `phi` is this fiber volume fraction.
    FiberVolumeFraction(f64),
}

/// A boundary condition on a surface.
#[derive(Clone, Debug, PartialEq)]
pub struct BoundaryCase {
    /// The physical surface.
    pub surface: String,
    /// Line of the case file.
    pub line: usize,
    /// The prescribed displacement or traction.
    pub load: LoadCase,
    /// The load curve over pseudo-time.
    pub curve: CurveCase,
}

/// The displacement or traction that a boundary prescribes.
#[derive(Clone, Debug, PartialEq)]
pub enum LoadCase {
    /// Displacement by component, m; a component that is `None` is free.
    Displacement([Option<f64>; 3]),
    /// Dead traction, Pa of reference area.
    Traction([f64; 3]),
}

/// A load factor as a function of pseudo-time `t` in `(0, 1]`.
#[derive(Clone, Debug, PartialEq)]
pub enum CurveCase {
    /// `factor = t`.
    Ramp,
    /// Linear between `(t, factor)` points with ascending `t`, constant before the first and after the last.
    Table(Vec<[f64; 2]>),
}

/// A prescribed displacement at a node.
#[derive(Clone, Debug, PartialEq)]
pub struct PointCase {
    /// The node.
    pub place: PointPlace,
    /// Line of the case file.
    pub line: usize,
    /// Displacement by component, m; a component that is `None` is free.
    pub displacement: [Option<f64>; 3],
    /// The load curve over pseudo-time.
    pub curve: CurveCase,
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
    pub value: [f64; 3],
    /// The load curve over pseudo-time.
    pub curve: CurveCase,
}

/// The load steps; by default 10 steps and at most 6 cuts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StepsCase {
    /// Number of load steps; step `k` ends at `t = k / count`.
    pub count: usize,
    /// Maximum number of times that a failed step is halved.
    pub max_cuts: u32,
}

impl Default for StepsCase {
    fn default() -> Self {
        Self { count: 10, max_cuts: 6 }
    }
}

/// Newton's method at the macro scale; by default tolerance 1e-8, at most 25 iterations, line search, start from
/// `Held`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NewtonCase {
    /// Tolerance of the relative residual.
    pub tolerance: f64,
    /// Maximum number of iterations per step.
    pub max_iterations: usize,
    /// Whether the line search may shorten steps.
    pub line_search: bool,
    /// The initial guess of every step but the first.
    pub start: StepStart,
    /// The linear solver.
    pub solver: Method,
}

impl Default for NewtonCase {
    fn default() -> Self {
        Self { tolerance: 1e-8, max_iterations: 25, line_search: true, start: StepStart::Held, solver: Method::Direct }
    }
}

/// The initial guess of a step that follows a converged one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StepStart {
    /// The converged state with only the prescribed displacements updated.
    Held,
    /// The converged state plus the increment of all displacements that its last tangent gives for the prescribed ones.
    Tangent,
}

/// Equilibrium at the micro scale; by default tolerance 1e-10, at most 50 iterations, at most 6 cuts, all stages.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MicroCase {
    /// Tolerance of the relative residual.
    pub tolerance: f64,
    /// Maximum number of iterations per RVE.
    pub max_iterations: usize,
    /// Maximum number of times that a failed increment is halved.
    pub max_cuts: u32,
    /// The solution stages that are allowed.
    pub stages: Stages,
    /// Whether each RVE stores the sensitivity of its node positions to the strain and starts from that prediction.
    pub predictor: bool,
    /// The linear solver.
    pub solver: Method,
}

impl Default for MicroCase {
    fn default() -> Self {
        Self {
            tolerance: 1e-10,
            max_iterations: 50,
            max_cuts: 6,
            stages: Stages::default(),
            predictor: true,
            solver: Method::Direct,
        }
    }
}

/// Number of ranks of each scale; by default one process computes both scales.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ScalesCase {
    /// Number of ranks of the macro scale.
    pub macro_ranks: usize,
    /// Number of ranks of the micro scale; 0: all ranks that the macro scale leaves, or one process for both scales.
    pub micro_ranks: usize,
    /// Whether ranks are assigned so that each rank of the micro scale is near a rank of the macro scale, according to
    /// the machine topology that hwloc reports.
    pub near: bool,
}

impl ScalesCase {
    /// Returns the smallest number of ranks with which this case can run.
    #[must_use]
    pub fn least(&self) -> usize {
        match (self.macro_ranks, self.micro_ranks) {
            (1, 0) => 1,
            (above, below) => above + below.max(1),
        }
    }
}

impl Default for ScalesCase {
    fn default() -> Self {
        Self { macro_ranks: 1, micro_ranks: 0, near: false }
    }
}

/// The result directory and the output written to it.
#[derive(Clone, Debug, PartialEq)]
pub struct OutputCase {
    /// The result directory, resolved against the folder of the case file.
    pub directory: PathBuf,
    /// Number of steps between two outputs of the fields; the last step is always written.
    pub every: usize,
    /// The elements whose deformed networks are written too.
    pub rve: RveOutput,
}

/// The elements whose deformed networks are written beside the fields.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum RveOutput {
    /// No element.
    None,
    /// All elements that have a network.
    All,
    /// The elements with these indices in the mesh, from 0; ascending, without repeats.
    Elements(Vec<usize>),
}
