//! One RVE on one core: equilibrium and tangent of a published network, and a Newton iteration of a large one.
//!
//! `cargo bench --bench rve`, with `BIOTISSUE_NETWORKS` naming the folder of the published networks; without it only
//! the networks of the dogbone example are timed.

use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use biotissue::backends::sparse::Sparse;
use biotissue::fiber::equilibrium::{EquilibriumParams, equilibrate};
use biotissue::fiber::homogenise;
use biotissue::fiber::law::{FiberMaterial, Law};
use biotissue::fiber::network::file;
use biotissue::fiber::rve::{Rve, RveModel, StressScale};
use biotissue::fiber::workspace::Workspace;
use criterion::{Criterion, criterion_group, criterion_main};
use nalgebra::Matrix3;

struct Case {
    model: RveModel<Sparse>,
    workspace: Workspace<Sparse>,
    params: EquilibriumParams,
}

impl Case {
    fn read(path: &Path, material: Option<FiberMaterial>) -> Self {
        let network = match file::read(path) {
            Ok(read) => Arc::new(read.network),
            Err(error) => panic!("{error}"),
        };
        let model = RveModel::new(&(), network, material, StressScale::Raw).expect("the network has a law");
        let workspace = Workspace::new(&(), &model).expect("the sparse backend makes any workspace");
        Self { model, workspace, params: EquilibriumParams::default() }
    }

    /// From rest to equilibrium; the number of Newton iterations.
    fn solve(&mut self, f: &Matrix3<f64>) -> (Rve, usize) {
        let mut rve = Rve::at_rest(self.model.network());
        let report = equilibrate(&self.model, &mut rve, f, &self.params, &mut self.workspace);
        let report = report.expect("the networks of the bench converge");
        (rve, report.iterations)
    }

    fn solve_and_tangent(&mut self, f: &Matrix3<f64>) -> f64 {
        let (rve, _) = self.solve(f);
        let pk1 = homogenise::pk1(&self.model, &self.workspace);
        let tangent = homogenise::tangent(&self.model, &rve, &pk1, &mut self.workspace);
        tangent.expect("its stiffness is regular").trace()
    }
}

fn published(name: &str) -> Option<PathBuf> {
    std::env::var_os("BIOTISSUE_NETWORKS").map(|folder| PathBuf::from(folder).join(name))
}

/// The deformation at which MuMFiM recorded its times, some 1 %.
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
        let mut case = Case::read(&path, None);
        let iterations = case.solve(&recorded()).1;
        c.bench_function(&format!("Network_2_7: solve ({iterations} iterations)"), |b| {
            b.iter(|| case.solve(black_box(&recorded())).1)
        });
        c.bench_function("Network_2_7: solve and tangent", |b| {
            b.iter(|| case.solve_and_tangent(black_box(&recorded())))
        });
    }
    let example = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/dogbone/networks/delaunay_1.txt");
    let law = Law::Exponential { youngs_modulus: 1.0e8, nonlinearity: 1.2 };
    let mut case = Case::read(&example, Some(FiberMaterial { law, radius: 5.0e-8, density: None }));
    let iterations = case.solve(&large).1;
    c.bench_function(&format!("delaunay_1 of the dogbone: solve ({iterations} iterations) and tangent"), |b| {
        b.iter(|| case.solve_and_tangent(black_box(&large)));
    });
    if let Some(path) = published("del_4450seedL5_new_1.txt") {
        let mut case = Case::read(&path, None);
        let iterations = case.solve(&large).1;
        let mut group = c.benchmark_group("del_4450");
        group.sample_size(10);
        group
            .bench_function(format!("solve ({iterations} iterations)"), |b| b.iter(|| case.solve(black_box(&large)).1));
        group.bench_function("solve and tangent", |b| b.iter(|| case.solve_and_tangent(black_box(&large))));
        group.finish();
    }
}

criterion_group!(benches, rves);
criterion_main!(benches);
