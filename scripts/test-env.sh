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
export PATH="$python/bin:$PATH" BIOTISSUE_REQUIRE_PYTHON=1 BIOTISSUE_REQUIRE_BROWSER="${BIOTISSUE_REQUIRE_BROWSER:-1}"
export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 OPENBLAS_NUM_THREADS=1
