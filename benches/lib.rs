//! Benchmarks: `cargo bench --package benches --bench NAME`, where NAME is a file of this folder.
