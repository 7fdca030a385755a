//! Algebraic multigrid: numbers of iterations, equal results on any number of threads, and what happens where it fails.

use std::sync::Arc;

use biotissue::backends::sparse::multigrid::{Multigrid, MultigridParams};
use biotissue::backends::sparse::{Matrix, Solver, Sparse, Vector};
use biotissue::fem::assembly::{Assembler, Unknowns, geometry};
use biotissue::fem::material::{Material, NeoHookean};
use biotissue::fem::mesh::{Mesh, shapes};
use biotissue::fem::point_field::PointResponses;
use biotissue::las::{
    Backend, Factorization, Iterative, Krylov, MatVec, MatrixOps, Preconditioner, SolveError, Solver as _,
    SolverParams, Sparsity, Symmetry, VectorOps,
};
use nalgebra::Matrix3;

/// The displacement at a position.
type Motion = fn(&[f64; 3]) -> [f64; 3];

/// A matrix with the vectors of its near null space.
struct System {
    matrix: Matrix,
    near_null_space: Vec<Vec<f64>>,
}

/// The stiffness at rest of a body; `stiffness` is that of an element relative to the others, by its center.
fn elasticity(mesh: &Mesh, prescribed: impl Fn([f64; 3]) -> [bool; 3], stiffness: impl Fn([f64; 3]) -> f64) -> System {
    let nodes = mesh.nodes();
    let unknowns = Unknowns::new(nodes.len(), |node, component| prescribed(nodes[node])[component]).unwrap();
    let pattern = Arc::new(unknowns.pattern(mesh).unwrap());
    let mut matrix = Sparse::<f64>::matrix(&(), &pattern).unwrap();
    let assembler = Assembler::<Sparse>::new(geometry(mesh).unwrap(), &unknowns, &matrix).unwrap();
    let at_rest = NeoHookean { mu: 3.0, lambda: 5.0 }.evaluate(&Matrix3::identity()).unwrap().tangent;
    let mut responses = PointResponses::zeros(mesh.points().len());
    for (point, tangent) in responses.tangent.iter_mut().enumerate() {
        *tangent = at_rest * stiffness(mesh.center(mesh.points().locate(point).element as usize));
    }
    assembler.stiffness(&vec![[0.0; 3]; nodes.len()], &[], &responses, &mut matrix).unwrap();
    let motions: [Motion; 6] = [
        |_| [1.0, 0.0, 0.0],
        |_| [0.0, 1.0, 0.0],
        |_| [0.0, 0.0, 1.0],
        |x| [0.0, -x[2], x[1]],
        |x| [x[2], 0.0, -x[0]],
        |x| [-x[1], x[0], 0.0],
    ];
    let near_null_space = motions.map(|motion| {
        let of_nodes: Vec<[f64; 3]> = nodes.iter().map(motion).collect();
        let free = unknowns.equation_numbers().iter().zip(of_nodes.as_flattened()).filter(|(number, _)| **number >= 0);
        free.map(|(_, value)| *value).collect()
    });
    System { matrix, near_null_space: near_null_space.into() }
}

/// A cube of `cells` cells per side, clamped at `x = 0`.
fn cube(cells: usize) -> System {
    let mesh = shapes::cuboid([cells; 3], [1.0; 3]).unwrap();
    elasticity(&mesh, |x| [x[0] == 0.0; 3], |_| 1.0)
}

/// The five-point Laplacian on a square of `side` by `side` cells with a Dirichlet condition around it, plus `drift`
/// times a convection term.
fn laplacian(side: i32, drift: f64) -> System {
    let at = |i: i32, j: i32| i * side + j;
    let squares = (0..side).flat_map(|i| (0..side).map(move |j| (i, j)));
    let pairs = squares.clone().flat_map(|(i, j)| {
        [(i + 1, j), (i, j + 1)]
            .into_iter()
            .filter(|&(k, l)| k < side && l < side)
            .map(move |(k, l)| [at(i, j), at(k, l)])
    });
    let pattern = Arc::new(Sparsity::from_elements((side * side) as usize, pairs).unwrap());
    let mut matrix = Sparse::<f64>::matrix(&(), &pattern).unwrap();
    for (i, j) in squares {
        matrix.add(&[at(i, j)], &[at(i, j)], &[4.0]).unwrap();
        for (k, l, v) in [(i - 1, j, -1.0 - drift), (i + 1, j, -1.0 + drift), (i, j - 1, -1.0), (i, j + 1, -1.0)] {
            if (0..side).contains(&k) && (0..side).contains(&l) {
                matrix.add(&[at(i, j)], &[at(k, l)], &[v]).unwrap();
            }
        }
    }
    System { matrix, near_null_space: Vec::new() }
}

