//! Cost of assembly on PETSc: 10 000 blocks of 6x6 added to a matrix of 9 000 unknowns, by the verbs and by direct
//! calls of PETSc's functions.
//!
//! On two cores with AVX2 and PETSc 3.18: `MatSetValues` by hand took 4.9 ms, `add` 4.8 ms when it still called
//! `MatSetValues` (it now writes to the arrays of the matrix), `add_at` 0.49 ms, `MatSetValuesCOO` by hand 0.56 ms.
#![allow(unsafe_code, reason = "calls PETSc by hand, to compare")]

use std::ffi::{c_int, c_void};
use std::hint::black_box;
use std::sync::Arc;

use biotissue::backends::petsc::{Context, Petsc};
use biotissue::las::conformance::Random;
use biotissue::las::{Backend, MatrixOps, Sparsity};
use criterion::{Criterion, criterion_group, criterion_main};

unsafe extern "C" {
    fn MatSetValues(
        mat: *mut c_void,
        m: c_int,
        rows: *const c_int,
        n: c_int,
        cols: *const c_int,
        values: *const f64,
        mode: c_int,
    ) -> c_int;
    fn MatZeroEntries(mat: *mut c_void) -> c_int;
    fn MatAssemblyBegin(mat: *mut c_void, kind: c_int) -> c_int;
    fn MatAssemblyEnd(mat: *mut c_void, kind: c_int) -> c_int;
    fn MatSetPreallocationCOO(mat: *mut c_void, count: isize, rows: *mut c_int, cols: *mut c_int) -> c_int;
    fn MatSetValuesCOO(mat: *mut c_void, values: *const f64, mode: c_int) -> c_int;
}

const INSERT_VALUES: c_int = 1;
const ADD_VALUES: c_int = 2;

fn blocks(nodes: usize, count: usize) -> Vec<[i32; 6]> {
    let mut random = Random::new(1);
    let bar = |_| {
        let first = random.below(nodes);
        let second = (first + 1 + random.below(40)) % nodes;
        let three = |node: usize| [0, 1, 2].map(|k| (3 * node + k) as i32);
        let ([a, b, c], [d, e, f]) = (three(first), three(second));
        [a, b, c, d, e, f]
    };
    (0..count).map(bar).collect()
}

fn assembly(c: &mut Criterion) {
    let context = Context::world().expect("PETSc starts");
    let blocks = blocks(3000, 10_000);
    let pattern = Arc::new(Sparsity::from_elements(9000, &blocks).expect("a pattern"));
    let mut matrix = Petsc::matrix(&context, &pattern).expect("a matrix");
    let values: [f64; 36] = std::array::from_fn(|k| k as f64);
    let mut slots = Vec::new();
    for rows in &blocks {
        matrix.locate(rows, rows, &mut slots).expect("in the pattern");
    }
    let mut group = c.benchmark_group("10 000 blocks of 6x6");
    group.sample_size(30);
    group.bench_function("MatSetValues by hand", |b| {
        let raw = matrix.as_ptr();
        // SAFETY: a live matrix, indices in range, one value per pair.
        b.iter(|| unsafe {
            assert_eq!(MatZeroEntries(raw), 0);
            for rows in &blocks {
                let (rows, values) = (rows.as_ptr(), black_box(&values).as_ptr());
                assert_eq!(MatSetValues(raw, 6, rows, 6, rows, values, ADD_VALUES), 0);
            }
            assert_eq!(MatAssemblyBegin(raw, 0), 0);
            assert_eq!(MatAssemblyEnd(raw, 0), 0);
        });
    });
    group.bench_function("add", |b| {
        b.iter(|| {
            matrix.zero().expect("no error");
            for rows in &blocks {
                matrix.add(rows, rows, black_box(&values)).expect("no error");
            }
            matrix.finish().expect("no error");
        });
    });
    group.bench_function("add_at", |b| {
        b.iter(|| {
            matrix.zero().expect("no error");
            for slots in slots.chunks_exact(36) {
                matrix.add_at(slots, black_box(&values)).expect("no error");
            }
            matrix.finish().expect("no error");
        });
    });
    // Runs last, because PETSc changes the storage of the matrix.
    let pairs = blocks.iter().flat_map(|rows| rows.iter().flat_map(|&row| rows.iter().map(move |&col| (row, col))));
    let (mut rows, mut cols): (Vec<c_int>, Vec<c_int>) = pairs.unzip();
    let coo = Petsc::matrix(&context, &pattern).expect("a matrix");
    // SAFETY: a live matrix that is used only through this pointer; as many rows as columns.
    let code =
        unsafe { MatSetPreallocationCOO(coo.as_ptr(), rows.len() as isize, rows.as_mut_ptr(), cols.as_mut_ptr()) };
    assert_eq!(code, 0);
    let mut all = vec![0.0; rows.len()];
    group.bench_function("MatSetValuesCOO by hand", |b| {
        b.iter(|| {
            for block in all.chunks_exact_mut(36) {
                block.copy_from_slice(black_box(&values));
            }
            // SAFETY: one value per pair.
            assert_eq!(unsafe { MatSetValuesCOO(coo.as_ptr(), all.as_ptr(), INSERT_VALUES) }, 0);
        });
    });
    group.finish();
}

criterion_group!(benches, assembly);
criterion_main!(benches);
