#!/usr/bin/env python3
"""Counts what the reused factorization of the linearized start saves.

A neo-Hookean cube, clamped at x = 0 and moved by 0.3 at x = 1, is solved by the direct solver in several numbers of load
steps, once with formulas at the points and once with RVEs that consist of the same formula alone. The body takes RVEs to
be expensive and factors the stiffness in every iteration; with formulas, the first iteration of a step reuses the
factorization of the step's linearized start. Prints iterations, factorizations (those of the linearized starts included)
and processor seconds of the whole run.

    python3 run.py [CELLS [STEPS...]]

CELLS is the number of cells per side, by default 20. The environment variable PROGRAM is the program; by default, the
script builds it.
"""

import json
import os
import pathlib
import resource
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
FORMULA = 'model = "neo-hookean", youngs_modulus = 1.0e6, poisson_ratio = 0.3'
MATERIALS = {"reused": f"{{ {FORMULA} }}", "new": f'{{ model = "fiber-rve", networks = [], matrix = {{ {FORMULA} }} }}'}
CASE = """
[mesh]
generate = {{ shape = "box", cells = [{cells}, {cells}, {cells}], size = [1.0, 1.0, 1.0] }}
[[region]]
name = "*"
material = {material}
[[boundary]]
surface = "x0"
displacement = {{ x = 0.0, y = 0.0, z = 0.0 }}
[[boundary]]
surface = "x1"
displacement = {{ x = 0.3, y = 0.0, z = 0.0 }}
[steps]
count = {count}
[newton]
solver = "direct"
[output]
every = 0
checkpoint = 1000
"""


def program():
    if "PROGRAM" in os.environ:
        return os.environ["PROGRAM"]
    subprocess.run(["cargo", "build", "--quiet", "--release"], cwd=ROOT, check=True)
    return pathlib.Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")) / "release" / "biotissue"


def processor_seconds():
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def run(command, folder, **case):
    """Returns the processor seconds of a run and its load steps."""
    (folder / "case.toml").write_text(CASE.format(**case))
    quiet = subprocess.DEVNULL
    before = processor_seconds()
    subprocess.run([command, "run", folder / "case.toml", "--threads", "1"], check=True, stdout=quiet, stderr=quiet)
    log = (folder / "results" / "log.jsonl").read_text().splitlines()
    events = [json.loads(line) for line in log]
    return processor_seconds() - before, [event["newton"] for event in events if event["event"] == "step"]


def main():
    cells, *counts = [int(argument) for argument in sys.argv[1:]] or [20]
    command = program()
    print("steps  first iteration  iterations  factorizations  s of processors")
    with tempfile.TemporaryDirectory() as folder:
        for count in counts or [1, 2, 3, 5, 10, 20]:
            for name, material in MATERIALS.items():
                case = {"cells": cells, "count": count, "material": material}
                seconds, steps = run(command, pathlib.Path(folder), **case)
                iterations = sum(step["iterations"] for step in steps)
                factorizations = sum(step["factorizations"]["cholesky"] + 1 for step in steps)
                print(f"{count:5}  {name:>15}  {iterations:10}  {factorizations:14}  {seconds:15.2f}", flush=True)


main()
