#!/usr/bin/env bash
# Runs two load steps of a dogbone with an RVE in every tetrahedron (dogbone.toml) and prints times by phase, iterations
# and memory. The arguments are the number of interior points of a network (300), the element size in m (0.0006, which
# gives 63 504 tetrahedra) and the number of threads (2).
#
# Needs Python and the command `time`. PROGRAM is the program; by default, the script builds it.
set -euo pipefail
cd "$(dirname "$0")"

points=${1:-300} size=${2:-0.0006} threads=${3:-2}
if [ -z "${PROGRAM:-}" ]; then
    (cd ../.. && cargo build --quiet --release)
    PROGRAM=${CARGO_TARGET_DIR:-$PWD/../../target}/release/biotissue
fi
folder=$(mktemp -d)
trap 'rm -r "$folder"' EXIT

for seed in 1 2 3 4 5 6 7 8; do
    "$PROGRAM" network generate --kind delaunay --points "$points" --seed "$seed" -o "$folder/delaunay_$seed.txt" >"$folder/output"
    "$PROGRAM" network info "$folder/delaunay_$seed.txt" | sed -n "s/^  nodes  */network $seed: /p"
done
sed "s/SIZE/$size/" dogbone.toml >"$folder/dogbone.toml"
/usr/bin/time -o "$folder/time" -f "%U %S %e %M" "$PROGRAM" run "$folder/dogbone.toml" --threads "$threads" >"$folder/output" 2>&1 || {
    cat "$folder/output" >&2
    exit 1
}
read -r user system wall kilobytes <"$folder/time"
awk -v user="$user" -v system_="$system" -v wall="$wall" -v kilobytes="$kilobytes" 'BEGIN {
    printf "whole run: %.1f s of processors, %.1f s, %.2f GB\n", user + system_, wall, kilobytes / 1e6 }'
python3 table.py "$folder/results"
