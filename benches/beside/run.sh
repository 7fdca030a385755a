#!/usr/bin/env bash
# Runs a neo-Hookean cube, clamped at x = 0 and moved by 0.3 at x = 1 in three load steps, by this program on one and two
# threads and by dolfinx, and prints processor and wall seconds and the peak memory of each. The arguments are numbers of
# cells along a side; by default 20 and 40.
#
# Needs Debian's python3-dolfinx-real and the command `time`. PYTHON is the interpreter that imports dolfinx.
set -euo pipefail
cd "$(dirname "$0")"
source box.sh

python=${PYTHON:-/usr/bin/python3}
# One thread for the libraries of dolfinx.
export OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1
(cd ../.. && cargo build --quiet --release)
program=${CARGO_TARGET_DIR:-$PWD/../../target}/release/biotissue
folder=$(mktemp -d)
trap 'rm -r "$folder"' EXIT

measured() { # measured NAME COMMAND...
    /usr/bin/time -o "$folder/time" -f "%U %S %e %M" "${@:2}" >"$folder/output" 2>&1 || {
        cat "$folder/output" >&2
        exit 1
    }
    read -r user system wall kilobytes <"$folder/time"
    awk -v name="$1" -v user="$user" -v system_="$system" -v wall="$wall" -v kilobytes="$kilobytes" 'BEGIN {
        printf "%-44s %8.1f s of processors %8.1f s %8.2f GB\n", name, user + system_, wall, kilobytes / 1e6 }'
}

if [ $# -eq 0 ]; then
    set -- 20 40
fi
for cells in "$@"; do
    write_box "$folder/box.toml" "$cells"
    for threads in 1 2; do
        measured "$cells cells, biotissue, $threads thread(s)" "$program" run "$folder/box.toml" --threads "$threads"
    done
    measured "$cells cells, dolfinx, CG with GAMG" "$python" box_dolfinx.py "$cells"
    grep '^{' "$folder/output" || true
done
