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

# From nothing, what would help a second build only makes the first longer.
if [ ! -d target/debug ]; then
    export CARGO_INCREMENTAL=0
fi

say "format"
cargo fmt --all --check

# Each line: the features of one set.
sets=(
    "--features default"
    "--no-default-features"
    "--no-default-features --features sparse"
    "--no-default-features --features dense"
    "--no-default-features --features petsc"
)
# All of them, so that what needs several shares one build.
everything=(--quiet --features biotissue/batched,biotissue/capi,biotissue/metis,biotissue/petsc,downstream/petsc)
# Beside the tests, since much of both keeps one core busy: lints of every pair of features (without `cuda`, which brings
# nothing), and the documentation. What it says comes at the end. It starts from what the lints have found out of all
# dependencies.
beside() {
    export CARGO_TARGET_DIR=$PWD/target/beside
    if [ ! -d target/beside/debug ]; then
        mkdir -p target/beside/debug
        cp -a target/debug/.fingerprint target/debug/build target/debug/deps target/beside/debug/
    fi
    if [ ! -x target/tools/bin/cargo-hack ]; then
        cargo install --quiet --debug --locked --root target/tools --target-dir target/tools cargo-hack
    fi
    target/tools/bin/cargo-hack hack clippy --quiet --lib --feature-powerset --depth 2 --exclude-features default,cuda,hwloc \
        -- -D warnings
    cargo clippy --quiet --lib --features cuda,hwloc -- -D warnings
    for features in "${sets[@]}" "--features batched,capi,metis,petsc"; do
        # shellcheck disable=SC2086
        RUSTDOCFLAGS="-D warnings" cargo doc --quiet --no-deps $features
    done
}
for features in "${sets[@]}"; do
    say "lints: $features"
    # shellcheck disable=SC2086
    cargo clippy --quiet --all-targets $features -- -D warnings
done
say "lints: everything, with the other packages"
cargo clippy "${everything[@]}" --workspace --all-targets --features overhead/petsc -- -D warnings

(set -e; beside) >target/beside.log 2>&1 &
lane=$!
trap 'kill "$lane" 2>/dev/null || true' EXIT

# Four whole sets. The examples, which the lints have checked, are built where they run.
tests() {
    cargo test --lib --bins --tests "$@"
    cargo test --doc "$@"
}
say "tests: default features"
tests --features default
for features in sparse,batched,metis dense petsc; do
    say "tests: $features alone"
    tests --quiet --no-default-features --features "$features"
done

export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 OPENBLAS_NUM_THREADS=1

say "tests: everything together: ranks as processes, the program on PETSc, packages that use the library, examples"
everything+=(--package biotissue --package custom-law --package downstream --package reactions)
cargo test "${everything[@]}" --test mpi
cargo test "${everything[@]}" --test program -- petsc processes
cargo test "${everything[@]}" --bin custom-law --bin downstream --bin reactions
cargo build "${everything[@]}" --example deposition --example many_matrices
examples="${CARGO_TARGET_DIR:-target}/debug/examples"
"$examples/deposition"
for ranks in 1 2; do
    mpirun --oversubscribe -n "$ranks" "$examples/many_matrices"
done

say "tests: PETSc under valgrind, on one rank and on two"
bash scripts/petsc-memcheck.sh

say "tests: C and Fortran, under valgrind"
bash scripts/capi.sh

say "tests, optimised: what the abstraction costs, instruction by instruction; PETSc"
optimised=(--quiet --release --package biotissue --package overhead --no-default-features --features overhead/petsc)
cargo build "${optimised[@]}" --bin overhead
"${CARGO_TARGET_DIR:-target}/release/overhead"
cargo test "${optimised[@]}" --test petsc

say "lints of every pair of features, and the documentation"
if ! wait "$lane"; then
    cat target/beside.log
    exit 1
fi

say "everything passed"