const TOLERANCE: f64 = 1e-8;

fn method(krylov: Krylov) -> Iterative {
    Iterative { preconditioner: Preconditioner::Multigrid, tolerance: TOLERANCE, ..Iterative::new(krylov) }
}

fn solver(system: &System, params: &SolverParams) -> Solver {
    let symbolic = Sparse::<f64>::analyze(&(), system.matrix.pattern(), params).unwrap();
    let mut solver = Sparse::<f64>::solver(&symbolic).unwrap();
    solver.set_near_null_space(&system.near_null_space).unwrap();
    solver
}

fn right_hand_side(len: usize) -> Vector {
    (0..len).map(|k| (k as f64).sin()).collect::<Vec<_>>().into()
}

/// Returns the number of iterations, after a check of the residual.
fn iterations(system: &System, symmetry: Symmetry, krylov: Krylov) -> usize {
    let mut solver = solver(system, &SolverParams::new(symmetry).iterative(method(krylov)));
    assert_eq!(solver.factor(&system.matrix).unwrap().kind, Factorization::Approximate);
    let n = system.matrix.pattern().rows();
    let (b, mut x, mut product) = (right_hand_side(n), Vector::from(vec![0.0; n]), Vector::from(vec![0.0; n]));
    let report = solver.solve(&b, &mut x).unwrap();
    system.matrix.mul(&x, &mut product).unwrap();
    product.axpy(-1.0, &b).unwrap();
    let residual: f64 = VectorOps::<Sparse>::norm(&product).unwrap();
    assert!(residual <= 1.001 * TOLERANCE * VectorOps::<Sparse>::norm(&b).unwrap(), "{residual:e}");
    report.iterations
}

#[test]
fn iterations_hardly_grow_with_the_number_of_unknowns() {
    let of_cubes = [4, 8, 16].map(|cells| iterations(&cube(cells), Symmetry::Definite, Krylov::Cg));
    assert!(of_cubes[2] <= 20 && of_cubes[2] <= of_cubes[1] + 5, "{of_cubes:?}");
    let of_squares = [30, 60, 120].map(|side| iterations(&laplacian(side, 0.0), Symmetry::Definite, Krylov::Cg));
    assert!(of_squares[2] <= 25 && of_squares[2] <= of_squares[1] + 6, "{of_squares:?}");
    // Without the rotations, elasticity takes many more.
    let translations = System { near_null_space: Vec::new(), ..cube(16) };
    assert!(iterations(&translations, Symmetry::Definite, Krylov::Cg) > of_cubes[2] + 5);
}

#[test]
fn jumps_rollers_and_slender_bodies_keep_it_sound() {
    let mesh = shapes::cuboid([12; 3], [1.0; 3]).unwrap();
    let stiff_core = |x: [f64; 3]| if x.iter().all(|x| (x - 0.5).abs() < 0.25) { 1e6 } else { 1.0 };
    let jump = elasticity(&mesh, |x| [x[0] == 0.0; 3], stiff_core);
    // Rollers: nodes with one, two or three unknowns.
    let rollers = elasticity(&mesh, |x| x.map(|x| x == 0.0), |_| 1.0);
    let slender = shapes::cuboid([200, 3, 3], [200.0, 3.0, 3.0]).unwrap();
    let beam = elasticity(&slender, |x| [x[0] == 0.0; 3], |_| 1.0);
    let quadratic = shapes::cuboid([4; 3], [1.0; 3]).unwrap().quadratic(Default::default()).unwrap();
    let quadratic = elasticity(&quadratic, |x| [x[0] == 0.0; 3], |_| 1.0);
    for (name, system, most) in
        [("jump", jump, 30), ("rollers", rollers, 20), ("beam", beam, 30), ("quadratic", quadratic, 40)]
    {
        let found = iterations(&system, Symmetry::Definite, Krylov::Cg);
        assert!(found <= most, "{name}: {found}");
    }
}

