//! Cost of a Newton iteration of a body: the unit cube with 20 cells per side (48 000 tetrahedra, neo-Hookean),
//! stretched by a tenth. It is either clamped at two faces, or on rollers at three faces with the normal component
//! prescribed, as at the planes of symmetry of a larger body.

use std::hint::black_box;
use std::sync::Arc;

use biotissue::backends::sparse::Sparse;
use biotissue::fem::assembly::{self, Assembler, Unknowns};
use biotissue::fem::material::NeoHookean;
use biotissue::fem::mesh::shapes;
use biotissue::fem::point_field::{FormulaField, PointField, PointResponses};
use biotissue::las::{Backend, MatrixOps, Solver, SolverParams, Symmetry, VectorOps};
use criterion::{Criterion, criterion_group, criterion_main};

fn clamped(c: &mut Criterion) {
    iteration(c, "box of 48 000 tetrahedra", |x, _| x[0] == 0.0 || x[0] == 1.0);
}

fn on_rollers(c: &mut Criterion) {
    iteration(c, "box of 48 000 tetrahedra on rollers", |x, direction| x[direction] == 0.0);
}

/// `fixed` returns whether a displacement component is prescribed at a position.
fn iteration(c: &mut Criterion, name: &str, fixed: impl Fn([f64; 3], usize) -> bool) {
    let mesh = shapes::cuboid([20; 3], [1.0; 3]).expect("a box");
    let (nodes, elements) = (mesh.nodes().len(), mesh.elements().len());
    let unknowns = Unknowns::new(nodes, |node, direction| fixed(mesh.nodes()[node], direction)).expect("few unknowns");
    let pattern = Arc::new(unknowns.pattern(&mesh).expect("a pattern"));
    let mut matrix = Sparse::<f64>::matrix(&(), &pattern).expect("a matrix");
    let geometry = assembly::geometry(&mesh).expect("positive volumes");
    let assembler = Assembler::<Sparse>::new(geometry, &unknowns, &matrix).expect("located");
    let mut field = FormulaField::uniform(NeoHookean { mu: 3846.0, lambda: 5769.0 }, &mesh);
    let displacements: Vec<[f64; 3]> =
        mesh.nodes().iter().map(|x| [0.1 * x[0], 0.02 * x[0] * x[1], -0.03 * x[2]]).collect();
    let (mut gradients, mut responses) = (Vec::new(), PointResponses::zeros(elements));
    let mut forces = vec![[0.0; 3]; nodes];
    let mut residual = Sparse::<f64>::vector(&(), unknowns.free()).expect("a vector");
    let mut direction = residual.clone();

    let mut group = c.benchmark_group(name);
    group.sample_size(20);
    group.bench_function("points", |b| {
        b.iter(|| {
            assembler.deformation_gradients(black_box(&displacements), &mut gradients);
            field.update(&gradients, &mut responses).expect("not inverted");
        });
    });
    group.bench_function("residual", |b| {
        b.iter(|| {
            assembler.internal_forces(&displacements, black_box(&responses.pk1), &mut forces);
            residual.zero().expect("serial");
            assembler.scatter(&mut forces, &[], &mut residual).expect("serial");
        });
    });
    group.bench_function("stiffness", |b| {
        b.iter(|| {
            matrix.zero().expect("serial");
            assembler.stiffness(&displacements, &[], black_box(&responses), &mut matrix).expect("serial");
        });
    });
    let params = SolverParams::new(Symmetry::Definite);
    let analyze = || Sparse::<f64>::analyze(&(), &pattern, &params).expect("a symmetric pattern");
    let mut solver = Sparse::solver(&analyze()).expect("a solver");
    group.sample_size(10);
    group.bench_function("analysis", |b| b.iter(analyze));
    group.bench_function("factor", |b| b.iter(|| solver.factor(black_box(&matrix)).expect("definite")));
    group.bench_function("solve", |b| {
        b.iter(|| solver.solve(black_box(&residual), &mut direction).expect("factored"));
    });
    group.finish();
}

criterion_group!(benches, clamped, on_rollers);
criterion_main!(benches);
