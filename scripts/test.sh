#!/usr/bin/env bash
# Runs all tests in one build of the default features, MPI, PETSc and all other backends.
#
# Needs Rust and Python. Installs missing tools: MPI, PETSc, a Fortran compiler, valgrind and Chromium as packages of the system,
# and meshio and vtk in a folder of their own. Arguments go to `cargo test`, for example: --test rve -- relaxation
#
# Tests of published networks look for them in the folder that BIOTISSUE_NETWORKS names, or in a folder next to this
# checkout. Without the networks these tests are skipped; with BIOTISSUE_REQUIRE_NETWORKS=1 this script fails instead.
set -euo pipefail
cd "$(dirname "$0")/.."
source scripts/test-env.sh

features=(--features batched,capi,cuda,hwloc,metis,petsc)
if [ $# -gt 0 ]; then
    exec cargo test "${features[@]}" "$@"
fi
cargo test --quiet "${features[@]}" --lib --bins --tests --examples
cargo test --quiet "${features[@]}" --doc
say "all tests passed"
