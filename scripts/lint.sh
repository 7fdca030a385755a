#!/usr/bin/env bash
# Checks lints and documentation on sets of features, and counts the instructions of the abstraction.
#
# scripts/check.sh and .ci/run run this script beside the tests: rustc checks a crate on one core, and optimizes a release build on
# one. It works in a folder of its own, where no build of a test has to wait for it, and at the lowest priority.
set -euo pipefail
cd "$(dirname "$0")/.."
bash scripts/install-test-tools.sh
renice -n 19 -p "$BASHPID" >/dev/null
export CARGO_TARGET_DIR=${CARGO_TARGET_DIR:-$PWD/target}/beside
export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 OPENBLAS_NUM_THREADS=1

# Prints a heading with the minutes and seconds since the start.
say() { printf '\n== lints %d:%02d %s\n' $((SECONDS / 60)) $((SECONDS % 60)) "$*"; }

# Features of one build each: all that have tests of their own.
sets=("default" "" "sparse" "dense" "petsc" "default batched capi cuda hwloc metis petsc")
# For any two features (but cuda and hwloc) of which the first does not imply the second, one set has the first without the
# second; of the combinations of three, nine tenths occur.
pairs=(
    "metis sparse dense capi petsc mpi" "generate metis sparse batched petsc mpi" "generate dense batched capi"
    "app generate dense petsc mpi" "metis sparse batched capi mpi" "app generate metis sparse capi" "cuda hwloc"
)

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
say "overhead of the abstraction, in instructions"
cargo run --quiet --release --package overhead --features petsc --bin overhead
say "all lints passed"
