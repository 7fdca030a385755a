//! The backend `petsc`, on one rank and on several. This program runs itself under `mpirun`, because MPI can be
//! initialized only once per process.
//!
//! `cargo test --test petsc -- WORD` runs the checks whose names contain the word.
#![allow(unsafe_code, reason = "replaces a function of MPI to count its calls")]

#[allow(dead_code, reason = "tests of other backends use the recorded numbers")]
mod bar_of_24;
mod petsc_parts;
mod support;

use std::ffi::{c_int, c_void};
use std::process::{Command, ExitCode};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use biotissue::backends::petsc::{Context, MatrixType, Petsc, Session, SessionError};
use biotissue::fem::assembly::{Assembler, Unknowns, geometry};
use biotissue::fem::boundary::{Conditions, LoadCurve, PointCondition, PointLocation, SurfaceCondition};
use biotissue::fem::constraint::{ConstrainedVolume, ConstraintMethod, VolumeConstraint};
use biotissue::fem::material::{Material, NeoHookean};
use biotissue::fem::mesh::shapes;
use biotissue::fem::point_field::{FormulaField, PointResponses};
use biotissue::fem::stepping::{StepParams, Stepper};
use biotissue::las::{
    Backend, Entries, FactorReport, Factorization, Iterative, Krylov, MatMat, MatVec, MatrixOps, NewtonSystem,
    Preconditioner, SolveError, Solver, SolverParams, Sparsity, StopReason, Symmetry, VectorOps,
    conformance::{self, Capabilities, Trials},
};
use mpi::collective::SystemOperation;
use mpi::ffi::{MPI_Comm, MPI_Datatype, MPI_Op, PMPI_Allreduce};
use mpi::topology::{Color, Communicator, SimpleCommunicator};
use mpi::traits::CommunicatorCollectives;
use nalgebra::Matrix3;

/// The environment variable that marks a launched process.
const LAUNCHED: &str = "BIOTISSUE_PETSC_TEST";

type Check = (&'static str, fn(&Context));

const CHECKS: &[Check] = &[
    ("vectors", |context| conformance::vectors::<Petsc>(context, trials(200, 1))),
    ("matrices", |context| check_matrices(context, trials(200, 1))),
    ("solvers", |context| conformance::solvers::<Petsc>(context, Capabilities::ALL)),
    ("conformance_in_blocks", conformance_in_blocks),
    ("blocks", blocks),
    ("mixed_writes", mixed_writes),
    ("verbs_on_threads", verbs_on_threads),
    ("shifted_diagonal", shifted_diagonal),
    ("iterative_methods", iterative_methods),
    ("a_preconditioner_is_kept_while_it_serves", a_preconditioner_is_kept_while_it_serves),
    ("options", options),
    ("errors", errors),
    ("owned_rows", owned_rows),
    ("floating_bodies", floating_bodies),
    ("split_communicators", split_communicators),
    ("frozen_rve", frozen_rve),
    ("stretched_body", stretched_body),
    ("constrained_body", constrained_body),
    ("parts_vectors", petsc_parts::vectors),
    ("parts_sums", petsc_parts::sums),
    ("parts_matrices", petsc_parts::matrices),
    ("parts_errors", petsc_parts::errors),
    ("parts_direct", petsc_parts::direct),
    ("parts_iterative", petsc_parts::iterative),
    ("parts_and_copies_by_multigrid", petsc_parts::multigrid_of_copies),
    ("parts_singular", petsc_parts::singular),
    ("parts_named_rows", petsc_parts::named_rows),
    ("parts_not_converged", petsc_parts::not_converged),
    ("parts_and_copies_fallback", petsc_parts::fallback),
    ("parts_of_nothing", petsc_parts::solve_nothing),
    #[cfg(all(feature = "sparse", feature = "generate"))]
    ("generated_network", generated_network),
];

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).filter(|word| !word.starts_with('-')).collect();
    if std::env::var_os(LAUNCHED).is_some() {
        return checks(&words);
    }
    let mut all_passed = true;
    for ranks in [0, 1, 2, 4] {
        let start = Instant::now();
        let passed = launch(ranks, &words);
        all_passed &= passed;
        let launcher = if ranks == 0 { "without mpirun".to_owned() } else { format!("mpirun -n {ranks}") };
        println!("{launcher} ... {} ({:.1} s)", if passed { "ok" } else { "FAILED" }, start.elapsed().as_secs_f64());
    }
    all_passed &= words.iter().any(|word| !"logging".contains(word.as_str())) || hot_verbs_do_not_write_to_the_log();
    if all_passed { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// All threads of a process share the log of PETSc, so that verbs that take no lock must not write to it.
fn hot_verbs_do_not_write_to_the_log() -> bool {
    let file = std::env::temp_dir().join(format!("biotissue-petsc-log-{}", std::process::id()));
    let options = format!("-log_view :{}", file.display());
    let program = std::env::current_exe().expect("this program has a path");
    let run =
        Command::new(&program).arg("verbs_on_threads").envs([(LAUNCHED, "1"), ("PETSC_OPTIONS", &options)]).status();
    let log = std::fs::read_to_string(&file).unwrap_or_default();
    let _ = std::fs::remove_file(&file);
    let is_log = log.contains("MatAssemblyEnd");
    let passed = run.is_ok_and(|status| status.success()) && is_log && !log.contains("MatSetValues");
    println!("hot_verbs_do_not_write_to_the_log ... {}", if passed { "ok" } else { "FAILED" });
    passed
}

/// Runs the checks in new processes; 0 ranks stands for one process without `mpirun`.
fn launch(ranks: usize, words: &[String]) -> bool {
    let program = std::env::current_exe().expect("this program has a path");
    let mut command = if ranks == 0 {
        Command::new(&program)
    } else {
        let mut command = Command::new("mpirun");
        command.args(["--oversubscribe", "--timeout", "1200", "-n", &ranks.to_string()]).arg(&program);
        command
    };
    command.args(words).env(LAUNCHED, "1");
    // The variables allow the user root, as in containers, set one thread per rank, and prevent kernels with
    // instructions that this processor lacks.
    command.envs([("OMPI_ALLOW_RUN_AS_ROOT", "1"), ("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1")]);
    command.envs([("OMP_NUM_THREADS", "1"), ("OPENBLAS_NUM_THREADS", "1")]);
    #[cfg(target_arch = "x86_64")]
    if std::env::var_os("OPENBLAS_CORETYPE").is_none() && is_x86_feature_detected!("avx2") {
        let core = if is_x86_feature_detected!("avx512f") { "SkylakeX" } else { "Haswell" };
        command.env("OPENBLAS_CORETYPE", core);
    }
    match command.status() {
        Ok(status) => status.success(),
        Err(error) => {
            println!("{command:?}: {error}");
            false
        }
    }
}

/// Runs all checks in this process, which may be one of several ranks.
fn checks(words: &[String]) -> ExitCode {
    // A panic ends the process, and thereby all ranks; otherwise the other ranks would wait for it.
    let print_panic = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        print_panic(panic);
        std::process::exit(101);
    }));
    let context = Context::world().expect("PETSc starts");
    for (name, check) in CHECKS {
        if words.is_empty() || words.iter().any(|word| name.contains(word.as_str())) {
            let start = Instant::now();
            check(&context);
            if context.rank() == 0 {
                println!("  {name} ... ok ({:.2} s)", start.elapsed().as_secs_f64());
            }
        }
    }
    if words.is_empty() || words.iter().any(|word| "sessions".contains(word.as_str())) {
        sessions(context);
    }
    ExitCode::SUCCESS
}

