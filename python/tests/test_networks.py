"""Networks and laws."""

from pathlib import Path

import numpy as np
import pytest
from biotissue import Law, Network, Rve

CORNERS = [[x, y, z] for x in (0, 2) for y in (0, 2) for z in (0, 2)]
STAR = ([*CORNERS, [1, 1, 1]], [[8, corner] for corner in range(8)])


def test_arrays_describe_a_network() -> None:
    star = Network(*STAR, name="star")
    assert star.name == "star" and repr(star) == "<biotissue.Network star: 9 nodes (1 interior), 8 fibers>"
    assert np.array_equal(star.nodes, (np.array(STAR[0]) - 1) / 2), "scaled to the unit cube"
    assert np.array_equal(star.fibers, STAR[1]) and star.fibers.dtype == np.int64
    assert np.array_equal(star.boundary, range(8)) and np.array_equal(star.interior, [8])
    np.testing.assert_allclose(star.lengths, np.sqrt(0.75), rtol=1e-15)
    assert star.laws == [] and np.array_equal(star.law_of, np.zeros(8))


@pytest.mark.parametrize("generate", [Network.delaunay, Network.voronoi])
def test_generated_networks_depend_on_the_seed_alone(generate) -> None:
    network = generate(15, 3)
    assert np.array_equal(network.nodes, generate(15, seed=3).nodes)
    assert not np.array_equal(network.nodes[:5], generate(15, 4).nodes[:5])
    assert np.abs(network.nodes).max() == 0.5
    assert sorted([*network.boundary, *network.interior]) == list(range(len(network.nodes)))


def test_fibers_follow_a_direction() -> None:
    def alignment(network: Network) -> float:
        """Return the order parameter P2 about x."""
        edges = np.diff(network.nodes[network.fibers], axis=1)[:, 0]
        return float(1.5 * np.mean((edges[:, 0] / network.lengths) ** 2) - 0.5)

    assert abs(alignment(Network.delaunay(200, 1))) < 0.05
    assert abs(alignment(Network.delaunay(200, 1, direction=(2.0, 0.0, 0.0), strength=0.5)) - 0.5) < 0.1


def test_a_network_is_read_as_it_was_written(tmp_path: Path, network: Network, law: Law) -> None:
    network.write(tmp_path / "network.txt")
    read = Network.read(str(tmp_path / "network.txt"))
    assert read.name == "network.txt"
    assert np.array_equal(read.nodes, network.nodes) and np.array_equal(read.fibers, network.fibers)
    assert read.laws == []


def test_a_network_has_the_laws_of_its_files(tmp_path: Path, root: Path) -> None:
    path = tmp_path / "two.txt"
    Network(*STAR).write(path)
    types = "".join(
        f'[[fiber_type]]\nname = "exponential"\nyoungs_modulus = {modulus}\nradius = 5e-8\nnonlinearity = 1.2\n'
        for modulus in (1.0e8, 2.0e8)
    )
    (tmp_path / "two.txt.toml").write_text(f"{types}[fibers]\ntypes = [0, 1, 0, 1, 0, 1, 0, 1]\n")
    two = Network.read(path)
    assert [law.parameters["youngs_modulus"] for law in two.laws] == [1.0e8, 2.0e8]
    assert np.array_equal(two.law_of, [0, 1] * 4)
    assert Rve(two).respond(np.diag([1.1, 1.0, 1.0])).W > 0.0

    two.write(tmp_path / "again.txt")
    again = Network.read(tmp_path / "again.txt")
    assert again.laws == two.laws and np.array_equal(again.law_of, two.law_of)
    with pytest.raises(FileExistsError, match="was not written with a network"):
        two.write(path)


def test_files_with_errors_are_reported_with_their_lines(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="missing.txt"):
        Network.read(tmp_path / "missing.txt")
    path = tmp_path / "bad.txt"
    path.write_text("2 1 0\n0 0 0\n1 1 one\n0 1\n")
    with pytest.raises(ValueError, match=r"bad.txt:3: .*one"):
        Network.read(path)


