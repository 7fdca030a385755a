#!/usr/bin/env bash
# Passes every check of the project: format, lints, documentation and tests on every feature set.
#
# Needs Rust and Python; installs meshio and vtk, in a folder of its own, for the tests that read results back with an
# independent reader. Published networks are used where BIOTISSUE_NETWORKS names their folder, or where they lie in a folder beside this checkout.
set -euo pipefail
cd "$(dirname "$0")/.."

say() { printf '\n== %s\n' "$*"; }

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
    python3 -m venv "$python" || {
        # Debian keeps venv in a package of its own.
        apt-get update -q && apt-get install -y -q --no-install-recommends python3-venv
        rm -rf "$python"
        python3 -m venv "$python"
    }
fi
"$python/bin/pip" install --quiet --disable-pip-version-check meshio vtk
export PATH="$python/bin:$PATH" BIOTISSUE_REQUIRE_PYTHON=1

say "format"
cargo fmt --check

# PETSc is checked where it is installed.
petsc=no
if pkg-config --exists PETSc 2>/dev/null && command -v mpirun >/dev/null; then petsc=yes; fi
say "PETSc: $petsc"

# Each line: the features of one set.
sets=(
    "--features default"
    "--no-default-features"
    "--no-default-features --features sparse"
    "--no-default-features --features dense"
    "--no-default-features --features generate"
    "--no-default-features --features dense,app"
    "--no-default-features --features batched"
    "--no-default-features --features cuda"
    "--features default,metis,batched"
)
if [ "$petsc" = yes ]; then
    sets+=("--no-default-features --features mpi" "--no-default-features --features petsc" "--features default,petsc")
fi

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

if [ "$petsc" = yes ]; then
    say "tests: PETSc on 1, 2 and 4 ranks"
    cargo test --quiet --features petsc --test petsc
    cargo test --quiet --release --no-default-features --features petsc --test petsc
fi

say "tests: a law of a downstream crate"
CARGO_TARGET_DIR="$PWD/target/custom-law" cargo test --quiet --manifest-path examples/custom-law/Cargo.toml

say "everything passed"
