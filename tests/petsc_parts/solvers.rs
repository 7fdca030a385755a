//! Solvers of systems in parts.

use std::sync::Arc;

use biotissue::backends::petsc::{Context, Petsc};
use biotissue::las::{
    Backend, Factorization, Iterative, Krylov, MatrixOps, Preconditioner, RankRows, SolveError, SolveReport, Solver,
    SolverParams, Sparsity, StopReason, Symmetry, VectorOps,
};

use super::truss::{Both, Division, Matrix, Truss, Vector, on_all, on_communicators, same_on_all};
use super::{SIZE, value};

type Failure = SolveError<<Petsc as Backend>::Error>;

fn solver(context: &Context, pattern: &Arc<Sparsity>, params: &SolverParams) -> <Petsc as Backend>::Solver {
    Petsc::solver(&Petsc::analyze(context, pattern, params).unwrap()).unwrap()
}

fn solvers(both: &Both, params: &SolverParams) -> [<Petsc as Backend>::Solver; 2] {
    [solver(&both.copies, &both.whole_pattern, params), solver(&both.parts, &both.pattern, params)]
}

/// Solves with several right-hand sides as copies and in parts, and compares all solutions with those of `direct`.
pub fn direct(context: &Context) {
    on_all(context, SIZE, true, |both| {
        let ([whole, part], name) = (both.matrices(), &both.name);
        for (symmetry, kind) in [
            (Symmetry::Definite, Factorization::Cholesky),
            (Symmetry::Symmetric, Factorization::Ldlt),
            (Symmetry::None, Factorization::Lu),
        ] {
            let [mut of_copies, mut of_parts] = solvers(both, &SolverParams::new(symmetry));
            let report = of_parts.factor(&part).unwrap();
            assert_eq!((report.kind, report.indefinite_at), (kind, None), "{name}");
            of_copies.factor(&whole).unwrap();
            if symmetry != Symmetry::None {
                assert_eq!(of_parts.factor_definite(&part).unwrap().negative_pivots, Some(0), "{name}");
            }
            let (b, mut x) = (both.vectors(value), both.vectors(|_| 7.0));
            of_copies.solve(&b[0], &mut x[0]).unwrap();
            of_parts.solve(&b[1], &mut x[1]).unwrap();
            both.assert_equal(&x, 1e-10, "direct solution");
            solve_many(both, &mut of_copies, &mut of_parts);
        }
    });
}

fn solve_many(both: &Both, of_copies: &mut impl Solver<Petsc>, of_parts: &mut impl Solver<Petsc>) {
    let right: Vec<[Vector; 2]> = (1..4).map(|k| both.vectors(move |row| value(k * row))).collect();
    let (b, of_part): (Vec<_>, Vec<_>) = right.into_iter().map(|[whole, part]| (whole, part)).unzip();
    let (mut x, mut y): (Vec<_>, Vec<_>) =
        (0..3).map(|_| both.vectors(|_| 7.0)).map(|[whole, part]| (whole, part)).unzip();
    of_copies.solve_many(&b, &mut x).unwrap();
    of_parts.solve_many(&of_part, &mut y).unwrap();
    for (whole, part) in x.into_iter().zip(y) {
        both.assert_equal(&[whole, part], 1e-10, "one of many solutions");
    }
}