/// There is one session at a time; every object created in it keeps it alive, and the objects may be dropped in any
/// order.
fn sessions(context: Context) {
    assert_eq!(Session::new().err(), Some(SessionError::Running));
    let pattern = laplacian_pattern(4);
    let mut a = Petsc::matrix(&context, &pattern).unwrap();
    fill_laplacian(&mut a, 4, 0.0);
    let symbolic = Petsc::analyze(&context, &pattern, &SolverParams::default()).unwrap();
    let mut solver = Petsc::solver(&symbolic).unwrap();
    let (b, mut x) = (ones(&context, 16), ones(&context, 16));
    drop((context, symbolic));
    solver.factor(&a).unwrap();
    drop(a);
    solver.solve(&b, &mut x).unwrap();
    assert_eq!(Session::new().err(), Some(SessionError::Running), "a solver and two vectors keep the session alive");
    drop(solver);
    drop(b);
    assert!(x.norm().unwrap() > 0.0);
    drop(x);
    // The session initialized MPI, which is possible only once.
    assert_eq!(Session::new().err(), Some(SessionError::Ended));
}

/// Returns trials with the same cases on all ranks; failing cases are not reduced.
fn trials(count: u32, block_size: usize) -> Trials {
    Trials { count, block_size, reduce: false, ..Trials::default() }
}

fn check_matrices(context: &Context, trials: Trials) {
    conformance::matrices::<Petsc>(context, trials);
    conformance::products::<Petsc>(context, trials);
    conformance::entries::<Petsc>(context, trials);
    conformance::algebra::<Petsc>(context, trials);
}

fn conformance_in_blocks(context: &Context) {
    let of_two = context.clone().with_block_size(2);
    check_matrices(&of_two, trials(60, 1));
    check_matrices(&of_two, trials(60, 2));
    check_matrices(&context.clone().with_matrix_type(MatrixType::Baij), trials(60, 3));
}