#[test]
fn an_unsymmetric_matrix_is_solved_by_gmres() {
    for krylov in [Krylov::Gmres { restart: 30 }, Krylov::BiCgStab] {
        let found = iterations(&laplacian(60, 0.3), Symmetry::None, krylov);
        assert!(found <= 40, "{krylov:?}: {found}");
    }
}

/// The box has more nodes than a task of any loop processes.
#[test]
fn results_do_not_depend_on_the_number_of_threads() {
    let system = cube(22);
    let n = system.matrix.pattern().rows();
    let solution = |threads: usize| -> Vec<u64> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let params = SolverParams::default().iterative(method(Krylov::Cg));
            let mut solver = solver(&system, &params);
            solver.factor(&system.matrix).unwrap();
            let mut x = Vector::from(vec![0.0; n]);
            solver.solve(&right_hand_side(n), &mut x).unwrap();
            x.as_slice().iter().map(|x| x.to_bits()).collect()
        })
    };
    let of_one = solution(1);
    assert!([2, 5].into_iter().all(|threads| solution(threads) == of_one));
}

#[test]
fn the_cycle_is_symmetric_and_positive_and_both_precisions_agree() {
    let system = cube(10);
    let n = system.matrix.pattern().rows();
    let (x, y) = (right_hand_side(n), Vector::from((0..n).map(|k| (0.3 * k as f64).cos()).collect::<Vec<_>>()));
    let apply = |single_precision: bool, v: &Vector| {
        let mut params = MultigridParams::default();
        params.single_precision = single_precision;
        let mut multigrid = Multigrid::new(system.matrix.pattern(), Symmetry::Definite, params).unwrap();
        multigrid.set_near_null_space(&system.near_null_space).unwrap();
        multigrid.set_up(&system.matrix).unwrap();
        assert!(multigrid.levels().len() > 1 && multigrid.operator_complexity() < 2.0, "{:?}", multigrid.levels());
        let mut z = Vector::from(vec![0.0; n]);
        multigrid.apply(v, &mut z).unwrap();
        z
    };
    let dot = |a: &Vector, b: &Vector| -> f64 { VectorOps::<Sparse>::dot(a, b).unwrap() };
    let (mx, my) = (apply(false, &x), apply(false, &y));
    let scale = (dot(&mx, &mx) * dot(&y, &y)).sqrt();
    assert!((dot(&mx, &y) - dot(&x, &my)).abs() < 1e-12 * scale);
    assert!(dot(&mx, &x) > 0.0 && dot(&my, &y) > 0.0);
    let mut difference = apply(true, &x);
    difference.axpy(-1.0, &mx).unwrap();
    assert!(dot(&difference, &difference).sqrt() < 1e-5 * dot(&mx, &mx).sqrt());
}

/// A hierarchy takes over the memory of the one before, whose prolongation has another pattern.
#[test]
fn a_hierarchy_has_the_bits_of_a_first_one() {
    let mesh = shapes::cuboid([12; 3], [1.0; 3]).unwrap();
    let stiff_core = |x: [f64; 3]| if x.iter().all(|x| (x - 0.5).abs() < 0.25) { 1e6 } else { 1.0 };
    let systems = [cube(12), elasticity(&mesh, |x| [x[0] == 0.0; 3], stiff_core)];
    let n = systems[0].matrix.pattern().rows();
    for single_precision in [true, false] {
        let mut params = MultigridParams::default();
        (params.single_precision, params.coarsest) = (single_precision, 30);
        let new = || Multigrid::new(systems[0].matrix.pattern(), Symmetry::Definite, params).unwrap();
        let set_up_and_apply = |multigrid: &mut Multigrid, system: &System| -> Vec<u64> {
            multigrid.set_near_null_space(&system.near_null_space).unwrap();
            multigrid.set_up(&system.matrix).unwrap();
            assert!(multigrid.levels().len() > 2);
            let mut z = Vector::from(vec![0.0; n]);
            multigrid.apply(&right_hand_side(n), &mut z).unwrap();
            z.as_slice().iter().map(|z| z.to_bits()).collect()
        };
        let first = [0, 1].map(|number| set_up_and_apply(&mut new(), &systems[number]));
        assert_ne!(first[0], first[1]);
        let mut multigrid = new();
        for number in [0, 1, 0, 1] {
            assert!(set_up_and_apply(&mut multigrid, &systems[number]) == first[number], "{single_precision} {number}");
        }
    }
}

