//! Tests of the Krylov methods on the compiled backends.
#![cfg(any(feature = "sparse", feature = "dense"))]

use std::sync::Arc;

use crate::las::{
    Backend, FactorReport, Factorization, Iterative, Krylov, MatrixOps, Preconditioner, RealBackend, SolveError,
    Solver, SolverParams, Sparsity, Symmetry, VectorOps,
};

const METHODS: [Krylov; 3] = [Krylov::Cg, Krylov::BiCgStab, Krylov::Gmres { restart: 20 }];

/// The five-point Laplacian on a square of `side` by `side` cells, with a convection term that makes it unsymmetric.
fn laplacian<B: RealBackend<Index = i32, Context = ()>>(side: i32, drift: f64) -> (Arc<Sparsity>, B::Matrix) {
    let at = |i: i32, j: i32| i * side + j;
    let pairs = (0..side).flat_map(|i| {
        (0..side).flat_map(move |j| [[at(i, j), at((i + 1) % side, j)], [at(i, j), at(i, (j + 1) % side)]])
    });
    let pattern = Arc::new(Sparsity::from_elements((side * side) as usize, pairs).unwrap());
    let mut a = B::matrix(&(), &pattern).unwrap();
    for i in 0..side {
        for j in 0..side {
            a.add(&[at(i, j)], &[at(i, j)], &[4.0]).unwrap();
            for (k, l, v) in [(i - 1, j, -1.0 - drift), (i + 1, j, -1.0 + drift), (i, j - 1, -1.0), (i, j + 1, -1.0)] {
                if (0..side).contains(&k) && (0..side).contains(&l) {
                    a.add(&[at(i, j)], &[at(k, l)], &[v]).unwrap();
                }
            }
        }
    }
    a.finish().unwrap();
    (pattern, a)
}

fn solve<B: RealBackend<Index = i32, Context = ()>>(
    (pattern, a): &(Arc<Sparsity>, B::Matrix),
    method: Iterative,
) -> Result<(usize, Vec<f64>), SolveError<B::Error>> {
    let params = SolverParams::new(Symmetry::None).iterative(method);
    let mut solver = B::solver(&B::analyze(&(), pattern, &params)?)?;
    assert_eq!(solver.factor(a)?.kind, Factorization::Approximate);
    let (mut b, mut x) = (B::vector(&(), pattern.rows()).unwrap(), B::vector(&(), pattern.rows()).unwrap());
    b.with_local_mut(|b| b.iter_mut().enumerate().for_each(|(k, b)| *b = ((k % 7) as f64).sin())).unwrap();
    let report = solver.solve(&b, &mut x)?;
    assert!(report.iterations > 0 && report.residual <= method.tolerance, "{report:?}");
    Ok((report.iterations, x.with_local(<[f64]>::to_vec).unwrap()))
}

fn agree_with_the_direct_solver<B: RealBackend<Index = i32, Context = ()>>() {
    for drift in [0.0, 0.3] {
        let system = laplacian::<B>(12, drift);
        let mut direct = B::solver(&B::analyze(&(), &system.0, &SolverParams::new(Symmetry::None)).unwrap()).unwrap();
        direct.factor(&system.1).unwrap();
        let (mut b, mut x) = (B::vector(&(), 144).unwrap(), B::vector(&(), 144).unwrap());
        b.with_local_mut(|b| b.iter_mut().enumerate().for_each(|(k, b)| *b = ((k % 7) as f64).sin())).unwrap();
        direct.solve(&b, &mut x).unwrap();
        let exact = x.with_local(<[f64]>::to_vec).unwrap();
        for krylov in METHODS.into_iter().filter(|&krylov| drift == 0.0 || krylov != Krylov::Cg) {
            for preconditioner in [Preconditioner::None, Preconditioner::Diagonal] {
                let method = Iterative { krylov, preconditioner, tolerance: 1e-12, ..Iterative::default() };
                let (iterations, x) = solve::<B>(&system, method).unwrap();
                let apart = x.iter().zip(&exact).fold(0.0_f64, |most, (x, e)| most.max((x - e).abs()));
                assert!(apart < 1e-10, "{krylov:?}, {preconditioner:?}: {apart:e} after {iterations}");
            }
        }
    }
}

