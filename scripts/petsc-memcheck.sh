#!/usr/bin/env bash
# Runs the tests of the backend `petsc` under valgrind: all on one rank; on two ranks without those of the solvers, which
# would take too long. Arguments go to cargo when it builds the tests.
set -euo pipefail
cd "$(dirname "$0")/.."

build=("$@" --no-default-features --features petsc --test petsc --no-run)
cargo test --quiet "${build[@]}"
program=$(cargo test "${build[@]}" 2>&1 | sed -n 's/.*(\(.*petsc-[0-9a-f]*\))$/\1/p')
export BIOTISSUE_PETSC_TEST=1 OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
bash scripts/memcheck.sh "$program"
mpirun --oversubscribe -n 2 bash scripts/memcheck.sh "$program" vectors matrices blocks mixed verbs options \
    errors iterative split rve body
