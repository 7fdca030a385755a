#!/usr/bin/env bash
# Runs a neo-Hookean cube, clamped at x = 0 and moved by 0.3 at x = 1 in three load steps, by this program on one and two
# threads, with and without fields, and by dolfinx, and prints processor and wall seconds and the peak memory of each. Of the
# runs without fields it prints the medians of wall seconds, and of those of the load steps alone, and how many times as fast
# two threads are; there are as many runs as RUNS says, by default 1. Two runs on one thread each, at the same time, show how
# many times as fast two cores of this machine can be, which share its memory and its host. Prints also the iterations of
# conjugate gradients to 1e-8 for the first linear system, those of dolfinx as `first_linear`. One and two threads have to
# write the same loads. The arguments are numbers of cells along a side; by default 20 and 40.
#
# Needs Debian's python3-dolfinx-real and the command `time`. PYTHON is the interpreter that imports dolfinx; BIOTISSUE is the
# program, by default a new release build.
set -euo pipefail
cd "$(dirname "$0")"
source box.sh

python=${PYTHON:-/usr/bin/python3}
# One thread for the libraries of dolfinx.
export OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1
if [ -z "${BIOTISSUE:-}" ]; then
    (cd ../.. && cargo build --quiet --release)
fi
program=${BIOTISSUE:-${CARGO_TARGET_DIR:-$PWD/../../target}/release/biotissue}
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

median() { # median FILE
    sort -g "$1" | awk '{ value[NR] = $1 } END { print (value[int((NR + 1) / 2)] + value[int(NR / 2) + 1]) / 2 }'
}

# The seconds of all load steps of a run.
load_steps() { # load_steps OUT
    grep '"event":"step"' "$1/log.jsonl" | sed 's/.*"total":\([0-9.]*\).*/\1/' | awk '{ sum += $1 } END { print sum }'
}

compared() { # compared NAME FILE FILE
    awk -v name="$1" -v one="$(median "$2")" -v two="$(median "$3")" 'BEGIN {
        printf "%-44s %8.2f s on one thread, %8.2f s on two: %.2f times as fast\n", name, one, two, one / two }'
}

# Two runs of a case on one thread each, at the same time: the seconds of their load steps.
side_by_side() { # side_by_side CASE
    "$program" run "$1" --threads 1 --out "$folder/beside-1" >"$folder/output-1" 2>&1 &
    local other=$!
    "$program" run "$1" --threads 1 --out "$folder/beside-2" >"$folder/output-2" 2>&1
    wait "$other"
    load_steps "$folder/beside-1"
    load_steps "$folder/beside-2"
    rm -r "$folder"/beside-{1,2}
}

if [ $# -eq 0 ]; then
    set -- 20 40
fi
for cells in "$@"; do
    write_box "$folder/box.toml" "$cells"
    rm -f "$folder"/{wall,steps}-*
    for _ in $(seq "${RUNS:-1}"); do
        for threads in 1 2; do
            rm -rf "$folder/threads-$threads"
            measured "$cells cells, biotissue, $threads thread(s)" \
                "$program" run "$folder/box.toml" --threads "$threads" --out "$folder/threads-$threads"
            echo "$wall" >>"$folder/wall-$threads"
            load_steps "$folder/threads-$threads" >>"$folder/steps-$threads"
        done
        side_by_side "$folder/box.toml" >>"$folder/steps-beside"
        cmp "$folder/threads-1/loads.csv" "$folder/threads-2/loads.csv"
    done
    compared "$cells cells, whole run" "$folder"/wall-{1,2}
    compared "$cells cells, load steps" "$folder"/steps-{1,2}
    awk -v name="$cells cells, load steps of two runs" -v one="$(median "$folder/steps-1")" \
        -v beside="$(median "$folder/steps-beside")" 'BEGIN {
            printf "%-44s %8.2f s at the same time: two cores can be %.2f times as fast\n", name, beside, 2 * one / beside }'
    write_box "$folder/fields.toml" "$cells" 1
    for threads in 1 2; do
        measured "$cells cells, with fields, $threads thread(s)" \
            "$program" run "$folder/fields.toml" --threads "$threads" --out "$folder/fields-$threads"
    done
    for fields in "$folder"/fields-1/*.vtu; do cmp "$fields" "$folder/fields-2/${fields##*/}"; done
    rm -r "$folder"/fields-{1,2}
    # Without this tolerance, linear systems are solved only as far as Newton's method needs.
    echo 'solver = { method = "cg", preconditioner = "multigrid", tolerance = 1e-8 }' >>"$folder/box.toml"
    "$program" run "$folder/box.toml" --out "$folder/fixed" >"$folder/output" 2>&1
    first=$(grep -o '"linear_starts":\[{"iterations":[0-9]*' "$folder/fixed/log.jsonl" | head -n 1)
    echo "$cells cells, biotissue: ${first##*:} iterations for the first linear system"
    measured "$cells cells, dolfinx, CG with GAMG" "$python" box_dolfinx.py "$cells"
    grep '^{' "$folder/output" || true
done
