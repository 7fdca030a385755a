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
# For any two features (but cuda and hwloc) of which the first does not imply the second, one set has the first without the
# second; of the combinations of three, nine tenths occur.
pairs=(
    "metis sparse dense capi petsc mpi" "generate metis sparse batched petsc mpi" "generate dense batched capi"
    "app generate dense petsc mpi" "metis sparse batched capi mpi" "app generate metis sparse capi" "cuda hwloc"
)

say "format"
cargo fmt --all --check

# rustc checks a crate on one core, and optimizes a release build on one: these run beside the tests, in a folder of their
# own, where no build of a test has to wait for them, and at the lowest priority, because ranks of MPI that wait for each other
# keep all cores busy.
beside=${CARGO_TARGET_DIR:-$PWD/target}/beside
lint_and_build() {
    renice -n 19 -p "$BASHPID" >/dev/null
    for features in "${sets[@]}"; do
        say "lints and documentation: ${features:-no features}"
        cargo clippy --quiet --all-targets --no-default-features --features "$features" -- -D warnings
        RUSTDOCFLAGS="-D warnings" cargo doc --quiet --no-deps --no-default-features --features "$features"
    done
    for features in "${pairs[@]}"; do
        say "lints: $features"
        cargo clippy --quiet --lib --bins --no-default-features --features "$features" -- -D warnings
    done
    say "lints: packages that use the library"
    cargo clippy --quiet --workspace --exclude biotissue --all-targets --features downstream/petsc,overhead/petsc,studies/petsc -- -D warnings
    say "build: overhead of the abstraction"
    cargo build --quiet --release --package overhead --features petsc --bin overhead
    say "all lints passed"
}
(CARGO_TARGET_DIR=$beside lint_and_build) &
lints=$!
trap 'kill "$lints" 2>/dev/null || true' EXIT

say "tests: dense alone"
cargo test --quiet --no-default-features --features dense --lib --tests
say "tests: petsc alone, without the checks of debug builds"
unchecked=(--config profile.dev.package.biotissue.debug-assertions=false --config profile.dev.package.biotissue.overflow-checks=false)
cargo test --quiet "${unchecked[@]}" --no-default-features --features petsc --lib --tests
say "tests: PETSc under valgrind"
bash scripts/petsc-memcheck.sh "${unchecked[@]}"
say "tests: C and Fortran, under valgrind"
bash scripts/capi.sh
say "tests: Python package"
bash scripts/python.sh
say "tests: packages that use the library, and examples"
cargo test --quiet --package custom-law --package custom-material --package downstream --package micro-scaling --package reactions --features downstream/petsc
# The build of scripts/test.sh.
cargo build --quiet --features batched,capi,cuda,hwloc,metis,petsc --bin biotissue --example deposition --example many_matrices
target/debug/examples/deposition
for ranks in 1 2; do
    mpirun --oversubscribe -n "$ranks" target/debug/examples/many_matrices
done
say "tests: published networks"
BIOTISSUE_PROGRAM=${CARGO_TARGET_DIR:-target}/debug/biotissue bash scripts/public-cases.sh 0
say "tests: MPI by MPICH"
bash scripts/mpich.sh
say "lints"
wait "$lints"
say "overhead of the abstraction, in instructions"
CARGO_TARGET_DIR=$beside cargo run --quiet --release --package overhead --features petsc --bin overhead
say "all checks passed"
