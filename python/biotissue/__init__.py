"""Fiber networks, RVEs and multiscale simulations of soft tissue.

An RVE (representative volume element) is a unit cube with a network of fibers. Its boundary follows a deformation
gradient ``F``; its interior nodes find their equilibrium. The forces at the boundary give the first Piola-Kirchhoff
stress ``P``, condensation of the interior gives the exact tangent ``A = dP/dF``, and ``W`` is the strain energy.

All quantities are in SI units: m, N, Pa, J/m^3.

>>> import numpy as np
>>> from biotissue import Law, Network, Rve
>>> network = Network.delaunay(20, seed=1)
>>> rve = Rve(network, Law.exponential(1.0e8, 1.2, radius=5.0e-8), fiber_volume_fraction=0.003)
>>> P, A, W = rve.respond([np.diag([stretch, 1.0, 1.0]) for stretch in (1.0, 1.05, 1.1)])
>>> P.shape, A.shape, W.shape
((3, 3, 3), (3, 3, 3, 3, 3), (3,))
"""

from ._biotissue import (
    ConvergenceError,
    EquilibriumError,
    Law,
    NeoHookean,
    Network,
    Results,
    Rve,
    __version__,
    run_case,
)
from ._response import Response

__all__ = [
    "ConvergenceError",
    "EquilibriumError",
    "Law",
    "NeoHookean",
    "Network",
    "Response",
    "Results",
    "Rve",
    "__version__",
    "run_case",
]
