//! Checks of the linear-algebra backend.

use std::sync::Arc;

use biotissue::backends::cuda::{Cuda, CudaErrorKind, Device, Vector};
use biotissue::backends::sparse::Sparse;
use biotissue::fem::boundary::{Conditions, LoadCurve, SurfaceCondition};
use biotissue::fem::material::NeoHookean;
use biotissue::fem::mesh::shapes;
use biotissue::fem::point_field::FormulaField;
use biotissue::fem::stepping::{StepParams, Stepper};
use biotissue::las::{
    Backend, Iterative, Krylov, MatVec, MatrixOps, Method, Preconditioner, RealBackend, SolveError, SolveReport,
    Solver, SolverParams, Sparsity, Symmetry, VectorOps,
    conformance::{self, Capabilities, Random, Trials},
};

use crate::Check;
use crate::elasticity::{System, cube};
use crate::emulation::is_emulated;

pub const CHECKS: &[Check] = &[
    ("las_device", device_is_described),
    ("las_copies", copies_are_renewed),
    ("las_vectors", |device| conformance::vectors::<Cuda>(device, trials(400))),
    ("las_matrices", |device| conformance::matrices::<Cuda>(device, trials(200))),
    ("las_products", |device| conformance::products::<Cuda>(device, trials(300))),
    ("las_entries", |device| conformance::entries::<Cuda>(device, trials(100))),
    ("las_algebra", |device| conformance::algebra::<Cuda>(device, trials(100))),
    ("las_long_vectors", long_vectors),
    ("las_extreme_norms", extreme_norms),
    ("las_products_with_large_matrices", products_with_large_matrices),
    ("las_values_are_sent_again", values_are_sent_again),
    ("las_krylov", krylov_methods),
    ("las_multigrid", multigrid),
    ("las_multigrid_of_rollers", multigrid_of_rollers),
    ("las_multigrid_of_numbers", multigrid_of_numbers),
    ("las_multigrid_updates", multigrid_updates),
    ("las_fallback", fallback),
    ("las_repeatable", repeatable),
    ("las_errors", errors),
    ("las_threads", threads),
    ("las_body", stretched_body),
    ("las_solvers", |device| conformance::solvers::<Cuda>(device, Capabilities::ALL)),
];

fn trials(count: u32) -> Trials {
    Trials { count, ..Trials::default() }.or_from_environment()
}

/// Returns the cells per side of a body: fewer where the kernels are executed by the processor.
fn cells(of_device: usize, emulated: usize) -> usize {
    if is_emulated() { emulated } else { of_device }
}

/// A vector with these entries.
fn vector(device: &Device, values: &[f64]) -> Vector {
    let mut vector = Cuda::vector(device, values.len()).unwrap();
    vector.with_local_mut(|to| to.copy_from_slice(values)).unwrap();
    vector.finish().unwrap();
    vector
}

fn values<B: Backend<Scalar = f64>>(vector: &B::Vector) -> Vec<f64> {
    vector.with_local(<[f64]>::to_vec).unwrap()
}

fn random(len: usize, seed: u64) -> Vec<f64> {
    let mut random = Random::new(seed);
    (0..len).map(|_| random.signed()).collect()
}

/// Checks that two lists differ by at most `within`, relative to the largest expected number.
fn assert_near(found: &[f64], expected: &[f64], within: f64, what: &str) {
    assert_eq!(found.len(), expected.len(), "{what}");
    let largest = expected.iter().fold(0.0, |most: f64, value| most.max(value.abs()));
    for (k, (found, expected)) in found.iter().zip(expected).enumerate() {
        let is_near = (found - expected).abs() <= within * largest;
        assert!(is_near, "{what}, entry {k}: {found} instead of {expected} (largest {largest})");
    }
}

fn device_is_described(device: &Device) {
    println!("       cuSPARSE: {}", device.has_cusparse().unwrap());
    let (free, total) = device.memory().unwrap();
    assert!(free > 0 && free <= total && Device::count().unwrap() > 0, "{free} of {total}");
    let error = Device::open(1000).unwrap_err();
    assert!(matches!(error.kind(), CudaErrorKind::NoDevice { ordinal: 1000, .. }), "{error}");
}

