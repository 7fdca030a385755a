"""Runs of cases and their results."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from biotissue import ConvergenceError, Network, Results, run_case
from conftest import CASE, write_case


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_case(tmp_path_factory.mktemp("case"))


@pytest.fixture(scope="module")
def results(case: Path) -> Results:
    return run_case(case, case.parent / "results")


def test_the_loads_are_those_of_the_table(results: Results) -> None:
    with open(results.directory / "loads.csv", newline="") as file:
        header, *rows = csv.reader(file)
    assert list(results.loads) == header
    assert len(rows) == 3
    for name, column in zip(header, zip(*rows)):
        assert np.array_equal(results.loads[name], np.array(column, dtype=float)), name
    assert results.loads["step"].dtype == np.int64
    np.testing.assert_allclose(results.loads["x1.ux"], [0.002 / 3, 0.004 / 3, 0.002], rtol=1e-9)
    np.testing.assert_allclose(results.loads["x1.fx"], -results.loads["x0.fx"], rtol=1e-6)
    assert np.all(np.diff(results.loads["x1.fx"]) > 0.0)


def test_the_fields_have_a_value_for_every_node_or_element(results: Results) -> None:
    assert results.title == "Box in tension" and results.converged is True
    assert np.array_equal(results.loads["t"], results.times[results.steps > 0])
    assert results.steps[-1] == 3
    ((kind, elements),) = results.cells
    assert kind == "tet4" and elements.shape == (len(elements), 4) and elements.dtype == np.int64
    points = results.points
    assert np.array_equal(np.ptp(points, axis=0), [0.02, 0.01, 0.01])
    assert elements.max() == len(points) - 1
    fields = results.fields(3)
    last = results.fields()
    assert all(np.array_equal(values, last[name]) for name, values in fields.items())
    displacement = fields["displacement"]
    assert displacement.shape == points.shape
    np.testing.assert_allclose(displacement[points[:, 0] == 0.02, 0], 0.002, rtol=1e-12)
    assert fields["energy_density"].shape == (len(elements),)
    assert fields["fiber_direction"].shape == (len(elements), 3)
    F = fields["deformation_gradient"]
    assert F.shape == (len(elements), 3, 3)
    # The gradient of a linear tetrahedron: its rows are those of dx/dX.
    X, x = points[elements], (points + displacement)[elements]
    dX, dx = (np.transpose(y[:, 1:] - y[:, :1], (0, 2, 1)) for y in (X, x))
    np.testing.assert_allclose(F, dx @ np.linalg.inv(dX), rtol=0.0, atol=1e-10)


def test_the_log_has_the_events_of_the_file(results: Results) -> None:
    with open(results.directory / "log.jsonl") as file:
        events = [json.loads(line) for line in file]
    assert [event["event"] for event in results.log] == [event["event"] for event in events]
    assert results.log[0] == events[0] and results.log[-1] == events[-1]
    assert [event["step"] for event in results.log if event["event"] == "step"] == [1, 2, 3]


def test_results_do_not_depend_on_threads_and_a_finished_run_can_be_resumed(case: Path, results: Results) -> None:
    directory = case.parent / "one thread"
    one = run_case(str(case), out=str(directory), threads=1)
    assert all(np.array_equal(values, one.loads[name]) for name, values in results.loads.items())
    resumed = run_case(case, directory, resume=True)
    assert np.array_equal(resumed.loads["x1.fx"], one.loads["x1.fx"])
    assert resumed.log[-1]["steps"] == 3


def test_the_case_names_the_directory(tmp_path: Path) -> None:
    case = write_case(
        tmp_path, CASE.replace("count = 3", "count = 1") + '\n[output]\ndirectory = "of-the-case"\nevery = 0\n'
    )
    results = run_case(case)
    assert results.directory == tmp_path / "of-the-case"
    assert len(results.loads["step"]) == 1 and len(results.steps) == 0
    with pytest.raises(FileNotFoundError, match="contains no fields"):
        _ = results.points
    assert repr(results) == f"<biotissue.Results of {tmp_path / 'of-the-case'}: 1 load steps>"


def test_a_step_without_convergence_is_an_error(tmp_path: Path) -> None:
    text = CASE.replace("x = 0.002", "x = -0.03").replace("count = 3", "count = 1\nmax_cuts = 1")
    case = write_case(tmp_path, text)
    with pytest.raises(ConvergenceError, match="load step 1 of 1 does not converge"):
        run_case(case, tmp_path / "results")
    results = Results(tmp_path / "results")
    assert results.converged is False and len(results.loads["step"]) == 0


def test_floppy_networks_beside_a_soft_matrix_give_a_warning(tmp_path: Path) -> None:
    text = CASE.replace("x = 0.002", "x = 0.0002").replace("count = 3", "count = 1")
    case = write_case(tmp_path, text.replace("shear_modulus = 1000.0", "shear_modulus = 3000.0"))
    Network.voronoi(20, 1).write(tmp_path / "networks" / "network-1.txt")
    with pytest.warns(UserWarning, match="1 of 2 networks has motions that no fiber resists, and the matrix"):
        run_case(case, tmp_path / "results")


def test_errors_of_cases_name_file_and_line(tmp_path: Path, results: Results) -> None:
    with pytest.raises(FileNotFoundError, match="missing.toml"):
        run_case(tmp_path / "missing.toml")
    case = write_case(tmp_path, CASE.replace('surface = "x1"', 'surface = "x9"').replace("count = 3", "count = 0"))
    with pytest.raises(ValueError, match=r"box.toml:\d+: "):
        run_case(case, tmp_path / "results")
    with pytest.raises(ValueError, match="threads is 0"):
        run_case(case, threads=0)
    with pytest.raises(FileNotFoundError, match="is not a result directory"):
        Results(tmp_path)
    with pytest.raises(KeyError, match="there are no fields of step 9"):
        results.fields(9)


def test_files_of_others_are_not_replaced(tmp_path: Path) -> None:
    case = write_case(tmp_path)
    (tmp_path / "results").mkdir()
    (tmp_path / "results" / "loads.csv").write_text("my own table\n")
    with pytest.raises(FileExistsError, match="loads.csv"):
        run_case(case, tmp_path / "results")
    assert (tmp_path / "results" / "loads.csv").read_text() == "my own table\n"