pub fn iterative(context: &Context) {
    on_all(context, SIZE, true, |both| {
        let ([whole, part], name) = (both.matrices(), &both.name);
        for (krylov, preconditioner) in [
            (Krylov::Cg, Preconditioner::None),
            (Krylov::Cg, Preconditioner::Diagonal),
            (Krylov::Cg, Preconditioner::Multigrid),
            (Krylov::BiCgStab, Preconditioner::Diagonal),
            (Krylov::Gmres { restart: 60 }, Preconditioner::Multigrid),
        ] {
            let method = Iterative { krylov, preconditioner, tolerance: 1e-13, max_iterations: 2000 };
            let mut of_copies = solver(&both.copies, &both.whole_pattern, &SolverParams::default());
            let mut of_parts = solver(&both.parts, &both.pattern, &SolverParams::default().iterative(method));
            assert_eq!(of_parts.uses_near_null_space(), preconditioner == Preconditioner::Multigrid);
            of_parts.set_near_null_space(&both.truss.rigid_motions(both.rows.own.clone())).unwrap();
            of_copies.factor(&whole).unwrap();
            assert_eq!(of_parts.factor_definite(&part).unwrap().kind, Factorization::Approximate, "{name}");
            let (b, mut x) = (both.vectors(value), both.vectors(|_| 7.0));
            of_copies.solve(&b[0], &mut x[0]).unwrap();
            let report = of_parts.solve(&b[1], &mut x[1]).unwrap();
            assert!(report.iterations > 0 && report.residual <= 1e-13, "{method:?} {report:?} {name}");
            both.assert_same_on_all(report.residual, "residual");
            both.assert_equal(&x, 1e-10, "iterative solution");
            let again = of_parts.solve(&b[1], &mut x[1]).unwrap();
            assert_eq!(again, report, "{name}");
            solve_many(both, &mut of_copies, &mut of_parts);
            let zero = both.vectors(|_| 0.0);
            of_parts.solve(&zero[1], &mut x[1]).unwrap();
            assert_eq!(x[1].norm().unwrap(), 0.0, "{name}");
        }
    });
}

