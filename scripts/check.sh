#!/usr/bin/env bash
# Runs every check that scripts/test.sh does not: format, lints and documentation on sets of features, tests of single
# backends and of the Python package, C and Fortran programs and PETSc under valgrind, the overhead of the abstraction, and
# MPI by MPICH.
#
# Needs what scripts/test.sh needs, and installs it in the same way.
set -euo pipefail
cd "$(dirname "$0")/.."
source scripts/test-env.sh

# Features of one build each: all that have tests of their own.
sets=("default" "" "sparse" "dense" "petsc" "default batched capi cuda hwloc metis petsc")
# For any two features (but cuda and hwloc), and any third that the two do not imply, one set has the two without it.
pairs=(
    "metis sparse dense capi petsc mpi" "app generate batched capi petsc mpi" "app generate metis sparse dense batched"
    "generate metis sparse batched petsc mpi" "app generate sparse dense capi mpi" "generate dense batched capi"
    "app generate dense petsc mpi" "metis sparse batched capi mpi" "app generate metis sparse capi"
    "sparse dense batched petsc mpi" "generate" "app" "app dense" "mpi" "cuda hwloc"
)

say "format"
cargo fmt --all --check

# rustc checks a crate on one core, and optimizes a release build on one: what needs no feature of the tests is built beside
# the lints of the sets, in a folder of its own.
beside=${CARGO_TARGET_DIR:-$PWD/target}/beside
build_beside() {
    for features in "${pairs[@]}"; do
        say "lints: $features"
        cargo clippy --quiet --lib --bins --no-default-features --features "$features" -- -D warnings
    done
    cargo build --quiet --release --package overhead --features petsc --bin overhead
}
report=$(mktemp)
(CARGO_TARGET_DIR=$beside build_beside) >"$report" 2>&1 &
other=$!
trap 'kill "$other" 2>/dev/null || true; rm -f "$report"' EXIT
for features in "${sets[@]}"; do
    say "lints and documentation: ${features:-no features}"
    cargo clippy --quiet --all-targets --no-default-features --features "$features" -- -D warnings
    RUSTDOCFLAGS="-D warnings" cargo doc --quiet --no-deps --no-default-features --features "$features"
done
say "lints: packages that use the library"
cargo clippy --quiet --workspace --exclude biotissue --all-targets --features downstream/petsc,overhead/petsc,studies/petsc -- -D warnings
outcome=0
wait "$other" || outcome=$?
cat "$report"
[ "$outcome" -eq 0 ]

for features in "dense" "petsc"; do
    say "tests: $features alone"
    cargo test --quiet --no-default-features --features "$features" --lib --tests
done
say "tests: packages that use the library, and examples"
cargo test --quiet --package custom-law --package custom-material --package downstream --package micro-scaling --package reactions --features downstream/petsc
# With the packages of both, cargo chooses the same features of all dependencies as for the Python package alone: one build
# of the library serves the example and that package.
cargo build --quiet --package biotissue --package biotissue-python --example deposition
target/debug/examples/deposition
cargo build --quiet --features petsc --example many_matrices
for ranks in 1 2; do
    mpirun --oversubscribe -n "$ranks" target/debug/examples/many_matrices
done

say "tests: Python package"
bash scripts/python.sh
say "tests: C and Fortran, under valgrind"
bash scripts/capi.sh
say "tests: PETSc without the checks of debug builds, and under valgrind"
cargo test --quiet --config profile.dev.package.biotissue.debug-assertions=false \
    --config profile.dev.package.biotissue.overflow-checks=false --no-default-features --features petsc --test petsc
bash scripts/petsc-memcheck.sh
say "tests: MPI by MPICH"
bash scripts/mpich.sh
say "overhead of the abstraction, in instructions"
CARGO_TARGET_DIR=$beside cargo run --quiet --release --package overhead --features petsc --bin overhead
say "all checks passed"
