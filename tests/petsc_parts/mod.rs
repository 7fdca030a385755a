//! Systems of which each rank holds a part, compared with the same systems of which every rank has copies.

mod solvers;
mod truss;

use biotissue::backends::petsc::{Context, MatrixType, Petsc};
use biotissue::las::{
    Backend, Entries, MatMat, MatVec, MatrixOps, RankRows, SolveError, Solver, SolverParams, VectorOps,
};

pub use solvers::{
    direct, fallback, iterative, multigrid_of_copies, named_rows, not_converged, singular, solve_nothing,
};
use truss::{Division, on_all, on_communicators, same_on_all};

const SIZE: [usize; 3] = [5, 4, 3];

/// Values without a pattern.
fn value(row: usize) -> f64 {
    (1.7 * row as f64).sin() + 0.1
}

pub fn vectors(context: &Context) {
    on_all(context, SIZE, true, |both| {
        let (own, name) = (both.rows.own.len(), &both.name);
        let numbers: Vec<i32> = (0..both.rows.local() as i32).collect();
        let (inside, ghosts) = numbers.split_at(own);
        let global = |local: &i32| both.rows.global_row(*local as usize);
        let values: Vec<f64> = numbers.iter().map(|local| value(global(local))).collect();
        let mut v = Petsc::vector(&both.parts, own).unwrap();
        assert_eq!((v.len(), v.as_slice().len()), (own, own), "{name}");
        v.set(&numbers, &values).unwrap();
        let mut read = vec![f64::NAN; ghosts.len()];
        v.get(ghosts, &mut read).unwrap();
        assert!(read.iter().all(|&read| read == 0.0), "a write to a ghost is dropped, {name}");
        v.add(ghosts, &values[own..]).unwrap();
        v.add(&[-1], &[1.0]).unwrap();
        v.finish().unwrap();
        let [whole, other] = both.vectors(value);
        let mut held = vec![f64::NAN; numbers.len()];
        v.get(&numbers, &mut held).unwrap();
        assert_eq!(held, values, "{name}");
        v.with_local(|local| assert_eq!(local, &values[..own])).unwrap();
        // The copies of the ghosts take part in `axpy` and `zero`, without communication.
        let mut twice = Petsc::vector(&both.parts, own).unwrap();
        twice.axpy(2.0, &other).unwrap();
        twice.get(&numbers, &mut held).unwrap();
        assert!(held.iter().zip(&values).all(|(twice, value)| *twice == 2.0 * value), "{name}");
        twice.zero().unwrap();
        twice.get(&numbers, &mut held).unwrap();
        assert!(held.iter().all(|&held| held == 0.0), "{name}");
        let (norm, dot) = (v.norm().unwrap(), v.dot(&other).unwrap());
        both.assert_same_on_all(norm, "norm");
        both.assert_same_on_all(dot, "dot product");
        assert!((norm - whole.norm().unwrap()).abs() < 1e-14 * norm, "{name}");
        assert!((dot - whole.dot(&whole).unwrap()).abs() < 1e-14 * dot, "{name}");
        assert_eq!(norm.to_bits(), v.norm().unwrap().to_bits(), "{name}");
        assert_eq!(twice.norm().unwrap(), 0.0, "{name}");
        for scale in [1e-200, 1e200] {
            let mut scaled = Petsc::vector(&both.parts, own).unwrap();
            scaled.axpy(scale, &v).unwrap();
            let found = scaled.norm().unwrap();
            both.assert_same_on_all(found, "norm");
            assert!((found - scale * norm).abs() < 1e-14 * found, "{found:e}, {name}");
        }
        let (_, mut broken) = (inside, both.vectors(value));
        if both.rows.own.contains(&40) {
            broken[1].as_mut_slice()[40 - both.rows.own.start] = f64::NAN;
        }
        assert!(broken[1].norm().unwrap().is_nan(), "{name}");
    });
}

pub fn sums(context: &Context) {
    on_communicators(context, |context| {
        let (rank, ranks) = (context.rank(), context.ranks());
        let rows = RankRows { own: rank..rank + 1, ghosts: Vec::new(), total: ranks };
        let parts = Petsc::with_rows(context, rows).unwrap().unwrap();
        let own = [1.0 / (rank as f64 + 3.0), 1.0, -(rank as f64)];
        let (mut sums, mut largest, mut of_copies) = (own, own, own);
        Petsc::sum(&parts, &mut sums).unwrap();
        Petsc::max(&parts, &mut largest).unwrap();
        let expected: f64 = (0..ranks).map(|rank| 1.0 / (rank as f64 + 3.0)).sum();
        assert_eq!(sums, [expected, ranks as f64, -((ranks * (ranks - 1) / 2) as f64)]);
        assert_eq!(largest, [1.0 / 3.0, 1.0, 0.0]);
        sums.iter().for_each(|&sum| same_on_all(&parts, sum, "sum"));
        Petsc::sum(context, &mut of_copies).unwrap();
        Petsc::max(context, &mut of_copies).unwrap();
        assert_eq!(of_copies, own);
        let mut nan = [if rank == 0 { f64::NAN } else { 1.0 }];
        Petsc::max(&parts, &mut nan).unwrap();
        assert!(nan[0].is_nan());
        Petsc::sum(&parts, &mut []).unwrap();
    });
}