def test_irregularities_of_files_are_warnings(tmp_path: Path) -> None:
    path = tmp_path / "doubled.txt"
    Network(STAR[0], [*STAR[1], [0, 8]]).write(path)
    with pytest.warns(UserWarning, match="doubled.txt"):
        Network.read(path)


def test_invalid_networks_are_errors() -> None:
    nodes, fibers = STAR
    with pytest.raises(ValueError, match=r"nodes has the shape \(9, 2\); expected \(n, 3\)"):
        Network(np.array(nodes)[:, :2], fibers)
    with pytest.raises(ValueError, match=r"fibers has the shape \(8,\)"):
        Network(nodes, np.zeros(8))
    with pytest.raises(ValueError, match="fiber 1 ends at node 0.5"):
        Network(nodes, [[8, 1], [8, 0.5]])
    with pytest.raises(ValueError, match="fiber 0 ends at node -1"):
        Network(nodes, [[8, -1]])
    with pytest.raises(ValueError, match="ends at node 9, but there are only 9 nodes"):
        Network(nodes, [[8, 9]])
    with pytest.raises(ValueError, match="0 points requested"):
        Network.delaunay(0, 1)
    with pytest.raises(ValueError, match="the strength of the alignment is 2"):
        Network.voronoi(20, 1, direction=(1.0, 0.0, 0.0), strength=2.0)
    with pytest.raises(ValueError, match="direction has 2 components, not 3"):
        Network.voronoi(20, 1, direction=[1.0, 0.0], strength=0.5)
    with pytest.raises(ValueError, match="needs a direction"):
        Network.voronoi(20, 1, strength=0.5)


def test_laws_have_their_formulas() -> None:
    E, B, radius = 1.0e8, 1.2, 5.0e-8
    stretch = np.linspace(0.9, 1.3, 9).reshape(3, 3)
    green = (stretch**2 - 1.0) / 2.0
    expected = [
        (Law.linear(E, radius), E * stretch * green),
        (Law.exponential(E, B, radius), E / B * np.expm1(B * green)),
    ]
    for law, stress in expected:
        np.testing.assert_allclose(law.stress(stretch), stress, rtol=1e-12, atol=1e-9)
    law = Law.exponential_stretch(E, B, 1.2, radius)
    np.testing.assert_allclose(law.stress(1.1), E / B * 1.1 * np.expm1(B * 0.105), rtol=1e-12)
    assert law.name == "exponential-stretch" and law.radius == radius
    assert law.parameters == {"youngs_modulus": E, "nonlinearity": B, "transition": 1.2}
    table = Law.table([0.9, 1.0, 1.1], [-1.0e6, 0.0, 2.0e6], radius)
    np.testing.assert_allclose(table.stress([0.9, 1.0, 1.1]), [-1.0e6, 0.0, 2.0e6], atol=1e-6)


def test_buckling_leaves_a_fraction_of_the_stiffness(network: Network) -> None:
    law = Law.linear(1.0e8, 5.0e-8)
    soft = law.with_buckling(compression=0.01)
    assert soft != law and soft.with_buckling() == law.with_buckling()
    assert np.array_equal(soft.stress([1.1]), law.stress([1.1]))
    assert 0.0 < soft.stress(0.9) / law.stress(0.9) < 0.1
    F = np.diag([1.1, 0.95, 0.95])
    assert Rve(network, soft).respond(F).W < Rve(network, law).respond(F).W


def test_invalid_laws_are_errors() -> None:
    with pytest.raises(ValueError, match="the Young's modulus of a fiber is -1"):
        Law.linear(-1.0, 5.0e-8)
    with pytest.raises(ValueError, match="the radius of a fiber is 0"):
        Law.exponential(1.0e8, 1.2, radius=0.0)
    with pytest.raises(ValueError, match="point 2: the stress falls from 2 to 1"):
        Law.table([1.0, 1.1, 1.2], [0.0, 2.0, 1.0], 5.0e-8)
    with pytest.raises(ValueError, match="2 stretches, but 1 stresses"):
        Law.table([1.0, 1.1], [0.0], 5.0e-8)
    with pytest.raises(ValueError, match="a stretch is 0"):
        Law.linear(1.0e8, 5.0e-8).stress([1.0, 0.0])