/// Every order of work on the host and on the device sees the newest entries.
fn copies_are_renewed(device: &Device) {
    let (mut x, mut y) = (vector(device, &[1.0, 2.0, 3.0]), Cuda::vector(device, 3).unwrap());
    y.axpy(2.0, &x).unwrap();
    assert_eq!(values::<Cuda>(&y), [2.0, 4.0, 6.0], "read after work on the device");
    y.add(&[0, -1], &[10.0, 5.0]).unwrap();
    assert_eq!(
        y.norm().unwrap(),
        (144.0_f64 + 16.0 + 36.0).sqrt(),
        "work on the device after a write without `finish`"
    );
    y.set(&[2], &[1.0]).unwrap();
    y.finish().unwrap();
    x.axpy(-1.0, &y).unwrap();
    let mut one = [0.0];
    x.get(&[2], &mut one).unwrap();
    assert_eq!((one[0], values::<Cuda>(&x)), (2.0, vec![-11.0, -2.0, 2.0]), "both copies after both kinds of work");
    x.axpby(1.0, &y, 0.0).unwrap();
    x.add(&[0], &[1.0]).unwrap();
    assert_eq!(values::<Cuda>(&x), [13.0, 4.0, 1.0], "an addition to entries that only the device had");
    assert_eq!(values::<Cuda>(&y), [12.0, 4.0, 1.0], "the other vector is as it was");
    x.zero().unwrap();
    assert_eq!(values::<Cuda>(&x), [0.0; 3], "zero, read on the host");
    x.axpy(1.0, &y).unwrap();
    x.zero().unwrap();
    assert_eq!(x.dot(&y).unwrap(), 0.0, "zero, used on the device");
    x.zero().unwrap();
    x.add(&[1], &[5.0]).unwrap();
    x.axpy(1.0, &y).unwrap();
    assert_eq!(values::<Cuda>(&x), [12.0, 9.0, 1.0], "zero, then a write, then work on the device");
    x.with_local(|of_x| {
        let norm = x.norm().unwrap();
        assert!((norm * norm - of_x.iter().map(|x| x * x).sum::<f64>()).abs() < 1e-12, "a norm while it is read");
    })
    .unwrap();
    assert_eq!(x.dot(&x).unwrap(), 144.0 + 81.0 + 1.0, "a vector with itself");
}

fn long_vectors(device: &Device) {
    for len in [0, 1, 31, 256, 2047, 2048, 2049, 100_003, 3_000_001] {
        let (of_x, of_y) = (random(len, 1), random(len, 2));
        let (x, mut y) = (vector(device, &of_x), vector(device, &of_y));
        let sizes: f64 = of_x.iter().zip(&of_y).map(|(x, y)| (x * y).abs()).sum();
        let dot: f64 = of_x.iter().zip(&of_y).map(|(x, y)| x * y).sum();
        let (first, second) = (x.dot(&y).unwrap(), x.dot(&y).unwrap());
        assert!((first - dot).abs() <= 1e-14 * sizes, "{len}: {first} instead of {dot}");
        assert_eq!(first.to_bits(), second.to_bits(), "{len}");
        y.axpy(0.5, &x).unwrap();
        let sum: Vec<f64> = of_x.iter().zip(&of_y).map(|(x, y)| y + 0.5 * x).collect();
        assert_near(&values::<Cuda>(&y), &sum, 1e-15, "axpy");
        y.axpby(-2.0, &x, 3.0).unwrap();
        let sum: Vec<f64> = of_x.iter().zip(&sum).map(|(x, y)| 3.0 * y - 2.0 * x).collect();
        assert_near(&values::<Cuda>(&y), &sum, 1e-15, "axpby");
    }
}

fn extreme_norms(device: &Device) {
    let norm = |values: &[f64]| vector(device, values).norm().unwrap();
    assert!((norm(&[3e200, 4e200]) - 5e200).abs() < 1e186 && (norm(&[3e-200, 4e-200]) - 5e-200).abs() < 1e-214);
    assert!(norm(&[1.0, f64::NAN]).is_nan());
    assert_eq!((norm(&[]), norm(&[0.0]), norm(&[1.0, f64::NEG_INFINITY])), (0.0, 0.0, f64::INFINITY));
}

/// Copies the values of the stiffness of a cube between backends of one pattern.
fn both(device: &Device, cells: usize, is_fixed: fn([f64; 3]) -> [bool; 3]) -> (System<Cuda>, System<Sparse>) {
    let (found, expected) = (cube::<Cuda>(device, cells, is_fixed), cube::<Sparse>(&(), cells, is_fixed));
    assert!(found.matrix.values() == expected.matrix.values(), "assembly has the same bits");
    (found, expected)
}

