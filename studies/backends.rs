//! Measures the time of a Newton iteration by backend, solver and size, and the differences between the results.
//!
//! ```text
//! cargo run --release --package studies --features petsc --bin backends
//! ```
//!
//! prints the tables of `docs/backends.md`; without the feature, the rows of PETSc are omitted. Under `mpirun` it
//! prints only the rows of PETSc, on that number of ranks.
//!
//! Every problem is solved from rest several times, by Newton's method in one increment. The time of a solution
//! (residuals, assembly, factorizations and linear solves) is divided by its number of Newton iterations; setup that is
//! done once per sparsity pattern is not included. The tables list the minimum and the median.

use std::sync::Arc;
use std::time::Instant;

use biotissue::backends::dense::Dense;
use biotissue::backends::sparse::Sparse;
use biotissue::fem::boundary::{Conditions, LoadCurve, SurfaceCondition};
use biotissue::fem::material::NeoHookean;
use biotissue::fem::mesh::{Mesh, shapes};
use biotissue::fem::point_field::FormulaField;
use biotissue::fem::stepping::{StepParams, Stepper};
use biotissue::fiber::equilibrium::{EquilibriumParams, Stage, Stages, equilibrate};
use biotissue::fiber::law::{FiberMaterial, Law};
use biotissue::fiber::network::{Network, generate};
use biotissue::fiber::rve::{Rve, RveModel, StressScale};
use biotissue::fiber::workspace::Workspace;
use biotissue::las::{Iterative, Krylov, Preconditioner, RealBackend, SolverParams};
use nalgebra::Matrix3;

type Error = Box<dyn std::error::Error>;

/// Interior nodes of the networks, for about a hundred, a thousand and ten thousand unknowns.
const POINTS: [usize; 3] = [34, 334, 3334];
/// Cells per side of the bodies, for about the same numbers of unknowns.
const CELLS: [usize; 3] = [3, 7, 15];
/// Number of timed solutions for each size.
const TIMES: [usize; 3] = [21, 11, 5];

/// The problem to solve.
enum Subject {
    /// The equilibrium of a network, stretched by 10 % and sheared.
    Network(Arc<Network>),
    /// The equilibrium of a neo-Hookean cube, stretched by 10 %.
    Body(Arc<Mesh>),
}

/// The result of one solution.
struct Solution {
    seconds: f64,
    iterations: usize,
    linear_iterations: usize,
    /// Stress components of a network (Pa), or nodal displacements of a body.
    answer: Vec<f64>,
}

/// Solves a problem once, from rest.
type Solve<'a> = Box<dyn FnMut() -> Result<Solution, Error> + 'a>;

fn main() -> Result<(), Error> {
    #[cfg(feature = "petsc")]
    let petsc = biotissue::backends::petsc::Context::world()?;
    #[cfg(feature = "petsc")]
    let ranks = (petsc.rank(), petsc.ranks());
    #[cfg(not(feature = "petsc"))]
    let ranks = (0, 1);
    let networks = POINTS.map(|points| generate::delaunay(points, 1).map(|made| Subject::Network(Arc::new(made))));
    let bodies = CELLS.map(|cells| shapes::cuboid([cells; 3], [1.0; 3]).map(|mesh| Subject::Body(Arc::new(mesh))));
    let networks = networks.into_iter().collect::<Result<Vec<_>, _>>()?;
    let bodies = bodies.into_iter().collect::<Result<Vec<_>, _>>()?;
    for (title, subjects) in [("fiber network", networks), ("body", bodies)] {
        let mut table = Table { subjects, answers: Vec::new(), prints: ranks.0 == 0 };
        table.head(title, ranks.1);
        if ranks.1 == 1 {
            table.line::<Sparse>("sparse, direct", &(), SolverParams::default(), 3)?;
            let ilut = Preconditioner::Ilut { drop_tolerance: 1e-3, fill: 20 };
            table.line::<Sparse>("sparse, CG with ILUT(1e-3, 20)", &(), iterative(Krylov::Cg, ilut), 3)?;
            table.line::<Sparse>("sparse, BiCGSTAB with ILUT(1e-3, 20)", &(), iterative(Krylov::BiCgStab, ilut), 3)?;
            table.line::<Sparse>(
                "sparse, CG with the diagonal",
                &(),
                iterative(Krylov::Cg, Preconditioner::Diagonal),
                3,
            )?;
            table.line::<Dense>("dense, direct", &(), SolverParams::default(), 2)?;
        }
        #[cfg(feature = "petsc")]
        for (name, params) in [
            ("petsc, direct", SolverParams::default()),
            ("petsc, CG with the diagonal", iterative(Krylov::Cg, Preconditioner::Diagonal)),
            ("petsc, CG with multigrid", iterative(Krylov::Cg, Preconditioner::Multigrid)),
        ] {
            table.line::<biotissue::backends::petsc::Petsc>(name, &petsc, params, 3)?;
        }
    }
    Ok(())
}