/// The pattern of a truss consists of 3x3 blocks, so that BAIJ stores the same entries as AIJ; the results are equal.
fn blocks(context: &Context) {
    let baij = context.clone().with_matrix_type(MatrixType::Baij);
    conformance::matrices::<Petsc>(&baij, trials(60, 1));
    for (seed, nodes) in (1..).zip([1, 3, 8, 20]) {
        let mut random = conformance::Random::new(seed);
        let pattern = random.truss(nodes, 2);
        let n = pattern.rows();
        let [mut a, mut b] = [context, &baij].map(|context| Petsc::matrix(context, &pattern).unwrap());
        assert_eq!((a.matrix_type(), b.matrix_type()), (MatrixType::Aij, MatrixType::Baij));
        let mut slots = [Vec::new(), Vec::new()];
        let oracle = conformance::DenseReference::dominant(&mut random, &pattern, |_| 1.0);
        for row in 0..n as i32 {
            let cols: Vec<i32> = pattern.row(row as usize).iter().map(|&c| c as i32).chain([-1]).collect();
            let of_row = |&c: &i32| if c < 0 { 9.0 } else { oracle.values[row as usize * n + c as usize] };
            let values: Vec<f64> = cols.iter().map(of_row).collect();
            for (matrix, slots) in [&mut a, &mut b].into_iter().zip(&mut slots) {
                matrix.add(&[row], &cols, &values).unwrap();
                matrix.zero_rows(&[row]).unwrap();
                matrix.set(&[row], &cols, &values).unwrap();
                slots.clear();
                matrix.locate(&[row], &cols, slots).unwrap();
                matrix.add_at(slots, &values).unwrap();
                matrix.finish().unwrap();
            }
        }
        assert_equal_entries(&a, &b);
        assert_equal_entries(&a.product(&a).unwrap(), &b.product(&b).unwrap());
        assert_equal_entries(&a.transpose().unwrap(), &b.transpose().unwrap());
        assert_equal_entries(&a.sum(2.0, &a, 1.0).unwrap(), &b.sum(2.0, &b, 1.0).unwrap());
        assert_eq!(b.product(&b).unwrap().matrix_type(), MatrixType::Baij);
        a.scale(0.5).unwrap();
        b.scale(0.5).unwrap();
        let (x, mut y) = (ones(context, n), [ones(context, n), ones(context, n)]);
        a.mul(&x, &mut y[0]).unwrap();
        b.mul(&x, &mut y[1]).unwrap();
        assert!(y[0].as_slice().iter().zip(y[1].as_slice()).all(|(a, b)| (a - b).abs() < 1e-12));
        let symbolic = Petsc::analyze(&baij, &pattern, &SolverParams::default()).unwrap();
        let mut solver = Petsc::solver(&symbolic).unwrap();
        assert_eq!(solver.factor(&b).unwrap().kind, Factorization::Cholesky);
        solver.solve(&x, &mut y[0]).unwrap();
        assert!(residual(&a, &x, &y[0]) < 1e-13);
    }
}

fn assert_equal_entries(a: &<Petsc as Backend>::Matrix, b: &<Petsc as Backend>::Matrix) {
    let mut entries = [Vec::new(), Vec::new()];
    for (matrix, entries) in [a, b].into_iter().zip(&mut entries) {
        matrix.for_each(|row, column, value| entries.push((row, column, value))).unwrap();
    }
    assert_eq!(entries[0], entries[1]);
}

/// Entries are added, set and read alternately, with and without `finish` in between.
fn mixed_writes(context: &Context) {
    let pattern = laplacian_pattern(3);
    let mut a = Petsc::matrix(context, &pattern).unwrap();
    let (row, mut slots, mut entry) = ([4, -1], Vec::new(), [0.0]);
    a.locate(&[4], &[4], &mut slots).unwrap();
    a.add(&row, &row, &[1.0, 9.0, 9.0, 9.0]).unwrap();
    a.set(&[4], &[4], &[5.0]).unwrap();
    a.add(&[4], &[4], &[2.0]).unwrap();
    a.add_at(&slots, &[3.0]).unwrap();
    a.get(&[4], &[4], &mut entry).unwrap();
    assert_eq!(entry, [10.0]);
    a.zero().unwrap();
    a.add(&[4], &[4], &[2.0]).unwrap();
    a.finish().unwrap();
    let (x, mut y) = (ones(context, 9), ones(context, 9));
    a.mul(&x, &mut y).unwrap();
    assert_eq!(y.as_slice(), [0.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0]);
    // A product must use the current values, not those of the previous product.
    for factor in [3.0, 5.0] {
        a.add_at(&slots, &[factor]).unwrap();
        a.finish().unwrap();
        a.mul(&x, &mut y).unwrap();
    }
    assert_eq!(y.as_slice()[4], 10.0);
    let mut sum = 0.0;
    a.for_each(|_, _, value| sum += value).unwrap();
    assert_eq!(sum, 10.0, "every rank must visit all entries");
}

/// Several threads, each with its own matrix, write to their matrices at the same time.
fn verbs_on_threads(context: &Context) {
    // On several ranks, all ranks must make their collective calls in the same order.
    let threads = if context.ranks() == 1 { 4 } else { 1 };
    let side = 12;
    let matrices: Vec<_> = (0..threads).map(|_| Petsc::matrix(context, &laplacian_pattern(side)).unwrap()).collect();
    std::thread::scope(|scope| {
        // Only a thread that is joined has freed its memory before the program ends, which valgrind checks.
        let joined = matrices.into_iter().enumerate().map(|(thread, mut a)| {
            scope.spawn(move || {
                for _ in 0..50 {
                    fill_laplacian(&mut a, side, thread as f64);
                    a.set(&[0], &[0], &[7.0]).unwrap();
                    a.add(&[0], &[0], &[1.0]).unwrap();
                }
                a.finish().unwrap();
                let (mut entry, mut sum) = ([0.0], 0.0);
                a.get(&[0], &[0], &mut entry).unwrap();
                assert_eq!(entry, [8.0]);
                a.for_each(|_, _, value| sum += value).unwrap();
                // The diagonal entries are 4, except for the first one, which is 8; every pair of neighbors along x or
                // y contributes -1 twice; the convection cancels in the sum.
                let side = f64::from(side);
                assert_eq!(sum, 4.0 * side * side + 4.0 - 4.0 * side * (side - 1.0));
            })
        });
        let joined: Vec<_> = joined.collect();
        joined.into_iter().for_each(|thread| thread.join().unwrap());
    });
}

