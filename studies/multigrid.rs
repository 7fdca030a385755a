//! Counts the iterations of conjugate gradients with algebraic multigrid for meshes, materials and shapes of cells of
//! many kinds, beside those with PETSc's GAMG.
//!
//! ```text
//! BIOTISSUE_NETWORKS=<folder> cargo run --release --package studies --features petsc --bin multigrid [-- TEXT]
//! ```
//!
//! prints the tables of `docs/multigrid.md`; with an argument, only the rows whose name contains it. Without the feature,
//! the columns of PETSc are omitted, and without the variable the ligament, a mesh by Gmsh in `<folder>/ligament`.
//!
//! The problems are the stiffness of a body at rest or the Laplacian on its mesh, with a right-hand side of random
//! numbers. Unless the name says otherwise, the body is a unit cube of tetrahedra of order 1, six in each cubic cell,
//! fixed at `x = 0` and `x = 1`, with Poisson's ratio 0.3. Both multigrid methods get the same near null space: the six
//! rigid motions, or the constants.

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use biotissue::backends::sparse::Sparse;
use biotissue::backends::sparse::multigrid::{Multigrid, MultigridParams};
use biotissue::fem::assembly::{Assembler, Unknowns, geometry};
use biotissue::fem::element::ElementType;
use biotissue::fem::material::{Material, NeoHookean};
use biotissue::fem::mesh::{Mesh, gmsh, shapes};
use biotissue::fem::point_field::PointResponses;
use biotissue::las::conformance::Random;
use biotissue::las::{
    Index, Iterative, Krylov, MatrixOps, Preconditioner, RealBackend, SolveError, Solver, SolverParams, Sparsity,
    Symmetry, VectorOps,
};
use nalgebra::{Matrix3, SMatrix};

type Error = Box<dyn std::error::Error>;

/// The largest number of iterations.
const MOST_ITERATIONS: usize = 300;
/// The ratio of large to small stiffnesses.
const JUMP: f64 = 1e6;
/// Blocks of the checkerboard along a side.
const BLOCKS: f64 = 6.0;

#[derive(Clone, Copy, PartialEq)]
enum Equation {
    Poisson,
    Elasticity { poissons_ratio: f64 },
}

