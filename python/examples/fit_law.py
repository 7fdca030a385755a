"""Fits two parameters of a fiber law to a measured stress-stretch curve.

The measurement, in `measured.csv`, is the nominal stress of a collagen gel that is stretched along x and held in width. It was
computed with E = 3e7 Pa and B = 4 and has errors of up to 2 %, so that the answer is known.

    python fit_law.py
"""

from pathlib import Path

import numpy as np
from biotissue import Law, Network, Rve
from scipy.optimize import OptimizeResult, least_squares

MEASURED = Path(__file__).with_name("measured.csv")
NETWORK = Network.delaunay(40, seed=1)
FIBER_VOLUME_FRACTION = 0.003


def stresses(youngs_modulus: float, nonlinearity: float, stretches: np.ndarray) -> np.ndarray:
    """Return the nominal stresses, Pa, of the network at these stretches along x."""
    law = Law.exponential(youngs_modulus, nonlinearity, radius=5.0e-8)
    rve = Rve(NETWORK, law, fiber_volume_fraction=FIBER_VOLUME_FRACTION)
    return rve.respond([np.diag([stretch, 1.0, 1.0]) for stretch in stretches]).P[:, 0, 0]


def fit(stretches: np.ndarray, measured: np.ndarray) -> tuple[np.ndarray, OptimizeResult]:
    """Return E and B with the least sum of squared relative errors, and the report of SciPy."""

    # Logarithms are of similar size for both parameters, and those of the stresses are linear in that of E.
    def residuals(logarithms: np.ndarray) -> np.ndarray:
        youngs_modulus, nonlinearity = np.exp(logarithms)
        return np.log(stresses(youngs_modulus, nonlinearity, stretches) / measured)

    bounds = np.log([[1.0e5, 0.01], [1.0e10, 100.0]])
    found = least_squares(residuals, x0=np.log([1.0e7, 1.0]), bounds=bounds, diff_step=1e-5)
    return np.exp(found.x), found


def main() -> np.ndarray:
    """Fit, print the parameters with their standard errors, and return them."""
    stretches, measured = np.loadtxt(MEASURED, delimiter=",", skiprows=1, unpack=True)
    parameters, found = fit(stretches, measured)
    variance = 2.0 * found.cost / (len(measured) - len(parameters))
    errors = parameters * np.sqrt(variance * np.diag(np.linalg.inv(found.jac.T @ found.jac)))
    mean_error = np.sqrt(np.mean(found.fun**2))
    print(f"{found.nfev} evaluations, root mean square error {mean_error:.2%}")
    print(f"E = {parameters[0]:.3e} +- {errors[0]:.0e} Pa")
    print(f"B = {parameters[1]:.2f} +- {errors[1]:.2f}")
    return parameters


if __name__ == "__main__":
    main()