/// Number of calls of `MPI_Allreduce`. By the profiling interface of MPI, the function below replaces that of the
/// library.
static REDUCTIONS: AtomicUsize = AtomicUsize::new(0);

/// Counts the call and passes it to the library.
///
/// # Safety
/// As for `MPI_Allreduce`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn MPI_Allreduce(
    send: *const c_void,
    receive: *mut c_void,
    count: c_int,
    kind: MPI_Datatype,
    operation: MPI_Op,
    comm: MPI_Comm,
) -> c_int {
    REDUCTIONS.fetch_add(1, Ordering::Relaxed);
    // SAFETY: the arguments are passed on unchanged.
    unsafe { PMPI_Allreduce(send, receive, count, kind, operation, comm) }
}

/// The diagonal is read by one collective call for any number of unknowns.
fn shifted_diagonal(context: &Context) {
    let side = 9;
    let pattern = laplacian_pattern(side);
    let symbolic = Petsc::analyze(context, &pattern, &SolverParams::default()).unwrap();
    let mut system = NewtonSystem::<Petsc>::new(context, &pattern, &symbolic).unwrap();
    fill_laplacian(&mut system.matrix, side, 0.0);
    system.matrix.add(&[40], &[40], &[-9.0]).unwrap();
    system.matrix.finish().unwrap();
    // The reductions that PETSc itself makes during the assembly are subtracted.
    let before = REDUCTIONS.load(Ordering::Relaxed);
    system.matrix.finish().unwrap();
    let assembly = REDUCTIONS.load(Ordering::Relaxed) - before;
    let before = REDUCTIONS.load(Ordering::Relaxed);
    assert_eq!(system.shift_diagonal(0.5).unwrap(), 5.0, "the largest absolute diagonal entry");
    let reductions = REDUCTIONS.load(Ordering::Relaxed) - before;
    assert_eq!(reductions, assembly + usize::from(context.ranks() > 1), "{} ranks", context.ranks());
    system.matrix.finish().unwrap();
    let mut diagonal = zeros(context, pattern.rows());
    system.matrix.diagonal(&mut diagonal).unwrap();
    let expected = |unknown| if unknown == 40 { -4.5 } else { 4.5 };
    assert!(diagonal.as_slice().iter().enumerate().all(|(unknown, &entry)| entry == expected(unknown)));
}

/// Returns the pattern of the negative Laplacian with convection on a grid of `side` by `side` points.
fn laplacian_pattern(side: i32) -> Arc<Sparsity> {
    let at = |i: i32, j: i32| if (0..side).contains(&i) && (0..side).contains(&j) { i * side + j } else { -1 };
    let pairs = (0..side).flat_map(|i| (0..side).flat_map(move |j| [[(i, j), (i + 1, j)], [(i, j), (i, j + 1)]]));
    let elements = pairs.map(|pair| pair.map(|(i, j)| at(i, j)));
    Arc::new(Sparsity::from_elements((side * side) as usize, elements).unwrap())
}

fn fill_laplacian(a: &mut <Petsc as Backend>::Matrix, side: i32, drift: f64) {
    a.zero().unwrap();
    let at = |i: i32, j: i32| if (0..side).contains(&i) && (0..side).contains(&j) { i * side + j } else { -1 };
    for i in 0..side {
        for j in 0..side {
            let columns = [at(i, j), at(i - 1, j), at(i + 1, j), at(i, j - 1), at(i, j + 1)];
            a.add(&[at(i, j)], &columns, &[4.0, -1.0 - drift, -1.0 + drift, -1.0, -1.0]).unwrap();
        }
    }
    a.finish().unwrap();
}

fn ones(context: &Context, len: usize) -> <Petsc as Backend>::Vector {
    let mut ones = Petsc::vector(context, len).unwrap();
    ones.as_mut_slice().fill(1.0);
    ones
}

fn residual(a: &<Petsc as Backend>::Matrix, b: &<Petsc as Backend>::Vector, x: &<Petsc as Backend>::Vector) -> f64 {
    let mut values = vec![0.0; b.len()];
    a.for_each(|row, column, value| values[row] += value * x.as_slice()[column]).unwrap();
    values.iter().zip(b.as_slice()).map(|(ax, b)| (ax - b).powi(2)).sum::<f64>().sqrt() / b.norm().unwrap()
}

/// Diffusion on the grid of [`fill_laplacian`], with this coefficient of the edges to the right of and above each point.
fn fill_diffusion(a: &mut <Petsc as Backend>::Matrix, side: i32, coefficient: impl Fn(i32) -> f64) {
    a.zero().unwrap();
    for i in 0..side {
        for j in 0..side {
            let (at, c) = (i * side + j, coefficient(i));
            for (next, is_inside) in [(at + side, i + 1 < side), (at + 1, j + 1 < side)] {
                let next = if is_inside { next } else { -1 };
                a.add(&[at, next], &[at, next], &[c, -c, -c, c]).unwrap();
            }
            if i == 0 || j == 0 {
                a.add(&[at], &[at], &[c]).unwrap();
            }
        }
    }
    a.finish().unwrap();
}