/// Returns the report of CG with multigrid, in parts or as copies, with or without the rigid motions.
fn by_multigrid(both: &Both, is_part: bool, with_motions: bool) -> SolveReport {
    let method = Iterative { preconditioner: Preconditioner::Multigrid, ..Iterative::new(Krylov::Cg) };
    let params = SolverParams::default().iterative(method);
    let of = usize::from(is_part);
    let mut solver = if is_part {
        solver(&both.parts, &both.pattern, &params)
    } else {
        solver(&both.copies, &both.whole_pattern, &params)
    };
    if with_motions {
        let rows = if is_part { both.rows.own.clone() } else { 0..both.rows.total };
        let mut motions = both.truss.rigid_motions(rows);
        // A vector that depends on the others is left out.
        motions.push(motions[0].iter().zip(&motions[4]).map(|(a, b)| a + 2.0 * b).collect());
        solver.set_near_null_space(&motions).unwrap();
    }
    solver.factor(&both.matrices()[of]).unwrap();
    let (b, mut x) = (both.vectors(value), both.vectors(|_| 0.0));
    let report = solver.solve(&b[of], &mut x[of]).unwrap();
    let mut direct = solvers(both, &SolverParams::default());
    direct[0].factor(&both.matrices()[0]).unwrap();
    let mut expected = both.vectors(|_| 0.0);
    direct[0].solve(&b[0], &mut expected[0]).unwrap();
    let [whole, _] = expected;
    if is_part {
        let [_, part] = x;
        both.assert_equal(&[whole, part], 1e-7, "solution by multigrid");
    } else {
        let error = whole.as_slice().iter().zip(x[0].as_slice()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(error < 1e-7 * whole.norm().unwrap(), "{error:e}");
    }
    report
}

/// The rigid motions make multigrid of elasticity converge in fewer iterations, as copies and in parts.
pub fn multigrid_of_copies(context: &Context) {
    let both = Both::new(context, Truss::new([25, 5, 5], true), Division::Uneven);
    for is_part in [false, true] {
        let [with, without] = [true, false].map(|with| by_multigrid(&both, is_part, with).iterations);
        assert!(2 * with < without, "in parts: {is_part}; {with} iterations with rigid motions, {without} without");
    }
}

/// A truss without supports is singular, and all ranks name the same unknown.
pub fn singular(context: &Context) {
    on_all(context, SIZE, false, |both| {
        let ([whole, part], name) = (both.matrices(), &both.name);
        for symmetry in [Symmetry::Definite, Symmetry::Symmetric, Symmetry::None] {
            let [mut of_copies, mut of_parts] = solvers(both, &SolverParams::new(symmetry));
            let expected = of_copies.factor(&whole);
            assert!(matches!(expected, Err(SolveError::Singular { .. })), "{symmetry:?} {expected:?} {name}");
            match of_parts.factor(&part) {
                Err(SolveError::Singular { unknown, ratio, .. }) => {
                    assert!(unknown < both.rows.total, "{name}");
                    both.assert_same_on_all(unknown as f64, "the unknown");
                    both.assert_same_on_all(ratio, "the ratio");
                }
                other => panic!("{symmetry:?} {name}: {other:?}"),
            }
        }
    });
}

/// A system of uncoupled unknowns; the diagonal entry of one of them is special.
struct Diagonal {
    parts: Context,
    pattern: Arc<Sparsity>,
    own: std::ops::Range<usize>,
}

impl Diagonal {
    fn new(context: &Context, total: usize, division: Division) -> Self {
        let own = division.own(total, context.rank(), context.ranks());
        let len = own.len() as u32;
        let pattern = Arc::new(Sparsity::from_rows(own.len(), (0..=len).collect(), (0..len).collect()).unwrap());
        let rows = RankRows { own: own.clone(), ghosts: Vec::new(), total };
        Self { parts: Petsc::with_rows(context, rows).unwrap().unwrap(), pattern, own }
    }

    fn matrix(&self, special: usize, value: f64) -> Matrix {
        let mut a = Petsc::matrix(&self.parts, &self.pattern).unwrap();
        for (local, row) in self.own.clone().enumerate() {
            let entry = if row == special { value } else { 1.0 + (row % 5) as f64 };
            a.add(&[local as i32], &[local as i32], &[entry]).unwrap();
        }
        a.finish().unwrap();
        a
    }

    fn factor(&self, params: &SolverParams, special: usize, value: f64, definite: bool) -> Result<(), Failure> {
        let (mut solver, a) = (solver(&self.parts, &self.pattern, params), self.matrix(special, value));
        if definite { solver.factor_definite(&a) } else { solver.factor(&a) }.map(drop)
    }
}

/// Errors name global rows, on all ranks alike.
pub fn named_rows(context: &Context) {
    on_communicators(context, |context| {
        for division in [Division::Uneven, Division::EmptyRank] {
            let system = Diagonal::new(context, 42, division);
            let direct = SolverParams::default();
            let cg = direct.iterative(Iterative::new(Krylov::Cg));
            for special in [0, 17, 41] {
                let bad = system.factor(&direct, special, f64::NAN, false);
                assert_eq!(bad, Err(SolveError::NotFinite { row: special }), "{division:?}");
                for symmetry in [Symmetry::Definite, Symmetry::Symmetric, Symmetry::None] {
                    match system.factor(&SolverParams::new(symmetry), special, 0.0, false) {
                        Err(SolveError::Singular { unknown, .. }) => assert_eq!(unknown, special, "{symmetry:?}"),
                        other => panic!("{division:?} {symmetry:?}: {other:?}"),
                    }
                }
                let bad = system.factor(&cg, special, 0.0, false);
                assert_eq!(bad, Err(SolveError::ZeroDiagonal { row: special }), "{division:?}");
                for params in [direct, cg] {
                    let bad = system.factor(&params, special, -1.0, true);
                    assert_eq!(bad, Err(SolveError::Indefinite { unknown: Some(special) }), "{division:?}");
                }
                let mut indefinite = solver(&system.parts, &system.pattern, &direct);
                let report = indefinite.factor(&system.matrix(special, -1.0)).unwrap();
                assert_eq!((report.indefinite_at, report.negative_pivots), (Some(special), Some(1)), "{division:?}");
                // All ranks know that a diagonal entry is negative, so that none searches for a null vector.
                system.factor(&SolverParams::new(Symmetry::Symmetric), special, -1e-12, false).unwrap();
                // Without a preconditioner, the direct method takes over. It finds the zero pivot.
                let mut replaced = cg;
                replaced.fallback = true;
                let bad = system.factor(&replaced, special, 0.0, false);
                assert!(matches!(bad, Err(SolveError::Singular { unknown, .. }) if unknown == special), "{bad:?}");
            }
        }
    });
}

fn three_iterations() -> SolverParams {
    let method = Iterative { max_iterations: 3, preconditioner: Preconditioner::None, ..Iterative::new(Krylov::Cg) };
    SolverParams::default().iterative(method)
}

pub fn not_converged(context: &Context) {
    on_all(context, SIZE, true, |both| {
        let [mut of_copies, mut of_parts] = solvers(both, &three_iterations());
        let [whole, part] = both.matrices();
        of_copies.factor(&whole).unwrap();
        of_parts.factor(&part).unwrap();
        let (b, mut x) = (both.vectors(value), both.vectors(|_| 7.0));
        let failures = [of_copies.solve(&b[0], &mut x[0]), of_parts.solve(&b[1], &mut x[1])];
        let residuals = failures.map(|failure| match failure {
            Err(SolveError::NotConverged {
                iterations: 3, residual, stop_reason: StopReason::MaxIterations, ..
            }) => residual,
            other => panic!("{}: {other:?}", both.name),
        });
        assert!((residuals[0] - residuals[1]).abs() < 1e-10 * residuals[0], "{residuals:?}, {}", both.name);
        both.assert_same_on_all(residuals[1], "residual");
        let infinite = both.vectors(|row| if row == 50 { f64::INFINITY } else { 1.0 });
        assert_eq!(of_parts.solve(&infinite[1], &mut x[1]), Err(SolveError::RhsNotFinite), "{}", both.name);
    });
}

/// Where the iterations do not converge, the direct method solves, as copies and in parts.
pub fn fallback(context: &Context) {
    on_all(context, SIZE, true, |both| {
        let mut params = three_iterations();
        params.fallback = true;
        let [mut of_copies, mut of_parts] = solvers(both, &params);
        let mut direct = solver(&both.copies, &both.whole_pattern, &SolverParams::default());
        let [whole, part] = both.matrices();
        direct.factor(&whole).unwrap();
        of_copies.factor(&whole).unwrap();
        of_parts.factor(&part).unwrap();
        let (b, mut x, mut expected) = (both.vectors(value), both.vectors(|_| 7.0), both.vectors(|_| 0.0));
        direct.solve(&b[0], &mut expected[0]).unwrap();
        for fallbacks in [1, 0] {
            let reports = [of_copies.solve(&b[0], &mut x[0]), of_parts.solve(&b[1], &mut x[1])];
            for report in reports {
                assert_eq!(report.unwrap().fallbacks, fallbacks, "{}", both.name);
            }
            let error = expected[0].as_slice().iter().zip(x[0].as_slice()).map(|(a, b)| (a - b).abs());
            assert!(error.fold(0.0, f64::max) < 1e-12 * expected[0].norm().unwrap());
            both.assert_equal(&x, 1e-10, "solution of the direct method");
        }
        // The direct method serves updated matrices too, until the next factorization.
        of_copies.update(&whole).unwrap();
        of_parts.update(&part).unwrap();
        assert_eq!(of_parts.solve(&b[1], &mut x[1]).unwrap().fallbacks, 0, "{}", both.name);
        of_parts.factor(&part).unwrap();
        assert_eq!(of_parts.solve(&b[1], &mut x[1]).unwrap().fallbacks, 1, "{}", both.name);
    });
}

/// A system without unknowns, and one without entries.
pub fn solve_nothing(context: &Context) {
    on_communicators(context, |context| {
        let none = Diagonal::new(context, 0, Division::Uneven);
        for params in [SolverParams::default(), three_iterations()] {
            let mut solver = solver(&none.parts, &none.pattern, &params);
            solver.factor(&none.matrix(0, 0.0)).unwrap();
            let [b, mut x] = [(); 2].map(|()| Petsc::vector(&none.parts, 0).unwrap());
            assert_eq!(b.norm().unwrap(), 0.0);
            solver.solve(&b, &mut x).unwrap();
        }
        let system = Diagonal::new(context, 42, Division::EmptyRank);
        let len = system.own.len();
        let pattern = Arc::new(Sparsity::from_rows(len, vec![0; len + 1], Vec::new()).unwrap());
        let mut a = Petsc::matrix(&system.parts, &pattern).unwrap();
        a.finish().unwrap();
        match solver(&system.parts, &pattern, &SolverParams::default()).factor(&a) {
            Err(SolveError::Singular { unknown, .. }) => same_on_all(&system.parts, unknown as f64, "the unknown"),
            other => panic!("{other:?}"),
        }
    });
}
