"""The response of an RVE."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class Response(NamedTuple):
    """Stress, tangent and energy of an RVE.

    The shapes are those for ``n`` deformation gradients; for a single one, of shape (3, 3), the first axis is missing.
    """

    P: NDArray[np.float64]
    """First Piola-Kirchhoff stress ``P[i, j]``, Pa; shape (n, 3, 3)."""

    A: NDArray[np.float64]
    """Tangent ``A[i, j, k, l] = dP[i, j] / dF[k, l]``, Pa; shape (n, 3, 3, 3, 3)."""

    W: NDArray[np.float64]
    """Strain energy per reference volume, J/m^3; shape (n,)."""