/// The multigrid hierarchy of an earlier matrix serves a similar one; for a very different one, it is computed again.
fn a_preconditioner_is_kept_while_it_serves(context: &Context) {
    let side = 24;
    let pattern = laplacian_pattern(side);
    let len = pattern.rows();
    let [uniform, similar, different] = [(1.0, 0.1), (1.0, 0.2), (1.0, 20.0)].map(|(c, slope)| {
        let mut a = Petsc::matrix(context, &pattern).unwrap();
        fill_diffusion(&mut a, side, |i| c + slope * f64::from(i));
        a
    });
    let method = Iterative {
        krylov: Krylov::Cg,
        preconditioner: Preconditioner::Multigrid,
        tolerance: 1e-10,
        max_iterations: 2000,
    };
    let solver = |method| {
        let params = SolverParams::default().iterative(method);
        Petsc::solver(&Petsc::analyze(context, &pattern, &params).unwrap()).unwrap()
    };
    let (b, mut x) = (ones(context, len), ones(context, len));
    let mut iterations = |solver: &mut <Petsc as Backend>::Solver, a: &<Petsc as Backend>::Matrix| {
        let report = solver.solve(&b, &mut x).unwrap();
        let found = residual(a, &b, &x);
        assert!(found <= 1.001e-10 && report.fallbacks == 0, "{found:e}");
        report.iterations
    };
    let mut kept = solver(method);
    assert_eq!(kept.update(&uniform).unwrap().kind, Factorization::Approximate);
    let fresh = iterations(&mut kept, &uniform);
    assert_eq!(kept.update(&similar).unwrap().kind, Factorization::Kept);
    let of_similar = iterations(&mut kept, &similar);
    assert!(of_similar <= fresh + fresh / 2, "{of_similar}, {fresh}");
    assert_eq!(kept.update(&different).unwrap().kind, Factorization::Kept);
    let slow = iterations(&mut kept, &different);
    assert!(slow > 2 * fresh, "{slow}, {fresh}");
    assert_eq!(kept.update(&different).unwrap().kind, Factorization::Approximate);
    let computed = iterations(&mut kept, &different);
    assert!(2 * computed < slow, "{computed}, {slow}");
    // A factorization forgets the aggregates and the interpolation of earlier matrices.
    let (mut later, mut fresh_solver) = (solver(method), solver(method));
    later.factor(&uniform).unwrap();
    later.factor(&different).unwrap();
    fresh_solver.factor(&different).unwrap();
    let mut solutions = [ones(context, len), ones(context, len)];
    let reports = [&mut later, &mut fresh_solver].into_iter().zip(&mut solutions);
    let reports: Vec<_> = reports.map(|(solver, x)| solver.solve(&b, x).unwrap()).collect();
    assert_eq!(reports[0], reports[1]);
    assert_eq!(solutions[0].as_slice(), solutions[1].as_slice());
    // A kept hierarchy with which the method fails is computed again within the solve.
    let mut few = solver(Iterative { max_iterations: computed.max(fresh) + 2, ..method });
    few.factor(&uniform).unwrap();
    iterations(&mut few, &uniform);
    assert_eq!(few.update(&different).unwrap().kind, Factorization::Kept);
    let with_wasted = iterations(&mut few, &different);
    assert!(with_wasted > computed.max(fresh) + 2, "{with_wasted}");
}

/// Every method with every preconditioner reaches its tolerance, also after the matrix has changed.
fn iterative_methods(context: &Context) {
    let side = 24;
    let pattern = laplacian_pattern(side);
    let len = pattern.rows();
    let mut a = Petsc::matrix(context, &pattern).unwrap();
    let b = ones(context, len);
    for preconditioner in [Preconditioner::None, Preconditioner::Diagonal, Preconditioner::Multigrid] {
        for krylov in [Krylov::Cg, Krylov::BiCgStab, Krylov::Gmres { restart: 40 }] {
            let symmetry = if krylov == Krylov::Cg { Symmetry::Definite } else { Symmetry::None };
            fill_laplacian(&mut a, side, if krylov == Krylov::Cg { 0.0 } else { 0.3 });
            let method = Iterative { krylov, preconditioner, tolerance: 1e-10, max_iterations: 2000 };
            let params = SolverParams::new(symmetry).iterative(method);
            let mut solver = Petsc::solver(&Petsc::analyze(context, &pattern, &params).unwrap()).unwrap();
            assert!(matches!(solver.solve(&b, &mut ones(context, len)), Err(SolveError::NotFactored)));
            let report = solver.factor_definite(&a).unwrap();
            assert_eq!((report.kind, report.negative_pivots), (Factorization::Approximate, None));
            let mut x = ones(context, len);
            let report = solver.solve(&b, &mut x).unwrap();
            let found = residual(&a, &b, &x);
            assert!(found <= 1.001e-10 && report.residual <= 1e-10, "{method:?}: {found:e} {report:?}");
            assert!(report.iterations > 0);
            // A later change of the matrix does not affect the solver.
            let mut changed = ones(context, len);
            a.scale(2.0).unwrap();
            solver.solve(&b, &mut changed).unwrap();
            assert_eq!(changed.as_slice(), x.as_slice());
            let report = solver.solve_many(&[ones(context, len), zeros(context, len)], &mut [changed, x]).unwrap();
            assert!(report.iterations > 0);
        }
    }
    fill_laplacian(&mut a, side, 0.0);
    let few =
        Iterative { max_iterations: 3, krylov: Krylov::Cg, preconditioner: Preconditioner::None, tolerance: 1e-10 };
    let params = SolverParams::default().iterative(few);
    let mut solver = Petsc::solver(&Petsc::analyze(context, &pattern, &params).unwrap()).unwrap();
    solver.factor(&a).unwrap();
    match solver.solve(&b, &mut ones(context, len)) {
        Err(SolveError::NotConverged {
            method: "CG",
            iterations: 3,
            residual,
            stop_reason: StopReason::MaxIterations,
            ..
        }) => {
            assert!(residual > 1e-10);
        }
        other => panic!("three iterations: {other:?}"),
    }
    let params = SolverParams::default().iterative(Iterative::default());
    let refused = Petsc::solver(&Petsc::analyze(context, &pattern, &params).unwrap()).err();
    assert!(matches!(refused, Some(SolveError::Unsupported { backend: "petsc", .. })), "{refused:?}");
}