fn clamped(x: [f64; 3]) -> [bool; 3] {
    [x[0] == 0.0; 3]
}

fn products_with_large_matrices(device: &Device) {
    let (System { matrix, .. }, System { matrix: on_host, .. }) = both(device, 12, clamped);
    let n = matrix.pattern().rows();
    let of_x = random(n, 3);
    let (x, mut y) = (vector(device, &of_x), Cuda::vector(device, n).unwrap());
    let (host_x, mut expected) = (of_x.into(), vec![0.0; n].into());
    MatVec::<Sparse>::mul(&on_host, &host_x, &mut expected).unwrap();
    matrix.mul(&x, &mut y).unwrap();
    assert_near(&values::<Cuda>(&y), expected.as_slice(), 1e-14, "product");
    let first = values::<Cuda>(&y);
    matrix.mul(&x, &mut y).unwrap();
    assert!(first == values::<Cuda>(&y), "products have the same bits");
    matrix.multiply_by_kernel(&x, &mut y).unwrap();
    assert_near(&values::<Cuda>(&y), expected.as_slice(), 1e-14, "product by the kernel of the crate");
    matrix.mul_transpose(&x, &mut y).unwrap();
    assert_near(&values::<Cuda>(&y), expected.as_slice(), 1e-14, "transposed product of a symmetric matrix");
}

fn values_are_sent_again(device: &Device) {
    let pattern = Arc::new(Sparsity::from_elements(3, [[0, 1], [1, 2]]).unwrap());
    let mut a = Cuda::matrix(device, &pattern).unwrap();
    let (x, mut y) = (vector(device, &[1.0, 10.0, 100.0]), Cuda::vector(device, 3).unwrap());
    a.add(&[0, 1], &[0, 1], &[1.0, 2.0, 3.0, 4.0]).unwrap();
    a.finish().unwrap();
    a.mul(&x, &mut y).unwrap();
    assert_eq!(values::<Cuda>(&y), [21.0, 43.0, 0.0]);
    let copy = a.clone();
    a.add(&[2], &[2], &[0.5]).unwrap();
    a.finish().unwrap();
    a.mul(&x, &mut y).unwrap();
    assert_eq!(values::<Cuda>(&y), [21.0, 43.0, 50.0], "after a write");
    let mut slots = Vec::new();
    a.locate(&[2], &[1], &mut slots).unwrap();
    a.add_at(&slots, &[1.0]).unwrap();
    a.mul(&x, &mut y).unwrap();
    assert_eq!(values::<Cuda>(&y), [21.0, 43.0, 60.0], "without `finish`");
    a.zero_rows(&[0]).unwrap();
    a.mul_transpose(&x, &mut y).unwrap();
    assert_eq!(values::<Cuda>(&y), [30.0, 140.0, 50.0], "the transpose");
    copy.mul(&x, &mut y).unwrap();
    assert_eq!(values::<Cuda>(&y), [21.0, 43.0, 0.0], "the copy is as it was");
    a.clone_from(&copy);
    a.mul(&x, &mut y).unwrap();
    assert_eq!(values::<Cuda>(&y), [21.0, 43.0, 0.0], "values copied into a matrix");
    a.zero().unwrap();
    a.mul(&x, &mut y).unwrap();
    assert_eq!(values::<Cuda>(&y), [0.0; 3], "zero");
}

/// Solves `A x = b` for a fixed right-hand side; returns the solution.
fn solve<B: RealBackend>(
    context: &B::Context,
    system: &System<B>,
    pattern: &Arc<Sparsity>,
    params: SolverParams,
) -> (SolveReport, Vec<f64>) {
    let mut solver = B::solver(&B::analyze(context, pattern, &params).unwrap()).unwrap();
    solver.set_near_null_space(&system.near_null_space).unwrap();
    solver.factor(&system.matrix).unwrap();
    let n = pattern.rows();
    let (mut b, mut x) = (B::vector(context, n).unwrap(), B::vector(context, n).unwrap());
    b.with_local_mut(|b| b.copy_from_slice(&random(n, 7))).unwrap();
    b.finish().unwrap();
    let report = solver.solve(&b, &mut x).unwrap();
    (report, values::<B>(&x))
}