/// A matrix that cannot be factored leaves no earlier one to solve with, nor does a tolerance out of range pass.
fn a_failed_factorization_discards_the_earlier_one<B: RealBackend<Index = i32, Context = ()>>(with_ilut: bool) {
    type Fail<B> = fn(
        &mut <B as Backend>::Solver,
        &<B as Backend>::Matrix,
    ) -> Result<FactorReport, SolveError<<B as Backend>::Error>>;
    let fails: [Fail<B>; 3] = [B::Solver::factor, B::Solver::update, B::Solver::factor_definite];
    let ((pattern, good), (_, mut bad)) = (laplacian::<B>(5, 0.0), laplacian::<B>(5, 0.0));
    let n = pattern.rows();
    bad.add(&[3], &[3], &[f64::NAN]).unwrap();
    bad.finish().unwrap();
    let (_, other) = laplacian::<B>(4, 0.0);
    let (mut b, mut x) = (B::vector(&(), n).unwrap(), B::vector(&(), n).unwrap());
    b.with_local_mut(|b| b.fill(1.0)).unwrap();
    let (ilut, restart) = (Preconditioner::Ilut { drop_tolerance: 1e-3, fill: 20 }, 1_000_000);
    let mut methods = vec![
        Iterative { preconditioner: Preconditioner::None, ..Iterative::new(Krylov::Gmres { restart }) },
        Iterative { preconditioner: Preconditioner::Diagonal, ..Iterative::new(Krylov::BiCgStab) },
        Iterative::new(Krylov::Cg),
    ];
    if with_ilut {
        methods.push(Iterative { preconditioner: ilut, ..Iterative::new(Krylov::BiCgStab) });
        methods.push(Iterative { preconditioner: Preconditioner::Multigrid, ..Iterative::new(Krylov::Cg) });
    }
    for method in methods {
        let params = SolverParams::new(Symmetry::Definite).iterative(method);
        let mut solver = B::solver(&B::analyze(&(), &pattern, &params).unwrap()).unwrap();
        for fail in fails {
            solver.factor(&good).unwrap();
            solver.solve(&b, &mut x).unwrap();
            assert!(matches!(fail(&mut solver, &bad), Err(SolveError::NotFinite { row: 3 })), "{method:?}");
            assert!(matches!(solver.solve(&b, &mut x), Err(SolveError::NotFactored)), "{method:?}");
            solver.factor(&good).unwrap();
            assert!(matches!(fail(&mut solver, &other), Err(SolveError::Size { .. })), "{method:?}");
            assert!(matches!(solver.solve(&b, &mut x), Err(SolveError::NotFactored)), "{method:?}");
        }
        solver.factor(&good).unwrap();
        for tolerance in [0.0, 1.0, 2.0, -1.0, f64::NAN] {
            solver.set_tolerance(tolerance);
            assert!(matches!(solver.solve(&b, &mut x), Err(SolveError::Parameter(_))), "{method:?}: {tolerance}");
        }
        solver.set_tolerance(1e-6);
        solver.solve(&b, &mut x).unwrap();
    }
}

#[test]
#[cfg(feature = "dense")]
fn dense_discards_a_failed_factorization() {
    a_failed_factorization_discards_the_earlier_one::<crate::backends::dense::Dense>(false);
}

#[test]
#[cfg(feature = "sparse")]
fn sparse_discards_a_failed_factorization() {
    a_failed_factorization_discards_the_earlier_one::<crate::backends::sparse::Sparse>(true);
}

#[test]
#[cfg(feature = "dense")]
fn dense_agrees() {
    agree_with_the_direct_solver::<crate::backends::dense::Dense>();
}

#[cfg(feature = "sparse")]
mod sparse {
    use super::*;
    use crate::backends::sparse::Sparse;
    use crate::las::conformance::{DenseReference, Random};
    use crate::las::{Backend, StopReason};

    const COMPLETE: Preconditioner = Preconditioner::Ilut { drop_tolerance: 0.0, fill: usize::MAX };