fn zeros(context: &Context, len: usize) -> <Petsc as Backend>::Vector {
    Petsc::vector(context, len).unwrap()
}

/// The options database, under the prefix of the context, overrides the parameters.
fn options(context: &Context) {
    let context = context.clone().with_prefix("other_");
    let factor = |symmetry| -> Result<FactorReport, SolveError<<Petsc as Backend>::Error>> {
        let pattern = laplacian_pattern(5);
        let mut a = Petsc::matrix(&context, &pattern).unwrap();
        fill_laplacian(&mut a, 5, 0.0);
        let mut solver = Petsc::solver(&Petsc::analyze(&context, &pattern, &SolverParams::new(symmetry))?)?;
        let report = solver.factor(&a)?;
        let (b, mut x) = (ones(&context, 25), ones(&context, 25));
        solver.solve(&b, &mut x)?;
        assert!(residual(&a, &b, &x) < 1e-4);
        Ok(report)
    };
    assert_eq!(factor(Symmetry::Definite).unwrap().kind, Factorization::Cholesky);
    context.set_option("pc_type", "lu").unwrap();
    assert_eq!(factor(Symmetry::Definite).unwrap().kind, Factorization::Lu);
    context.clear_option("pc_type").unwrap();
    if context.ranks() == 1 {
        context.set_option("pc_factor_mat_solver_type", "petsc").unwrap();
        let report = factor(Symmetry::Definite).unwrap();
        assert_eq!((report.kind, report.negative_pivots), (Factorization::Cholesky, Some(0)));
    }
    context.set_option("pc_factor_mat_solver_type", "nonsense").unwrap();
    let Err(SolveError::Backend(error)) = factor(Symmetry::None) else { panic!("there is no such package") };
    assert!(error.text().contains("nonsense"), "not the message of PETSc: {error}");
    assert!(error.function() == "MatGetFactor" && error.code() != 0, "{error}");
    context.clear_option("pc_factor_mat_solver_type").unwrap();
    context.set_option("pc_type", "jacobi").unwrap();
    context.set_option("ksp_type", "cg").unwrap();
    assert_eq!(factor(Symmetry::None).unwrap().kind, Factorization::Approximate);
    context.clear_option("pc_type").unwrap();
    context.clear_option("ksp_type").unwrap();
}

fn errors(context: &Context) {
    let (mut three, four) = (ones(context, 3), ones(context, 4));
    for error in [three.dot(&four).unwrap_err(), three.axpy(1.0, &four).unwrap_err()] {
        assert!(error.text().to_lowercase().contains("incompatible"), "not the message of PETSc: {error}");
        assert!(error.to_string().starts_with("PETSc error"), "{error}");
    }
    let mut a = Petsc::matrix(context, &laplacian_pattern(3)).unwrap();
    let short = a.add(&[0, 1], &[0], &[1.0]).unwrap_err();
    assert!(short.text().contains("1 values for 2 pairs"), "{short}");
    let outside = a.add(&[0], &[8], &[1.0]);
    if cfg!(debug_assertions) {
        let text = outside.unwrap_err().to_string();
        assert!(text.contains("(0, 8) is not in the pattern"), "{text}");
    } else {
        outside.unwrap();
        a.finish().unwrap();
        let mut entry = [7.0];
        a.get(&[0], &[8], &mut entry).unwrap();
        assert_eq!(entry, [0.0]);
    }
    let bad = context.set_option("a\0b", "1").unwrap_err();
    assert!(bad.text().contains("NUL"), "{bad}");
}

/// Each half of the ranks solves its own system.
fn split_communicators(context: &Context) {
    let world = SimpleCommunicator::world();
    let half = world.split_by_color(Color::with_value(world.rank() % 2)).expect("of one color");
    let half = Context::new(context.session(), &half);
    assert_eq!(half.ranks(), (context.ranks() + 1 - context.rank() % 2) / 2);
    let side = 6 + (context.rank() % 2) as i32;
    let pattern = laplacian_pattern(side);
    let mut a = Petsc::matrix(&half, &pattern).unwrap();
    fill_laplacian(&mut a, side, 0.0);
    let mut solver = Petsc::solver(&Petsc::analyze(&half, &pattern, &SolverParams::default()).unwrap()).unwrap();
    solver.factor(&a).unwrap();
    let (b, mut x) = (ones(&half, pattern.rows()), ones(&half, pattern.rows()));
    solver.solve(&b, &mut x).unwrap();
    assert!(residual(&a, &b, &x) < 1e-13);
}