fn iterative(krylov: Krylov, preconditioner: Preconditioner) -> SolverParams {
    let method = Iterative { preconditioner, tolerance: 1e-10, max_iterations: 3000, ..Iterative::new(krylov) };
    SolverParams::new(Symmetry::Definite).iterative(method)
}

fn krylov_methods(device: &Device) {
    let (system, on_host) = both(device, cells(5, 4), clamped);
    let pattern = on_host.matrix.pattern();
    let (_, expected) = solve(&(), &on_host, pattern, SolverParams::default());
    for krylov in [Krylov::Cg, Krylov::BiCgStab, Krylov::Gmres { restart: 40 }] {
        for preconditioner in [Preconditioner::None, Preconditioner::Diagonal, Preconditioner::Multigrid] {
            let what = format!("{krylov:?} with {preconditioner:?}");
            let params = iterative(krylov, preconditioner);
            let (report, found) = solve(device, &system, pattern, params);
            let (host_report, _) = solve(&(), &on_host, pattern, params);
            println!("       {what}: {} iterations, sparse {}", report.iterations, host_report.iterations);
            assert_near(&found, &expected, 1e-7, &what);
            assert!(report.iterations > 0 && report.residual <= 1e-10 && report.fallbacks == 0, "{report:?}");
            // Rounding differs; BiCGSTAB is sensitive to it.
            let most = if krylov == Krylov::BiCgStab { 2 } else { 1 } * host_report.iterations * 3 / 2 + 3;
            assert!(report.iterations <= most, "{what}: {} instead of {}", report.iterations, host_report.iterations);
        }
    }
}

/// Compares multigrid with the direct solver and its number of iterations with that of `sparse`.
fn check_multigrid(device: &Device, cells: usize, is_fixed: fn([f64; 3]) -> [bool; 3]) {
    let (system, on_host) = both(device, cells, is_fixed);
    let pattern = on_host.matrix.pattern();
    let params = iterative(Krylov::Cg, Preconditioner::Multigrid);
    let (report, found) = solve(device, &system, pattern, params);
    let (host_report, expected) = solve(&(), &on_host, pattern, params);
    println!("       {cells} cells: {} iterations, sparse {}", report.iterations, host_report.iterations);
    assert_near(&found, &expected, 1e-7, "multigrid");
    assert!(report.iterations <= host_report.iterations + 1, "{report:?}, sparse {host_report:?}");
}

fn multigrid(device: &Device) {
    for cells in [3, 8, cells(16, 6)] {
        check_multigrid(device, cells, clamped);
    }
}

/// Nodes on rollers have fewer than three unknowns, so that vectors are padded.
fn multigrid_of_rollers(device: &Device) {
    check_multigrid(device, cells(9, 7), |x| [x[0] == 0.0, x[1] == 0.0, x[2] == 0.0]);
}

/// The Laplacian of a square: nodes of one unknown.
fn multigrid_of_numbers(device: &Device) {
    let side = cells(60, 40) as i32;
    let at = |i: i32, j: i32| side * i + j;
    let edges: Vec<[i32; 2]> = (0..side)
        .flat_map(|i| (1..side).flat_map(move |j| [[at(i, j - 1), at(i, j)], [at(j - 1, i), at(j, i)]]))
        .collect();
    let pattern = Arc::new(Sparsity::from_elements((side * side) as usize, edges.iter().copied()).unwrap());
    fn laplacian<B: RealBackend<Index = i32>>(
        context: &B::Context,
        pattern: &Arc<Sparsity>,
        edges: &[[i32; 2]],
    ) -> System<B> {
        let mut matrix = B::matrix(context, pattern).unwrap();
        for edge in edges {
            matrix.add(edge, edge, &[1.0, -1.0, -1.0, 1.0]).unwrap();
        }
        matrix.add(&[0], &[0], &[1.0]).unwrap();
        matrix.finish().unwrap();
        System { matrix, near_null_space: Vec::new() }
    }
    let params = iterative(Krylov::Cg, Preconditioner::Multigrid);
    let (report, found) = solve(device, &laplacian::<Cuda>(device, &pattern, &edges), &pattern, params);
    let (host_report, expected) = solve(&(), &laplacian::<Sparse>(&(), &pattern, &edges), &pattern, params);
    println!("       {} iterations, sparse {}", report.iterations, host_report.iterations);
    assert_near(&found, &expected, 1e-6, "Laplacian");
    assert!(report.iterations <= host_report.iterations + 1, "{report:?}, sparse {host_report:?}");
}

