//! The phases of a Newton iteration and of a tangent.

use std::hint::black_box;
use std::time::Instant;

use biotissue::backends::sparse::Sparse;
use biotissue::fiber::equilibrium::equilibrate;
use biotissue::fiber::rve::Rve;
use biotissue::fiber::truss::FiberStates;
use biotissue::fiber::workspace::Workspace;
use biotissue::las::{Backend, MatrixOps, Solver, SolverParams, Symmetry};

use crate::memory::measured;
use crate::system::{System, params};

/// Returns the minimum time of many runs, in ms.
fn least(mut run: impl FnMut()) -> f64 {
    let (start, mut best, mut runs) = (Instant::now(), f64::INFINITY, 0);
    while runs < 5 || start.elapsed().as_secs_f64() < 0.5 {
        let begin = Instant::now();
        run();
        best = best.min(begin.elapsed().as_secs_f64());
        runs += 1;
    }
    1e3 * best
}

/// Prints a table of the phases, and the memory.
pub fn print(system: &mut System) {
    let network = system.model.network();
    let (nodes, fibers, unknowns) = (network.nodes().len(), network.fibers().len(), system.model.unknowns());
    println!("**{}**: {nodes} nodes, {fibers} fibers, {unknowns} unknowns\n", system.name);
    println!("| phase | ms |\n|---|---|");
    let positions = system.workspace.positions().to_vec();
    let (mut states, mut forces) = (FiberStates::default(), vec![[0.0; 3]; nodes]);
    let truss = system.model.truss();
    let evaluate = least(|| truss.evaluate(black_box(&positions), &mut states));
    let sum = least(|| truss.nodal_forces(black_box(&states), &mut forces));
    println!("| fibers: stretch, force, stiffness | {evaluate:.4} |\n| nodal forces | {sum:.4} |");
    let mut diagonal = Vec::new();
    let assemble = least(|| {
        system.stiffness.zero().expect("it cannot fail");
        system.slots.assemble(truss, black_box(&states), &mut diagonal, &mut system.stiffness).expect("it cannot fail");
    });
    println!("| assembly | {assemble:.4} |");
    let solver_params = SolverParams::new(Symmetry::Definite);
    let mut symbolic = None;
    let analysis = least(|| symbolic = Sparse::<f64>::analyze(&(), &system.pattern, &solver_params).ok());
    let mut solver = Sparse::<f64>::solver(&symbolic.expect("an analysis")).expect("a solver");
    let factor = least(|| {
        solver.factor(black_box(&system.stiffness)).expect("definite");
    });
    let right = Sparse::<f64>::vector(&(), unknowns).expect("a vector");
    let mut solution = right.clone();
    let solve = least(|| {
        solver.solve(black_box(&right), &mut solution).expect("factored");
    });
    println!("| factor | {factor:.4} |\n| solve | {solve:.4} |\n| analysis, once per network | {analysis:.2} |");
    let iterations = system.report.iterations;
    let whole = least(|| {
        let mut rve = Rve::at_rest(system.model.network());
        equilibrate(&system.model, &mut rve, &system.target, &params(), &mut system.workspace).expect("it did before");
    });
    println!(
        "| equilibrium, {iterations} iterations | {whole:.4} |\n| one iteration of the equilibrium | {:.4} |",
        whole / iterations as f64
    );
    let both = least(|| {
        let mut rve = Rve::at_rest(system.model.network());
        let solved = equilibrate(&system.model, &mut rve, &system.target, &params(), &mut system.workspace);
        black_box(solved.expect("it did before").tangent().expect("regular"));
    });
    let tangent = both - whole;
    println!("| equilibrium and tangent | {both:.4} |\n| tangent alone | {tangent:.4} |\n");
    let (symbolic, analysis) =
        measured(|| Sparse::<f64>::analyze(&(), &system.pattern, &solver_params).expect("an analysis"));
    let (_solver, factor) = measured(|| Sparse::<f64>::solver(&symbolic).expect("a solver"));
    let (_workspace, workspace) = measured(|| Workspace::new(&(), &system.model).expect("a workspace"));
    println!(
        "Memory, kB: analysis {analysis:.0}, solver {factor:.0}, workspace including its solver {workspace:.0}.\n"
    );
}
