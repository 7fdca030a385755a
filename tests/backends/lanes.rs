//! Systems of one pattern side by side: each lane gets what the backend `sparse` finds for its matrix alone.

use std::sync::Arc;

use biotissue::backends::batched::{Batched, Lanes, Matrix, Vector};
use biotissue::backends::sparse::{self, Sparse};
use biotissue::las::conformance::{DenseReference, Random};
use biotissue::las::{Backend, FactorReport, Solver, SolverParams, Sparsity, Symmetry};

/// Matrices of all kinds: definite ones and, in between, one that is indefinite, one that is singular, one that is not finite.
fn matrices(random: &mut Random, pattern: &Sparsity, count: usize) -> Vec<DenseReference> {
    let mut all: Vec<_> = (0..count).map(|_| DenseReference::dominant(random, pattern, |_| 1.0)).collect();
    let n = pattern.rows();
    all[1] = DenseReference::dominant(random, pattern, |row| if row % 5 == 1 { -1.0 } else { 1.0 });
    for k in 0..n {
        *all[2].at(4, k) = 0.0;
        *all[2].at(k, 4) = 0.0;
    }
    // Of each pair of entries, the factorization reads only one.
    let column = *pattern.row(0).last().unwrap() as usize;
    *all[3].at(0, column) = f64::NAN;
    all
}

fn values(pattern: &Sparsity, a: &DenseReference) -> Vec<f64> {
    (0..a.rows).flat_map(|row| pattern.row(row).iter().map(move |&column| a.get(row, column as usize))).collect()
}

fn batch<const N: usize>(pattern: &Arc<Sparsity>, all: &[DenseReference]) -> Matrix<f64, N> {
    let lanes: Vec<Vec<f64>> = all.iter().map(|a| values(pattern, a)).collect();
    let mut matrix = Matrix::zeros(pattern);
    for (entry, value) in matrix.values_mut().iter_mut().enumerate() {
        *value = Lanes(std::array::from_fn(|lane| lanes[lane][entry]));
    }
    matrix
}

/// The factorization and the solution of one matrix by the backend `sparse`.
fn alone(
    pattern: &Arc<Sparsity>,
    params: &SolverParams,
    a: &DenseReference,
    b: &[f64],
) -> Result<(FactorReport, Vec<f64>), String> {
    let mut matrix = sparse::Matrix::zeros(pattern);
    matrix.values_mut().copy_from_slice(&values(pattern, a));
    let mut solver = Sparse::<f64>::solver(&Sparse::<f64>::analyze(&(), pattern, params).unwrap()).unwrap();
    let report = solver.factor(&matrix).map_err(|error| error.to_string())?;
    let (b, mut x) = (b.to_vec().into(), sparse::Vector::from(vec![0.0; b.len()]));
    solver.solve(&b, &mut x).unwrap();
    Ok((report, x.as_slice().to_vec()))
}

fn right<const N: usize>(n: usize) -> Vector<f64, N> {
    (0..n).map(|k| Lanes(std::array::from_fn(|lane| (k % 7) as f64 - lane as f64))).collect::<Vec<_>>().into()
}

fn each_lane_is_as_alone<const N: usize>(symmetry: Symmetry) {
    let mut random = Random::new(17);
    let pattern = random.truss(30, 2);
    let (n, all) = (pattern.rows(), matrices(&mut random, &pattern, N));
    let params = SolverParams::new(symmetry);
    let symbolic = Batched::<f64, N>::analyze(&(), &pattern, &params).unwrap();
    #[cfg(target_arch = "x86_64")]
    {
        let has_vectors = match N {
            4 => is_x86_feature_detected!("avx2"),
            8 => is_x86_feature_detected!("avx512f"),
            _ => false,
        };
        assert_eq!(symbolic.uses_vectors(), has_vectors && symmetry != Symmetry::None);
    }
    let mut solver = Batched::<f64, N>::solver(&symbolic).unwrap();
    let matrix = batch::<N>(&pattern, &all);
    assert!(solver.factor(&matrix).is_err(), "one lane is singular, another not finite");
    let (b, mut x) = (right::<N>(n), Vector::from(vec![Lanes([0.0; N]); n]));
    assert!(solver.solve(&b, &mut x).is_err());
    let reports = solver.factor_lanes(&matrix).unwrap();
    solver.solve(&b, &mut x).unwrap();
    for (lane, (a, report)) in all.iter().zip(reports).enumerate() {
        let of_lane = |x: &Vector<f64, N>| x.as_slice().iter().map(|x| x.0[lane]).collect::<Vec<f64>>();
        let found = of_lane(&x);
        match (alone(&pattern, &params, a, &of_lane(&b)), report) {
            (Err(expected), Err(error)) => {
                assert_eq!(error.to_string(), expected, "lane {lane}");
                assert!(found.iter().all(|x| x.is_nan()), "lane {lane}");
            }
            (Ok((expected, alone)), Ok(report)) => {
                // LDL^T of `sparse` exchanges unknowns.
                let is_equal = (report.pivot_ratio / expected.pivot_ratio - 1.0).abs() < 1e-10;
                assert!(is_equal || symmetry == Symmetry::Symmetric, "lane {lane}: {report:?}, {expected:?}");
                assert_eq!(FactorReport { pivot_ratio: 1.0, ..report }, FactorReport { pivot_ratio: 1.0, ..expected });
                let size = alone.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
                assert!(alone.iter().zip(&found).all(|(x, y)| (x - y).abs() < 1e-12 * size), "lane {lane}");
            }
            (alone, report) => panic!("lane {lane}: {report:?} instead of {alone:?}"),
        }
    }
    the_neighbors_do_not_matter::<N>(&mut solver, &pattern, &all, &x);
}

/// Exchanges the matrices of all lanes but the first, and compares its bits.
fn the_neighbors_do_not_matter<const N: usize>(
    solver: &mut <Batched<f64, N> as Backend>::Solver,
    pattern: &Arc<Sparsity>,
    all: &[DenseReference],
    before: &Vector<f64, N>,
) {
    let mut shuffled = all.to_vec();
    shuffled[1..].reverse();
    solver.factor_lanes(&batch::<N>(pattern, &shuffled)).unwrap();
    let mut x = Vector::from(vec![Lanes([0.0; N]); pattern.rows()]);
    solver.solve(&right::<N>(pattern.rows()), &mut x).unwrap();
    let first = |x: &Vector<f64, N>| x.as_slice().iter().map(|x| x.0[0].to_bits()).collect::<Vec<u64>>();
    assert_eq!(first(&x), first(before));
}

#[test]
fn each_lane_gets_what_it_gets_alone() {
    for symmetry in [Symmetry::Definite, Symmetry::Symmetric, Symmetry::None] {
        each_lane_is_as_alone::<4>(symmetry);
        each_lane_is_as_alone::<5>(symmetry);
        each_lane_is_as_alone::<8>(symmetry);
    }
}
