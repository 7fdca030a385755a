//! Assembly of stiffness matrices at positions located once (`add_at`), and by blocks whose positions are searched each
//! time (`add`), for bodies of tetrahedra and fiber networks, on every backend compiled in.
//!
//! Run by `cargo bench --package benches --features petsc --bench assembly`; `docs/backends.md` lists such times. An
//! assembly starts from arbitrary matrix values and ends with `finish`; zeroing, which costs the same for both, is not
//! included.

use std::hint::black_box;
use std::sync::Arc;

use biotissue::backends::dense::Dense;
use biotissue::backends::sparse::Sparse;
use biotissue::fem::assembly::{self, Assembler, Unknowns, local};
use biotissue::fem::element::{self, reference::Tet4};
use biotissue::fem::material::NeoHookean;
use biotissue::fem::mesh::shapes;
use biotissue::fem::point_field::{FormulaField, PointField, PointResponses};
use biotissue::fiber::law::{FiberMaterial, Law};
use biotissue::fiber::network::generate;
use biotissue::fiber::stiffness::{self, StiffnessSlots};
use biotissue::fiber::truss::{FiberStates, Truss};
use biotissue::las::{MatrixOps, RealBackend};
use criterion::{Criterion, criterion_group, criterion_main};
use nalgebra::Matrix3;

/// The unit cube with `cells` cells per side, six neo-Hookean tetrahedra each, slightly sheared.
fn body<B: RealBackend<Index = i32>>(c: &mut Criterion, context: &B::Context, cells: usize) {
    let mesh = shapes::cuboid([cells; 3], [1.0; 3]).expect("a box");
    let clamped: Vec<bool> = mesh.nodes().iter().map(|x| x[0] == 0.0 || x[0] == 1.0).collect();
    let unknowns = Unknowns::new(clamped.len(), |node, _| clamped[node]).expect("few unknowns");
    let pattern = Arc::new(unknowns.pattern(&mesh).expect("a pattern"));
    let mut matrix = B::matrix(context, &pattern).expect("a matrix");
    let geometry = assembly::geometry(&mesh).expect("positive volumes");
    let assembler = Assembler::<B>::new(geometry, &unknowns, &matrix).expect("located");
    let points_of = |nodes: &[u32]| {
        let corners = std::array::from_fn(|a| mesh.nodes()[nodes[a] as usize]);
        element::geometry::<Tet4, 4, 1>(&corners).expect("positive volumes")
    };
    let points: Vec<_> = mesh.elements().iter().map(points_of).collect();
    let gradients = vec![Matrix3::new(1.1, 0.05, 0.0, 0.0, 0.95, 0.02, 0.0, 0.0, 1.0); mesh.elements().len()];
    let displacements = vec![[0.0; 3]; mesh.nodes().len()];
    let mut responses = PointResponses::zeros(gradients.len());
    let mut field = FormulaField::uniform(NeoHookean { mu: 3846.0, lambda: 5769.0 }, &mesh);
    field.update(&gradients, &mut responses).expect("not inverted");
    let number = |node: u32, component: usize| unknowns.equation_numbers()[3 * node as usize + component];
    let rows: Vec<[i32; 12]> =
        mesh.elements().iter().map(|nodes| std::array::from_fn(|k| number(nodes[k / 3], k % 3))).collect();

    let name = format!("{}: body of {} tetrahedra, {} unknowns", B::NAME, rows.len(), pattern.rows());
    let mut group = c.benchmark_group(name);
    group.sample_size(30);
    group.bench_function("blocks alone", |b| {
        b.iter(|| {
            for (points, tangent) in points.iter().zip(responses.tangent.as_chunks().0) {
                black_box(local::stiffness(points, black_box(tangent)));
            }
        });
    });
    group.bench_function("add_at", |b| {
        b.iter(|| {
            assembler.stiffness(&displacements, &[], black_box(&responses), &mut matrix).expect("no error");
            matrix.finish().expect("no error");
        });
    });
    group.bench_function("add", |b| {
        b.iter(|| {
            for ((points, tangent), rows) in points.iter().zip(responses.tangent.as_chunks().0).zip(&rows) {
                let block = local::stiffness(points, black_box(tangent));
                matrix.add(rows, rows, local::entries(&block)).expect("no error");
            }
            matrix.finish().expect("no error");
        });
    });
    group.finish();
}