/// A problem on several meshes.
struct Case {
    equation: Equation,
    name: &'static str,
    /// The numbers of cells, from which the meshes are made.
    cells: Vec<usize>,
    mesh: Box<dyn Fn(usize) -> Result<Mesh, Error>>,
    fixed: [&'static str; 2],
    /// Young's modulus or the conductivity of an element, from its number and center.
    stiffness: fn(usize, [f64; 3]) -> f64,
    /// Whether the nodes are numbered at random.
    is_shuffled: bool,
}

impl Case {
    fn new<F>(equation: Equation, name: &'static str, cells: &[usize], mesh: F) -> Self
    where
        F: Fn(usize) -> Result<Mesh, Error> + 'static,
    {
        let (cells, mesh) = (cells.to_vec(), Box::new(mesh));
        Self { equation, name, cells, mesh, fixed: ["x0", "x1"], stiffness: |_, _| 1.0, is_shuffled: false }
    }
}

/// Returns the cases of each table.
fn cases() -> [(&'static str, Vec<Case>); 2] {
    let elasticity = Equation::Elasticity { poissons_ratio: 0.3 };
    let mut elastic = of_equation(elasticity);
    let irregular = |nu, name, cells: [usize; 2], order: usize| {
        Case::new(Equation::Elasticity { poissons_ratio: nu }, name, &cells, move |cells| irregular(cells, order))
    };
    elastic.push(Case { is_shuffled: true, ..irregular(0.3, "nodes moved and numbered at random", [12, 24], 1) });
    elastic.extend([
        irregular(0.45, "nodes moved, Poisson's ratio 0.45", [12, 24], 1),
        irregular(0.49, "nodes moved, Poisson's ratio 0.49", [12, 24], 1),
        irregular(0.45, "nodes moved, order 2, Poisson's ratio 0.45", [6, 12], 2),
        irregular(0.49, "nodes moved, order 2, Poisson's ratio 0.49", [6, 12], 2),
    ]);
    let cantilever = |name, cells: [usize; 2], mesh: fn(usize) -> Result<Mesh, Error>| Case {
        fixed: ["x0", "x0"],
        ..Case::new(elasticity, name, &cells, mesh)
    };
    elastic.extend([
        cantilever("cube fixed at one side", [12, 24], |n| cuboid([n; 3], [1.0; 3])),
        cantilever("beam, length 64 times its width, fixed at one end", [2, 4], |n| {
            cuboid([64 * n, n, n], [64.0, 1.0, 1.0])
        }),
        cantilever("plate, side 100 times its thickness, fixed at one side", [2, 4], |n| {
            cuboid([12 * n, 12 * n, n], [1.0, 1.0, 0.01])
        }),
    ]);
    [("Poisson equation", of_equation(Equation::Poisson)), ("elasticity", elastic)]
}

/// Returns the cases of both equations.
fn of_equation(equation: Equation) -> Vec<Case> {
    let cube = |name, cells: &[usize]| Case::new(equation, name, cells, |n| cuboid([n; 3], [1.0; 3]));
    let with = |name, stiffness| Case { stiffness, ..cube(name, &[12, 24]) };
    let flat = |name, factor: usize, cells: [usize; 2]| {
        Case::new(equation, name, &cells, move |n| cuboid([n, n, factor * n], [1.0; 3]))
    };
    let mut cases = vec![
        cube("cube", &[20, 40, 64]),
        Case::new(equation, "hexahedra", &[12, 24], |n| Ok(shapes::cuboid_of(ElementType::Hex8, [n; 3], [1.0; 3])?)),
        Case::new(equation, "order 2", &[6, 12], |n| Ok(shapes::cuboid_of(ElementType::Tet10, [n; 3], [1.0; 3])?)),
        Case::new(equation, "nodes moved", &[12, 24], |n| irregular(n, 1)),
        Case::new(equation, "nodes moved, order 2", &[6, 12], |n| irregular(n, 2)),
        with("core 1e6 times as stiff", |_, x| if x.iter().all(|x| (x - 0.5).abs() < 0.25) { JUMP } else { 1.0 }),
        with("random checkerboard of 1 and 1e6", |_, x| {
            let number = x.iter().fold(0.0, |number, x| BLOCKS * number + (BLOCKS * x).floor());
            if is_chosen(number as u64) { JUMP } else { 1.0 }
        }),
        with("each element at random 1 or 1e6", |element, _| if is_chosen(element as u64) { JUMP } else { 1.0 }),
        flat("cells flat by 10", 10, [6, 12]),
        flat("cells flat by 100", 100, [3, 6]),
        Case::new(equation, "cells long by 10", &[2, 4], |n| cuboid([10 * n, 10 * n, n], [1.0; 3])),
        Case::new(equation, "cells long by 100", &[1, 2], |n| cuboid([100 * n, 100 * n, n], [1.0; 3])),
    ];
    if let Ok(folder) = std::env::var("BIOTISSUE_NETWORKS") {
        let mesh = move |order| {
            let read = gmsh::read(&Path::new(&folder).join("ligament/ligament_6192.msh"))?.mesh;
            if order == 2 { Ok(read.quadratic(Default::default())?) } else { Ok(read) }
        };
        let ligament = Case::new(equation, "ligament, order 1 and 2", &[1, 2], mesh);
        cases.push(Case { fixed: ["face78", "face82"], ..ligament });
    }
    cases
}

/// Returns true for every second number at random.
fn is_chosen(number: u64) -> bool {
    Random::new(number).below(2) == 1
}

fn cuboid(cells: [usize; 3], size: [f64; 3]) -> Result<Mesh, Error> {
    Ok(shapes::cuboid(cells, size)?)
}

/// Moves the nodes inside a cube at random, along each axis by up to 30 % of the cell; by half or less of that where an
/// element would otherwise keep less than a tenth of its volume.
fn irregular(cells: usize, order: usize) -> Result<Mesh, Error> {
    let regular = cuboid([cells; 3], [1.0; 3])?;
    let width = 1.0 / cells as f64;
    let mut nodes = regular.nodes().to_vec();
    let mut elements_of = vec![Vec::new(); nodes.len()];
    for corners in regular.elements().iter() {
        corners.iter().for_each(|&node| elements_of[node as usize].push(corners));
    }
    let mut random = Random::new(1);
    for node in 0..nodes.len() {
        let from = nodes[node];
        let mut shift = [(); 3].map(|()| 0.3 * width * random.signed());
        let is_inside = from.iter().all(|x| (0.5 * width..1.0 - 0.5 * width).contains(x));
        for _ in 0..if is_inside { 4 } else { 0 } {
            nodes[node] = std::array::from_fn(|i| from[i] + shift[i]);
            if elements_of[node].iter().all(|corners| volume(&nodes, corners) > 0.1 * width.powi(3) / 6.0) {
                break;
            }
            nodes[node] = from;
            shift = shift.map(|s| 0.5 * s);
        }
    }
    let (regions, surfaces) = (regular.regions().to_vec(), regular.surfaces().to_vec());
    let mesh = Mesh::new(nodes, regular.elements().clone(), regular.region_of().to_vec(), regions, surfaces)?;
    Ok(if order == 2 { mesh.quadratic(Default::default())? } else { mesh })
}

/// Returns the volume of a tetrahedron.
fn volume(nodes: &[[f64; 3]], corners: &[u32]) -> f64 {
    let edge = |k: usize, i: usize| nodes[corners[k + 1] as usize][i] - nodes[corners[0] as usize][i];
    Matrix3::from_fn(edge).determinant() / 6.0
}

/// A linear system, for any backend.
struct Problem {
    mesh: Mesh,
    unknowns: Unknowns,
    pattern: Arc<Sparsity>,
    responses: PointResponses,
    near_null_space: Vec<Vec<f64>>,
    right_hand_side: Vec<f64>,
}

impl Problem {
    fn new(case: &Case, cells: usize) -> Result<Self, Error> {
        let mesh = (case.mesh)(cells)?;
        let mut is_fixed = vec![false; mesh.nodes().len()];
        for name in case.fixed {
            let surface = mesh.surface(name).ok_or_else(|| format!("the mesh has no surface `{name}`"))?;
            surface.nodes().into_iter().for_each(|node| is_fixed[node as usize] = true);
        }
        // The Laplacian is the x component of a vector equation whose components are not coupled.
        let is_poisson = case.equation == Equation::Poisson;
        let prescribed = |node: usize, component: usize| is_fixed[node] || is_poisson && component > 0;
        let mut order: Vec<u32> = (0..mesh.nodes().len() as u32).collect();
        let mut random = Random::new(2);
        if case.is_shuffled {
            (1..order.len()).for_each(|end| order.swap(end, random.below(end + 1)));
        }
        let unknowns = Unknowns::in_order(&order, prescribed)?;
        let mut responses = PointResponses::zeros(mesh.points().len());
        let tangent = tangent(case.equation)?;
        for (point, of_point) in responses.tangent.iter_mut().enumerate() {
            let element = mesh.points().locate(point).element as usize;
            *of_point = tangent * (case.stiffness)(element, mesh.center(element));
        }
        let pattern = Arc::new(unknowns.pattern(&mesh)?);
        let near_null_space =
            if is_poisson { vec![vec![1.0; pattern.rows()]] } else { rigid_motions(&mesh, &unknowns) };
        let right_hand_side = (0..pattern.rows()).map(|_| random.signed()).collect();
        Ok(Self { mesh, unknowns, pattern, responses, near_null_space, right_hand_side })
    }

    fn matrix<B: RealBackend>(&self, context: &B::Context) -> Result<B::Matrix, Error> {
        let mut matrix = B::matrix(context, &self.pattern)?;
        let assembler = Assembler::<B>::new(geometry(&self.mesh)?, &self.unknowns, &matrix)?;
        let at_rest = vec![[0.0; 3]; self.mesh.nodes().len()];
        assembler.stiffness(&at_rest, &[], &self.responses, &mut matrix)?;
        matrix.finish()?;
        Ok(matrix)
    }
}

fn tangent(equation: Equation) -> Result<SMatrix<f64, 9, 9>, Error> {
    let Equation::Elasticity { poissons_ratio: nu } = equation else { return Ok(SMatrix::identity()) };
    let material = NeoHookean { mu: 0.5 / (1.0 + nu), lambda: nu / ((1.0 + nu) * (1.0 - 2.0 * nu)) };
    Ok(material.evaluate(&Matrix3::identity())?.tangent)
}

/// The displacement at a position.
type Motion = fn(&[f64; 3]) -> [f64; 3];

/// Returns the translations and rotations of the free components.
fn rigid_motions(mesh: &Mesh, unknowns: &Unknowns) -> Vec<Vec<f64>> {
    let motions: [Motion; 6] = [
        |_| [1.0, 0.0, 0.0],
        |_| [0.0, 1.0, 0.0],
        |_| [0.0, 0.0, 1.0],
        |x| [0.0, -x[2], x[1]],
        |x| [x[2], 0.0, -x[0]],
        |x| [-x[1], x[0], 0.0],
    ];
    let of_motion = |motion| {
        let displacements: Vec<[f64; 3]> = mesh.nodes().iter().map(motion).collect();
        let mut values = vec![0.0; unknowns.free()];
        for (&number, &value) in unknowns.equation_numbers().iter().zip(displacements.as_flattened()) {
            if let Ok(number) = usize::try_from(number) {
                values[number] = value;
            }
        }
        values
    };
    motions.map(of_motion).into()
}

/// Solves a problem on a backend and returns the columns of the table: iterations, seconds of setup and of solution. If
/// the iteration fails, a direct solver replaces it where `fallback` is true.
fn solve<B: RealBackend>(context: &B::Context, problem: &Problem, fallback: bool) -> Result<String, Error> {
    let matrix = problem.matrix::<B>(context)?;
    let method = Iterative {
        preconditioner: Preconditioner::Multigrid,
        tolerance: 1e-8,
        max_iterations: MOST_ITERATIONS,
        ..Iterative::new(Krylov::Cg)
    };
    let mut params = SolverParams::new(Symmetry::Definite).iterative(method);
    params.fallback = fallback;
    let n = problem.pattern.rows();
    let (mut b, mut x) = (B::vector(context, n)?, B::vector(context, n)?);
    let rows: Vec<B::Index> = (0..n).map(B::Index::of).collect();
    b.set(&rows, &problem.right_hand_side)?;
    let start = Instant::now();
    let mut solver = B::solver(&B::analyze(context, &problem.pattern, &params)?)?;
    solver.set_near_null_space(&problem.near_null_space)?;
    solver.factor(&matrix)?;
    let setup = start.elapsed().as_secs_f64();
    let start = Instant::now();
    let iterations = match solver.solve(&b, &mut x) {
        Ok(report) if report.fallbacks == 0 => report.iterations.to_string(),
        Ok(report) => format!("fails after {}, then direct", report.iterations),
        Err(SolveError::NotConverged { iterations, .. }) => format!("fails after {iterations}"),
        Err(error) => return Err(error.into()),
    };
    Ok(format!("{iterations} | {setup:.2} | {:.2}", start.elapsed().as_secs_f64()))
}

/// Where PETSc describes a solver after its solution.
#[cfg(feature = "petsc")]
fn description() -> std::path::PathBuf {
    std::env::temp_dir().join(format!("multigrid-{}.txt", std::process::id()))
}

/// Solves a problem by GAMG and returns the columns of the table: operator complexity, iterations, seconds of setup and of
/// solution.
#[cfg(feature = "petsc")]
fn by_gamg(context: &biotissue::backends::petsc::Context, problem: &Problem) -> Result<String, Error> {
    let solved = solve::<biotissue::backends::petsc::Petsc>(context, problem, false)?;
    let described = std::fs::read_to_string(description())?;
    // `Complexity:    grid = 1.02    operator = 1.11`
    let complexity: f64 = match described.lines().find_map(|line| line.split_once("operator = ")) {
        Some((_, complexity)) => complexity.trim().parse()?,
        None => return Err("PETSc does not state the operator complexity".into()),
    };
    Ok(format!("{complexity:.2} | {solved}"))
}

/// Returns the number of levels and the operator complexity.
fn hierarchy(problem: &Problem) -> Result<String, Error> {
    let matrix = problem.matrix::<Sparse>(&())?;
    let mut multigrid = Multigrid::new(&problem.pattern, Symmetry::Definite, MultigridParams::default())?;
    multigrid.set_near_null_space(&problem.near_null_space)?;
    multigrid.set_up(&matrix)?;
    Ok(format!("{} | {:.2}", multigrid.levels().len(), multigrid.operator_complexity()))
}

fn main() -> Result<(), Error> {
    let wanted = std::env::args().nth(1).unwrap_or_default();
    #[cfg(feature = "petsc")]
    let petsc = biotissue::backends::petsc::Context::world()?;
    #[cfg(feature = "petsc")]
    petsc.set_option("ksp_view", &format!("ascii:{}", description().display()))?;
    for (title, cases) in cases() {
        let (columns, gamg) = (
            "unknowns | levels | complexity | iterations | setup, s | solution, s",
            " GAMG: complexity | iterations | setup, s | solution, s |",
        );
        let gamg = if cfg!(feature = "petsc") { gamg } else { "" };
        let rules = "---|".repeat(if gamg.is_empty() { 7 } else { 11 });
        println!("\n| {title} | {columns} |{gamg}\n|{rules}");
        for case in cases.iter().filter(|case| case.name.contains(&wanted)) {
            for &cells in &case.cells {
                let problem = Problem::new(case, cells)?;
                let (hierarchy, ours) = (hierarchy(&problem)?, solve::<Sparse>(&(), &problem, true)?);
                print!("| {} | {} | {hierarchy} | {ours} |", case.name, problem.pattern.rows());
                #[cfg(feature = "petsc")]
                print!(" {} |", by_gamg(&petsc, &problem)?);
                println!();
            }
        }
    }
    #[cfg(feature = "petsc")]
    std::fs::remove_file(description())?;
    Ok(())
}
