#!/usr/bin/env bash
# Runs the cube of run.sh with conjugate gradients and multigrid and with the direct solver, both to a relative residual of
# 1e-11, and prints the greatest difference of a force relative to the greatest force. The argument is the number of cells
# along a side, by default 20. BIOTISSUE is the program, by default a new release build.
set -euo pipefail
cd "$(dirname "$0")"
source box.sh

cells=${1:-20}
if [ -z "${BIOTISSUE:-}" ]; then
    (cd ../.. && cargo build --quiet --release)
fi
program=${BIOTISSUE:-${CARGO_TARGET_DIR:-$PWD/../../target}/release/biotissue}
folder=$(mktemp -d)
trap 'rm -r "$folder"' EXIT

run_with() { # run_with NAME SOLVER
    write_box "$folder/$1.toml" "$cells"
    printf 'tolerance = 1e-11\nsolver = %s\n' "$2" >>"$folder/$1.toml"
    "$program" run "$folder/$1.toml" --out "$folder/$1" >"$folder/output" 2>&1 || {
        cat "$folder/output" >&2
        exit 1
    }
}

run_with direct '"direct"'
run_with multigrid '{ method = "cg", preconditioner = "multigrid" }'
echo "$cells cells: difference $(force_difference "$folder/direct/loads.csv" "$folder/multigrid/loads.csv")"