pub fn matrices(context: &Context) {
    on_all(context, SIZE, true, |both| {
        let ([whole, mut part], name) = (both.matrices(), &both.name);
        assert_eq!(part.shape(), (both.rows.own.len(), both.rows.local()));
        let all: Vec<i32> = (0..both.rows.total as i32).collect();
        let numbers: Vec<i32> = (0..both.rows.local() as i32).collect();
        let mut expected = vec![0.0; all.len() * all.len()];
        whole.get(&all, &all, &mut expected).unwrap();
        let check = |part: &truss::Matrix, zeroed: Option<usize>| {
            let mut found = vec![f64::NAN; numbers.len() * numbers.len()];
            part.get(&numbers, &numbers, &mut found).unwrap();
            for (k, found) in found.into_iter().enumerate() {
                let (local, column) = (k / numbers.len(), both.rows.global_row(k % numbers.len()));
                let row = both.rows.global_row(local);
                let is_zero = local >= both.rows.own.len() || zeroed == Some(row);
                let expected = if is_zero { 0.0 } else { expected[row * all.len() + column] };
                assert!((found - expected).abs() < 1e-14, "({row}, {column}): {found}, not {expected}; {name}");
            }
        };
        check(&part, None);
        assert!(
            numbers.iter().all(|&number| part.owns_any_row(&[number]) == ((number as usize) < both.rows.own.len()))
        );
        let [mut y, x, mut d] = [|_| 0.0, value, |_| 0.0].map(|value: fn(usize) -> f64| both.vectors(value));
        whole.mul(&x[0], &mut y[0]).unwrap();
        part.mul(&x[1], &mut y[1]).unwrap();
        both.assert_equal(&y, 1e-14, "product");
        whole.diagonal(&mut d[0]).unwrap();
        part.diagonal(&mut d[1]).unwrap();
        both.assert_equal(&d, 1e-15, "diagonal");
        whole.inverse_diagonal(&mut d[0]).unwrap();
        part.inverse_diagonal(&mut d[1]).unwrap();
        both.assert_equal(&d, 1e-15, "inverse of the diagonal");
        // Zeroed rows make the matrix unsymmetric.
        for row in [0, both.rows.total / 2] {
            let ([mut whole, mut part], local) = (both.matrices(), both.rows.local_number(row));
            whole.zero_rows(&[row as i32]).unwrap();
            part.zero_rows(&[local.map_or(-1, |local| local as i32)]).unwrap();
            whole.finish().unwrap();
            part.finish().unwrap();
            check(&part, Some(row));
            whole.mul_transpose(&x[0], &mut y[0]).unwrap();
            part.mul_transpose(&x[1], &mut y[1]).unwrap();
            both.assert_equal(&y, 1e-14, "transposed product");
        }
        part.scale(2.0).unwrap();
        whole.mul(&x[0], &mut y[0]).unwrap();
        y[0].as_mut_slice().iter_mut().for_each(|y| *y *= 2.0);
        part.mul(&x[1], &mut y[1]).unwrap();
        both.assert_equal(&y, 1e-14, "product after scaling");
    });
}

/// An error on one rank is an error on all, and the ranks can go on afterward.
pub fn errors(context: &Context) {
    on_communicators(context, |context| {
        let (rank, ranks) = (context.rank(), context.ranks());
        let good = RankRows { own: 3 * rank..3 * rank + 3, ghosts: Vec::new(), total: 3 * ranks };
        let is_last = rank + 1 == ranks;
        let cases: [(&str, RankRows); 6] = [
            ("begin at", RankRows { own: good.own.start + usize::from(is_last)..good.own.end, ..good.clone() }),
            ("own", RankRows { own: good.own.start..good.own.end - usize::from(is_last), ..good.clone() }),
            ("is row 0", RankRows { ghosts: vec![0; 2 * usize::from(is_last)], ..good.clone() }),
            ("ghost", RankRows { ghosts: vec![good.own.start as u32; usize::from(is_last)], ..good.clone() }),
            ("ghost", RankRows { ghosts: vec![3 * ranks as u32; usize::from(is_last)], ..good.clone() }),
            ("row", RankRows { total: good.total + usize::from(is_last), ..good.clone() }),
        ];
        for (text, rows) in cases {
            let error = Petsc::with_rows(context, rows.clone()).unwrap_err().to_string();
            assert!(error.contains(text), "{rows:?}: {error}");
        }
        let both = truss::Both::new(context, truss::Truss::new(SIZE, true), Division::Uneven);
        let error = Petsc::vector(&both.parts, both.rows.own.len() + 1).unwrap_err().to_string();
        assert!(error.contains("own rows"), "{error}");
        let wrong = if is_last { &both.whole_pattern } else { &both.pattern };
        if ranks > 1 {
            assert!(Petsc::matrix(&both.parts, wrong).is_err());
            assert!(Petsc::analyze(&both.parts, wrong, &SolverParams::default()).is_err());
        }
        let [_, a] = both.matrices();
        assert!(a.for_each(|_, _, _| ()).unwrap_err().text().contains("part of a matrix"));
        assert!(Entries::pattern(&a).is_err());
        for outcome in [a.sum(1.0, &a, 1.0), a.product(&a), a.transpose()] {
            assert!(matches!(outcome, Err(SolveError::Unsupported { backend: "petsc", .. })));
        }
        let [whole, mut part] = both.vectors(value);
        if ranks > 1 {
            assert!(part.dot(&whole).is_err() && whole.dot(&part).is_err() && part.axpy(1.0, &whole).is_err());
        }
        // Blocks of the format `baij` are not used.
        let in_blocks = both.parts.clone().with_matrix_type(MatrixType::Baij);
        assert_eq!(Petsc::matrix(&in_blocks, &both.pattern).unwrap().matrix_type(), MatrixType::Aij);
        let symbolic = Petsc::analyze(&both.parts, &both.pattern, &SolverParams::default()).unwrap();
        let mut solver = Petsc::solver(&symbolic).unwrap();
        assert!(solver.set_near_null_space(&[vec![1.0; both.rows.own.len() + usize::from(is_last)]]).is_err());
        solver.factor(&a).unwrap();
    });
}
