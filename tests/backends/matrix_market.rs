//! Matrix Market files written and read by all backends and by another library; transfer of matrices and vectors
//! between backends.

use std::path::Path;

use biotissue::backends::{dense::Dense, sparse::Sparse};
use biotissue::las::conformance::Random;
use biotissue::las::market::{self, MarketError};
use biotissue::las::{Backend, Entries, MatrixOps, Scalar, transfer};

/// Returns the nonzero entries.
fn entries<B: Backend<Scalar: Scalar, Matrix: Entries<B>>>(a: &B::Matrix) -> Vec<(usize, usize, f64)> {
    let mut entries = Vec::new();
    a.for_each(|row, column, value| entries.push((row, column, value.as_f64()))).unwrap();
    entries.retain(|&(.., value)| value != 0.0);
    entries
}

/// Returns a matrix whose entries have many decimal digits.
fn matrix(unknowns: usize) -> biotissue::backends::sparse::Matrix {
    let mut random = Random::new(unknowns as u64);
    let pattern = random.elements(unknowns);
    let mut a = Sparse::<f64>::matrix(&(), &pattern).unwrap();
    for value in a.values_mut() {
        *value = random.signed() * 10f64.powi(random.below(40) as i32 - 20) / 3.0;
    }
    a
}

#[test]
fn a_written_matrix_is_read_back_bitwise() {
    let dir = tempfile::tempdir().unwrap();
    for unknowns in [1, 5, 60] {
        let (file, a) = (dir.path().join("a.mtx"), matrix(unknowns));
        market::write::<Sparse>(&file, &a).unwrap();
        let expected = entries::<Sparse>(&a);
        assert!(entries::<Sparse>(&market::read::<Sparse>(&file, &()).unwrap()) == expected, "{unknowns}");
        let dense = market::read::<Dense>(&file, &()).unwrap();
        assert!(entries::<Dense>(&dense) == expected, "{unknowns}, dense");
        market::write::<Dense>(&file, &dense).unwrap();
        assert!(entries::<Sparse>(&market::read::<Sparse>(&file, &()).unwrap()) == expected, "{unknowns}, from dense");
        let rounded = market::read::<Sparse<f32>>(&file, &()).unwrap();
        let exact = |(&single, &double): (&f32, &f64)| single == double as f32;
        assert!(rounded.values().iter().zip(dense.values()).all(exact), "{unknowns}, rounded");
    }
}

#[test]
fn another_library_reads_and_writes_the_same_matrix() {
    let dir = tempfile::tempdir().unwrap();
    let (file, a) = (dir.path().join("a.mtx"), matrix(30));
    market::write::<Sparse>(&file, &a).unwrap();
    let other: sprs::CsMat<f64> = sprs::io::read_matrix_market::<f64, usize, _>(&file).unwrap().to_csr();
    let all = other.iter().map(|(&value, (row, column))| (row, column, value));
    let theirs: Vec<_> = all.filter(|&(.., value)| value != 0.0).collect();
    assert!(theirs == entries::<Sparse>(&a), "sprs reads other entries");
    sprs::io::write_matrix_market(&file, &other).unwrap();
    assert!(entries::<Sparse>(&market::read::<Sparse>(&file, &()).unwrap()) == theirs, "we read other entries");
}

#[test]
fn errors_name_the_missing_file() {
    let error = market::read::<Sparse>(Path::new("no/such.mtx"), &()).unwrap_err();
    assert!(matches!(error, MarketError::Input(_)) && error.to_string().starts_with("no/such.mtx: "), "{error}");
    let error = market::write::<Sparse>(Path::new("no/such.mtx"), &matrix(2)).unwrap_err();
    assert!(error.to_string().starts_with("no/such.mtx cannot be written"), "{error}");
}

#[test]
fn matrices_and_vectors_are_transferred_between_backends() {
    let a = matrix(40);
    let dense = transfer::matrix::<Sparse, Dense>(&a, &()).unwrap();
    assert_eq!(entries::<Dense>(&dense), entries::<Sparse>(&a));
    let back = transfer::matrix::<Dense, Sparse>(&dense, &()).unwrap();
    assert_eq!(entries::<Sparse>(&back), entries::<Sparse>(&a));
    assert_eq!(MatrixOps::<Sparse>::shape(&back), (40, 40));
    let rounded = transfer::matrix::<Sparse, Sparse<f32>>(&a, &()).unwrap();
    assert!(rounded.values().iter().zip(a.values()).all(|(&to, &from)| to == from as f32));
    let x = vec![1.0 / 3.0, -2.0].into();
    assert_eq!(transfer::vector::<Sparse, Dense<f32>>(&x, &()).unwrap().as_slice(), [1.0_f32 / 3.0, -2.0]);
    let mut y = vec![7.0, 7.0].into();
    transfer::vector_into::<Sparse, Dense>(&x, &mut y).unwrap();
    assert_eq!(y.as_slice(), [1.0 / 3.0, -2.0]);
    let error = transfer::vector_into::<Sparse, Dense>(&x, &mut vec![7.0].into()).unwrap_err();
    assert_eq!(error.to_string(), "a vector of 2 entries does not fit into one of 1");
}
