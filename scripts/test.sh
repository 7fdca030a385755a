#!/usr/bin/env bash
# Passes every check of the project: format, lints, documentation and tests on every feature set.
#
# Needs Rust and Python; installs what else is missing: MPI, PETSc, a Fortran compiler and valgrind as packages of the
# system, and meshio and vtk, in a folder of its own, for the tests that read results back with an independent reader.
# Published networks are used where BIOTISSUE_NETWORKS names their folder, or where they lie in a folder beside this checkout;
# with BIOTISSUE_REQUIRE_NETWORKS=1 this fails where they are not found.
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
if [ -z "${BIOTISSUE_NETWORKS:-}" ] && [ "${BIOTISSUE_REQUIRE_NETWORKS:-0}" != 0 ]; then
    echo "no published networks beside the checkout, and BIOTISSUE_REQUIRE_NETWORKS is set:" >&2
    echo "let BIOTISSUE_NETWORKS name their folder, the one with Network_2_7.txt in it" >&2
    exit 1
fi
say "published networks: ${BIOTISSUE_NETWORKS:-none, their tests say that they skip}"

# Independent readers of VTK files, meshio and VTK itself; they come over the network while the lints keep the cores busy.
python="$PWD/target/python"
readers() {
    if [ ! -x "$python/bin/python3" ]; then
        rm -rf "$python"
        python3 -m venv "$python"
    fi
    "$python/bin/pip" install --quiet --disable-pip-version-check meshio vtk
}
readers &
reading=$!
export PATH="$python/bin:$PATH" BIOTISSUE_REQUIRE_PYTHON=1
export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 OPENBLAS_NUM_THREADS=1

# From nothing, what would help a second build, or a debugger, only makes the first longer. In one unit the compiler does
# least, and inlines what loops call: in several, the tests run up to three times as long. The lane `beside` keeps both cores busy.
if [ ! -d target/debug ]; then
    export CARGO_INCREMENTAL=0 CARGO_PROFILE_DEV_CODEGEN_UNITS=1 CARGO_PROFILE_DEV_DEBUG=false
fi
# Nor are programs that run a few seconds worth what it takes to optimize each package once more as a whole.
export CARGO_PROFILE_DEV_LTO=off

say "format"
cargo fmt --all --check

