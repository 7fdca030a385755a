//! One RVE on one core: equilibrium and tangent as a whole, and the phases of a Newton iteration.
//!
//! Run by `cargo bench --package benches --bench rve`, with `BIOTISSUE_NETWORKS` set to the folder of the published
//! networks; without it only generated networks and one of the dogbone example are timed. `docs/kernel.md` lists such
//! times, compared with those of other direct solvers.

use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use biotissue::backends::sparse::Sparse;
use biotissue::fiber::equilibrium::{EquilibriumParams, equilibrate};
use biotissue::fiber::law::{FiberMaterial, Law};
use biotissue::fiber::network::{Network, file, generate};
use biotissue::fiber::rve::{Rve, RveModel, StressScale};
use biotissue::fiber::stiffness::{self, StiffnessSlots};
use biotissue::fiber::truss::FiberStates;
use biotissue::fiber::workspace::Workspace;
use biotissue::las::{Backend, MatrixOps, Solver, SolverParams, Symmetry};
use criterion::measurement::WallTime;
use criterion::{BenchmarkGroup, Criterion, criterion_group, criterion_main};
use nalgebra::Matrix3;

struct Case {
    model: RveModel<Sparse>,
    workspace: Workspace<Sparse>,
    params: EquilibriumParams,
}

impl Case {
    fn read(path: &Path, material: Option<FiberMaterial>) -> Self {
        match file::read(path) {
            Ok(read) => Self::new(read.network, material),
            Err(error) => panic!("{error}"),
        }
    }

    fn new(network: Network, material: Option<FiberMaterial>) -> Self {
        let model = RveModel::new(&(), Arc::new(network), material, StressScale::Raw).expect("the network has a law");
        let workspace = Workspace::new(&(), &model).expect("the sparse backend makes any workspace");
        Self { model, workspace, params: EquilibriumParams::default() }
    }

    /// Solves from rest to equilibrium; returns the number of Newton iterations.
    fn solve(&mut self, f: &Matrix3<f64>) -> (Rve, usize) {
        let mut rve = Rve::at_rest(self.model.network());
        let solved = equilibrate(&self.model, &mut rve, f, &self.params, &mut self.workspace);
        let iterations = solved.expect("the networks of the bench converge").report().iterations;
        (rve, iterations)
    }

    fn solve_and_tangent(&mut self, f: &Matrix3<f64>) -> f64 {
        let mut rve = Rve::at_rest(self.model.network());
        let solved = equilibrate(&self.model, &mut rve, f, &self.params, &mut self.workspace);
        let tangent = solved.and_then(|mut solved| solved.tangent());
        tangent.expect("its stiffness is regular").trace()
    }

    /// Times all phases of a solution and a tangent, at the equilibrium of `f`.
    fn phases(&mut self, group: &mut BenchmarkGroup<'_, WallTime>, f: &Matrix3<f64>) {
        let (_, iterations) = self.solve(f);
        group
            .bench_function(format!("equilibrium, {iterations} iterations"), |b| b.iter(|| self.solve(black_box(f)).1));
        group.bench_function("equilibrium and tangent", |b| b.iter(|| self.solve_and_tangent(black_box(f))));
        let (mut rve, _) = self.solve(f);
        group.bench_function("stability and tangent of an equilibrium", |b| {
            b.iter(|| {
                let solved = equilibrate(&self.model, &mut rve, black_box(f), &self.params, &mut self.workspace);
                solved.and_then(|mut solved| solved.tangent()).expect("regular")
            });
        });
        let (truss, positions) = (self.model.truss(), self.workspace.positions());
        let (mut states, mut forces) = (FiberStates::default(), vec![[0.0; 3]; positions.len()]);
        group.bench_function("force", |b| {
            b.iter(|| {
                truss.evaluate(black_box(positions), &mut states);
                truss.nodal_forces(&states, &mut forces);
            });
        });
        let pattern = Arc::new(stiffness::pattern(self.model.network()).expect("few unknowns"));
        let slots = StiffnessSlots::<Sparse>::locate(&(), truss, &pattern).expect("serial");
        let mut matrix = Sparse::<f64>::matrix(&(), &pattern).expect("serial");
        let mut diagonal = Vec::new();
        group.bench_function("assembly", |b| {
            b.iter(|| {
                matrix.zero().expect("serial");
                slots.assemble(truss, black_box(&states), &mut diagonal, &mut matrix).expect("serial");
            });
        });
        let params = SolverParams::new(Symmetry::Definite);
        let symbolic = Sparse::<f64>::analyze(&(), &pattern, &params).expect("a symmetric pattern");
        let mut solver = Sparse::solver(&symbolic).expect("a solver");
        group.bench_function("factor", |b| b.iter(|| solver.factor(black_box(&matrix)).expect("definite")));
        let right = vec![Sparse::<f64>::vector(&(), pattern.rows()).expect("a vector"); 6];
        let mut solutions = right.clone();
        group.bench_function("solve", |b| {
            b.iter(|| solver.solve(black_box(&right[0]), &mut solutions[0]).expect("factored"));
        });
        group.bench_function("solve for six at once", |b| {
            b.iter(|| solver.solve_many(black_box(&right), &mut solutions).expect("factored"));
        });
    }
}

fn published(name: &str) -> Option<PathBuf> {
    std::env::var_os("BIOTISSUE_NETWORKS").map(|folder| PathBuf::from(folder).join(name))
}

fn collagen() -> FiberMaterial {
    let law = Law::Exponential { youngs_modulus: 1.0e8, nonlinearity: 1.2 };
    FiberMaterial { law, radius: 5.0e-8, density: None }
}

/// The deformation at which MuMFiM recorded its times, about 1 %.
#[rustfmt::skip]
fn recorded() -> Matrix3<f64> {
    Matrix3::new(
        0.999819, -0.000293362, 0.000371752,
        0.000360323, 1.01319, 0.000355325,
        -0.000570166, 0.000635382, 0.999488,
    )
}

fn rves(c: &mut Criterion) {
    let large = Matrix3::new(1.1, 0.05, 0.0, 0.0, 0.95, 0.02, 0.0, 0.0, 1.0);
    if let Some(path) = published("Network_2_7.txt") {
        Case::read(&path, None).phases(&mut c.benchmark_group("Network_2_7"), &recorded());
    }
    let example = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/dogbone/networks/delaunay_1.txt");
    let mut case = Case::read(&example, Some(collagen()));
    case.phases(&mut c.benchmark_group("delaunay_1 of the dogbone"), &large);
    for points in [300, 1000] {
        let network = generate::delaunay(points, 1).expect("enough points");
        let mut group = c.benchmark_group(format!("delaunay of {points} points"));
        group.sample_size(40);
        Case::new(network, Some(collagen())).phases(&mut group, &large);
    }
    if let Some(path) = published("del_4450seedL5_new_1.txt") {
        let mut group = c.benchmark_group("del_4450");
        group.sample_size(10);
        Case::read(&path, None).phases(&mut group, &large);
    }
}

criterion_group!(benches, rves);
criterion_main!(benches);