#[test]
fn a_solver_in_single_precision_has_multigrid_too() {
    let system = cube(8);
    let mut matrix = Sparse::<f32>::matrix(&(), system.matrix.pattern()).unwrap();
    matrix.values_mut().iter_mut().zip(system.matrix.values()).for_each(|(to, from)| *to = *from as f32);
    let cg = Iterative { tolerance: 1e-4, ..method(Krylov::Cg) };
    let symbolic = Sparse::<f32>::analyze(&(), matrix.pattern(), &SolverParams::default().iterative(cg)).unwrap();
    let mut solver = Sparse::<f32>::solver(&symbolic).unwrap();
    let modes: Vec<Vec<f32>> =
        system.near_null_space.iter().map(|mode| mode.iter().map(|v| *v as f32).collect()).collect();
    solver.set_near_null_space(&modes).unwrap();
    solver.factor(&matrix).unwrap();
    let n = matrix.pattern().rows();
    let (b, mut x) = (vec![1.0_f32; n].into(), vec![0.0_f32; n].into());
    assert!(solver.solve(&b, &mut x).unwrap().iterations < 15);
}

/// The hierarchy of an earlier matrix serves a similar one; for a very different one, the numbers are computed again.
#[test]
fn a_preconditioner_is_kept_while_it_serves() {
    let mesh = shapes::cuboid([10; 3], [1.0; 3]).unwrap();
    let clamp = |x: [f64; 3]| [x[0] == 0.0; 3];
    let first = elasticity(&mesh, clamp, |_| 1.0);
    let similar = elasticity(&mesh, clamp, |x| 1.0 + 0.1 * x[0]);
    let different = elasticity(&mesh, clamp, |x| if x[1] > 0.5 { 200.0 } else { 1.0 });
    let mut solver = solver(&first, &SolverParams::default().iterative(method(Krylov::Cg)));
    let n = first.matrix.pattern().rows();
    let (b, mut x) = (right_hand_side(n), Vector::from(vec![0.0; n]));
    assert_eq!(solver.update(&first.matrix).unwrap().kind, Factorization::Approximate);
    let fresh = solver.solve(&b, &mut x).unwrap().iterations;
    assert_eq!(solver.update(&similar.matrix).unwrap().kind, Factorization::Kept);
    assert!(solver.solve(&b, &mut x).unwrap().iterations <= fresh + 2);
    assert_eq!(solver.update(&different.matrix).unwrap().kind, Factorization::Kept);
    let kept = solver.solve(&b, &mut x).unwrap().iterations;
    assert!(kept > 2 * fresh, "{kept}, {fresh}");
    assert_eq!(solver.update(&different.matrix).unwrap().kind, Factorization::Approximate);
    let refreshed = solver.solve(&b, &mut x).unwrap().iterations;
    assert!(2 * refreshed < kept, "{refreshed}, {kept}");
    let mut product = Vector::from(vec![0.0; n]);
    different.matrix.mul(&x, &mut product).unwrap();
    product.axpy(-1.0, &b).unwrap();
    assert!(VectorOps::<Sparse>::norm(&product).unwrap() < 1e-7 * VectorOps::<Sparse>::norm(&b).unwrap());
}

/// A matrix with many negative eigenvalues, on which conjugate gradients break down.
fn indefinite() -> System {
    let mut system = cube(6);
    for at in 0..system.matrix.pattern().rows() as i32 {
        system.matrix.add(&[at], &[at], &[-0.4]).unwrap();
    }
    system
}

#[test]
fn a_direct_solver_replaces_an_iteration_that_fails() {
    let (bad, good) = (indefinite(), cube(6));
    let n = bad.matrix.pattern().rows();
    let (b, mut x, mut exact) = (right_hand_side(n), Vector::from(vec![0.0; n]), Vector::from(vec![0.0; n]));
    let cg = SolverParams::default().iterative(method(Krylov::Cg));
    let mut strict = solver(&bad, &cg);
    let refused = strict.factor(&bad.matrix).and_then(|_| strict.solve(&b, &mut x).map(drop));
    assert!(refused.is_err());

    let mut params = cg;
    params.fallback = true;
    let mut tolerant = solver(&bad, &params);
    tolerant.factor(&bad.matrix).unwrap();
    tolerant.solve(&b, &mut x).unwrap();
    let mut direct = solver(&bad, &SolverParams::default());
    direct.factor(&bad.matrix).unwrap();
    direct.solve(&b, &mut exact).unwrap();
    exact.axpy(-1.0, &x).unwrap();
    assert!(VectorOps::<Sparse>::norm(&exact).unwrap() < 1e-10 * VectorOps::<Sparse>::norm(&x).unwrap());
    // The direct method stays until the next call of `factor`.
    assert_eq!(tolerant.update(&good.matrix).unwrap().kind, Factorization::Cholesky);
    assert_eq!(tolerant.factor(&good.matrix).unwrap().kind, Factorization::Approximate);
    assert!(tolerant.solve(&b, &mut x).unwrap().iterations > 0);
}