/// A preconditioner is kept for similar matrices and renewed for others.
fn multigrid_updates(device: &Device) {
    let System { mut matrix, near_null_space } = cube::<Cuda>(device, cells(8, 6), clamped);
    let pattern = Arc::clone(matrix.pattern());
    let params = iterative(Krylov::Cg, Preconditioner::Multigrid);
    let mut solver = Cuda::solver(&Cuda::analyze(device, &pattern, &params).unwrap()).unwrap();
    solver.set_near_null_space(&near_null_space).unwrap();
    let (b, mut x) = (vector(device, &random(pattern.rows(), 5)), Cuda::vector(device, pattern.rows()).unwrap());
    let mut residual = Cuda::vector(device, pattern.rows()).unwrap();
    for change in [0.0, 0.01, 30.0, 30.0, 0.01] {
        let diagonal: Vec<i32> = (0..pattern.rows() as i32).collect();
        for &i in &diagonal[..pattern.rows() / 2] {
            matrix.add(&[i], &[i], &[change]).unwrap();
        }
        matrix.finish().unwrap();
        let factored = solver.update(&matrix).unwrap();
        let report = solver.solve(&b, &mut x).unwrap();
        println!("       change {change}: {:?}, {} iterations", factored.kind, report.iterations);
        matrix.mul(&x, &mut residual).unwrap();
        residual.axpy(-1.0, &b).unwrap();
        let relative = residual.norm().unwrap() / b.norm().unwrap();
        assert!(relative < 1e-9, "residual {relative:e} after a change by {change}");
    }
}

/// A matrix that conjugate gradients do not solve is solved directly.
fn fallback(device: &Device) {
    let pattern = Arc::new(Sparsity::from_elements(40, (0..39).map(|i| [i, i + 1])).unwrap());
    let mut a = Cuda::matrix(device, &pattern).unwrap();
    for i in 0..40 {
        a.add(&[i], &[i], &[if i % 2 == 0 { 3.0 } else { -2.0 }]).unwrap();
    }
    for i in 0..39 {
        a.add(&[i, i + 1], &[i, i + 1], &[0.0, 1.0, 1.0, 0.0]).unwrap();
    }
    a.finish().unwrap();
    let b = vector(device, &random(40, 9));
    for preconditioner in [Preconditioner::Diagonal, Preconditioner::Multigrid] {
        let mut params = iterative(Krylov::Cg, preconditioner);
        let solver = |params: &SolverParams| Cuda::solver(&Cuda::analyze(device, &pattern, params).unwrap()).unwrap();
        let mut x = Cuda::vector(device, 40).unwrap();
        let mut plain = solver(&params);
        let failed = plain.factor(&a).and_then(|_| plain.solve(&b, &mut x));
        assert!(failed.is_err(), "{failed:?}");
        params.fallback = true;
        let mut falling_back = solver(&params);
        falling_back.factor(&a).unwrap();
        let report = falling_back.solve(&b, &mut x).unwrap();
        let mut residual = Cuda::vector(device, 40).unwrap();
        a.mul(&x, &mut residual).unwrap();
        residual.axpy(-1.0, &b).unwrap();
        assert!(residual.norm().unwrap() < 1e-12 && report.fallbacks <= 1, "{report:?}");
        if preconditioner == Preconditioner::Diagonal {
            let refused = solver(&params).factor_definite(&a);
            assert!(matches!(refused, Err(SolveError::Indefinite { .. })), "{refused:?}");
        }
    }
}

/// Two runs give the same bits.
fn repeatable(device: &Device) {
    let system = cube::<Cuda>(device, cells(7, 5), clamped);
    for preconditioner in [Preconditioner::Diagonal, Preconditioner::Multigrid] {
        let run = || solve(device, &system, system.matrix.pattern(), iterative(Krylov::Cg, preconditioner));
        let (first, second) = (run(), run());
        assert_eq!(first.0, second.0, "{preconditioner:?}");
        assert!(first.1 == second.1, "{preconditioner:?}");
    }
}