/// Returns the parameters of an iterative solver with a relative tolerance of 1e-10.
fn iterative(krylov: Krylov, preconditioner: Preconditioner) -> SolverParams {
    let method = Iterative { krylov, preconditioner, tolerance: 1e-10, max_iterations: 10_000 };
    SolverParams::default().iterative(method)
}

/// A table with one column per size and one row per backend and solver.
struct Table {
    /// The problems, by size.
    subjects: Vec<Subject>,
    /// The results of the first row, by size.
    answers: Vec<Vec<f64>>,
    /// Whether this rank prints; one rank does.
    prints: bool,
}

impl Table {
    /// Prints the header of the table.
    fn head(&self, title: &str, ranks: usize) {
        if self.prints {
            let sizes: Vec<_> =
                self.subjects.iter().map(|subject| format!("{} unknowns", subject.unknowns())).collect();
            println!("\n| {title}, {ranks} ranks | {} | difference |\n|---|---|---|---|---|", sizes.join(" | "));
        }
    }

    /// Prints the times of the first `most` sizes on one backend.
    fn line<B>(&mut self, name: &str, context: &B::Context, params: SolverParams, most: usize) -> Result<(), Error>
    where
        B: RealBackend,
    {
        let (mut cells, mut difference) = (Vec::new(), 0.0_f64);
        for (size, subject) in self.subjects.iter().enumerate() {
            if size >= most {
                cells.push("too large".to_owned());
                continue;
            }
            match solutions::<B>(subject, context, &params, TIMES[size]) {
                Ok(solutions) => {
                    let answer = &solutions[0].answer;
                    if self.answers.len() == size {
                        self.answers.push(answer.clone());
                    }
                    difference = difference.max(distance(answer, &self.answers[size]));
                    cells.push(cell(&solutions));
                }
                Err(error) => {
                    cells.push("fails".to_owned());
                    eprintln!("{name}: {error}");
                }
            }
        }
        if self.prints {
            println!("| {name} | {} | {difference:.0e} |", cells.join(" | "));
        }
        Ok(())
    }
}

/// Formats the minimum and the median of the milliseconds per Newton iteration, followed by the Krylov iterations per
/// Newton iteration in parentheses.
fn cell(solutions: &[Solution]) -> String {
    let of = |solution: &Solution| 1e3 * solution.seconds / solution.iterations as f64;
    let mut times: Vec<f64> = solutions.iter().map(of).collect();
    times.sort_by(f64::total_cmp);
    let (least, median) = (digits(times[0]), digits(times[times.len() / 2]));
    match solutions[0].linear_iterations / solutions[0].iterations {
        0 => format!("{least}, {median}"),
        linear => format!("{least}, {median} ({linear})"),
    }
}

/// Formats a number with three significant digits.
fn digits(x: f64) -> String {
    let after_point = (2.0 - x.log10().floor()).clamp(0.0, 6.0) as usize;
    format!("{x:.after_point$}")
}

/// Returns the largest difference, relative to the largest entry of `others`.
fn distance(some: &[f64], others: &[f64]) -> f64 {
    let largest = others.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    some.iter().zip(others).fold(0.0_f64, |most, (x, y)| most.max((x - y).abs())) / largest
}

