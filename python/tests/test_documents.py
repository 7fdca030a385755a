"""The examples of the documents, and the stubs."""

import doctest
import importlib.util
import re
import runpy
import subprocess
import sys
from pathlib import Path

import biotissue
import pytest
from biotissue import _biotissue
from conftest import write_case


def test_the_example_finds_the_parameters(root: Path, capsys: pytest.CaptureFixture[str]) -> None:
    youngs_modulus, nonlinearity = runpy.run_path(str(root / "python/examples/fit_law.py"))["main"]()
    assert abs(youngs_modulus / 3.0e7 - 1.0) < 0.05, youngs_modulus
    assert abs(nonlinearity / 4.0 - 1.0) < 0.1, nonlinearity
    assert re.search(r"^E = .* Pa\nB = ", capsys.readouterr().out, re.MULTILINE)


@pytest.mark.parametrize("document", ["README.md", "python/README.md"])
def test_the_examples_of_the_documents_run(
    root: Path, document: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    blocks = re.findall(r"^```python\n(.*?)^```", (root / document).read_text(), re.MULTILINE | re.DOTALL)
    assert blocks
    write_case(tmp_path)
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    for block in blocks:
        exec(compile(block, document, "exec"), names)
    printed = capsys.readouterr().out
    for line in re.findall(r"^.*print\(.*# (.*)$", "".join(blocks), re.MULTILINE):
        assert line in printed


def test_the_example_of_the_package_runs() -> None:
    outcome = doctest.testmod(biotissue)
    assert outcome.attempted > 0 and outcome.failed == 0


def test_all_public_objects_are_exported_and_documented() -> None:
    assert biotissue.__all__ == sorted(biotissue.__all__)
    assert set(dir(_biotissue)) & set(biotissue.__all__) == set(biotissue.__all__) - {"Response"}
    for name in set(biotissue.__all__) - {"__version__"}:
        thing = getattr(biotissue, name)
        assert thing.__doc__, name
        if (
            isinstance(thing, type)
            and thing.__module__.startswith("biotissue")
            and not issubclass(thing, (tuple, Exception))
        ):
            assert thing.__module__ == "biotissue"
            members = [member for member in vars(thing) if not member.startswith("_")]
            assert all(getattr(thing, member).__doc__ for member in members), name


def test_the_stubs_describe_the_package() -> None:
    if importlib.util.find_spec("mypy") is None:
        stub = Path(_biotissue.__file__).with_name("_biotissue.pyi").read_text()
        for name in set(biotissue.__all__) - {"Response"}:
            assert re.search(rf"^(class |def )?{name}\b", stub, re.MULTILINE), name
        pytest.skip("mypy is not installed: only the names were compared")
    command = [sys.executable, "-m", "mypy.stubtest", "biotissue"]
    checked = subprocess.run(command, check=False, capture_output=True, text=True)
    assert checked.returncode == 0, checked.stdout + checked.stderr