# Each line: the features of one set.
sets=(
    "default"
    ""
    "sparse"
    "dense"
    "petsc"
    "batched capi hwloc metis petsc"
)
# What `biotissue` depends on is the same whatever features it has, so that all sets share one build of it. That each
# feature does with less is for the lane `beside` to show.
alike=(--package biotissue --package same-dependencies)
of() { # a set: the features of `biotissue` in the words of a command for several packages
    printf -- '--no-default-features'
    for feature in $1; do printf -- ' --features biotissue/%s' "$feature"; done
}
# All of them, so that what needs several shares one build.
everything=(--quiet "${alike[@]}" --features biotissue/default,biotissue/batched,biotissue/capi,biotissue/hwloc,biotissue/metis,biotissue/petsc)
# Packages that use the library as others do.
users=(--package custom-law --package downstream --package reactions --features downstream/petsc)
# Beside the tests, since much of both keeps one core busy; what it says comes at the end. It starts from what the lints have
# found out of all dependencies.
beside() {
    local builds=${CARGO_TARGET_DIR:-$PWD/target}
    export CARGO_TARGET_DIR=$PWD/target/beside

    say "lints of library and program: features together that lack any third, alone, and with no more dependencies than they ask for"
    lint() { cargo clippy --quiet --lib --bins "$@" -- -D warnings; }
    # Any two features are together in one of these without any third, but for what they bring themselves: what fails
    # with two features, and would with a third, is found as by all 36 pairs.
    local together=(
        "metis sparse dense capi petsc mpi" "app generate batched capi petsc mpi" "app generate metis sparse dense batched"
        "generate metis sparse batched petsc mpi" "app generate sparse dense capi mpi" "generate dense batched capi"
        "app generate dense petsc mpi" "metis sparse batched capi mpi" "app generate metis sparse capi"
        "sparse dense batched petsc mpi"
    )
    # Those that stand alone and are no set of the tests.
    local alone=(generate app mpi "cuda hwloc")
    for features in "${together[@]}" "${alone[@]}"; do
        # shellcheck disable=SC2046
        lint "${alike[@]}" $(of "$features")
    done
    # What features ask of their dependencies, where nothing that shares them asks for more; `sparse` and `mpi` are built so for C.
    # shellcheck disable=SC2046
    lint $(of "app dense")

    say "documentation"
    for features in "${sets[@]}"; do
        # shellcheck disable=SC2046
        RUSTDOCFLAGS="-D warnings" cargo doc --quiet --no-deps "${alike[@]}" $(of "$features")
    done

    say "tests: C and Fortran, under valgrind"
    bash scripts/capi.sh

    say "what the abstraction costs, instruction by instruction"
    # What is measured is our own: these take the most time to optimize, and are not run.
    local optimized=(--config 'profile.release.package."*".debug=false')
    for package in faer wide nalgebra simba nano-gemm-{c,f}{32,64} gemm-{c,f}{32,64} iced-x86 object; do
        optimized+=(--config "profile.release.package.$package.opt-level=0")
    done
    cargo build --quiet --release "${optimized[@]}" --package overhead --features petsc --bin overhead
    target/beside/release/overhead

    # What follows is of the same build as the tests of the sets.
    export CARGO_TARGET_DIR=$builds
    say "tests: PETSc without the checks that only tests have"
    # shellcheck disable=SC2046
    cargo test --quiet --config profile.dev.package.biotissue.debug-assertions=false \
        --config profile.dev.package.biotissue.overflow-checks=false "${alike[@]}" $(of petsc) --test petsc
    say "tests: PETSc under valgrind, on one rank and on two"
    bash scripts/petsc-memcheck.sh

    say "tests: packages that use the library, examples"
    cargo test "${everything[@]}" "${users[@]}" --bin custom-law --bin downstream --bin reactions
    cargo build "${everything[@]}" "${users[@]}" --example deposition --example many_matrices
    "$builds/debug/examples/deposition"
    for ranks in 1 2; do
        mpirun --oversubscribe -n "$ranks" "$builds/debug/examples/many_matrices"
    done
    say "all this passed"
}
for features in "${sets[@]}"; do
    say "lints: ${features:-no features}"
    # shellcheck disable=SC2046
    cargo clippy --quiet "${alike[@]}" --all-targets $(of "$features") -- -D warnings
done
say "lints: everything, with the other packages"
cargo clippy "${everything[@]}" --workspace --all-targets --features downstream/petsc,overhead/petsc -- -D warnings

# Before the tests start to compile: files that a compiler removes meanwhile cannot be copied.
if [ ! -d target/beside/debug ]; then
    mkdir -p target/beside/debug
    cp -a target/debug/.fingerprint target/debug/build target/debug/deps target/beside/debug/
fi
(set -e; beside) >target/beside.log 2>&1 &
lane=$!
trap 'kill "$lane" 2>/dev/null || true' EXIT

wait "$reading"
# Four whole sets. The examples, which the lints have checked, are built where they run.
for features in default "sparse batched hwloc metis" dense petsc; do
    say "tests: $features"
    # Unit tests take longer to optimize than to run without that.
    # shellcheck disable=SC2046
    cargo test --quiet "${alike[@]}" --lib --config profile.dev.package.biotissue.opt-level=0 $(of "$features")
    programs=(--bins)
    for file in tests/*.rs tests/*/main.rs; do
        program=$(basename "${file%/main.rs}" .rs)
        case $program in
        mpi) continue ;; # with everything, below
        petsc) [ "$features" = petsc ] || continue ;;
        esac
        programs+=(--test "$program")
    done
    # shellcheck disable=SC2046
    cargo test --quiet "${alike[@]}" "${programs[@]}" $(of "$features")
    # shellcheck disable=SC2046
    cargo test --quiet "${alike[@]}" --doc $(of "$features")
done

say "tests: everything together: ranks as processes, the program on PETSc"
cargo test "${everything[@]}" "${users[@]}" --test mpi
cargo test "${everything[@]}" "${users[@]}" --test program -- petsc processes near

say "beside all this, since the lints"
outcome=0
wait "$lane" || outcome=$?
cat target/beside.log
[ "$outcome" = 0 ] || exit "$outcome"

say "everything passed"
