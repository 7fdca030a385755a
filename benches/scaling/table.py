"""Prints the times and iterations of every load step of a dogbone; the argument is the result directory of the run."""

import csv
import json
import pathlib
import sys

LENGTH = 0.038  # of the sample, m
# What follows plain Newton if it fails on an RVE.
STAGES = ("regularized", "cuts", "relaxation")

results = pathlib.Path(sys.argv[1])
events = [json.loads(line) for line in (results / "log.jsonl").read_text(encoding="utf-8").splitlines()]
start = next(event for event in events if event["event"] == "start")
steps = [event for event in events if event["event"] == "step"]
with open(results / "loads.csv", encoding="utf-8", newline="") as file:
    loads = {int(row["step"]): row for row in csv.DictReader(file)}


def row(name, value, form="{:.1f}"):
    print(f"{name:<42}" + "".join(f"{form.format(value(step)):>12}" for step in steps))


def newton(key):
    return lambda step: step["newton"][key]


def seconds(phase):
    return lambda step: step["newton"]["seconds"][phase]


def rve(key):
    return lambda step: step["rve"][key]


def extension(step):
    return 100 * float(loads[step["step"]]["right.ux"]) / LENGTH


def other(step):
    times = step["newton"]["seconds"]
    return times["total"] - sum(times[phase] for phase in ("point_field", "assembly", "factor", "solve"))


print(f"{start['elements']} elements, {start['unknowns']} unknowns, {start['rves']} RVEs, {start['threads']} threads")
print(f"all steps: {events[-1]['seconds']:.1f} s; before them: mesh, analysis, the RVEs at rest")
print(f"linear system of the body: {start['solver']}")
row("load step", lambda step: step["step"], "{}")
row("extension at its end, %", extension)
row("Newton iterations of the body", newton("iterations"), "{}")
row("iterations of the linear solver", newton("linear_iterations"), "{}")
row("cuts", lambda step: step["cuts"], "{}")
row("RVE solves", rve("solves"), "{}")
row("Newton iterations per RVE solve, mean", rve("iterations_mean"), "{:.2f}")
row("Newton iterations per RVE solve, largest", rve("iterations_max"), "{}")
row("RVE solves beyond Newton's method", lambda step: sum(step["rve"][f"by_{stage}"] for stage in STAGES), "{}")
row("step, s", seconds("total"))
row("RVEs and forces, s", seconds("point_field"))
row("assembly, s", seconds("assembly"))
row("factorization or preconditioner, s", seconds("factor"))
row("linear solution, s", seconds("solve"))
row("other: verification, checkpoint, s", other)
row("RVEs, summed over threads, s", rve("seconds_cpu"))
