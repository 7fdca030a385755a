#!/usr/bin/env bash
# Checks published networks, which must all be accepted, and runs the published ligament.
#
# BIOTISSUE_MUMFIM_CASES names a folder with MuMFiM's public test cases: every network in it is read, and a body of every mesh of
# a known format is run. BIOTISSUE_NETWORKS names the folder with the ligament (ligament/): all its networks are checked, and
# its body is run with two of the 50 load steps, or as many as the argument says (0: it is checked only). A folder that is not
# named is skipped, with a message. BIOTISSUE_PROGRAM is the program to use; without it, the script builds one.
set -euo pipefail
cd "$(dirname "$0")/.."

steps=${1:-2}
program=${BIOTISSUE_PROGRAM:-}
if [ -z "$program" ]; then
    cargo build --quiet --release
    program=${CARGO_TARGET_DIR:-$PWD/target}/release/biotissue
fi
folder=$(mktemp -d)
trap 'rm -r "$folder"' EXIT

# Networks have a parameter file beside them, or the numbers of nodes, unknowns and fibers in their first line.
networks_in() {
    find "$1" -type f -name '*.txt' -print0 | sort -z | while IFS= read -r -d '' file; do
        if [ -f "$file.params" ] || head -n 1 "$file" | grep -Eq '^ *[0-9]+ +[0-9]+ +[0-9]+ *$'; then
            printf '%s\0' "$file"
        fi
    done
}

refused=0
check_networks() { # check_networks FOLDER
    local count=0 before=$refused
    while IFS= read -r -d '' file; do
        count=$((count + 1))
        if ! "$program" network info "$file" >"$folder/output" 2>&1; then
            refused=$((refused + 1))
            sed "s|^|refused: |" "$folder/output"
        fi
    done < <(networks_in "$1")
    echo "$1: $count networks, $((refused - before)) refused"
    if [ "$count" -eq 0 ]; then
        echo "no network found: is this the folder of the test cases?" >&2
        exit 1
    fi
}

# Checks each mesh, and runs one load step of a rubber-like body of this shape, whose first surface is held while a traction of
# 0.1 % of its stiffness pulls at the last one. The conditions of the published cases are in files of a commercial mesher.
run_meshes() { # run_meshes FOLDER
    local count=0
    while IFS= read -r -d '' file; do
        count=$((count + 1))
        mesh_case "$file" 'free = "rigid"' >"$folder/mesh.toml"
        if ! "$program" check "$folder/mesh.toml" --json >"$folder/plan.json" 2>"$folder/error"; then
            refused=$((refused + 1))
            sed "s|^|refused: |" "$folder/error"
            continue
        fi
        names=$(python3 -c 'import json, sys; print(*json.load(sys.stdin)["surfaces"], sep="\n")' <"$folder/plan.json")
        mapfile -t surfaces <<<"$names"
        if [ "${#surfaces[@]}" -lt 2 ]; then
            echo "$(basename "$file"): checked; it has no two surfaces to pull at"
            continue
        fi
        {
            mesh_case "$file" ""
            printf '[[boundary]]\nsurface = "%s"\ndisplacement = { x = 0.0, y = 0.0, z = 0.0 }\n' "${surfaces[0]}"
            printf '[[boundary]]\nsurface = "%s"\ntraction = [1.0e3, 0.0, 0.0]\n' "${surfaces[-1]}"
            printf '[steps]\ncount = 1\n[output]\nfields = []\n'
        } >"$folder/mesh.toml"
        if "$program" run "$folder/mesh.toml" --out "$folder/results" >"$folder/output" 2>&1; then
            echo "$(basename "$file"): $(tail -n 1 "$folder/output" | sed 's|; results in .*||')"
        else
            refused=$((refused + 1))
            sed "s|^|failed: $(basename "$file"): |" "$folder/output" | tail -n 4
        fi
    done < <(find "$1" -type f \( -name '*.msh' -o -name '*.vtu' -o -name '*.inp' -o -name '*.mesh' -o -name '*.feb' \) -print0 | sort -z)
    echo "$1: $count meshes of known formats"
}

mesh_case() { # mesh_case FILE BODY
    cat <<CASE
[body]
$2
[mesh]
file = "$1"
[[region]]
name = "*"
material = { model = "neo-hookean", youngs_modulus = 1.0e6, poisson_ratio = 0.3 }
CASE
}

if [ -n "${BIOTISSUE_MUMFIM_CASES:-}" ]; then
    check_networks "$BIOTISSUE_MUMFIM_CASES"
    run_meshes "$BIOTISSUE_MUMFIM_CASES"
else
    echo "skipped: BIOTISSUE_MUMFIM_CASES names no folder with MuMFiM's public test cases"
fi

ligament=${BIOTISSUE_NETWORKS:+$BIOTISSUE_NETWORKS/ligament}
if [ -z "$ligament" ] || [ ! -d "$ligament" ]; then
    echo "skipped: BIOTISSUE_NETWORKS names no folder with ligament/"
    exit "$((refused > 0))"
fi
check_networks "$ligament"
run_meshes "$ligament"
cat >"$folder/ligament.toml" <<CASE
title = "A facet capsular ligament"
[mesh]
file = "$ligament/ligament_6192.msh"
[[region]]
name = "*"
[region.material]
model = "fiber-rve"
networks = ["$ligament/theta_*.txt"]
choose = { index = { grid = "$ligament/field_grid.csv", bins = 20 } }
fiber_volume_fraction = 0.003
[[boundary]]
surface = "face82"
displacement = { x = 0.0, y = 0.0, z = 0.0 }
[[boundary]]
surface = "face78"
displacement = { x = $(awk "BEGIN { print 2.5e-3 * $steps / 50 }"), y = 0.0, z = 0.0 }
[steps]
count = $((steps > 0 ? steps : 1))
[newton]
tolerance = 1e-5
CASE
"$program" check "$folder/ligament.toml"
if [ "$steps" -gt 0 ]; then
    "$program" run "$folder/ligament.toml" --out "$folder/results"
fi
exit "$((refused > 0))"