/// A Delaunay network of `points` points, stretched by a tenth.
fn network<B: RealBackend<Index = i32>>(c: &mut Criterion, context: &B::Context, points: usize) {
    let network = Arc::new(generate::delaunay(points, 1).expect("enough points"));
    let law = Law::Exponential { youngs_modulus: 1.0e8, nonlinearity: 1.2 };
    let material = FiberMaterial { law, radius: 5.0e-8, density: None };
    let truss = Truss::new(Arc::clone(&network), Some(material)).expect("the network has a law");
    let positions: Vec<[f64; 3]> = network.nodes().iter().map(|x| [1.1 * x[0], 0.97 * x[1], x[2]]).collect();
    let mut states = FiberStates::default();
    truss.evaluate(&positions, &mut states);
    let pattern = Arc::new(stiffness::pattern(&network).expect("few unknowns"));
    let slots = StiffnessSlots::<B>::locate(context, &truss, &pattern).expect("located");
    let mut matrix = B::matrix(context, &pattern).expect("a matrix");
    let number = network.interior_number();
    let rows: Vec<[[i32; 3]; 2]> =
        truss.ends().iter().map(|ends| ends.map(|node| unknowns_of(number[node as usize]))).collect();

    let name = format!("{}: network of {} fibers, {} unknowns", B::NAME, rows.len(), pattern.rows());
    let mut group = c.benchmark_group(name);
    group.sample_size(30);
    let mut diagonal = Vec::new();
    group.bench_function("add_at", |b| {
        b.iter(|| {
            slots.assemble(&truss, black_box(&states), &mut diagonal, &mut matrix).expect("no error");
            matrix.finish().expect("no error");
        });
    });
    group.bench_function("add, the same blocks", |b| {
        b.iter(|| {
            diagonal.clear();
            diagonal.resize(pattern.rows() / 3 + 1, [0.0; 9]);
            let last = pattern.rows() / 3;
            for (fiber, [a, b]) in rows.iter().enumerate() {
                let block = black_box(&states).block(fiber);
                for rows in [a, b] {
                    let at = if rows[0] < 0 { last } else { rows[0] as usize / 3 };
                    diagonal[at].iter_mut().zip(&block).for_each(|(sum, k)| *sum += k);
                }
                if a[0] >= 0 && b[0] >= 0 {
                    let block = block.map(|k| -k);
                    matrix.add(a, b, &block).expect("no error");
                    matrix.add(b, a, &block).expect("no error");
                }
            }
            for (node, block) in diagonal[..last].iter().enumerate() {
                let rows = unknowns_of(node as i32);
                matrix.add(&rows, &rows, block).expect("no error");
            }
            matrix.finish().expect("no error");
        });
    });
    group.bench_function("add, a block of 6x6 a fiber", |b| {
        b.iter(|| {
            for (fiber, ends) in rows.iter().enumerate() {
                let block = black_box(&states).block(fiber);
                let sign = |i: usize, j: usize| if i / 3 == j / 3 { 1.0 } else { -1.0 };
                let both: [f64; 36] = std::array::from_fn(|k| {
                    let (i, j) = (k / 6, k % 6);
                    sign(i, j) * block[3 * (i % 3) + j % 3]
                });
                let rows = ends.as_flattened();
                matrix.add(rows, rows, &both).expect("no error");
            }
            matrix.finish().expect("no error");
        });
    });
    group.finish();
}

/// Returns the unknowns of an interior node; negative numbers, which are ignored, for a node on the boundary.
fn unknowns_of(node: i32) -> [i32; 3] {
    if node < 0 { [-1; 3] } else { [3 * node, 3 * node + 1, 3 * node + 2] }
}

fn assemblies(c: &mut Criterion) {
    body::<Dense>(c, &(), 6);
    network::<Dense>(c, &(), 300);
    body::<Sparse>(c, &(), 6);
    body::<Sparse>(c, &(), 20);
    network::<Sparse>(c, &(), 300);
    network::<Sparse>(c, &(), 3000);
    #[cfg(feature = "petsc")]
    {
        use biotissue::backends::petsc::{Context, Petsc};
        let context = Context::world().expect("PETSc starts");
        body::<Petsc>(c, &context, 6);
        body::<Petsc>(c, &context, 20);
        network::<Petsc>(c, &context, 300);
        network::<Petsc>(c, &context, 3000);
    }
}

criterion_group!(benches, assemblies);
criterion_main!(benches);
