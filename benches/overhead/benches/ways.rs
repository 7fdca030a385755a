//! The assembly loop, blocks of 12 by 12 of 10 368 tetrahedra (1296 for `dense`), in five ways of calling on every
//! backend.
//!
//! `cargo bench --package overhead [--features petsc]`

use criterion::{Criterion, criterion_group, criterion_main};
use overhead::{assembly, ways};

const SIDE: usize = 12;

fn loops(c: &mut Criterion) {
    for backend in ways::BACKENDS {
        // A dense matrix of this size would take 300 MB; the same loop runs on a smaller cube.
        let side = if *backend == "dense" { SIDE / 2 } else { SIDE };
        let mut group = c.benchmark_group(format!("12x12 blocks, {backend}"));
        group.sample_size(20);
        for way in ["raw", "las", "call", "table", "object"] {
            group.bench_function(way, |b| {
                b.iter_custom(|times| {
                    assembly::run(backend, way, side, times as usize).expect("the loop of a backend that is there")
                });
            });
        }
    }
}

criterion_group!(benches, loops);
criterion_main!(benches);
