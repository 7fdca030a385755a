"""Responses of RVEs: derivatives, batches, paths, errors."""

import threading

import numpy as np
import pytest
from biotissue import EquilibriumError, Law, NeoHookean, Network, Response, Rve
from numpy.typing import ArrayLike

PHI = 0.003
F0 = np.array([[1.1, 0.05, 0.0], [-0.02, 0.97, 0.03], [0.01, 0.0, 0.96]])
UNITS = np.eye(9).reshape(9, 3, 3)
STEP = 1e-5


@pytest.fixture(params=["network", "network in a matrix"])
def rve(request: pytest.FixtureRequest, network: Network, law: Law) -> Rve:
    matrix = NeoHookean(1.0e3, 0.3) if request.param == "network in a matrix" else None
    return Rve(network, law, fiber_volume_fraction=PHI, matrix=matrix)


def differences(values: np.ndarray) -> np.ndarray:
    """Return central differences of values at F0 + STEP * UNITS and F0 - STEP * UNITS."""
    return (values[:9] - values[9:]) / (2.0 * STEP)


def test_the_stress_is_the_derivative_of_the_energy_and_the_tangent_that_of_the_stress(rve: Rve) -> None:
    around = rve.respond(np.concatenate([F0 + STEP * UNITS, F0 - STEP * UNITS]))
    P, A, W = rve.respond(F0)
    assert W > 0.0
    np.testing.assert_allclose(differences(around.W).reshape(3, 3), P, rtol=0.0, atol=1e-6 * np.abs(P).max())
    # Row [k, l] of the differences is dP / dF[k, l].
    dP = differences(around.P).reshape(3, 3, 3, 3).transpose(2, 3, 0, 1)
    np.testing.assert_allclose(dP, A, rtol=0.0, atol=1e-6 * np.abs(A).max())


def test_a_matrix_adds_its_stress(network: Network, law: Law) -> None:
    mu, nu = 2.0e3, 0.3
    alone = Rve(network, law, fiber_volume_fraction=PHI).respond(F0)
    both = Rve(network, law, fiber_volume_fraction=PHI, matrix=NeoHookean(mu, nu)).respond(F0)
    inverse = np.linalg.inv(F0).T
    lame = 2.0 * mu * nu / (1.0 - 2.0 * nu)
    expected = mu * (F0 - inverse) + lame * np.log(np.linalg.det(F0)) * inverse
    np.testing.assert_allclose(both.P - alone.P, expected, rtol=0.0, atol=1e-9 * np.abs(expected).max())


def test_shapes(rve: Rve) -> None:
    arguments: list[tuple[ArrayLike, tuple[int, ...]]] = [
        (F0, ()),
        (F0[None], (1,)),
        ([F0.tolist()] * 3, (3,)),
        (np.empty((0, 3, 3)), (0,)),
    ]
    for F, leading in arguments:
        for response in (rve.respond(F), rve.respond_path(F)):
            assert isinstance(response, Response)
            assert response.P.shape == (*leading, 3, 3)
            assert response.A.shape == (*leading, 3, 3, 3, 3)
            assert response.W.shape == leading
            assert all(array.dtype == np.float64 and array.flags.c_contiguous for array in response)


def test_arrays_of_any_layout_and_type_are_read(rve: Rve, gradients: np.ndarray) -> None:
    expected = rve.respond(gradients).P
    assert np.array_equal(rve.respond(np.asfortranarray(gradients)).P, expected)
    assert np.array_equal(rve.respond(np.repeat(gradients, 2, axis=0)[::2]).P, expected)
    assert np.array_equal(rve.respond(np.eye(3, dtype=int)).P, rve.respond(np.eye(3)).P)


def test_a_batch_gives_the_responses_of_single_gradients(rve: Rve, gradients: np.ndarray) -> None:
    batch = rve.respond(gradients)
    for k, F in enumerate(gradients):
        for of_batch, alone in zip(batch, rve.respond(F)):
            scale = np.abs(of_batch).max()
            np.testing.assert_allclose(of_batch[k], alone, rtol=0.0, atol=1e-9 * scale)


def test_results_have_the_same_bits_for_any_number_of_threads(
    network: Network, law: Law, gradients: np.ndarray
) -> None:
    one, two = (Rve(network, law, threads=threads).respond(gradients) for threads in (1, 2))
    assert all(np.array_equal(a, b) for a, b in zip(one, two))


def test_a_path_of_an_elastic_response_gives_the_same_as_a_batch(rve: Rve) -> None:
    F = np.array([np.eye(3) + s * (F0 - np.eye(3)) for s in np.linspace(0.0, 1.0, 21)])
    batch, path = rve.respond(F), rve.respond_path(F)
    for of_batch, of_path in zip(batch, path):
        np.testing.assert_allclose(of_path, of_batch, rtol=0.0, atol=1e-9 * np.abs(of_batch).max())