/// The first Piola-Kirchhoff stress of the frozen network, computed by a dense Newton method in NumPy.
#[rustfmt::skip]
const PK1: [f64; 9] = [
    6.149991150121224e-07, 1.0954968381666093e-07, 8.768152088715524e-09,
    1.0425200347948875e-07, -1.2054212637095344e-10, -2.3714575089806494e-08,
    7.001871553380709e-09, -2.9906044812725463e-08, 2.4947673773164943e-07,
];
/// The energy of the frozen network, computed likewise.
const ENERGY: f64 = 2.684522924677931e-08;

fn frozen_rve(context: &Context) {
    let network = support::frozen();
    let f = Matrix3::new(1.08, 0.03, 0.0, 0.01, 0.97, 0.02, 0.0, -0.02, 1.01);
    let mut bench = support::Bench::<Petsc>::within(context, &network, None);
    let mut rve = bench.at_rest();
    bench.solve(&mut rve, &f).unwrap();
    let pk1 = bench.pk1();
    assert!((pk1 - Matrix3::from_row_slice(&PK1)).amax() < 1e-9 * pk1.amax(), "{pk1}");
    assert!((bench.energy() - ENERGY).abs() < 1e-9 * ENERGY, "{}", bench.energy());
    let tangent = bench.tangent(&rve);
    #[cfg(feature = "sparse")]
    assert_same_tangent::<biotissue::backends::sparse::Sparse>(&tangent, &f);
    #[cfg(feature = "dense")]
    assert_same_tangent::<biotissue::backends::dense::Dense>(&tangent, &f);
    assert!((tangent - tangent.transpose()).amax() < 1e-9 * tangent.amax());
}

#[cfg(any(feature = "sparse", feature = "dense"))]
fn assert_same_tangent<B>(tangent: &biotissue::fiber::homogenize::Tangent, f: &Matrix3<f64>)
where
    B: biotissue::las::RealBackend<Context = ()>,
{
    let mut bench = support::Bench::<B>::new(&support::frozen(), None);
    let mut rve = bench.at_rest();
    bench.solve(&mut rve, f).unwrap();
    let other = bench.tangent(&rve);
    assert!((tangent - other).amax() < 1e-9 * other.amax(), "{tangent} {other}");
}

/// For a network of several thousand fibers on any number of ranks, the stress agrees with that of the sparse backend
/// in one process. `examples/large_network.rs` compares numbers of ranks for a hundred thousand fibers.
#[cfg(all(feature = "sparse", feature = "generate"))]
fn generated_network(context: &Context) {
    let network = Arc::new(biotissue::fiber::network::generate::delaunay(500, 1).unwrap());
    assert!(network.fibers().len() > 4000);
    let material = Some(support::laws()[1].clone());
    let f = Matrix3::new(1.1, 0.05, 0.0, 0.0, 0.95, 0.02, 0.0, 0.0, 1.0);
    let mut bench = support::Bench::<Petsc>::within(context, &network, material.clone());
    let mut rve = bench.at_rest();
    bench.solve(&mut rve, &f).unwrap();
    let mut alone = support::Bench::<biotissue::backends::sparse::Sparse>::new(&network, material);
    let mut rve = alone.at_rest();
    alone.solve(&mut rve, &f).unwrap();
    let (pk1, expected) = (bench.pk1(), alone.pk1());
    assert!((pk1 - expected).amax() < 4e-10 * expected.amax(), "{pk1} {expected}");
}

/// The supports of a block of 24 tetrahedra that is pulled to a stretch of 1.25.
fn pulled_block() -> Conditions {
    let side = |name: &str, x| SurfaceCondition {
        surface: name.into(),
        displacement: [Some(x), None, None],
        curve: LoadCurve::Ramp,
    };
    let point =
        |node, displacement| PointCondition { place: PointLocation::Node(node), displacement, curve: LoadCurve::Ramp };
    Conditions {
        surfaces: vec![side("left", 0.0), side("right", 0.5)],
        points: vec![point(6, [Some(0.0); 3]), point(5, [None, None, Some(0.0)])],
        ..Conditions::default()
    }
}

/// A block of 24 tetrahedra is pulled to a stretch of 1.25. The exact solution is homogeneous, with the lateral stretch
/// `s` from `mu (s^2 - 1) + lambda ln(1.25 s^2) = 0`.
fn stretched_body(context: &Context) {
    let (mu, lambda) = (3846.0, 5769.0);
    let conditions = pulled_block();
    let mut s: f64 = 1.0;
    for _ in 0..50 {
        s -= (mu * (s * s - 1.0) + lambda * (1.25 * s * s).ln()) / (2.0 * mu * s + 2.0 * lambda / s);
    }
    let mesh = Arc::new(bar_of_24::mesh());
    let mut order: Vec<u32> = (0..mesh.nodes().len() as u32).collect();
    for _ in 0..2 {
        let field = FormulaField::uniform(NeoHookean { mu, lambda }, &mesh);
        let params = StepParams { count: 4, ..StepParams::default() };
        let mut stepper =
            Stepper::<Petsc, _>::in_order(&order, context, Arc::clone(&mesh), &conditions, field, params).unwrap();
        assert_eq!(stepper.run(&mut ()).unwrap().len(), 4);
        for (x, u) in bar_of_24::NODES.iter().zip(&stepper.state().displacements) {
            let exact = [0.25 * (x[0] + 1.0), (s - 1.0) * (x[1] + 1.0), (s - 1.0) * x[2]];
            assert!((0..3).all(|i| (u[i] - exact[i]).abs() < 1e-9), "{x:?}: {u:?}, exact {exact:?}");
        }
        // The second run has the unknowns in reverse order.
        order.reverse();
    }
}

