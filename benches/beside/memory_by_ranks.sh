#!/usr/bin/env bash
# Runs the cube of run.sh on PETSc with several numbers of ranks of the macro scale, and prints for each the memory of the first
# rank, which reads the mesh, and the greatest of the others, both also without what a body of a few elements takes (the
# libraries), and the greatest difference of a reaction from that of the first number, relative to the greatest reaction. The
# arguments are the number of cells along a side, by default 40, and the numbers of ranks, by default 1 2 4 8.
#
# With DIVIDED=1, `biotissue divide` divides the body before each run on several ranks, so that no rank reads the mesh, and the
# script prints its memory. With SETUP=1, the cube stays at rest, and there is no multigrid hierarchy: the memory is that of the
# setup and of the matrix.
#
# Needs MPI, PETSc and the command `time`, as the tests do (scripts/test.sh installs them).
set -euo pipefail
cd "$(dirname "$0")"
source box.sh

cells=${1:-40}
numbers=("${@:2}")
if [ ${#numbers[@]} -eq 0 ]; then
    numbers=(1 2 4 8)
fi
export OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1 OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
(cd ../.. && cargo build --quiet --release --features petsc,metis)
program=${CARGO_TARGET_DIR:-$PWD/../../target}/release/biotissue
folder=$(mktemp -d)
trap 'rm -r "$folder"' EXIT

write_case() { # write_case CELLS MACRO_RANKS
    write_box "$folder/box.toml" "$1"
    cat >>"$folder/box.toml" <<CASE
tolerance = 1e-11
solver = { method = "cg", preconditioner = "multigrid" }
[scales]
macro = $2
micro = 1
CASE
    if [ "${SETUP:-0}" = 1 ]; then
        sed -i 's/x = 0.3/x = 0.0/; s/"multigrid"/"diagonal"/' "$folder/box.toml"
    fi
}

# Prints the memory of the first macro rank and the greatest of the others, kilobytes.
run_on() { # run_on CELLS MACRO_RANKS
    local ranks=$(($2 + 1)) rank_memory="$folder/memory"
    rm -f "$rank_memory".*
    write_case "$1" "$2"
    local options=()
    if [ "${DIVIDED:-0}" = 1 ] && [ "$2" -gt 1 ]; then
        /usr/bin/time -f "divide: %M kB, %e s" -o "$folder/divide" \
            "$program" divide "$folder/box.toml" --ranks "$2" --out "$folder/divided" >/dev/null
        cat "$folder/divide" >&2
        options=(--divided "$folder/divided")
    fi
    # shellcheck disable=SC2016 # the shell of each rank expands the variable
    mpirun --oversubscribe -n "$ranks" bash -c '
        exec /usr/bin/time -f %M -o "$1.$OMPI_COMM_WORLD_RANK" "$2" run "$3" --backend petsc --threads 1 --out "$4" "${@:5}"
    ' rank "$rank_memory" "$program" "$folder/box.toml" "$folder/out" "${options[@]}" >"$folder/output" 2>&1 || {
        cat "$folder/output" >&2
        exit 1
    }
    # The last rank is that of the micro scale, which has nothing to solve.
    cat "$rank_memory.0"
    for rank in $(seq 1 $(($2 - 1))); do cat "$rank_memory.$rank"; done | sort -n | tail -n 1
}

libraries=$(run_on 2 1)
echo "libraries: $((libraries / 1000)) MB"
for macro in "${numbers[@]}"; do
    start=$(date +%s.%N)
    mapfile -t memory < <(run_on "$cells" "$macro")
    wall=$(awk -v start="$start" -v end="$(date +%s.%N)" 'BEGIN { print end - start }')
    cp "$folder/out/loads.csv" "$folder/loads.$macro"
    difference=none
    if [ "${SETUP:-0}" = 0 ]; then
        difference=$(force_difference "$folder/loads.${numbers[0]}" "$folder/loads.$macro")
    fi
    awk -v cells="$cells" -v macro="$macro" -v first="${memory[0]}" -v others="${memory[1]:-$libraries}" \
        -v libraries="$libraries" -v wall="$wall" -v difference="$difference" 'BEGIN {
            printf "%d cells, %2d ranks: first %5.0f MB, others %5.0f MB, without libraries %5.0f and %5.0f MB, %5.1f s, difference %s\n",
                cells, macro, first / 1000, others / 1000, (first - libraries) / 1000, (others - libraries) / 1000, wall,
                difference }'
done
