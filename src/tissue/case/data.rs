//! What a case holds once it is read and checked.

use std::path::PathBuf;

use crate::fiber::equilibrium::Stages;
use crate::fiber::law::FiberMaterial;
use crate::las::Method;

/// A checked case. Paths are absolute, resolved against the folder of the case file.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    /// The file it was read from.
    pub file: PathBuf,
    /// What the run is called.
    pub title: String,
    /// Where the mesh comes from.
    pub mesh: MeshSource,
    /// The line of the case file where its source stands, for errors found once the mesh is made.
    pub mesh_line: usize,
    /// Meters of one mesh unit.
    pub mesh_scale: f64,
    /// Materials, region by region.
    pub regions: Vec<RegionCase>,
    /// What is prescribed on surfaces.
    pub boundaries: Vec<BoundaryCase>,
    /// What is prescribed at single nodes.
    pub points: Vec<PointCase>,
    /// Forces per reference volume.
    pub body_forces: Vec<BodyForceCase>,
    /// Load steps.
    pub steps: StepsCase,
    /// Newton at the macro scale.
    pub newton: NewtonCase,
    /// Newton at the micro scale.
    pub micro: MicroCase,
    /// Ranks.
    pub scales: ScalesCase,
    /// What is written where.
    pub output: OutputCase,
}

/// Where a mesh comes from.
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
    /// Its line in the case file, for errors found once the mesh is read.
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

/// A material given by a formula. All pairs of elastic constants are reduced to these two.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FormulaCase {
    /// Which formula.
    pub model: FormulaModel,
    /// Shear modulus `mu`, Pa.
    pub shear_modulus: f64,
    /// Lame's first constant `lambda`, Pa.
    pub lame_lambda: f64,
}

/// The formulas.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FormulaModel {
    /// `mu/2 (I1 - 3) - mu ln J + lambda/2 (ln J)^2`.
    NeoHookean,
    /// Small strain.
    LinearElastic,
}

/// A fiber network at every integration point.
#[derive(Clone, Debug, PartialEq)]
pub struct FiberRveCase {
    /// The network files, globs resolved, sorted. None at all leaves the matrix alone, which is then given.
    pub networks: Vec<PathBuf>,
    /// Which network an element gets.
    pub choose: Choose,
    /// Seed of the choice.
    pub seed: u64,
    /// The scale of the stress.
    pub scale: ScaleCase,
    /// The law of all fibers; `None`: what the files beside each network say.
    pub law: Option<FiberMaterial>,
    /// A matrix in parallel.
    pub matrix: Option<FormulaCase>,
    /// When RVEs are created, sleep, and are deleted.
    pub life: LifeCase,
}

/// When the RVE of an element is created, sleeps, and is deleted. By default it is there and awake from the beginning to the
/// end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LifeCase {
    /// It is created once the strain of its element, `|E|` with `E = (F^T F - I) / 2`, has passed this.
    pub created_at: f64,
    /// What answers before.
    pub before: Before,
    /// It sleeps once no component of `F` changes by as much in a step, until one has changed by more since.
    pub asleep_below: f64,
    /// It is deleted once the strain has passed this; its matrix answers from then on.
    pub deleted_at: f64,
}

impl Default for LifeCase {
    fn default() -> Self {
        Self { created_at: 0.0, before: Before::Linear, asleep_below: 0.0, deleted_at: f64::INFINITY }
    }
}

/// What answers for an RVE that is not created yet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Before {
    /// The linear response of its network at rest, and its matrix if it has one.
    Linear,
    /// Its matrix alone.
    Matrix,
}

/// Which network of the library an element gets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Choose {
    /// A hash of seed and element number.
    Random,
    /// Element number modulo the number of networks.
    Cycle,
}

/// How network forces become stresses (`kappa` of the physics).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ScaleCase {
    /// `kappa = 1`.
    Raw,
    /// `kappa = phi / sum(A L)` with this fiber volume fraction.
    FiberVolumeFraction(f64),
}

/// What is prescribed on a surface.
#[derive(Clone, Debug, PartialEq)]
pub struct BoundaryCase {
    /// The physical surface.
    pub surface: String,
    /// Its line in the case file.
    pub line: usize,
    /// What is prescribed there.
    pub load: LoadCase,
    /// Its course over pseudo-time.
    pub curve: CurveCase,
}