/// The same block, pulled at constant volume: the lateral stretch is `s = 1.25^(-1/2)`, and the pressure that removes the
/// lateral stress `mu (s^2 - 1)`. All ranks compute the same pressure.
fn constrained_body(context: &Context) {
    let (mu, lambda, s) = (3846.0, 5769.0, 1.25_f64.sqrt().recip());
    let mesh = Arc::new(bar_of_24::mesh());
    for method in [ConstraintMethod::Multiplier, ConstraintMethod::Penalty { factor: 100.0 }] {
        let of = ConstrainedVolume::Region("*".into());
        let constraint = VolumeConstraint { name: "block".into(), of, curve: None, method };
        let conditions = Conditions { constraints: vec![constraint], ..pulled_block() };
        let field = FormulaField::uniform(NeoHookean { mu, lambda }, &mesh);
        let params = StepParams { count: 4, ..StepParams::default() };
        let mut stepper = Stepper::<Petsc, _>::new(context, Arc::clone(&mesh), &conditions, field, params).unwrap();
        stepper.run(&mut ()).unwrap();
        let state = stepper.state();
        for (x, u) in bar_of_24::NODES.iter().zip(&state.displacements) {
            let exact = [0.25 * (x[0] + 1.0), (s - 1.0) * (x[1] + 1.0), (s - 1.0) * x[2]];
            assert!((0..3).all(|i| (u[i] - exact[i]).abs() < 1e-6), "{x:?}: {u:?}, exact {exact:?}");
        }
        let (pressure, expected) = (state.volumes[0].pressure, mu * (s * s - 1.0));
        assert!((pressure - expected).abs() < 1e-6 * mu, "{pressure} {expected}");
        let bits = pressure.to_bits();
        let mut bits_of_all = vec![0_u64; SimpleCommunicator::world().size() as usize];
        SimpleCommunicator::world().all_gather_into(&bits, &mut bits_of_all[..]);
        assert!(bits_of_all.iter().all(|&other| other == bits), "{bits_of_all:?}");
    }
}

/// Each row is owned by exactly one rank, and no rank owns a constrained row.
fn owned_rows(context: &Context) {
    let a = Petsc::matrix(context, &laplacian_pattern(5)).unwrap();
    let owned: Vec<i32> = (0..25).map(|row| i32::from(a.owns_any_row(&[row]))).collect();
    let mut all = vec![0; 25];
    SimpleCommunicator::world().all_reduce_into(&owned[..], &mut all[..], SystemOperation::sum());
    assert_eq!(all, [1; 25]);
    assert!(!a.owns_any_row(&[-1]) && !a.owns_any_row(&[]));
    assert!(a.owns_any_row(&(-1..25).collect::<Vec<_>>()));
}

/// Factors the stiffness at rest of a box of cells with unit edges; `fixed` selects the fixed nodes by their position.
fn factored(
    context: &Context,
    cells: [usize; 3],
    symmetry: Symmetry,
    fixed: impl Fn([f64; 3]) -> bool,
) -> Result<FactorReport, SolveError<<Petsc as Backend>::Error>> {
    let mesh = shapes::cuboid(cells, cells.map(|count| count as f64)).unwrap();
    let unknowns = Unknowns::new(mesh.nodes().len(), |node, _| fixed(mesh.nodes()[node])).unwrap();
    let pattern = Arc::new(unknowns.pattern(&mesh).unwrap());
    let mut matrix = Petsc::matrix(context, &pattern).unwrap();
    let assembler = Assembler::<Petsc>::new(geometry(&mesh).unwrap(), &unknowns, &matrix).unwrap();
    let at_rest = NeoHookean { mu: 3.0, lambda: 5.0 }.evaluate(&Matrix3::identity()).unwrap().tangent;
    let mut responses = PointResponses::zeros(mesh.points().len());
    responses.tangent.fill(at_rest);
    assembler.stiffness(&vec![[0.0; 3]; mesh.nodes().len()], &[], &responses, &mut matrix).unwrap();
    matrix.finish().unwrap();
    let symbolic = Petsc::analyze(context, &pattern, &SolverParams::new(symmetry)).unwrap();
    Petsc::solver(&symbolic).unwrap().factor(&matrix)
}

/// A body on a hinge is reported as singular although rounding errors make all pivots nonzero; a slender beam with
/// sufficient supports is not, although its pivots are small.
fn floating_bodies(context: &Context) {
    for symmetry in [Symmetry::Definite, Symmetry::Symmetric] {
        let hinged = factored(context, [6; 3], symmetry, |x| x[0] == 0.0 && x[1] == 0.0);
        assert!(matches!(hinged, Err(SolveError::Singular { .. })), "{symmetry:?}: {hinged:?}");
        let beam = factored(context, [100, 1, 1], symmetry, |x| x[0] == 0.0);
        assert!(beam.is_ok(), "{symmetry:?}: {beam:?}");
    }
}
