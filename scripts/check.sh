#!/usr/bin/env bash
# Runs every check that scripts/test.sh does not: tests of single backends and of the Python package, C and Fortran programs and
# PETSc under valgrind, MPI by MPICH, and scripts/lint.sh; with the argument `tests`, all but the last.
#
# Needs what scripts/test.sh needs, and installs it in the same way.
set -euo pipefail
cd "$(dirname "$0")/.."
source scripts/test-env.sh

if [ "${1:-}" != tests ]; then
    source scripts/beside.sh
fi

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
if [ "${1:-}" != tests ]; then
    wait_for_lints
fi
say "all checks passed${1:+, lints excepted}"