/// What a boundary prescribes.
#[derive(Clone, Debug, PartialEq)]
pub enum LoadCase {
    /// Displacement by component, m; `None` is free.
    Displacement([Option<f64>; 3]),
    /// Dead traction, Pa of reference area.
    Traction([f64; 3]),
}

/// A factor over pseudo-time `t` in `(0, 1]`.
#[derive(Clone, Debug, PartialEq)]
pub enum CurveCase {
    /// `factor = t`.
    Ramp,
    /// Linear between `(t, factor)` points with ascending `t`, constant outside.
    Table(Vec<[f64; 2]>),
}

/// What is prescribed at a node.
#[derive(Clone, Debug, PartialEq)]
pub struct PointCase {
    /// Which one.
    pub place: PointPlace,
    /// Its line in the case file.
    pub line: usize,
    /// Displacement by component, m; `None` is free.
    pub displacement: [Option<f64>; 3],
    /// Its course over pseudo-time.
    pub curve: CurveCase,
}

/// Which node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PointPlace {
    /// The one nearest to a position, in mesh units.
    At([f64; 3]),
    /// The one of this index, from 0.
    Node(usize),
}

/// A force per reference volume.
#[derive(Clone, Debug, PartialEq)]
pub struct BodyForceCase {
    /// The physical volume; `*` is all of the body.
    pub region: String,
    /// Its line in the case file.
    pub line: usize,
    /// N/m^3.
    pub value: [f64; 3],
    /// Its course over pseudo-time.
    pub curve: CurveCase,
}

/// Load steps; 10 steps and 6 cuts unless the case says otherwise.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StepsCase {
    /// How many; step `k` ends at `t = k / count`.
    pub count: usize,
    /// How often a step that fails may be halved.
    pub max_cuts: u32,
}

impl Default for StepsCase {
    fn default() -> Self {
        Self { count: 10, max_cuts: 6 }
    }
}

/// Newton at the macro scale; by default 1e-8 in at most 25 iterations, with the line search, from the held state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NewtonCase {
    /// Relative residual.
    pub tolerance: f64,
    /// Iterations a step.
    pub max_iterations: usize,
    /// Whether the line search may shorten steps.
    pub line_search: bool,
    /// Where every step but the first starts from.
    pub start: StepStart,
    /// How linear systems are solved.
    pub solver: Method,
}

impl Default for NewtonCase {
    fn default() -> Self {
        Self { tolerance: 1e-8, max_iterations: 25, line_search: true, start: StepStart::Held, solver: Method::Direct }
    }
}

/// The first guess of a step that follows a converged one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StepStart {
    /// The converged state with only the prescribed values moved.
    Held,
    /// The converged state with the moved values distributed over the body by its last tangent.
    Tangent,
}

/// Equilibria at the micro scale; by default 1e-10 in at most 50 iterations, 6 cuts, every stage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MicroCase {
    /// Relative residual.
    pub tolerance: f64,
    /// Iterations an RVE.
    pub max_iterations: usize,
    /// How often an increment that fails may be halved.
    pub max_cuts: u32,
    /// The stages that may be tried.
    pub stages: Stages,
    /// Whether RVEs keep how their nodes follow a strain, and start from that.
    pub predictor: bool,
    /// How linear systems are solved.
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

/// Ranks of each scale; by default one process that does both.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ScalesCase {
    /// Ranks of the macro scale.
    pub macro_ranks: usize,
    /// Ranks of the micro scale; 0: those that the macro scale leaves, or one process for both.
    pub micro_ranks: usize,
    /// Whether ranks are dealt out so that those of the micro scale are near one of the macro scale, by what hwloc
    /// knows of the machines.
    pub near: bool,
}

impl ScalesCase {
    /// The fewest ranks that it can be meant for.
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

/// What is written where.
#[derive(Clone, Debug, PartialEq)]
pub struct OutputCase {
    /// The result directory, resolved against the folder of the case file.
    pub directory: PathBuf,
    /// Fields are written every so many steps (and at the last).
    pub every: usize,
    /// Whose deformed networks are written too.
    pub rve: RveOutput,
}

/// The elements whose deformed networks are written beside the fields.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum RveOutput {
    /// None.
    None,
    /// All that have one.
    All,
    /// These, by their index in the mesh, from 0; ascending, without repeats.
    Elements(Vec<usize>),
}
