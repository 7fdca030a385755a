# Sourced by test.sh and check.sh: installs the tools of the tests and sets their environment.

# Prints a heading with the minutes and seconds since the start.
say() { printf '\n== %d:%02d %s\n' $((SECONDS / 60)) $((SECONDS % 60)) "$*"; }

bash scripts/install-test-tools.sh

if [ -z "${BIOTISSUE_NETWORKS:-}" ]; then
    found=$(find ../*/data -maxdepth 1 -name Network_2_7.txt -print -quit 2>/dev/null || true)
    if [ -n "$found" ]; then
        BIOTISSUE_NETWORKS=$(cd "$(dirname "$found")" && pwd)
        export BIOTISSUE_NETWORKS
    fi
fi
if [ -z "${BIOTISSUE_NETWORKS:-}" ] && [ "${BIOTISSUE_REQUIRE_NETWORKS:-0}" != 0 ]; then
    echo "error: BIOTISSUE_REQUIRE_NETWORKS is set, but no published networks were found" >&2
    echo "  cure: let BIOTISSUE_NETWORKS name their folder, the one that contains Network_2_7.txt" >&2
    exit 1
fi

# meshio and VTK read the results back, independently of this crate.
python="$PWD/target/python"
if ! "$python/bin/python3" -c 'import meshio, vtk' 2>/dev/null; then
    rm -rf "$python"
    python3 -m venv "$python"
    "$python/bin/pip" install --quiet --disable-pip-version-check meshio vtk
fi
# The compiler NVRTC, which compiles the kernels for graphics processors without one. Some systems have no such package; its tests
# are then skipped.
if ! "$python/bin/python3" -c 'import nvidia.cu13' 2>/dev/null; then
    "$python/bin/pip" install --quiet --disable-pip-version-check 'nvidia-cuda-nvrtc>=13,<14' ||
        echo "warning: there is no NVRTC for the tests of kernels for graphics processors, which are skipped" >&2
fi
nvrtc=$(compgen -G "$python/lib/python3*/site-packages/nvidia/cu13/lib" || true)
if [ -n "$nvrtc" ]; then
    export LD_LIBRARY_PATH="$nvrtc${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}" BIOTISSUE_REQUIRE_NVRTC="${BIOTISSUE_REQUIRE_NVRTC:-1}"
fi
export PATH="$python/bin:$PATH" BIOTISSUE_REQUIRE_PYTHON=1 BIOTISSUE_REQUIRE_CXX=1 BIOTISSUE_REQUIRE_BROWSER="${BIOTISSUE_REQUIRE_BROWSER:-1}"
export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 OPENBLAS_NUM_THREADS=1