#[test]
fn input_that_does_not_fit_is_refused() {
    let system = cube(4);
    let pattern = system.matrix.pattern();
    let mut multigrid = Multigrid::new(pattern, Symmetry::Definite, MultigridParams::default()).unwrap();
    let n = pattern.rows();
    let (x, mut y) = (right_hand_side(n), Vector::from(vec![0.0; n]));
    assert_eq!(multigrid.apply(&x, &mut y), Err(SolveError::NotFactored));
    assert!(matches!(multigrid.set_near_null_space(&[vec![1.0; 5]]), Err(SolveError::Size { found: 5, .. })));
    assert!(matches!(multigrid.set_up(&cube(3).matrix), Err(SolveError::Size { .. })));
    let triangle = Arc::new(Sparsity::from_rows(2, vec![0, 2, 3], vec![0, 1, 1]).unwrap());
    let refused = Multigrid::new(&triangle, Symmetry::Definite, MultigridParams::default());
    assert!(matches!(refused, Err(SolveError::UnsymmetricPattern { row: 0, column: 1 })));
    let mut empty_row = laplacian(40, 0.0);
    MatrixOps::<Sparse>::zero_rows(&mut empty_row.matrix, &[7]).unwrap();
    let mut multigrid =
        Multigrid::new(empty_row.matrix.pattern(), Symmetry::Definite, MultigridParams::default()).unwrap();
    assert_eq!(multigrid.set_up(&empty_row.matrix), Err(SolveError::ZeroDiagonal { row: 7 }));
}

/// What is not finite neither passes for a solution nor for a singular matrix.
#[test]
fn numbers_that_are_not_finite_do_not_vanish() {
    let system = cube(4);
    let pattern = system.matrix.pattern();
    let n = pattern.rows();
    let mut multigrid = Multigrid::new(pattern, Symmetry::Definite, MultigridParams::default()).unwrap();
    multigrid.set_near_null_space(&system.near_null_space).unwrap();
    multigrid.set_up(&system.matrix).unwrap();
    for wrong in [f64::NAN, -f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let (mut x, mut y) = (right_hand_side(n), Vector::from(vec![0.0; n]));
        x.as_mut_slice()[n / 2] = wrong;
        multigrid.apply(&x, &mut y).unwrap();
        assert!(y.as_slice().iter().all(|y| y.is_nan()), "{wrong}");
        let mut bad = system.matrix.clone();
        MatrixOps::<Sparse>::add(&mut bad, &[20], &[20], &[wrong]).unwrap();
        assert_eq!(multigrid.set_up(&bad), Err(SolveError::NotFinite { row: 20 }));
        assert_eq!(multigrid.apply(&x, &mut y), Err(SolveError::NotFactored));
        multigrid.set_up(&system.matrix).unwrap();
    }
}

#[test]
fn a_negative_diagonal_is_indefinite() {
    let system = cube(4);
    let mut negative = system.matrix.clone();
    negative.values_mut().iter_mut().for_each(|value| *value = -*value);
    let cg = Iterative { preconditioner: Preconditioner::Multigrid, ..Iterative::new(Krylov::Cg) };
    let mut solver = solver(&system, &SolverParams::new(Symmetry::Definite).iterative(cg));
    assert!(matches!(solver.factor_definite(&negative), Err(SolveError::Indefinite { .. })));
    let n = negative.pattern().rows();
    let refused = solver.solve(&right_hand_side(n), &mut Vector::from(vec![0.0; n]));
    assert!(matches!(refused, Err(SolveError::NotFactored)), "{refused:?}");
    solver.factor_definite(&system.matrix).unwrap();
}