/// Solves the problem once without using the time, then `times` times; returns the latter solutions.
fn solutions<B>(
    subject: &Subject,
    context: &B::Context,
    params: &SolverParams,
    times: usize,
) -> Result<Vec<Solution>, Error>
where
    B: RealBackend,
{
    let mut solve = match subject {
        Subject::Network(network) => equilibrium::<B>(network, context, params)?,
        Subject::Body(mesh) => stretching::<B>(mesh, context, params),
    };
    solve()?;
    (0..times).map(|_| solve()).collect()
}

impl Subject {
    /// Returns the number of unknowns of the linear systems.
    fn unknowns(&self) -> usize {
        match self {
            Self::Network(network) => 3 * network.interior().len(),
            Self::Body(mesh) => 3 * mesh.nodes().iter().filter(|x| x[0] != 0.0 && x[0] != 1.0).count(),
        }
    }
}

/// Sets up the equilibrium of a network.
fn equilibrium<'a, B>(
    network: &Arc<Network>,
    context: &'a B::Context,
    params: &SolverParams,
) -> Result<Solve<'a>, Error>
where
    B: RealBackend,
{
    let law = Law::Exponential { youngs_modulus: 1.0e8, nonlinearity: 1.2 };
    let material = FiberMaterial { law, radius: 5.0e-8, density: None };
    let scale = StressScale::FiberVolumeFraction(0.003);
    let model = RveModel::<B>::with_solver(context, Arc::clone(network), Some(material), scale, params)?;
    let mut workspace = Workspace::new(context, &model)?;
    // Plain Newton is the only stage, so that a failure is visible.
    let mut params = EquilibriumParams::default().with_stages(Stages::of(&[Stage::Newton]));
    params.chord_steps = Some(0);
    let f = Matrix3::new(1.1, 0.05, 0.0, 0.0, 0.95, 0.02, 0.0, 0.0, 1.0);
    Ok(Box::new(move || {
        let mut rve = Rve::at_rest(model.network());
        let start = Instant::now();
        let solved = equilibrate(&model, &mut rve, &f, &params, &mut workspace)?;
        let seconds = start.elapsed().as_secs_f64();
        let (answer, report) = (solved.pk1().as_slice().to_vec(), solved.report());
        let linear_iterations = report.newton.linear_iterations;
        Ok(Solution { seconds, iterations: report.iterations, linear_iterations, answer })
    }))
}

/// Sets up the stretching of a neo-Hookean body.
fn stretching<'a, B>(mesh: &Arc<Mesh>, context: &'a B::Context, params: &SolverParams) -> Solve<'a>
where
    B: RealBackend,
{
    let side = |surface: &str, x: f64| SurfaceCondition {
        surface: surface.into(),
        displacement: [Some(x), Some(0.0), Some(0.0)],
        curve: LoadCurve::Ramp,
    };
    let conditions = Conditions { surfaces: vec![side("x0", 0.0), side("x1", 0.1)], ..Conditions::default() };
    let mut params = StepParams { count: 1, max_cuts: 0, solver: Some(*params), ..StepParams::default() };
    params.newton.tolerance = 1e-10;
    let mesh = Arc::clone(mesh);
    Box::new(move || {
        let field = FormulaField::uniform(NeoHookean { mu: 3846.0, lambda: 5769.0 }, &mesh);
        let mut stepper = Stepper::<B, _>::new(context, Arc::clone(&mesh), &conditions, field, params)?;
        let report = stepper.step(&mut ())?;
        let seconds = report.solves.iter().map(|newton| newton.seconds);
        let seconds = seconds.map(|part| part.residual + part.jacobian + part.factor + part.solve).sum();
        let linear_iterations = report.solves.iter().map(|newton| newton.linear_iterations).sum();
        let answer = stepper.state().displacements.as_flattened().to_vec();
        Ok(Solution { seconds, iterations: report.iterations(), linear_iterations, answer })
    })
}
