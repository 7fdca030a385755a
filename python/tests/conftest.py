"""Fixtures: a small network with its law, and the case of a small body."""

from pathlib import Path

import numpy as np
import pytest
from biotissue import Law, Network

ROOT = Path(__file__).resolve().parents[2]
"""The folder of the repository."""


CASE = """
title = "Box in tension"

[mesh]
generate = { shape = "box", cells = [2, 1, 1], size = [0.02, 0.01, 0.01] }

[[region]]
name = "*"
[region.material]
model = "fiber-rve"
networks = ["networks/*.txt"]
fiber_volume_fraction = 0.003
law = { name = "exponential", youngs_modulus = 1.0e8, radius = 5.0e-8, nonlinearity = 1.2 }
matrix = { model = "neo-hookean", shear_modulus = 1000.0, poisson_ratio = 0.3 }

[[boundary]]
surface = "x0"
displacement = { x = 0.0, y = 0.0, z = 0.0 }

[[boundary]]
surface = "x1"
displacement = { x = 0.002 }

[steps]
count = 3
"""


def write_case(folder: Path, text: str = CASE) -> Path:
    """Write a case of a box, with its networks, and return the case file."""
    (folder / "networks").mkdir()
    Network.delaunay(20, 1).write(folder / "networks" / "network-1.txt")
    Network.delaunay(20, 2).write(folder / "networks" / "network-2.txt")
    case = folder / "box.toml"
    case.write_text(text)
    return case


@pytest.fixture(scope="session")
def network() -> Network:
    return Network.delaunay(20, seed=1)


@pytest.fixture(scope="session")
def law() -> Law:
    return Law.exponential(1.0e8, 1.2, radius=5.0e-8)


@pytest.fixture
def gradients() -> np.ndarray:
    """Forty deformation gradients near the identity."""
    return np.eye(3) + np.random.default_rng(1).uniform(-0.05, 0.05, (40, 3, 3))


@pytest.fixture(scope="session")
def root() -> Path:
    return ROOT
