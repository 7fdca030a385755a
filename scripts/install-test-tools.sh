#!/usr/bin/env bash
# Installs what the tests need in addition to Rust and Python: MPI, PETSc, a Fortran compiler and valgrind, as packages
# of Debian or Ubuntu. Does nothing if all of them are present. On other systems, install them by hand; the packages are
# listed below.
set -euo pipefail

packages=(
    build-essential pkg-config python3-venv
    openmpi-bin libopenmpi-dev  # ranks
    libclang-dev                # the Rust binding of MPI is made from its headers
    libhwloc-dev libudev-dev    # where ranks run
    petsc-dev                   # with MUMPS, hypre and SuiteSparse
    libopenblas0-serial         # one thread a rank
    gfortran valgrind           # the C interface and its check
)

# Each tool is detected by the command or library that it provides, so that a user's own builds are recognized too.
all_there() {
    pkg-config --exists PETSc hwloc libudev || return 1
    command -v cc gfortran valgrind mpirun mpicc >/dev/null || return 1
    python3 -c 'import ensurepip' 2>/dev/null || return 1
    # bindgen finds libclang through ldconfig, in the folder of the system's LLVM, or through LIBCLANG_PATH.
    compgen -G '/usr/lib/llvm-*/lib/libclang*.so*' >/dev/null || ldconfig -p | grep libclang >/dev/null || [ -n "${LIBCLANG_PATH:-}" ]
}
as_root=()
[ "$(id -u)" = 0 ] || as_root=(sudo)
export DEBIAN_FRONTEND=noninteractive

# A browser for the report page. Some systems have no such package; without a browser, its tests fail unless
# BIOTISSUE_REQUIRE_BROWSER is 0: they are then skipped and listed.
if ! command -v chromium chromium-browser google-chrome >/dev/null && [ -z "${BIOTISSUE_CHROMIUM:-}" ] && command -v apt-get >/dev/null; then
    { "${as_root[@]}" apt-get update -q && "${as_root[@]}" apt-get install -y -q --no-install-recommends chromium; } >&2 ||
        echo "warning: there is no Chromium for the tests of the report page: BIOTISSUE_REQUIRE_BROWSER=0 skips them" >&2
fi
# Gmsh, for a command of a tutorial; without it, the test of this command is skipped and listed.
if ! command -v gmsh >/dev/null && command -v apt-get >/dev/null; then
    { "${as_root[@]}" apt-get update -q && "${as_root[@]}" apt-get install -y -q --no-install-recommends gmsh; } >&2 ||
        echo "warning: there is no Gmsh for the command of a tutorial, which is not tested" >&2
fi
if all_there; then
    exit 0
fi
if ! command -v apt-get >/dev/null; then
    echo "error: the tests need MPI, PETSc 3.18 or later, libclang, gfortran and valgrind, and there is no apt-get here" >&2
    echo "  cure: install them with this system's packages; on Debian they are: ${packages[*]}" >&2
    exit 1
fi
"${as_root[@]}" apt-get update -q
"${as_root[@]}" apt-get install -y -q --no-install-recommends "${packages[@]}"
