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
<<<<<<< HEAD
    "--no-default-features --features petsc"
    "--features default,batched,capi,metis,petsc"
=======
    "--no-default-features --features generate"
    "--no-default-features --features dense,app"
    "--no-default-features --features batched"
    "--no-default-features --features cuda"
    "--workspace --features default,metis,batched"
    "--no-default-features --features mpi"
    "--no-default-features --features petsc"
    "--workspace --features default,petsc"
>>>>>>> examples
)
for features in "${sets[@]}"; do
    say "lints: $features"
    # shellcheck disable=SC2086
    cargo clippy --quiet --all-targets $features -- -D warnings
done
say "lints: the other packages"
others=(custom-law headers overhead overhead-unit)
cargo clippy --quiet --all-targets "${others[@]/#/--package=}" --features overhead/petsc -- -D warnings

say "lints: every pair of features"
if [ ! -x target/tools/bin/cargo-hack ]; then
    cargo install --quiet --locked --root target/tools --target-dir target/tools cargo-hack@0.6
fi
target/tools/bin/cargo-hack hack clippy --quiet --lib --feature-powerset --depth 2 --exclude-features default -- -D warnings

say "documentation"
for features in "${sets[@]}"; do
    # shellcheck disable=SC2086
    RUSTDOCFLAGS="-D warnings" cargo doc --quiet --no-deps $features
done

# Four whole sets.
say "tests: all default features"
cargo test --features default
for features in sparse,batched,metis dense petsc; do
    say "tests: $features alone"
    cargo test --quiet --no-default-features --features "$features"
done

say "tests: PETSc in an optimised build, and in the program"
cargo test --quiet --release --package biotissue --package overhead --no-default-features \
    --features biotissue/petsc,overhead/petsc --test petsc
cargo test --quiet --features petsc --test program -- petsc

<<<<<<< HEAD
say "tests: PETSc under valgrind, on one rank and on two"
bash scripts/petsc-memcheck.sh

say "tests: C and Fortran, under valgrind"
bash scripts/capi.sh

say "tests: what the abstraction costs, instruction by instruction"
cargo run --quiet --release --package overhead --features petsc

say "tests: packages that use the library"
cargo test --quiet --package custom-law
=======
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
>>>>>>> examples

say "everything passed"