fn errors(device: &Device) {
    let pattern = Arc::new(Sparsity::from_elements(3, [[0, 1], [1, 2]]).unwrap());
    let a = Cuda::matrix(device, &pattern).unwrap();
    let (x, mut y) = (Cuda::vector(device, 3).unwrap(), Cuda::vector(device, 2).unwrap());
    assert!(matches!(a.mul(&x, &mut y), Err(SolveError::Size { found: 2, expected: 3, .. })));
    let ilut = Preconditioner::Ilut { drop_tolerance: 1e-3, fill: 10 };
    let params = iterative(Krylov::BiCgStab, ilut);
    let refused = Cuda::solver(&Cuda::analyze(device, &pattern, &params).unwrap()).map(drop).unwrap_err();
    assert!(refused.to_string().starts_with("the backend `cuda` has no incomplete factorization"), "{refused}");
    // Unknowns that are not coupled cannot be coarsened.
    let uncoupled = Arc::new(Sparsity::from_elements(9000, (0..9000).map(|i| [i])).unwrap());
    let mut identity = Cuda::matrix(device, &uncoupled).unwrap();
    let all: Vec<i32> = (0..9000).collect();
    all.iter().for_each(|&i| identity.add(&[i], &[i], &[1.0]).unwrap());
    identity.finish().unwrap();
    let params = iterative(Krylov::Cg, Preconditioner::Multigrid);
    let mut solver = Cuda::solver(&Cuda::analyze(device, &uncoupled, &params).unwrap()).unwrap();
    let refused = solver.factor(&identity).map(drop).unwrap_err();
    assert!(refused.to_string().contains("8192"), "{refused}");
    let params = iterative(Krylov::Cg, Preconditioner::Diagonal);
    let mut solver = Cuda::solver(&Cuda::analyze(device, &pattern, &params).unwrap()).unwrap();
    assert!(matches!(solver.solve(&x, &mut Cuda::vector(device, 3).unwrap()), Err(SolveError::NotFactored)));
    assert!(matches!(solver.factor(&a), Err(SolveError::ZeroDiagonal { row: 0 })));
    assert!(matches!(params.method, Method::Iterative(_)));
}

/// Vectors and solvers move between threads, which share a device.
fn threads(device: &Device) {
    let expected: Vec<f64> = (0..4).map(|k| random(10_000, k).iter().map(|x| x * x).sum::<f64>().sqrt()).collect();
    std::thread::scope(|scope| {
        for (k, expected) in expected.iter().enumerate() {
            let x = vector(device, &random(10_000, k as u64));
            scope.spawn(move || {
                for _ in 0..50 {
                    let found = x.norm().unwrap();
                    assert!((found - expected).abs() < 1e-10 * expected, "{found} instead of {expected}");
                }
            });
        }
    });
}

/// A body of neo-Hookean material has the displacements that `sparse` computes, with a direct solver and with multigrid.
fn stretched_body(device: &Device) {
    let prescribed = |surface: &str, displacement| SurfaceCondition {
        surface: surface.into(),
        displacement,
        curve: LoadCurve::Ramp,
    };
    let conditions = Conditions {
        surfaces: vec![prescribed("x0", [Some(0.0); 3]), prescribed("x1", [Some(0.2), Some(0.05), Some(0.0)])],
        ..Conditions::default()
    };
    fn run<B: RealBackend<Index = i32>>(
        context: &B::Context,
        conditions: &Conditions,
        solver: Option<SolverParams>,
    ) -> Vec<[f64; 3]> {
        let mesh = Arc::new(shapes::cuboid([8, 6, 6], [1.0, 0.7, 0.6]).unwrap());
        let field = FormulaField::uniform(NeoHookean { mu: 3.0e3, lambda: 5.0e3 }, &mesh);
        let mut params = StepParams { count: 2, ..StepParams::default() };
        params.newton.tolerance = 1e-11;
        params.solver = solver;
        let mut stepper = Stepper::<B, _>::new(context, Arc::clone(&mesh), conditions, field, params).unwrap();
        stepper.run(&mut ()).unwrap();
        stepper.state().displacements.clone()
    }
    let expected = run::<Sparse>(&(), &conditions, None);
    for solver in [None, Some(iterative(Krylov::Cg, Preconditioner::Multigrid))] {
        let found = run::<Cuda>(device, &conditions, solver);
        assert_near(found.as_flattened(), expected.as_flattened(), 1e-9, &format!("displacements, {solver:?}"));
    }
}