def test_a_path_continues_until_it_is_reset(rve: Rve) -> None:
    F = np.array([np.diag([stretch, 1.0, 1.0]) for stretch in np.linspace(1.0, 1.2, 11)])
    assert np.array_equal(rve.gradient, np.eye(3))
    assert np.array_equal(rve.positions, rve.network.nodes)
    whole = rve.respond_path(F)
    assert np.array_equal(rve.gradient, F[-1])
    boundary = rve.network.boundary
    np.testing.assert_allclose(rve.positions[boundary], rve.network.nodes[boundary] @ F[-1].T, rtol=0.0, atol=1e-15)
    rve.reset()
    assert np.array_equal(rve.gradient, np.eye(3))
    first, second = rve.respond_path(F[:4]), rve.respond_path(F[4:])
    assert np.array_equal(np.concatenate([first.P, second.P]), whole.P)


def test_without_a_fraction_stresses_are_the_forces_of_the_unit_cube(network: Network, law: Law) -> None:
    raw, scaled = Rve(network, law).respond(F0), Rve(network, law, fiber_volume_fraction=PHI).respond(F0)
    volume = np.pi * law.radius**2 * network.lengths.sum()
    np.testing.assert_allclose(raw.P * PHI / volume, scaled.P, rtol=1e-12)


def test_threads_may_share_an_rve(network: Network, law: Law, gradients: np.ndarray) -> None:
    rve = Rve(network, law)
    expected, found = rve.respond(gradients).W, {}

    def solve(number: int) -> None:
        found[number] = (rve.respond(gradients).W, rve.respond_path(gradients[:1]).W)

    threads = [threading.Thread(target=solve, args=(number,)) for number in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(found) == [0, 1, 2, 3]
    assert all(np.array_equal(batch, expected) for batch, _ in found.values())


@pytest.mark.parametrize("count", [3, 40])
def test_a_gradient_without_equilibrium_is_named(network: Network, law: Law, count: int) -> None:
    rve = Rve(network, law)
    F = np.broadcast_to(np.eye(3), (count, 3, 3)).copy()
    F[[1, count - 1]] = np.diag([10.0, 1.0, 1.0])
    with pytest.raises(EquilibriumError, match=r"^F\[1\]: the fiber forces are excessive") as caught:
        rve.respond(F)
    assert caught.value.index == 1
    F[0] = 1.01 * np.eye(3)
    with pytest.raises(EquilibriumError) as caught:
        rve.respond_path(F)
    assert caught.value.index == 1
    assert np.array_equal(rve.gradient, F[0]), "the RVE stays at the last equilibrium"


@pytest.mark.parametrize(
    ("F", "message"),
    [
        (np.eye(2), r"F has the shape \(2, 2\); expected \(3, 3\) or \(n, 3, 3\)"),
        (np.ones(9), r"F has the shape \(9,\)"),
        (np.ones((1, 1, 3, 3)), r"F has the shape \(1, 1, 3, 3\)"),
        (np.diag([1.0, np.nan, 1.0]), "F has a component that is not finite"),
        (np.diag([1.0, np.inf, 1.0]), "F has a component that is not finite"),
        (np.diag([1.0, -1.0, 1.0]), "F has the determinant -1e0"),
        (np.array([np.eye(3), np.zeros((3, 3))]), r"F\[1\] has the determinant 0e0"),
        (1e200 * np.eye(3), "F has the determinant inf"),
        ("one", "could not convert string to float"),
    ],
)
def test_invalid_gradients_are_errors(rve: Rve, F: np.ndarray, message: str) -> None:
    for respond in (rve.respond, rve.respond_path):
        with pytest.raises(ValueError, match=message):
            respond(F)


def test_invalid_arguments_are_errors(network: Network, law: Law) -> None:
    with pytest.raises(ValueError, match="the fiber volume fraction is 2"):
        Rve(network, law, fiber_volume_fraction=2.0)
    with pytest.raises(ValueError, match="the network delaunay-20-1 was read without a law"):
        Rve(network)
    for tolerance in (0.0, 1.0, np.nan):
        with pytest.raises(ValueError, match="the tolerance is"):
            Rve(network, law, tolerance=tolerance)
    with pytest.raises(ValueError, match="threads is 0"):
        Rve(network, law, threads=0)
    with pytest.raises(ValueError, match="Poisson's ratio is 0.5"):
        NeoHookean(1.0, 0.5)
    with pytest.raises(ValueError, match="the shear modulus is -1"):
        NeoHookean(-1.0, 0.3)
