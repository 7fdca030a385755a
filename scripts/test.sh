#!/usr/bin/env bash
# Passes every check of the project: format, lints, documentation and tests on every feature set.
#
# Needs Rust and Python; installs what else is missing: MPI, PETSc, a Fortran compiler and valgrind as packages of the
# system, and meshio and vtk, in a folder of its own, for the tests that read results back with an independent reader.
# Published networks are used where BIOTISSUE_NETWORKS names their folder, or where they lie in a folder beside this checkout.
set -euo pipefail
cd "$(dirname "$0")/.."

# Minutes since the start stand before each section: where the time of this command goes.
say() { printf '\n== %d:%02d %s\n' $((SECONDS / 60)) $((SECONDS % 60)) "$*"; }

say "tools of the tests"
bash scripts/install-test-tools.sh

if [ -z "${BIOTISSUE_NETWORKS:-}" ]; then
    found=$(find ../*/data -maxdepth 1 -name Network_2_7.txt -print -quit 2>/dev/null || true)
    if [ -n "$found" ]; then
        BIOTISSUE_NETWORKS=$(cd "$(dirname "$found")" && pwd)
        export BIOTISSUE_NETWORKS
    fi
fi
say "published networks: ${BIOTISSUE_NETWORKS:-none, their tests say that they skip}"

say "independent readers of VTK files: meshio and VTK itself"
python="$PWD/target/python"
if [ ! -x "$python/bin/python3" ]; then
    rm -rf "$python"
    python3 -m venv "$python"
fi
"$python/bin/pip" install --quiet --disable-pip-version-check meshio vtk
export PATH="$python/bin:$PATH" BIOTISSUE_REQUIRE_PYTHON=1

say "format"
cargo fmt --all --check

# Each line: the features of one set, and of the crates downstream where they are checked with it.
sets=(
    "--features default"
    "--no-default-features"
    "--no-default-features --features sparse"
    "--no-default-features --features dense"
    "--no-default-features --features generate"
    "--no-default-features --features dense,app"
    "--no-default-features --features batched"
    "--no-default-features --features cuda"
    "--workspace --features default,metis,batched"
    "--no-default-features --features mpi"
    "--no-default-features --features petsc"
    "--workspace --features default,petsc"
)
for features in "${sets[@]}"; do
    say "lints: $features"
    # shellcheck disable=SC2086
    cargo clippy --quiet --all-targets $features -- -D warnings
done

say "documentation"
for features in "${sets[@]}"; do
    # shellcheck disable=SC2086
    RUSTDOCFLAGS="-D warnings" cargo doc --quiet --no-deps $features
done

say "tests, all features"
cargo test --features default
for features in "--no-default-features --features sparse" "--no-default-features --features dense"; do
    say "tests: $features"
    # shellcheck disable=SC2086
    cargo test --quiet $features
done

say "tests: lanes, and orders of elimination by METIS"
cargo test --quiet --features batched,metis --lib --test backends -- sparse batched

# In one build: the library is compiled once for all of these.
all=(--quiet --workspace --features petsc)
say "tests: PETSc on 1, 2 and 4 ranks, and crates downstream"
cargo test "${all[@]}" --test petsc --bin custom-law --bin downstream
cargo test --quiet --release --no-default-features --features petsc --test petsc

say "tests: examples that check themselves"
cargo build "${all[@]}" --example deposition --example many_matrices
examples="${CARGO_TARGET_DIR:-target}/debug/examples"
"$examples/deposition"
export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 OPENBLAS_NUM_THREADS=1
for ranks in 1 2; do
    mpirun --oversubscribe -n "$ranks" "$examples/many_matrices"
done

say "everything passed"
