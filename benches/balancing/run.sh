#!/usr/bin/env bash
# Runs two uneven cases on two cores: on two micro ranks of one thread each without and with load balancing, and on one micro
# rank with two threads, and prints how the ranks shared the work. The argument is a folder for networks and results, by
# default target/balancing. There, status-mixed.svg (docs/balance-status.svg) and status-compressed.svg (docs/balance-compressed.svg) are the charts of
# the runs whose RVEs move.
set -euo pipefail
cd "$(dirname "$0")"

(cd ../.. && cargo build --quiet --release)
target=${CARGO_TARGET_DIR:-$PWD/../../target}
program=$target/release/biotissue
folder=${1:-$target/balancing}
mkdir -p "$folder"
cp mixed.toml compressed.toml "$folder"
cd "$folder"

network() { # network FILE NODES SEED
    "$program" network generate --kind delaunay --nodes "$2" --seed "$3" -o "$1" >network.log
}
for seed in 1 2 3; do network "small_$seed.txt" 200 "$seed"; done
network large.txt 2000 4
for seed in 1 2 3 4; do network "medium_$seed.txt" 400 "$seed"; done

printf '%-11s %-30s %7s %9s %10s %9s %10s %6s\n' case ranks 'wall, s' idle_any idle_mean max/mean migrations moved
for case in mixed compressed; do
    for ranks in nothing default pool; do
        {
            cat "$case.toml"
            [ "$ranks" != nothing ] || printf '\n[scales.balance]\nplanner = "none"\n'
            printf '\n[output]\nevery = 0\ncosts = true\n'
        } >"$case-$ranks.toml"
        arguments=(--ranks 3 --threads 1)
        [ "$ranks" != pool ] || arguments=(--ranks 2 --threads 2)
        "$program" run "$case-$ranks.toml" "${arguments[@]}" --out "$case-$ranks" >"$case-$ranks.log" 2>&1
        python3 - "$case" "$ranks" "$case-$ranks/log.jsonl" <<'PYTHON'
import json, sys
case, ranks, log = sys.argv[1:]
names = {"nothing": "2 x 1 thread, RVEs stay", "default": "2 x 1 thread, RVEs move", "pool": "1 x 2 threads"}
events = [json.loads(line) for line in open(log)]
steps = [event["scales"] for event in events if event["event"] == "step"]
seconds = sum(step["micro"]["seconds"] for step in steps)
mean = lambda key: sum(step["micro"][key] * step["micro"]["seconds"] for step in steps) / seconds
busy = sum(step["micro"]["seconds"] / max(step["micro"]["max_over_mean"], 1) for step in steps)
moved = sum(step["moved"] for step in steps)
print(f"{case:11} {names[ranks]:30} {events[-1]['seconds']:7.2f} {mean('idle_any'):9.1%} {mean('idle_mean'):10.1%}"
      f" {seconds / busy:9.3f} {sum(step['migrations'] for step in steps):10} {moved:6}")
PYTHON
    done
    "$program" report "$case-default" --charts "$case-charts" >"$case-charts.log"
    cp "$case-charts/rank-status.svg" "status-$case.svg"
done