    #[test]
    fn agrees() {
        agree_with_the_direct_solver::<Sparse>();
    }

    #[test]
    fn a_complete_factorization_needs_one_iteration() {
        for krylov in METHODS {
            let method = Iterative { krylov, preconditioner: COMPLETE, tolerance: 1e-12, ..Iterative::default() };
            assert_eq!(solve::<Sparse>(&laplacian::<Sparse>(12, 0.0), method).unwrap().0, 1, "{krylov:?}");
        }
    }

    #[test]
    fn more_fill_takes_fewer_iterations() {
        let system = laplacian::<Sparse>(40, 0.2);
        for krylov in [Krylov::BiCgStab, Krylov::Gmres { restart: 40 }] {
            let iterations = [(1e-1, 2), (1e-2, 5), (1e-3, 10), (1e-4, 40)].map(|(drop_tolerance, fill)| {
                let preconditioner = Preconditioner::Ilut { drop_tolerance, fill };
                solve::<Sparse>(&system, Iterative { krylov, preconditioner, ..Iterative::default() }).unwrap().0
            });
            assert!(iterations.is_sorted_by(|a, b| a > b), "{krylov:?}: {iterations:?}");
        }
    }

    #[test]
    fn a_solve_that_does_not_converge_reports_its_residual() {
        let method = Iterative {
            krylov: Krylov::Cg,
            preconditioner: Preconditioner::None,
            max_iterations: 3,
            ..Iterative::default()
        };
        let error = solve::<Sparse>(&laplacian::<Sparse>(12, 0.0), method).unwrap_err();
        let SolveError::NotConverged {
            method: "CG",
            iterations: 3,
            residual,
            stop_reason: StopReason::MaxIterations,
            ..
        } = error
        else {
            panic!("{error}")
        };
        assert!(residual > 1e-10 && residual < 1.0, "{residual}");
        // Conjugate gradients detect a matrix that is not positive definite.
        let mut random = Random::new(7);
        let pattern = random.elements(30);
        let oracle = DenseReference::dominant(&mut random, &pattern, |i| if i == 5 { -1.0 } else { 1.0 });
        let mut a = Sparse::<f64>::matrix(&(), &pattern).unwrap();
        for row in 0..30 {
            for &c in pattern.row(row) {
                let value = oracle.values[row * 30 + c as usize];
                MatrixOps::<Sparse>::set(&mut a, &[row as i32], &[c as i32], &[value]).unwrap();
            }
        }
        let method = Iterative { max_iterations: 100, ..method };
        let error = solve::<Sparse>(&(pattern, a), method).unwrap_err();
        assert!(matches!(error, SolveError::NotConverged { stop_reason: StopReason::Breakdown, .. }), "{error}");
    }

    #[test]
    fn stagnation_at_the_rounding_limit_is_reported() {
        let (krylov, preconditioner) = (Krylov::Cg, Preconditioner::Diagonal);
        let method = Iterative { krylov, preconditioner, tolerance: 1e-30, max_iterations: 100_000 };
        let error = solve::<Sparse>(&laplacian::<Sparse>(12, 0.0), method).unwrap_err();
        let SolveError::NotConverged { stop_reason: StopReason::Stagnated, residual, .. } = error else {
            panic!("{error}")
        };
        assert!(residual < 1e-13, "{residual:e}");
    }

    #[test]
    fn a_nonfinite_right_hand_side_is_rejected() {
        let (pattern, a) = laplacian::<Sparse>(3, 0.0);
        let params = SolverParams::default().iterative(Iterative::new(Krylov::Cg));
        let mut solver = Sparse::<f64>::solver(&Sparse::<f64>::analyze(&(), &pattern, &params).unwrap()).unwrap();
        solver.factor(&a).unwrap();
        let (mut b, mut x) = (Sparse::<f64>::vector(&(), 9).unwrap(), Sparse::<f64>::vector(&(), 9).unwrap());
        b.set(&[4], &[f64::NAN]).unwrap();
        assert_eq!(solver.solve(&b, &mut x), Err(SolveError::RhsNotFinite));
    }
}
